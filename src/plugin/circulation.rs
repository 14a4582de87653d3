//! Circulate: blood flows through the vessels of organs with a [`Perfusion`], and is lost.
//!
//! In: [`Vessels`] at rest, the ledgers in [`VesselWounds`], and the time. Out: rates on [`OpenEnd`] entities,
//! [`BloodLoss`] and messages. Networks of small trees are made within a frame, those of large ones in the task pool.
//! Given the same vessels, actions and time steps, the same is lost to the last bit, as long as no network is on its way.

use crate::plugin::{
    components::{GrowthProgress, OrganVessels, VesselSystem},
    growth_state::GrowthState,
    open_ends::{OpenEnd, OpenEndEntities},
    organ_flow::{FlowingEnd, OrganFlow, Trees},
    perfusion::{
        BleedingStarted, BleedingStopped, BloodLoss, CirculationFailed, OrganSupply, Patient, Perfusion, SegmentSupply,
    },
    supply::Gauge,
    vessels::{Lineage, Vessels},
    wounds::VesselWounds,
};
use crate::synthesis::{
    haemodynamics::{BedLink, FlowError},
    tree::System,
    units::{Flow, Volume},
    wound::{Bleeding, EndState, Wounds},
};
use bevy::{
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Res},
        component::Component,
        entity::Entity,
        hierarchy::ChildOf,
        lifecycle::Remove,
        message::MessageWriter,
        observer::On,
        query::{QueryData, With},
        system::{Commands, Query, SystemParam},
        world::{EntityWorldMut, Ref},
    },
    log::warn,
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready},
    time::Time,
};

/// Nodes whose networks are made within a frame; those of more are made beside the frames.
pub(crate) const AT_ONCE: usize = 8192;

/// The flow in an organ's vessels. The plugin drives it.
#[derive(Component, Debug, Default)]
pub struct CirculationState {
    /// The vessels that the flow is of, or will be when it is made.
    made_for: Option<MadeFor>,
    /// How they are perfused, paused or not.
    made_with: Option<Perfusion>,
    task: Option<Task<Result<OrganFlow, FlowError>>>,
    flow: Option<OrganFlow>,
    bleeding: [Bleeding; 2],
    /// Open ends in the order of the networks'.
    ends: [Vec<FlowingEnd>; 2],
    /// Whether the gaps have to be laid anew.
    is_unlaid: bool,
    /// How the supply is measured, once the vessels have grown.
    pub(crate) gauge: Gauge,
    error: Option<FlowError>,
}

/// Which vessels a flow is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MadeFor {
    lineages: [Lineage; 2],
    nodes: [usize; 2],
    is_grown: bool,
}

impl CirculationState {
    /// Whether blood flows: the vessels are there, and their network has been made.
    pub fn flows(&self) -> bool {
        self.flow.is_some()
    }

    /// How each open end of a system bleeds, as of the last frame.
    pub fn bleeding(&self, system: System) -> &Bleeding {
        &self.bleeding[system.index()]
    }

    /// Why no blood flows, if something is wrong.
    pub fn error(&self) -> Option<&FlowError> {
        self.error.as_ref()
    }

