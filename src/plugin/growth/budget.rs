//! What growth may cost in a frame, what it did cost, and what it is expected to cost.

use bevy::{
    ecs::{change_detection::ResMut, reflect::ReflectResource, resource::Resource},
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::time::Duration;

/// How much all growing organs together may do in a frame. Change it at any time.
///
/// Whatever it says, one step is done in each frame as long as any organ grows, so growth always comes to its end.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub enum GrowthBudget {
    /// The time for everything that growth does in a frame: starting growths, which takes half of it at most, steps, and
    /// publishing what they changed. No step begins that is expected to end later, but for the first; and one growth is
    /// always started, where any waits to be.
    Time(Duration),
    /// This many steps, each organ's counted, and all starts. Of use where frames are to be the same on every machine.
    Steps(u32),
}

impl GrowthBudget {
    /// Default time: an eighth of a frame at 60 frames a second.
    pub const DEFAULT_TIME: Duration = Duration::from_millis(2);

    /// Whether another step may begin after this many steps, where the frame's work is expected to have taken `until` at
    /// its end.
    ///
    /// The time is asked for only where it matters.
    pub fn allows(self, steps: u32, until: impl FnOnce() -> Duration) -> bool {
        steps == 0
            || match self {
                Self::Time(time) => until() <= time,
                Self::Steps(most) => steps < most,
            }
    }

    /// The same for starts, of which there may be any number where steps are counted.
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

/// What growth did in the last frame, and how long that took.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct GrowthFrame {
    /// Steps, over all organs.
    pub steps: u32,
    /// Time for starting growths: copies of meshes, and the planting of roots. Tissues are prepared beside the frames.
    pub start_time: Duration,
    /// Time for the steps, and for the radii that follow from them.
    pub step_time: Duration,
    /// Time for bringing vessel entities up to date.
    pub publish_time: Duration,
}

impl GrowthFrame {
    /// Everything that the [`GrowthBudget`] is for.
    pub fn time(&self) -> Duration {
        self.start_time + self.step_time + self.publish_time
    }
}

/// The last costs of something that is done again and again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LastCosts([Duration; 3]);

impl LastCosts {
    /// Takes in another one.
    pub(crate) fn add(&mut self, cost: Duration) {
        self.0 = [self.0[1], self.0[2], cost];
    }

    /// What the next one will cost: the median, which an interrupted one doesn't change. Zero as long as too few are known.
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
    /// Settling the radii and publishing what it changed, later in the frame.
    pub(crate) publish: Duration,
}

/// What the steps of one growth have cost.
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

    /// Takes in what it cost to publish the steps done since the last time.
    pub(crate) fn note_publishing(&mut self, cost: Duration) {
        let cost = cost + std::mem::take(&mut self.settling);
        if let Some(each) = cost.checked_div(std::mem::take(&mut self.unpublished)) {
            self.publishing.add(each);
        }
    }

    /// What the next step is expected to cost.
    pub(crate) fn expected(&self) -> StepCost {
        StepCost { step: self.steps.expected(), publish: self.publishing.expected() }
    }
}

/// Lets those that take turns, in rising order, begin with the one after the `last` that had one.
pub(crate) fn begin_after<T: Ord + Copy, C>(round: &mut [(T, C)], last: Option<T>) {
    let next = last.map_or(0, |last| round.partition_point(|&(organ, _)| organ <= last));
    round.rotate_left(if next == round.len() { 0 } else { next });
}

/// Gives each of a round a step in turn as long as the budget allows. `step` gives the cost of that one's next step, if it
/// has more to do. `spent` is what the frame has taken so far.
///
/// Gives the number of steps done.
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

/// Begins a frame's account.
pub(crate) fn begin_frame(mut frame: ResMut<GrowthFrame>) {
    *frame = GrowthFrame::default();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    const MS: Duration = Duration::from_millis(1);

    /// Steps done in one frame of `budget`, where each takes `takes` and is expected to take `expected`.
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
        // half of what is done is published later: that time is kept free
        assert_eq!(steps_in(2 * MS, MS / 4, cost(MS / 4, MS / 4)), (4, MS));
        // without knowledge a step may overrun, once
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
        // one whose steps don't fit in a frame is neither favoured nor left behind
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
