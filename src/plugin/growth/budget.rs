//! The time that growth may take in a frame, the time it took, and the time it is expected to take.

use bevy::{
    ecs::{change_detection::ResMut, reflect::ReflectResource, resource::Resource},
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::time::Duration;

/// How much work all growing organs together may do in a frame. It may be changed at any time.
///
/// At least one step is done in each frame while any organ grows, so growth always finishes.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub enum GrowthBudget {
    /// The time for everything that growth does in a frame: starting growths (at most half of it), steps, and
    /// publishing their changes. After the first, no step begins that is expected to end too late. One waiting growth
    /// is always started.
    Time(Duration),
    /// This many steps, summed over all organs, and all starts. Use it where frames must be the same on every machine.
    Steps(u32),
}

impl GrowthBudget {
    /// Default time: an eighth of a frame at 60 frames a second.
    pub const DEFAULT_TIME: Duration = Duration::from_millis(2);

    /// Whether another step may begin after this many steps. `until` is the time that the frame's work is expected to
    /// have taken when that step ends.
    ///
    /// `until` is called only if the time matters.
    pub fn allows(self, steps: u32, until: impl FnOnce() -> Duration) -> bool {
        steps == 0
            || match self {
                Self::Time(time) => until() <= time,
                Self::Steps(most) => steps < most,
            }
    }

    /// The same for starts. [`Steps`](Self::Steps) does not limit their number.
    pub(crate) fn allows_start(self, starts: u32, until: impl FnOnce() -> Duration) -> bool {
        match self {
            Self::Time(time) => Self::Time(time / 2).allows(starts, until),
            Self::Steps(_) => true,
        }
    }
}

impl Default for GrowthBudget {
    fn default() -> Self {
        Self::Time(Self::DEFAULT_TIME)
    }
}

/// What growth did in the last frame, and how long it took.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct GrowthFrame {
    /// Steps, over all organs.
    pub steps: u32,
    /// Time for starting growths: copying meshes, and starts that take no time. Jobs prepare tissues and place roots,
    /// outside this time.
    pub start_time: Duration,
    /// Time for the steps, and for the radii that result from them.
    pub step_time: Duration,
    /// Time for bringing vessel entities up to date.
    pub publish_time: Duration,
}

impl GrowthFrame {
    /// Total time that counts against the [`GrowthBudget`].
    pub fn time(&self) -> Duration {
        self.start_time + self.step_time + self.publish_time
    }
}

/// The last costs of repeated work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LastCosts([Duration; 3]);

impl LastCosts {
    /// Adds a cost and drops the oldest.
    pub(crate) fn add(&mut self, cost: Duration) {
        self.0 = [self.0[1], self.0[2], cost];
    }

    /// Expected cost of the next one: the median, which one interruption doesn't change. Zero while too few are known.
    pub(crate) fn expected(&self) -> Duration {
        let [a, b, c] = self.0;
        a.max(b).min(a.min(b).max(c))
    }
}

/// What a step is expected to cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct StepCost {
    /// The step itself.
    pub(crate) step: Duration,
    /// Settling the radii and publishing the changes, later in the frame.
    pub(crate) publish: Duration,
}

/// Costs of one growth's past steps.
#[derive(Debug, Default)]
pub(crate) struct Costs {
    steps: LastCosts,
    /// Settling and publishing, for each step that was published.
    publishing: LastCosts,
    /// Settling, since the vessels were last published.
    settling: Duration,
    /// Steps that haven't been published.
    unpublished: u32,
}

impl Costs {
    pub(crate) fn note_step(&mut self, cost: Duration) {
        self.steps.add(cost);
        self.unpublished += 1;
    }

    pub(crate) fn note_settling(&mut self, cost: Duration) {
        self.settling += cost;
    }

    /// Records the cost of publishing the steps since the last time.
    pub(crate) fn note_publishing(&mut self, cost: Duration) {
        let cost = cost + std::mem::take(&mut self.settling);
        if let Some(each) = cost.checked_div(std::mem::take(&mut self.unpublished)) {
            self.publishing.add(each);
        }
    }

    /// Expected cost of the next step.
    pub(crate) fn expected(&self) -> StepCost {
        StepCost { step: self.steps.expected(), publish: self.publishing.expected() }
    }
}

/// Rotates a round, sorted in rising order, so that it begins with the one after the `last` to have had a turn.
pub(crate) fn begin_after<T: Ord + Copy, C>(round: &mut [(T, C)], last: Option<T>) {
    let next = last.map_or(0, |last| round.partition_point(|&(organ, _)| organ <= last));
    round.rotate_left(if next == round.len() { 0 } else { next });
}

/// Gives each member of a round a step in turn while the budget allows. `step` returns the cost of the member's next
/// step, if it has one. `spent` is the time that the frame has taken so far.
///
/// Returns the number of steps done.
pub(crate) fn share_out<T: Copy>(
    budget: GrowthBudget,
    mut round: Vec<(T, StepCost)>,
    spent: impl Fn() -> Duration,
    mut step: impl FnMut(T) -> Option<StepCost>,
) -> u32 {
    let mut steps = 0;
    let mut turn = 0;
    let mut to_publish = Duration::ZERO;
    while !round.is_empty() {
        turn %= round.len();
        let (organ, cost) = round[turn];
        if !budget.allows(steps, || spent() + to_publish + cost.step + cost.publish) {
            break;
        }
        steps += 1;
        to_publish += cost.publish;
        match step(organ) {
            Some(next) => {
                round[turn].1 = next;
                turn += 1;
            }
            None => drop(round.remove(turn)),
        }
    }
    steps
}