    /// Takes the ledgers for others than they were.
    pub(crate) fn lay_again(&mut self) {
        self.is_unlaid = true;
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

    fn fail(&mut self, organ: Entity, error: FlowError, failed: &mut MessageWriter<CirculationFailed>) {
        warn!("{organ}: its blood stands still: {error}");
        self.task = None;
        self.flow = None;
        self.ends.iter_mut().for_each(Vec::clear);
        self.error = Some(error.clone());
        failed.write(CirculationFailed { organ, error });
    }
}

/// A vessel entity, with all that flow reads.
#[derive(QueryData)]
pub(crate) struct Perfused {
    entity: Entity,
    system: &'static VesselSystem,
    vessels: &'static Vessels,
    wounds: Option<Ref<'static, VesselWounds>>,
    entities: Option<&'static OpenEndEntities>,
}

/// An organ with blood, and what its vessels grow from.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct PerfusedOrgan {
    entity: Entity,
    perfusion: Ref<'static, Perfusion>,
    vessels: Option<&'static OrganVessels>,
    growth: Option<&'static GrowthState>,
    progress: Option<&'static GrowthProgress>,
    state: &'static mut CirculationState,
    loss: &'static mut BloodLoss,
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
pub(crate) fn make_flow(mut organs: Query<PerfusedOrgan>, vessels: Query<Perfused>, mut messages: BleedingMessages) {
    for mut organ in &mut organs {
        let made_for = organ.vessels_now(&vessels);
        if organ.takes_note_of(made_for) {
            organ.begin(made_for, &vessels, &mut messages);
        }
        let Some(made) = organ.state.task.as_mut().and_then(check_ready) else { continue };
        organ.state.task = None;
        organ.accept(made, &mut messages.failed);
    }
}

impl PerfusedOrganItem<'_, '_> {
    fn entities(&self) -> &[Entity] {
        self.vessels.map_or(&[], OrganVessels::entities)
    }

