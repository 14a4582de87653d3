//! The part of a network that open ends act on, small enough to be solved many times in a frame.
//!
//! Only the paths from the open ends to their roots matter. Everything that hangs off them is a constant shunt. Joints
//! are nodes where an end is attached or two paths meet. A run of segments between two joints is one conductance with a
//! shunt at each end: eliminating the nodes in between, one by one, turns a star of three into a triangle. All
//! operations add, multiply and divide positive numbers. So m ends make at most 2m joints, however large the tree.

use super::circuit::{Circuit, REFERENCE, SOURCE, Shunt};
use crate::synthesis::pace::{Pace, Stretch};

/// No joint.
const NONE: u32 = u32::MAX;

/// A node where an open end is attached, where paths meet, or where a path begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    /// The next joint towards the root, or none.
    above: u32,
    /// Whether it is a root, held at the root pressure.
    pub is_root: bool,
    /// Bed, links and whole subtrees at the joint.
    pub hanging: Shunt,
    /// The subtrees alone.
    pub subtrees: Shunt,
    /// The run of segments to the joint above.
    pub run: Run,
    /// `hanging`, the open ends and the joints below, in the solution.
    below: Shunt,
    pressure: f64,
}

/// A run of segments as a conductance with a shunt at each end.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    pub upper: Shunt,
    pub through: f64,
    pub lower: Shunt,
}

impl Joint {
    /// The next joint towards the root.
    pub fn above(&self) -> Option<u32> {
        (self.above != NONE).then_some(self.above)
    }
}

impl Run {
    /// Extends the run by the node at its upper end, which has a shunt, and by the segment above that.
    fn extend(&mut self, hanging: Shunt, resistance: f64) {
        let middle = Shunt { y: self.upper.y + hanging.y, s: self.upper.s + hanging.s };
        // Shares of the three arms of the star, with all conductances multiplied by the new segment's resistance.
        let total = 1.0 + resistance * (self.through + middle.y);
        let (up, down) = (1.0 / total, resistance * self.through / total);
        self.upper = Shunt { y: middle.y * up, s: middle.s * up };
        self.lower.y += middle.y * down;
        self.lower.s += middle.s * down;
        self.through *= up;
    }
}

/// The paths from open ends to their roots, as joints.
#[derive(Clone, Debug, Default)]
pub(super) struct Skeleton {
    /// Below before above.
    joints: Vec<Joint>,
    /// All slots on the paths, below before above.
    active: Vec<u32>,
    /// The joint of a slot. Only valid for slots on the paths.
    joint_of: Vec<u32>,
    /// Number of the trace in which a slot was last on a path.
    seen: Vec<u32>,
    trace: u32,
}

impl Skeleton {
    /// Value of [`joint_of`](Self::joint_of) for a slot that will be a joint.
    const DUE: u32 = u32::MAX - 1;

    /// Traces the paths from the slots with attached ends. The sums of all slots off the paths must be up to date.
    pub async fn trace(&mut self, circuit: &Circuit, attached: impl Iterator<Item = u32>, pace: &Pace) {
        self.begin_trace(circuit.links.len());
        let (mut walks, mut stretch) = (Vec::new(), Stretch::default());
        for slot in attached {
            walks.push(self.active.len());
            self.walk(circuit, slot);
            if stretch.ends_after(self.active.len() - walks[walks.len() - 1]) {
                pace.rest(0.0).await;
            }
        }
        // A later walk ends where it meets an earlier one, so its slots lie below.
        let mut ordered = Vec::with_capacity(self.active.len());
        let mut end = self.active.len();
        for &start in walks.iter().rev() {
            ordered.extend_from_slice(&self.active[start..end]);
            end = start;
        }
        self.active = ordered;
        for at in 0..self.active.len() {
            let slot = self.active[at];
            if self.joint_of[slot as usize] == Self::DUE {
                self.joint_of[slot as usize] = self.joints.len() as u32;
                let joint = self.joint(circuit, slot);
                self.joints.push(joint);
            }
            if stretch.ends_after(1) {
                pace.rest(at as f32 / self.active.len() as f32).await;
            }
        }
        for joint in &mut self.joints {
            joint.above = if joint.above == NONE { NONE } else { self.joint_of[joint.above as usize] };
        }
    }

    fn begin_trace(&mut self, slots: usize) {
        self.joints.clear();
        self.active.clear();
        self.joint_of.resize(slots, NONE);
        self.seen.resize(slots, 0);
        self.trace = self.trace.wrapping_add(1);
        if self.trace == 0 {
            self.seen.fill(0);
            self.trace = 1;
        }
    }

