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
        tree::Vessels,
        wounds::VesselWounds,
    },
};
use crate::synthesis::{
    haemodynamics::{Bleeding, EndState, FlowError, FlowSettings},
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

/// Times that a network is solved to fit its bed.
const FITTING: usize = 40;

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
        let is_grown = self.progress.is_none_or(GrowthProgress::is_settled);
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
        let is_new = self.state.made_for != Some(made_for);
        let blood = self.wish.and_then(|wish| wish.blood);
        if !is_new && !self.perfusion.is_changed() && blood == self.state.blood {
            return false;
        }
        self.state.blood = blood;
        let extent = self.growth.and_then(GrowthState::tissue).map(|tissue| tissue.extent());
        let mut hydraulics = self.perfusion.hydraulics(blood, extent);
        // What an organ takes once it has grown is too much for its first vessels.
        hydraulics.flow = hydraulics.flow.filter(|_| made_for.is_grown);
        let made_with = Some((hydraulics, self.perfusion.bleeding));
        let is_otherwise = self.state.made_with != made_with;
        if is_otherwise {
            self.state.made_with = made_with;
        }
        is_new || is_otherwise
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
        let trees = self.trees(vessels);
        let hydraulics = self.state.made_with.as_ref().map(|(hydraulics, _)| hydraulics.clone()).unwrap_or_default();
        let has_resistance = |settings: &FlowSettings| settings.bed.resistance.is_some();
        let is_joined = hydraulics.flow.is_some() || hydraulics.settings.artery.as_ref().is_some_and(has_resistance);
        let links: Vec<BedLink> = match self.growth.and_then(GrowthState::growth) {
            Some(growth) if is_joined => growth.bed_links().to_vec(),
            _ => Vec::new(),
        };
        // A bed that is fitted takes some tens of solutions.
        let work = if hydraulics.flow.is_some() { nodes.saturating_mul(FITTING) } else { nodes };
        let make = async move |pace: Pace| OrganFlow::new(trees, &hydraulics, &links, &pace).await;
        self.state.job = Some(jobs.start(work, make));
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

/// Tells that the ends of vessels stop bleeding which are despawned, or removed from their entity.
pub(crate) fn stop_bleeding(
    removed: On<Remove, Vessels>,
    vessels: Query<(&Vessels, &VesselsOf)>,
    mut organs: Query<&mut CirculationState>,
    mut stopped: Announcer<BleedingStopped>,
) {
    let Ok((vessels, of)) = vessels.get(removed.entity) else { return };
    let Ok(mut state) = organs.get_mut(of.0) else { return };
    let kind = vessels.kind();
    // Another entity of this kind may have the blood.
    if state.made_for.is_none_or(|made_for| made_for.lineages[kind] != vessels.lineage()) {
        return;
    }
    let ends = std::mem::take(&mut state.ends[kind]);
    for (_, end) in state.bleeding[kind].ends().iter().zip(ends).filter(|(end, _)| end.state == EndState::Bleeding) {
        let (organ, vessels) = (of.0, removed.entity);
        stopped.announce(BleedingStopped { organ, vessels, end: end.id, side: end.side, entity: None });
    }
    state.bleeding[kind] = Bleeding::new(*state.bleeding[kind].settings()).unwrap_or_default();
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