/// Resets the account at the start of a frame.
pub(crate) fn begin_frame(mut frame: ResMut<GrowthFrame>) {
    *frame = GrowthFrame::default();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    const MS: Duration = Duration::from_millis(1);

    /// Steps done in one frame of `budget` if each takes `takes` and is expected to take `expected`.
    fn steps_in(budget: Duration, takes: Duration, expected: StepCost) -> (u32, Duration) {
        let clock = Cell::new(Duration::ZERO);
        let steps = share_out(
            GrowthBudget::Time(budget),
            vec![((), expected)],
            || clock.get(),
            |()| {
                clock.set(clock.get() + takes);
                Some(expected)
            },
        );
        (steps, clock.get())
    }

    #[test]
    fn no_step_begins_that_would_overrun() {
        let cost = |step, publish| StepCost { step, publish };
        assert_eq!(steps_in(2 * MS, MS / 2, cost(MS / 2, Duration::ZERO)), (4, 2 * MS));
        assert_eq!(steps_in(2 * MS, MS * 3 / 4, cost(MS * 3 / 4, Duration::ZERO)), (2, MS * 3 / 2));
        // publishing takes half of the time: it is kept free
        assert_eq!(steps_in(2 * MS, MS / 4, cost(MS / 4, MS / 4)), (4, MS));
        // with unknown costs one step may overrun
        assert_eq!(steps_in(2 * MS, 3 * MS / 2, StepCost::default()), (2, 3 * MS));
    }

    #[test]
    fn one_step_is_always_done() {
        let cost = StepCost { step: 9 * MS, publish: MS };
        for budget in [GrowthBudget::Steps(0), GrowthBudget::Time(Duration::ZERO), GrowthBudget::Time(MS)] {
            assert_eq!(share_out(budget, vec![((), cost)], || Duration::from_secs(1), |()| Some(cost)), 1);
        }
        let nobody = Vec::<((), StepCost)>::new();
        assert_eq!(share_out(GrowthBudget::Steps(9), nobody, || Duration::ZERO, |()| None), 0);
    }

    /// Frames of three organs that need 3, 100 and 100 steps of different cost.
    fn assert_fair(budget: GrowthBudget, costs: [Duration; 3], frames: u32) {
        let mut left = [3_i32, 100, 100];
        let mut last = None;
        for frame in 1..=frames {
            let clock = Cell::new(Duration::ZERO);
            let cost = |organ: usize| StepCost { step: costs[organ], publish: Duration::ZERO };
            let mut round: Vec<_> = (0..3).filter(|&organ| left[organ] > 0).map(|organ| (organ, cost(organ))).collect();
            begin_after(&mut round, last);
            let steps = share_out(
                budget,
                round,
                || clock.get(),
                |organ: usize| {
                    last = Some(organ);
                    left[organ] -= 1;
                    clock.set(clock.get() + costs[organ]);
                    (left[organ] > 0).then(|| cost(organ))
                },
            );
            assert!(steps > 0 || left == [0; 3]);
            assert!((left[1] - left[2]).abs() <= 1, "frame {frame}: {left:?}");
        }
        assert_eq!(left[0], 0);
        assert!(left[1] < 80);
    }

    #[test]
    fn organs_take_turns_within_and_across_frames() {
        assert_fair(GrowthBudget::Steps(2), [MS; 3], 30);
        assert_fair(GrowthBudget::Time(2 * MS), [MS / 10, MS * 3 / 4, MS / 3], 30);
        // an organ whose steps don't fit in a frame is neither favoured nor left behind
        assert_fair(GrowthBudget::Time(2 * MS), [MS, 5 * MS, MS / 2], 60);
    }

    #[test]
    fn a_round_begins_after_the_last() {
        let begin = |organs: &[u32], last| {
            let mut round: Vec<_> = organs.iter().map(|&organ| (organ, ())).collect();
            begin_after(&mut round, last);
            round.into_iter().map(|(organ, ())| organ).collect::<Vec<_>>()
        };
        assert_eq!(begin(&[1, 2, 3], None), [1, 2, 3]);
        assert_eq!(begin(&[1, 2, 3], Some(1)), [2, 3, 1]);
        assert_eq!(begin(&[1, 3], Some(2)), [3, 1]);
        assert_eq!(begin(&[1, 3], Some(3)), [1, 3]);
        assert_eq!(begin(&[], Some(3)), [0; 0]);
    }

    #[test]
    fn one_interrupted_step_is_forgotten() {
        let mut costs = LastCosts::default();
        assert_eq!(costs.expected(), Duration::ZERO);
        for cost in [3, 4, 900, 5] {
            costs.add(cost * MS);
        }
        assert_eq!(costs.expected(), 5 * MS, "the median of 4, 900 and 5");
        costs.add(6 * MS);
        assert_eq!(costs.expected(), 6 * MS);
        costs.add(4 * MS);
        assert_eq!(costs.expected(), 5 * MS);
    }

    #[test]
    fn starts_take_half_of_the_time_and_one_is_always_done() {
        let budget = GrowthBudget::Time(2 * MS);
        assert!(budget.allows_start(0, || 9 * MS));
        assert!(budget.allows_start(5, || MS));
        assert!(!budget.allows_start(1, || MS + MS / 10));
        assert!(GrowthBudget::Steps(1).allows_start(99, || 99 * MS));
    }
}
