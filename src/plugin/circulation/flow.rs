//! Circulate: the blood of organs with a [`Perfusion`], made to flow.
//!
//! In: [`Vessels`] at rest and the organ's settings. Out: the flow in [`CirculationState`]. Networks are made in
//! jobs. Given the same vessels, actions and time steps, the same is
//! lost to the last bit, as long as no network is on its way.

use crate::plugin::{
    announcer::Announcer,
    circulation::{
        bleeding::BleedingMessages,
        messages::{BleedingStopped, CirculationError, CirculationFailed},
        organ_flow::{FlowingEnd, OrganFlow, Trees},
        patient::Patient,
        perfusion::{BloodLoss, OrganSupply, Perfusion, SegmentSupply},
        supply::Gauge,
    },
    growth::{progress::GrowthProgress, state::GrowthState},
    job::{Job, JobPanic, Jobs},
    surgery::open_ends::{OpenEnd, OpenEndEntities},
    vessels::{lineage::Lineage, relations::OrganVessels, tree::Vessels, wounds::VesselWounds},
};
use crate::plugin::{circulation::patient::patient_of, vessels::relations::VesselsOf};
use crate::synthesis::{
    haemodynamics::{Bleeding, EndState, FlowError},
    pace::Pace,
    tree::{BedLink, ByKind, VesselKind},
};
use bevy::{
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut},
        component::Component,
        entity::Entity,
        hierarchy::ChildOf,
        lifecycle::Remove,
        observer::On,
        query::{QueryData, With},
        reflect::ReflectComponent,
        system::{Commands, Query},
        world::{EntityWorldMut, Ref},
    },
    log::warn,
    reflect::{Reflect, ReflectDeserialize, ReflectSerialize, std_traits::ReflectDefault},
};
use serde::{Deserialize, Serialize};

/// The flow in an organ's vessels. The plugin drives it.
///
/// Scenes and clones of the organ keep how far its open ends have clotted. All else is made anew.
#[derive(Component, Debug, Default, Reflect, Serialize, Deserialize)]
#[reflect(opaque, Component, Default, Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CirculationState {
    /// The vessels that the flow is of, or will be when it is made.
    #[serde(skip)]
    made_for: Option<MadeFor>,
    /// How they are perfused, paused or not.
    #[serde(skip)]
    made_with: Option<Perfusion>,
    #[serde(skip)]
    job: Option<Job<Result<OrganFlow, FlowError>>>,
    #[serde(skip)]
    pub(crate) flow: Option<OrganFlow>,
    pub(crate) bleeding: ByKind<Bleeding>,
    /// Open ends in the order of the networks'.
    #[serde(skip)]
    pub(crate) ends: ByKind<Vec<FlowingEnd>>,
    /// Whether the gaps have to be laid anew.
    #[serde(skip)]
    pub(crate) is_unlaid: bool,
    /// How the supply is measured, once the vessels have grown.
    #[serde(skip)]
    pub(crate) gauge: Gauge,
    #[serde(skip)]
    error: Option<CirculationError>,
}

/// Which vessels a flow is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MadeFor {
    lineages: ByKind<Lineage>,
    nodes: ByKind<usize>,
    is_grown: bool,
}

/// What scenes keep.
impl Clone for CirculationState {
    fn clone(&self) -> Self {
        Self { bleeding: self.bleeding.clone().map(|_, bleeding| bleeding.resumed()), ..Self::default() }
    }
}

impl MadeFor {
    /// Whether some of its vessels have given way to others.
    fn is_replaced_by(&self, now: &Self) -> bool {
        VesselKind::ALL.into_iter().any(|kind| self.nodes[kind] > 0 && self.lineages[kind] != now.lineages[kind])
    }
}

impl CirculationState {
    /// Whether blood flows: the vessels are there, and their network has been made.
    pub fn flows(&self) -> bool {
        self.flow.is_some()
    }

    /// How each open end of a kind of vessels bleeds, as of the last frame.
    pub fn bleeding(&self, kind: VesselKind) -> &Bleeding {
        &self.bleeding[kind]
    }

    /// Why no blood flows, if something is wrong.
    pub fn error(&self) -> Option<&CirculationError> {
        self.error.as_ref()
    }

    pub(crate) fn flow(&self) -> Option<&OrganFlow> {
        self.flow.as_ref()
    }

    /// Takes over a new flow, with what the old one has laid.
    fn take(&mut self, mut flow: OrganFlow, is_grown: bool) -> Result<(), FlowError> {
        if let Some(before) = &self.flow {
            flow.keep_gaps_of(before)?;
        }
        self.flow = Some(flow);
        self.is_unlaid = true;
        self.gauge = if is_grown { Gauge::ready() } else { Gauge::default() };
        Ok(())
    }
}

/// A vessel entity, with all that flow reads.
#[derive(QueryData)]
pub(crate) struct Perfused {
    pub(crate) entity: Entity,
    pub(crate) vessels: &'static Vessels,
    pub(crate) wounds: Option<Ref<'static, VesselWounds>>,
    pub(crate) entities: Option<&'static OpenEndEntities>,
}

