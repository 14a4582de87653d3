//! Circulate: makes the blood of organs with a [`Perfusion`] flow.
//!
//! In: [`Vessels`](crate::plugin::Vessels) at rest and the organ's settings. Out: the flow in [`CirculationState`].
//! Jobs make the networks. The same vessels, actions and time steps give the same blood loss to the last bit, while no
//! network is being made.

use crate::plugin::{
    announcer::Announcer,
    circulation::{
        gauge::Gauge,
        messages::{BleedingMessages, BleedingStopped, CirculationError, CirculationFailed},
        organ_flow::{OrganFlow, Trees},
        patient::{Patient, patient_of},
        perfused::{Perfused, PerfusedOrgan, PerfusedOrganItem, each_kind},
        perfusion::{BloodLoss, OrganSupply, Perfusion, SegmentSupply},
        state::{CirculationState, MadeFor},
    },
    growth::{progress::GrowthProgress, state::GrowthState},
    job::{Job, JobPanic, Jobs},
    surgery::open_ends::{OpenEnd, OpenEndEntities},
    vessels::{
        relations::{OrganVessels, VesselsOf},
        wounds::VesselWounds,
    },
};
use crate::synthesis::{
    haemodynamics::{Bleeding, EndState, FlowError},
    pace::Pace,
    tree::{BedLink, ByKind},
};
use bevy::ecs::{
    change_detection::{DetectChanges, DetectChangesMut},
    entity::Entity,
    hierarchy::ChildOf,
    lifecycle::Remove,
    observer::On,
    query::With,
    system::{Commands, Query},
    world::EntityWorldMut,
};

/// Gives a patient to organs that find none, and the written components to their vessels.
pub(crate) fn prepare_organs(
    mut commands: Commands,
    organs: Query<(Entity, Option<&OrganVessels>), With<Perfusion>>,
    patients: Query<(), With<Patient>>,
    parents: Query<&ChildOf>,
    supplies: Query<(), With<SegmentSupply>>,
) {
    for (organ, vessels) in &organs {
        if patient_of(organ, &parents, |entity| patients.contains(entity)).is_none() {
            commands.entity(organ).try_insert(Patient::default());
        }
        let entities = vessels.map_or(&[][..], OrganVessels::entities);
        for &vessels in entities.iter().filter(|&&vessels| !supplies.contains(vessels)) {
            commands.entity(vessels).try_insert(SegmentSupply::default());
        }
    }
}

/// Makes the flow of vessels that are new, have grown, or have a changed perfusion.
pub(crate) fn make_flow(
    mut organs: Query<PerfusedOrgan>,
    vessels: Query<Perfused>,
    mut messages: BleedingMessages,
    jobs: Jobs,
) {
    for mut organ in &mut organs {
        let made_for = organ.vessels_now(&vessels);
        if organ.takes_note_of(made_for) {
            organ.begin(made_for, &vessels, &mut messages, &jobs);
        }
        if let Some(made) = Job::poll(&mut organ.state.job) {
            organ.accept(made, &mut messages.failed);
        }
    }
}

impl PerfusedOrganItem<'_, '_> {
    fn vessels_now(&self, vessels: &Query<Perfused>) -> MadeFor {
        let is_grown = self.progress.is_none_or(GrowthProgress::is_finished);
        let mut made_for = MadeFor { lineages: ByKind::default(), nodes: ByKind::default(), is_grown };
        for found in each_kind(self.entities(), vessels) {
            let kind = found.vessels.kind();
            made_for.lineages[kind] = found.vessels.lineage();
            made_for.nodes[kind] = found.vessels.tree().len();
        }
        made_for
    }

    /// Whether a new flow has to be made.
    fn takes_note_of(&mut self, made_for: MadeFor) -> bool {
        let mut is_new = self.state.made_for != Some(made_for);
        if self.perfusion.is_changed() {
            let made_with = Some((self.perfusion.hydraulics(), self.perfusion.bleeding));
            is_new |= self.state.made_with != made_with;
            self.state.made_with = made_with;
        }
        is_new
    }

