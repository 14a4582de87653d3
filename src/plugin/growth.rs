//! Grow: steps of all organs, one each in turn, until the frame's budget is used up.
//!
//! The budget limits how many steps a frame does, never what a step does: the same seed gives the same vessels at any
//! frame rate.

use crate::plugin::{
    components::{GrowthControl, GrowthPhase, GrowthProgress},
    growth_state::GrowthState,
    messages::GrowthFinished,
};
use bevy::{
    ecs::{
        change_detection::{Res, ResMut},
        entity::Entity,
        message::MessageWriter,
        reflect::ReflectResource,
        resource::Resource,
        system::{Local, Query},
    },
    platform::time::Instant,
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::time::Duration;

/// How much all growing organs together may do in a frame. Change it at any time.
///
/// Whatever it says, one step is done in each frame as long as any organ grows, so growth always comes to its end.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub enum GrowthBudget {
    /// No step begins after this time. A step that has begun is ended, so the last one may overrun.
    Time(Duration),
    /// This many steps, each organ's counted. Of use where frames are to be the same on every machine.
    Steps(u32),
}

impl GrowthBudget {
    /// Default time: an eighth of a frame at 60 frames a second.
    pub const DEFAULT_TIME: Duration = Duration::from_millis(2);

    /// Whether another step may begin, after this many steps and this time.
    ///
    /// The time is asked for only where it matters.
    pub fn allows(self, steps: u32, elapsed: impl FnOnce() -> Duration) -> bool {
        steps == 0
            || match self {
                Self::Time(time) => elapsed() < time,
                Self::Steps(most) => steps < most,
            }
    }
}

impl Default for GrowthBudget {
    fn default() -> Self {
        Self::Time(Self::DEFAULT_TIME)
    }
}

/// What growth did in the last frame.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GrowthFrame {
    /// Steps, over all organs.
    pub steps: u32,
    /// Time that they took.
    pub time: Duration,
}

/// Does as many steps as the budget allows.
pub(crate) fn grow(
    budget: Res<GrowthBudget>,
    mut frame: ResMut<GrowthFrame>,
    mut last: Local<Option<Entity>>,
    mut organs: Query<(Entity, &GrowthControl, &mut GrowthState, &mut GrowthProgress)>,
) {
    let start = Instant::now();
    let mut steps = 0;
    for (_, _, mut state, mut progress) in organs.iter_mut().filter(|(_, _, state, _)| state.finish) {
        steps += run_to_end(&mut state, &mut progress);
    }
    let waiting = organs.iter().filter(|(_, control, state, _)| state.may_step(**control));
    let turns = turns(waiting.map(|(organ, ..)| organ).collect(), *last);
    steps += share_out(
        *budget,
        turns,
        || start.elapsed(),
        |organ| {
            *last = Some(organ);
            organs.get_mut(organ).is_ok_and(|(_, control, mut state, mut progress)| {
                step(&mut state, &mut progress);
                state.may_step(*control)
            })
        },
    );
    *frame = GrowthFrame { steps, time: start.elapsed() };
}

/// Says which growths have done all their steps.
pub(crate) fn end_growths(
    mut organs: Query<(Entity, &GrowthState, &mut GrowthProgress)>,
    mut finished: MessageWriter<GrowthFinished>,
) {
    for (organ, state, mut progress) in &mut organs {
        if progress.phase == GrowthPhase::Growing && is_done(state) {
            progress.phase = GrowthPhase::Finished;
            finished.write(GrowthFinished { organ });
        }
    }
}

/// Does one step of an organ.
fn step(state: &mut GrowthState, progress: &mut GrowthProgress) {
    let start = Instant::now();
    state.step();
    let grow_time = progress.grow_time + start.elapsed();
    *progress = GrowthProgress::of(GrowthPhase::Growing, state.growth(), grow_time);
}