    fn vessels_now(&self, vessels: &Query<Perfused>) -> MadeFor {
        let is_grown = self.progress.is_none_or(GrowthProgress::is_finished);
        let mut made_for = MadeFor { lineages: [Lineage::default(); 2], nodes: [0; 2], is_grown };
        for found in vessels.iter_many(self.entities()) {
            made_for.lineages[found.system.0.index()] = found.vessels.lineage();
            made_for.nodes[found.system.0.index()] = found.vessels.tree().len();
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

    /// Begins to make a flow: at once where that is quick. Large trees wait until they have grown.
    fn begin(&mut self, made_for: MadeFor, vessels: &Query<Perfused>, messages: &mut BleedingMessages) {
        let is_other = self.state.made_for.is_none_or(|before| before.lineages != made_for.lineages);
        self.state.made_for = Some(made_for);
        self.state.task = None;
        self.state.error = None;
        if is_other {
            self.forget(vessels, messages);
        }
        if let Err(error) = self.follow_bleeding_settings() {
            self.state.fail(self.entity, error, &mut messages.failed);
            return;
        }
        let nodes: usize = made_for.nodes.iter().sum();
        if nodes > AT_ONCE && !made_for.is_grown {
            return;
        }
        let (trees, perfusion) = (self.trees(vessels), Perfusion::clone(&self.perfusion));
        let links: Vec<BedLink> = match self.growth.and_then(GrowthState::growth) {
            Some(growth) if perfusion.bed.resistance.is_some() => growth.bed_links().to_vec(),
            _ => Vec::new(),
        };
        let make = move || OrganFlow::new(trees, &perfusion, &links);
        if nodes > AT_ONCE {
            let pool = AsyncComputeTaskPool::get_or_init(TaskPool::new);
            self.state.task = Some(pool.spawn(async move { make() }));
        } else {
            self.accept(make(), &mut messages.failed);
        }
    }

    /// Copies of the trees at rest.
    fn trees(&self, vessels: &Query<Perfused>) -> Trees {
        let mut trees = Trees::default();
        for found in vessels.iter_many(self.entities()) {
            let tree = found.vessels.tree_at_rest();
            trees[found.system.0.index()] = (tree.len() > 1).then(|| tree.into_owned());
        }
        trees
    }

    /// Nothing is left of the blood in other vessels, whose ends are gone.
    fn forget(&mut self, vessels: &Query<Perfused>, messages: &mut BleedingMessages) {
        for found in vessels.iter_many(self.entities()) {
            let system = found.system.0.index();
            let ends = self.state.bleeding[system].ends().iter().zip(&self.state.ends[system]);
            for (_, end) in ends.filter(|(flowing, _)| flowing.state == EndState::Bleeding) {
                let (organ, vessels) = (self.entity, found.entity);
                messages.stopped.write(BleedingStopped { organ, vessels, end: end.id, side: end.side, entity: None });
            }
        }
        let settings = *self.state.bleeding[0].settings();
        self.state.flow = None;
        self.state.ends.iter_mut().for_each(Vec::clear);
        self.state.gauge = Gauge::default();
        self.state.bleeding = [(); 2].map(|()| Bleeding::new(settings).unwrap_or_default());
        self.loss.set_if_neq(BloodLoss::default());
    }

    /// Other settings of the bleeding begin the clotting anew.
    fn follow_bleeding_settings(&mut self) -> Result<(), FlowError> {
        let settings = self.perfusion.bleeding;
        for bleeding in &mut self.state.bleeding {
            if *bleeding.settings() != settings {
                *bleeding = Bleeding::new(settings)?;
            }
        }
        Ok(())
    }

    fn accept(&mut self, made: Result<OrganFlow, FlowError>, failed: &mut MessageWriter<CirculationFailed>) {
        let is_grown = self.state.made_for.is_some_and(|made_for| made_for.is_grown);
        if let Err(error) = made.and_then(|flow| self.state.take(flow, is_grown)) {
            self.state.fail(self.entity, error, failed);
        }
    }
}

/// Who is told of bleeding.
#[derive(SystemParam)]
pub(crate) struct BleedingMessages<'w> {
    started: MessageWriter<'w, BleedingStarted>,
    stopped: MessageWriter<'w, BleedingStopped>,
    failed: MessageWriter<'w, CirculationFailed>,
}

/// Lets open ends bleed for as long as the frame lasts.
pub(crate) fn bleed(
    time: Option<Res<Time>>,
    mut organs: Query<PerfusedOrgan>,
    vessels: Query<Perfused>,
    mut patients: Query<&mut Patient>,
    parents: Query<&ChildOf>,
    mut open_ends: Query<&mut OpenEnd>,
    mut messages: BleedingMessages,
) {
    let frame = time.map_or(0.0, |time| time.delta_secs_f64());
    let mut turns: Vec<Entity> = organs.iter().map(|organ| organ.entity).collect();
    // Organs that share a patient take their turns in the same order always.
    turns.sort_unstable();
    for entity in turns {
        let Ok(mut organ) = organs.get_mut(entity) else { continue };
        let Some(patient) = patient_of(entity, &parents, |entity| patients.contains(entity)) else { continue };
        let Ok(mut patient) = patients.get_mut(patient) else { continue };
        let seconds = if organ.perfusion.paused { 0.0 } else { frame };
        match organ.bleed(seconds, patient.bypass_change_detection(), &vessels, &mut open_ends, &mut messages) {
            Ok(false) => {}
            Ok(true) => patient.set_changed(),
            Err(error) => organ.state.fail(entity, error, &mut messages.failed),
        }
    }
}

impl PerfusedOrganItem<'_, '_> {
    /// Bleeds for a time, and says whether anything was lost.
    fn bleed(
        &mut self,
        seconds: f64,
        patient: &mut Patient,
        vessels: &Query<Perfused>,
        open_ends: &mut Query<&mut OpenEnd>,
        messages: &mut BleedingMessages,
    ) -> Result<bool, FlowError> {
        let entities = self.vessels.map_or(&[][..], OrganVessels::entities);
        let state = self.state.bypass_change_detection();
        let before = lay_gaps(state, entities, vessels)?;
        let Some(flow) = state.flow.as_mut() else { return Ok(false) };
        if before.is_none() && (!state.ends.iter().any(|ends| !ends.is_empty()) || seconds == 0.0) {
            return Ok(false);
        }
        let lost = state.bleeding.each_ref().map(Bleeding::lost);
        flow.step(&mut state.bleeding, seconds, &mut patient.blood)?;
        let lost: f64 = state
            .bleeding
            .iter()
            .zip(lost)
            .map(|(now, before)| now.lost().cubic_metres() - before.cubic_metres())
            .sum();
        self.loss.total = Volume::from_cubic_metres(self.loss.total.cubic_metres() + lost);
        self.loss.rates = state.bleeding.each_ref().map(Bleeding::rate);
        let rate: f64 = self.loss.rates.iter().map(|rate| rate.cubic_metres_per_second()).sum();
        self.loss.rate = Flow::from_cubic_metres_per_second(rate);
        let bleeds = |bleeding: &Bleeding| bleeding.ends().iter().filter(|end| end.state == EndState::Bleeding).count();
        self.loss.bleeding_ends = state.bleeding.iter().map(bleeds).sum();
        for found in vessels.iter_many(entities) {
            let system = found.system.0.index();
            let before = before.as_ref().map_or(&state.ends[system], |before| &before[system]);
            tell(self.entity, &found, &state.bleeding[system], [before, &state.ends[system]], messages);
            show(&found, &state.bleeding[system], &state.ends[system], open_ends);
        }
        state.gauge.pass(seconds, lost > 0.0);
        Ok(lost > 0.0)
    }
}

/// Lays the gaps of ledgers that changed over the networks. Returns the ends that were open before, if any gap was laid.
fn lay_gaps(
    state: &mut CirculationState,
    entities: &[Entity],
    vessels: &Query<Perfused>,
) -> Result<Option<[Vec<FlowingEnd>; 2]>, FlowError> {
    let Some(flow) = state.flow.as_mut() else { return Ok(None) };
    let is_changed = |found: PerfusedItem| found.wounds.is_some_and(|wounds| wounds.is_changed());
    if !std::mem::take(&mut state.is_unlaid) && !vessels.iter_many(entities).any(is_changed) {
        return Ok(None);
    }
    let none = Wounds::default();
    let mut before = <[Vec<FlowingEnd>; 2]>::default();
    for found in vessels.iter_many(entities) {
        let system = found.system.0;
        let wounds = found.wounds.as_ref().filter(|wounds| wounds.is_of(found.vessels));
        let ends = flow.lay(system, wounds.map_or(&none, |wounds| wounds.ledger()))?;
        before[system.index()] = std::mem::replace(&mut state.ends[system.index()], ends);
    }
    state.gauge.demand();
    Ok(Some(before))
}

/// Says which ends of a vessel entity began and stopped to bleed.
fn tell(
    organ: Entity,
    found: &PerfusedItem,
    bleeding: &Bleeding,
    [before, now]: [&[FlowingEnd]; 2],
    messages: &mut BleedingMessages,
) {
    let entity = |end: &FlowingEnd| found.entities.and_then(|entities| entities.get(end.id));
    for change in bleeding.changes() {
        let is_it = |end: &&FlowingEnd| (end.node, end.side) == (change.node, change.side);
        let vessels = found.entity;
        if !change.bleeds {
            if let Some(end) = before.iter().find(is_it) {
                let entity = entity(end);
                messages.stopped.write(BleedingStopped { organ, vessels, end: end.id, side: end.side, entity });
            }
        } else if let Some((end, entity)) = now.iter().find(is_it).and_then(|end| Some((end, entity(end)?))) {
            messages.started.write(BleedingStarted { organ, vessels, end: end.id, side: end.side, entity });
        }
    }
}

/// Writes rates on the entities of a vessel entity's open ends.
fn show(found: &PerfusedItem, bleeding: &Bleeding, ends: &[FlowingEnd], open_ends: &mut Query<&mut OpenEnd>) {
    for (flowing, end) in bleeding.ends().iter().zip(ends) {
        let Some(entity) = found.entities.and_then(|entities| entities.get(end.id)) else { continue };
        let Ok(mut open_end) = open_ends.get_mut(entity) else { continue };
        let shown = OpenEnd {
            flow: flowing.flow,
            pressure: flowing.pressure,
            velocity: flowing.velocity,
            lost: flowing.lost,
            state: flowing.state,
            ..*open_end
        };
        open_end.set_if_neq(shown);
    }
}

/// The patient whom an organ belongs to: itself, or the nearest above it.
pub(crate) fn patient_of(
    organ: Entity,
    parents: &Query<&ChildOf>,
    is_patient: impl Fn(Entity) -> bool,
) -> Option<Entity> {
    std::iter::once(organ).chain(parents.iter_ancestors(organ)).find(|&entity| is_patient(entity))
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