/// An organ with blood, and what its vessels grow from.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct PerfusedOrgan {
    pub(crate) entity: Entity,
    pub(crate) perfusion: Ref<'static, Perfusion>,
    pub(crate) vessels: Option<&'static OrganVessels>,
    pub(crate) growth: Option<&'static GrowthState>,
    pub(crate) progress: Option<&'static GrowthProgress>,
    pub(crate) state: &'static mut CirculationState,
    pub(crate) loss: &'static mut BloodLoss,
}

/// Gives a patient to organs that find none, and their vessels what is to be written on them.
pub(crate) fn prepare_organs(
    mut commands: Commands,
    organs: Query<(Entity, Option<&OrganVessels>), With<Perfusion>>,
    patients: Query<(), With<Patient>>,
    parents: Query<&ChildOf>,
    supplies: Query<(), With<SegmentSupply>>,
) {
    for (organ, vessels) in &organs {
        if patient_of(organ, &parents, |entity| patients.contains(entity)).is_none() {
            commands.entity(organ).insert(Patient::default());
        }
        let entities = vessels.map_or(&[][..], OrganVessels::entities);
        for &vessels in entities.iter().filter(|&&vessels| !supplies.contains(vessels)) {
            commands.entity(vessels).try_insert(SegmentSupply::default());
        }
    }
}

/// Makes the flow of vessels that are new, have grown, or are to be perfused otherwise.
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
    fn entities(&self) -> &[Entity] {
        self.vessels.map_or(&[], OrganVessels::entities)
    }

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

    /// Whether another flow is to be made than there is.
    fn takes_note_of(&mut self, made_for: MadeFor) -> bool {
        let mut is_new = self.state.made_for != Some(made_for);
        if self.perfusion.is_changed() {
            let made_with = Some(Perfusion { paused: false, ..Perfusion::clone(&self.perfusion) });
            is_new |= self.state.made_with != made_with;
            self.state.made_with = made_with;
        }
        is_new
    }

    /// Begins to make a flow. Large trees wait until they have grown.
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
        let (trees, perfusion) = (self.trees(vessels), Perfusion::clone(&self.perfusion));
        let links: Vec<BedLink> = match self.growth.and_then(GrowthState::growth) {
            Some(growth) if perfusion.bed.resistance.is_some() => growth.bed_links().to_vec(),
            _ => Vec::new(),
        };
        let make = async move |pace: Pace| OrganFlow::new(trees, &perfusion, &links, &pace).await;
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

    /// Nothing is left of the blood in other vessels, whose ends are gone.
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

    /// Other settings of the bleeding begin the clotting anew.
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
        match made.map(|made| made.and_then(|flow| self.state.take(flow, is_grown))) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => self.fail(error.into(), failed),
            Err(panic) => self.fail(panic.into(), failed),
        }
    }

    /// The blood stands still until something changes.
    pub(crate) fn fail(&mut self, error: CirculationError, failed: &mut Announcer<CirculationFailed>) {
        let organ = self.entity;
        warn!("{organ}: its blood stands still: {error}");
        self.state.job = None;
        self.state.flow = None;
        self.state.ends.values_mut().for_each(Vec::clear);
        self.state.error = Some(error.clone());
        *self.loss = BloodLoss { total: self.loss.total, ..BloodLoss::default() };
        failed.announce(CirculationFailed { organ, error });
    }
}

/// The vessel entity of each kind; of several of one kind, the first.
pub(crate) fn each_kind<'a>(
    entities: &'a [Entity],
    vessels: &'a Query<Perfused>,
) -> impl Iterator<Item = PerfusedItem<'a, 'a>> {
    let mut seen = ByKind::<bool>::default();
    vessels.iter_many(entities).filter(move |found| !std::mem::replace(&mut seen[found.vessels.kind()], true))
}

/// An organ that is to have no blood any more.
pub(crate) fn remove_circulation(
    removed: On<Remove, Perfusion>,
    organs: Query<&OrganVessels>,
    vessels: Query<&OpenEndEntities>,
    mut open_ends: Query<&mut OpenEnd>,
    mut commands: Commands,
) {
    let entities = organs.get(removed.entity).map_or(&[][..], OrganVessels::entities);
    for &entity in entities {
        commands.entity(entity).try_remove::<SegmentSupply>();
        for (_, end) in vessels.get(entity).iter().flat_map(|ends| ends.iter()) {
            if let Ok(mut end) = open_ends.get_mut(end) {
                end.dry();
            }
        }
    }
    commands.entity(removed.entity).queue_silenced(|mut organ: EntityWorldMut| {
        organ.remove::<(CirculationState, BloodLoss, OrganSupply)>();
    });
}

/// Vessels whose ledger is gone have no gaps: those that were laid are taken off.
pub(crate) fn lay_again(
    removed: On<Remove, VesselWounds>,
    vessels: Query<&VesselsOf>,
    mut organs: Query<&mut CirculationState>,
) {
    if let Ok(mut circulation) = vessels.get(removed.entity).and_then(|organ| organs.get_mut(organ.0)) {
        circulation.is_unlaid = true;
    }
}
