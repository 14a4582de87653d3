//! Grow: steps of all organs, one each in turn, until the frame's budget is used up.
//!
//! The budget limits how many steps a frame does, never what a step does: the same seed gives the same vessels at any
//! frame rate. A step can't be divided. The cost of the next one, publishing included, is predicted from the organ's
//! last steps, and a step that would overrun waits for the next frame. Its organ has the first turn there, so all
//! organs do the same number of steps, give or take one.

use crate::plugin::announcer::Announcer;
use crate::plugin::growth::budget::{GrowthBudget, GrowthFrame, begin_after, share_out};
use crate::plugin::growth::{
    messages::GrowthFinished,
    progress::{GrowthControl, GrowthPhase, GrowthProgress},
    source::{Organ, StartMessages},
    state::GrowthState,
};
use bevy::{
    ecs::{
        change_detection::{Res, ResMut},
        entity::Entity,
        system::{Local, Query},
    },
    platform::time::Instant,
};

/// Does as many steps as the budget allows.
pub(crate) fn grow(
    budget: Res<GrowthBudget>,
    mut frame: ResMut<GrowthFrame>,
    mut last: Local<Option<Entity>>,
    mut organs: Query<(Entity, &GrowthControl, &mut GrowthState, &mut GrowthProgress)>,
) {
    let start = Instant::now();
    let mut steps = 0;
    let mut restored = Vec::new();
    for (organ, _, mut state, mut progress) in organs.iter_mut().filter(|(_, _, state, _)| state.must_repeat_steps()) {
        steps += catch_up(&mut state, &mut progress);
        restored.push(organ);
    }
    let may_finish = |organ: &Entity, state: &GrowthState| state.finish && !restored.contains(organ);
    for (_, _, mut state, mut progress) in organs.iter_mut().filter(|(organ, _, state, _)| may_finish(organ, state)) {
        steps += run_to_end(&mut state, &mut progress);
    }
    // Wounds are given back to vessels that are as they were saved, before these grow on.
    let waiting =
        organs.iter().filter(|(organ, control, state, _)| state.may_step(**control) && !restored.contains(organ));
    let mut round: Vec<_> = waiting.map(|(organ, _, state, _)| (organ, state.costs.expected())).collect();
    round.sort_unstable_by_key(|&(organ, _)| organ);
    begin_after(&mut round, *last);
    let started = frame.start_time;
    steps += share_out(
        *budget,
        round,
        || started + start.elapsed(),
        |organ| {
            *last = Some(organ);
            let (_, control, mut state, mut progress) = organs.get_mut(organ).ok()?;
            step(&mut state, &mut progress);
            state.may_step(*control).then(|| state.costs.expected())
        },
    );
    for (_, _, mut state, mut progress) in organs.iter_mut().filter(|(_, _, state, _)| state.is_unsettled()) {
        settle(&mut state, &mut progress);
    }
    frame.steps += steps;
    frame.step_time += start.elapsed();
}

/// Publish: announces the growths that have done all their steps, once their vessels are published.
pub(crate) fn end_growths(
    mut organs: Query<(Entity, &GrowthState, &mut GrowthProgress)>,
    mut finished: Announcer<GrowthFinished>,
) {
    for (organ, state, mut progress) in &mut organs {
        if progress.phase == GrowthPhase::Growing && state.is_done() {
            progress.phase = GrowthPhase::Finished;
            finished.announce(GrowthFinished { organ });
        }
    }
}

/// Fails the organs of which a step has panicked.
pub(crate) fn end_panicked(mut organs: Query<Organ>, mut messages: StartMessages) {
    for mut organ in organs.iter_mut().filter(|organ| organ.state.has_panicked()) {
        if let Some(error) = organ.state.take_panic() {
            organ.report(Err(error), &mut messages);
        }
    }
}

/// Does one step of an organ.
fn step(state: &mut GrowthState, progress: &mut GrowthProgress) {
    let start = Instant::now();
    state.step();
    let cost = start.elapsed();
    state.costs.note_step(cost);
    let grow_time = progress.grow_time + cost;
    *progress = GrowthProgress::of(state.phase_of_steps(), state.active(), grow_time);
}

/// Brings an organ's radii up to date with its steps. A successor that has caught up replaces the drawn vessels.
fn settle(state: &mut GrowthState, progress: &mut GrowthProgress) {
    let start = Instant::now();
    state.settle();
    let cost = start.elapsed();
    state.costs.note_settling(cost);
    // Some generators make their trees only now.
    *progress = GrowthProgress::of(state.phase_of_steps(), state.active(), progress.grow_time + cost);
}

/// Repeats the steps that an organ had done when it was saved, and returns their number.
fn catch_up(state: &mut GrowthState, progress: &mut GrowthProgress) -> u32 {
    let start = Instant::now();
    let before = progress.step;
    state.catch_up();
    *progress = GrowthProgress::of(GrowthPhase::Growing, state.growth(), progress.grow_time + start.elapsed());
    progress.step.saturating_sub(before)
}

/// Does all remaining steps of an organ that has its tissue, and returns their number.
pub(crate) fn run_to_end(state: &mut GrowthState, progress: &mut GrowthProgress) -> u32 {
    if !state.is_growing() || state.rests() {
        // Without a tissue and with wounds the request stays; at the end it is fulfilled.
        state.finish &= !state.is_done();
        return 0;
    }
    let start = Instant::now();
    let before = progress.step;
    state.run();
    let grow_time = progress.grow_time + start.elapsed();
    *progress = GrowthProgress::of(GrowthPhase::Growing, state.growth(), grow_time);
    progress.step.saturating_sub(before)
}