    /// Marks the path from a slot up to its root, or to a marked path.
    fn walk(&mut self, circuit: &Circuit, start: u32) {
        let mut slot = start;
        while self.seen[slot as usize] != self.trace {
            self.seen[slot as usize] = self.trace;
            self.active.push(slot);
            let upstream = circuit.links[slot as usize].upstream;
            let begins = upstream <= SOURCE;
            self.joint_of[slot as usize] = if slot == start || begins { Self::DUE } else { NONE };
            if begins {
                return;
            }
            slot = upstream;
        }
        self.joint_of[slot as usize] = Self::DUE;
    }

    /// Measures the shunt at a joint, and the run above it. Its `above` is still a slot.
    fn joint(&self, circuit: &Circuit, slot: u32) -> Joint {
        let mut upper = circuit.links[slot as usize].upstream;
        let mut joint = Joint {
            above: NONE,
            is_root: upper == SOURCE,
            hanging: self.hanging(circuit, slot, circuit.beds[slot as usize]),
            subtrees: self.hanging(circuit, slot, Shunt::default()),
            run: Run::default(),
            below: Shunt::default(),
            pressure: 0.0,
        };
        if upper <= SOURCE {
            return joint;
        }
        joint.run.through = 1.0 / circuit.slots[slot as usize].resistance;
        while self.joint_of[upper as usize] == NONE {
            let hanging = self.hanging(circuit, upper, circuit.beds[upper as usize]);
            joint.run.extend(hanging, circuit.slots[upper as usize].resistance);
            upper = circuit.links[upper as usize].upstream;
        }
        joint.above = upper;
        // A run whose flow all leaks still joins its ends, so that nothing is divided by 0.
        joint.run.through = joint.run.through.max(f64::MIN_POSITIVE);
        joint
    }

    /// A bed and the children off the paths.
    fn hanging(&self, circuit: &Circuit, slot: u32, bed: Shunt) -> Shunt {
        let mut hanging = bed;
        let mut child = circuit.links[slot as usize].first_child;
        while child != REFERENCE {
            let link = circuit.links[child as usize];
            if link.upstream == slot && self.seen[child as usize] != self.trace {
                let below = &circuit.slots[child as usize];
                hanging.y += below.below.y * below.through;
                hanging.s += below.below.s * below.through;
            }
            child = link.next_sibling;
        }
        hanging
    }

    /// All joints, below before above.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// All slots on the paths, below before above.
    pub fn active(&self) -> &[u32] {
        &self.active
    }

    /// The joint of a slot with an attached end.
    pub fn joint_at(&self, slot: u32) -> u32 {
        self.joint_of[slot as usize]
    }

    /// Begins a solution without open ends. Until its end, pressures are relative to that outside, which is `ambient`
    /// above the bed's: a wide hole leaves so little pressure before it that rounding would lose it beside the bed's.
    pub fn begin(&mut self, ambient: f64) {
        for joint in &mut self.joints {
            joint.below = joint.hanging.counted_from(ambient);
        }
    }

    /// Adds the draw of an open end.
    pub fn draw(&mut self, joint: u32, stump: Shunt) {
        let below = &mut self.joints[joint as usize].below;
        below.y += stump.y;
        below.s += stump.s;
    }

    /// Finds the pressures of all joints. The root pressure is relative to the bed's.
    pub fn solve(&mut self, source: f64, ambient: f64) {
        for at in 0..self.joints.len() {
            let Joint { above, run, below, .. } = self.joints[at];
            if above == NONE {
                continue;
            }
            let (upper, lower) = (run.upper.counted_from(ambient), run.lower.counted_from(ambient));
            let (y, s) = (below.y + lower.y, below.s + lower.s);
            let share = run.through / (run.through + y);
            let into = &mut self.joints[above as usize].below;
            into.y += upper.y + share * y;
            into.s += upper.s + share * s;
        }
        for at in (0..self.joints.len()).rev() {
            let Joint { above, is_root, run, below, .. } = self.joints[at];
            self.joints[at].pressure = if is_root {
                source - ambient
            } else if above == NONE {
                // Cut off: its bed and ends determine the pressure. A piece without a bed has run dry.
                if below.y > 0.0 { below.s / below.y } else { 0.0 }
            } else {
                let lower = run.lower.counted_from(ambient);
                let (y, s) = (below.y + lower.y, below.s + lower.s);
                (run.through * self.joints[above as usize].pressure + s) / (run.through + y)
            };
        }
    }

    /// Pressure of a joint relative to that outside.
    pub fn pressure(&self, joint: u32) -> f64 {
        self.joints[joint as usize].pressure
    }
}