    /// Starts making a flow. Large trees wait until they have grown.
    fn begin(&mut self, made_for: MadeFor, vessels: &Query<Perfused>, messages: &mut BleedingMessages, jobs: &Jobs) {
        let is_other = self.state.made_for.is_some_and(|before| before.is_replaced_by(&made_for));
        self.state.made_for = Some(made_for);
        self.state.job = None;
        self.state.error = None;
        if is_other {
            self.forget(vessels, messages);
        }
        if let Err(error) = self.follow_bleeding_settings() {
            self.fail(error.into(), &mut messages.failed);
            return;
        }
        let nodes: usize = made_for.nodes.values().sum();
        if !(made_for.is_grown || jobs.is_small(nodes)) {
            return;
        }
        let (trees, hydraulics) = (self.trees(vessels), self.perfusion.hydraulics());
        let links: Vec<BedLink> = match self.growth.and_then(GrowthState::growth) {
            Some(growth) if self.perfusion.bed.resistance.is_some() => growth.bed_links().to_vec(),
            _ => Vec::new(),
        };
        let make = async move |pace: Pace| OrganFlow::new(trees, &hydraulics, &links, &pace).await;
        self.state.job = Some(jobs.start(nodes, make));
    }

    /// Copies of the trees at rest.
    fn trees(&self, vessels: &Query<Perfused>) -> Trees {
        let mut trees = Trees::default();
        for found in each_kind(self.entities(), vessels) {
            let tree = found.vessels.tree_at_rest();
            trees[found.vessels.kind()] = (tree.len() > 1).then(|| tree.into_owned());
        }
        trees
    }

    /// Drops the flow of replaced vessels, whose ends no longer exist.
    fn forget(&mut self, vessels: &Query<Perfused>, messages: &mut BleedingMessages) {
        for found in each_kind(self.entities(), vessels) {
            let kind = found.vessels.kind();
            let ends = self.state.bleeding[kind].ends().iter().zip(&self.state.ends[kind]);
            for (_, end) in ends.filter(|(flowing, _)| flowing.state == EndState::Bleeding) {
                let (organ, vessels) = (self.entity, found.entity);
                messages.stopped.announce(BleedingStopped {
                    organ,
                    vessels,
                    end: end.id,
                    side: end.side,
                    entity: None,
                });
            }
        }
        let settings = *self.state.bleeding.artery.settings();
        self.state.flow = None;
        self.state.ends.values_mut().for_each(Vec::clear);
        self.state.gauge = Gauge::default();
        self.state.bleeding = ByKind::from_fn(|_| Bleeding::new(settings).unwrap_or_default());
        self.loss.set_if_neq(BloodLoss::default());
    }

    /// Restarts the clotting if the bleeding settings changed.
    fn follow_bleeding_settings(&mut self) -> Result<(), FlowError> {
        let settings = self.perfusion.bleeding;
        for bleeding in self.state.bleeding.values_mut() {
            if *bleeding.settings() != settings {
                *bleeding = Bleeding::new(settings)?;
            }
        }
        Ok(())
    }

    fn accept(
        &mut self,
        made: Result<Result<OrganFlow, FlowError>, JobPanic>,
        failed: &mut Announcer<CirculationFailed>,
    ) {
        let is_grown = self.state.made_for.is_some_and(|made_for| made_for.is_grown);
        let taken = made.map_err(CirculationError::from).and_then(|made| Ok(self.state.take(made?, is_grown)?));
        if let Err(error) = taken {
            self.fail(error, failed);
        }
    }
}

/// Removes the flow of an organ that lost its [`Perfusion`].
pub(crate) fn remove_circulation(
    removed: On<Remove, Perfusion>,
    organs: Query<&OrganVessels>,
    vessels: Query<&OpenEndEntities>,
    mut open_ends: Query<&mut OpenEnd>,
    mut stopped: Announcer<BleedingStopped>,
    mut commands: Commands,
) {
    let organ = removed.entity;
    let entities = organs.get(organ).map_or(&[][..], OrganVessels::entities);
    for &vessel in entities {
        commands.entity(vessel).try_remove::<SegmentSupply>();
        for (id, entity) in vessels.get(vessel).iter().flat_map(|ends| ends.iter()) {
            let Ok(mut end) = open_ends.get_mut(entity) else { continue };
            if end.state == EndState::Bleeding {
                let (side, entity) = (end.side, Some(entity));
                stopped.announce(BleedingStopped { organ, vessels: vessel, end: id, side, entity });
            }
            end.dry();
        }
    }
    commands.entity(organ).queue_silenced(|mut organ: EntityWorldMut| {
        organ.remove::<(CirculationState, BloodLoss, OrganSupply)>();
    });
}

/// Takes the gaps off vessels whose ledger was removed.
pub(crate) fn lay_again(
    removed: On<Remove, VesselWounds>,
    vessels: Query<&VesselsOf>,
    mut organs: Query<&mut CirculationState>,
) {
    if let Ok(mut circulation) = vessels.get(removed.entity).and_then(|organ| organs.get_mut(organ.0)) {
        circulation.is_unlaid = true;
    }
}
