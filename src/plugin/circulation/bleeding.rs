//! Circulate: open ends bleed for the duration of a frame.
//!
//! In: the flow of organs, the ledgers in [`VesselWounds`](crate::plugin::VesselWounds), and the frame's time. Out:
//! rates on [`OpenEnd`] entities, [`BloodLoss`](crate::plugin::BloodLoss) and messages.

use crate::plugin::{
    circulation::{
        messages::{BleedingMessages, BleedingStarted, BleedingStopped},
        organ_flow::FlowingEnd,
        patient::{Patient, patient_of},
        perfused::{Perfused, PerfusedItem, PerfusedOrgan, PerfusedOrganItem, each_kind},
        state::CirculationState,
    },
    surgery::open_ends::OpenEnd,
    vessels::relations::OrganVessels,
};
use crate::synthesis::tree::ByKind;
use crate::synthesis::{
    haemodynamics::{Bleeding, EndState, FlowError},
    units::{Flow, Volume},
    wound::Wounds,
};
use bevy::{
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Res},
        entity::Entity,
        hierarchy::ChildOf,
        system::Query,
    },
    time::Time,
};

/// Lets open ends bleed for the duration of the frame.
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
    // Organs that share a patient always take their turns in the same order.
    turns.sort_unstable();
    for entity in turns {
        let Ok(mut organ) = organs.get_mut(entity) else { continue };
        let Some(patient) = patient_of(entity, &parents, |entity| patients.contains(entity)) else { continue };
        let Ok(mut patient) = patients.get_mut(patient) else { continue };
        let seconds = if organ.perfusion.paused { 0.0 } else { frame };
        match organ.bleed(seconds, patient.bypass_change_detection(), &vessels, &mut open_ends, &mut messages) {
            Ok(false) => {}
            Ok(true) => patient.set_changed(),
            Err(error) => organ.fail(error.into(), &mut messages.failed),
        }
    }
}

impl PerfusedOrganItem<'_, '_> {
    /// Bleeds for a time, and returns whether any blood was lost.
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
        let Some(flow) = state.flow.as_mut() else {
            run_dry(state, entities, vessels, open_ends);
            return Ok(false);
        };
        if before.is_none() && (!state.ends.values().any(|ends| !ends.is_empty()) || seconds == 0.0) {
            return Ok(false);
        }
        let lost = state.bleeding.as_ref().map(|_, bleeding| bleeding.lost());
        flow.step(&mut state.bleeding, seconds, &mut patient.blood)?;
        let lost: f64 = state
            .bleeding
            .values()
            .zip(lost.values())
            .map(|(now, before)| now.lost().cubic_metres() - before.cubic_metres())
            .sum();
        self.loss.total = Volume::from_cubic_metres(self.loss.total.cubic_metres() + lost);
        self.loss.rates = state.bleeding.as_ref().map(|_, bleeding| bleeding.rate());
        let rate: f64 = self.loss.rates.values().map(|rate| rate.cubic_metres_per_second()).sum();
        self.loss.rate = Flow::from_cubic_metres_per_second(rate);
        let bleeds = |bleeding: &Bleeding| bleeding.ends().iter().filter(|end| end.state == EndState::Bleeding).count();
        self.loss.bleeding_ends = state.bleeding.values().map(bleeds).sum();
        for found in each_kind(entities, vessels) {
            let kind = found.vessels.kind();
            let before = before.as_ref().map_or(&state.ends[kind], |before| &before[kind]);
            tell(self.entity, &found, &state.bleeding[kind], [before, &state.ends[kind]], messages);
            show(&found, &state.bleeding[kind], &state.ends[kind], open_ends);
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
) -> Result<Option<ByKind<Vec<FlowingEnd>>>, FlowError> {
    let Some(flow) = state.flow.as_mut() else { return Ok(None) };
    let is_changed = |found: PerfusedItem| found.wounds.is_some_and(|wounds| wounds.is_changed());
    if !std::mem::take(&mut state.is_unlaid) && !each_kind(entities, vessels).any(is_changed) {
        return Ok(None);
    }
    let none = Wounds::default();
    let mut before = ByKind::<Vec<FlowingEnd>>::default();
    for found in each_kind(entities, vessels) {
        let kind = found.vessels.kind();
        let wounds = found.wounds.as_ref().filter(|wounds| wounds.is_of(found.vessels));
        let ends = flow.lay(kind, wounds.map_or(&none, |wounds| wounds.ledger()))?;
        before[kind] = std::mem::replace(&mut state.ends[kind], ends);
    }
    state.gauge.demand();
    Ok(Some(before))
}

/// Announces which ends of a vessel entity began or stopped bleeding.
fn tell(
    organ: Entity,
    found: &PerfusedItem,
    bleeding: &Bleeding,
    [before, now]: [&[FlowingEnd]; 2],
    messages: &mut BleedingMessages,
) {
    let entity = |end: &FlowingEnd| found.entities.and_then(|entities| entities.get(end.id));
    for change in bleeding.changes() {
        // Both lists are in the order of the network's ends.
        let find = |ends: &[FlowingEnd]| {
            let found = ends.binary_search_by_key(&(change.node, change.side), |end| (end.node, end.side));
            found.ok().map(|index| ends[index])
        };
        let vessels = found.entity;
        if !change.bleeds {
            if let Some(end) = find(before) {
                let entity = entity(&end);
                messages.stopped.announce(BleedingStopped { organ, vessels, end: end.id, side: end.side, entity });
            }
        } else if let Some((end, entity)) = find(now).and_then(|end| Some((end, entity(&end)?))) {
            messages.started.announce(BleedingStarted { organ, vessels, end: end.id, side: end.side, entity });
        }
    }
}

/// Lets the open ends run dry whose flow has failed.
fn run_dry(
    state: &mut CirculationState,
    entities: &[Entity],
    vessels: &Query<Perfused>,
    open_ends: &mut Query<&mut OpenEnd>,
) {
    for found in each_kind(entities, vessels) {
        for end in std::mem::take(&mut state.ends[found.vessels.kind()]) {
            let Some(entity) = found.entities.and_then(|entities| entities.get(end.id)) else { continue };
            if let Ok(mut open_end) = open_ends.get_mut(entity) {
                open_end.dry();
            }
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