/// Does all remaining steps of an organ that has its tissue, and says how many they were.
pub(crate) fn run_to_end(state: &mut GrowthState, progress: &mut GrowthProgress) -> u32 {
    if state.growth().is_none() || is_done(state) {
        // Without a tissue the wish stays; at the end there is nothing left to wish for.
        state.finish &= !is_done(state);
        return 0;
    }
    let start = Instant::now();
    let before = progress.step;
    state.run();
    let grow_time = progress.grow_time + start.elapsed();
    *progress = GrowthProgress::of(GrowthPhase::Growing, state.growth(), grow_time);
    progress.step - before
}

/// Whether there is a growth, and it has done all its steps.
pub(crate) fn is_done(state: &GrowthState) -> bool {
    state.growth().is_some_and(|growth| growth.is_finished())
}

/// The order in which organs take turns: rising, from the one after the `last` that had one.
fn turns<T: Ord + Clone>(mut organs: Vec<T>, last: Option<T>) -> Vec<T> {
    organs.sort_unstable();
    let next = last.map_or(0, |last| organs.partition_point(|organ| *organ <= last));
    let after = organs.split_off(next);
    [after, organs].concat()
}

/// Gives each a step in turn as long as the budget allows. `step` says whether there are more to do for that one.
///
/// Gives the number of steps done.
fn share_out<T: Copy>(
    budget: GrowthBudget,
    mut turns: Vec<T>,
    elapsed: impl Fn() -> Duration,
    mut step: impl FnMut(T) -> bool,
) -> u32 {
    let mut steps = 0;
    let mut turn = 0;
    while !turns.is_empty() && budget.allows(steps, &elapsed) {
        turn %= turns.len();
        steps += 1;
        if step(turns[turn]) {
            turn += 1;
        } else {
            turns.remove(turn);
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn no_step_begins_after_the_time_is_over() {
        let clock = Cell::new(Duration::ZERO);
        let budget = GrowthBudget::Time(Duration::from_millis(2));
        let count = |step_time: Duration| {
            clock.set(Duration::ZERO);
            share_out(
                budget,
                vec![()],
                || clock.get(),
                |()| {
                    clock.set(clock.get() + step_time);
                    true
                },
            )
        };
        assert_eq!(count(Duration::from_micros(500)), 4);
        assert_eq!(count(Duration::from_micros(1999)), 2);
        assert_eq!(count(Duration::from_millis(2)), 1);
        assert_eq!(count(Duration::from_secs(1)), 1);
    }

    #[test]
    fn one_step_is_always_done() {
        for budget in [GrowthBudget::Steps(0), GrowthBudget::Time(Duration::ZERO)] {
            assert_eq!(share_out(budget, vec![()], || Duration::from_secs(1), |()| true), 1);
        }
        assert_eq!(share_out(GrowthBudget::Steps(9), Vec::<()>::new(), || Duration::ZERO, |()| true), 0);
    }

    /// Steps done for each of three organs that need 3, 100 and 100 steps, over frames of two steps.
    #[test]
    fn organs_take_turns_within_and_across_frames() {
        let mut left = [3_i32, 100, 100];
        let mut last = None;
        for frame in 1..=30 {
            let growing = (0..3).filter(|&organ| left[organ] > 0).collect();
            share_out(
                GrowthBudget::Steps(2),
                turns(growing, last),
                || Duration::ZERO,
                |organ: usize| {
                    last = Some(organ);
                    left[organ] -= 1;
                    left[organ] > 0
                },
            );
            assert!((left[1] - left[2]).abs() <= 1, "frame {frame}: {left:?}");
        }
        assert_eq!(left[0], 0);
        assert_eq!(left[1] + left[2], 200 - (60 - 3));
    }

    #[test]
    fn turns_begin_after_the_last() {
        assert_eq!(turns(vec![3, 1, 2], None), [1, 2, 3]);
        assert_eq!(turns(vec![3, 1, 2], Some(1)), [2, 3, 1]);
        assert_eq!(turns(vec![3, 1], Some(2)), [3, 1]);
        assert_eq!(turns(vec![3, 1], Some(3)), [1, 3]);
        assert_eq!(turns(vec![], Some(3)), [0; 0]);
    }
}
