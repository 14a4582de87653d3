//! A tree reduced to its joints with another network: linked nodes, open ends and the forks between them.
//!
//! In: a [`Network`], the slots with links, and the draw of open ends. Out: pressures at those slots for any currents
//! into them, at the cost of the joints alone: at most two for each link or end, however large the tree.

use super::{
    Network,
    open_ends::OpenEnds,
    skeleton::{Joint, Skeleton},
};
use crate::synthesis::pace::Pace;

/// A joint after eliminating all joints below it.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// The joint above, the source or nothing.
    above: u32,
    /// Share of a current into the joint that goes upwards, and of the pressure above that arrives.
    share: f64,
    /// Pressure per current, for zero pressure above.
    resistance: f64,
}

/// A tree between its links, its open ends and its roots.
#[derive(Clone, Debug, Default)]
pub(super) struct Quotient {
    skeleton: Skeleton,
    nodes: Vec<Node>,
    /// Conductances below the joints, while they are eliminated.
    sums: Vec<f64>,
    /// Currents into the joints, which become their pressures. Then those of the source and of the null joint.
    values: Vec<f64>,
}

impl Quotient {
    /// Traces the tree again, after it changed or was cut, or the linked nodes changed.
    pub async fn trace(&mut self, network: &mut Network, linked: &[u32], pace: &Pace) {
        network.circuit.sum_all(&pace.part(0.0..0.5)).await;
        let ends = network.ends.all().iter().map(|end| end.attached);
        self.skeleton.trace(&network.circuit, linked.iter().copied().chain(ends), &pace.part(0.5..1.0)).await;
    }

    /// All joints, below before above.
    pub fn joints(&self) -> &[Joint] {
        self.skeleton.joints()
    }

    /// The joint of a slot with a link or an attached end.
    pub fn joint_at(&self, slot: u32) -> u32 {
        self.skeleton.joint_at(slot)
    }

    /// Eliminates the joints from the tips to the roots, with the draw of open ends and leaks from joints into the bed's
    /// pool.
    pub fn eliminate(&mut self, ends: &OpenEnds, leaks: impl Iterator<Item = (u32, f64)>) {
        let joints = self.skeleton.joints();
        let (source, nothing) = (joints.len() as u32, joints.len() as u32 + 1);
        self.sums.clear();
        self.sums.extend(joints.iter().map(|joint| joint.hanging.y));
        for end in ends.all() {
            self.sums[self.skeleton.joint_at(end.attached) as usize] += end.stump.y;
        }
        for (joint, leak) in leaks {
            self.sums[joint as usize] += leak;
        }
        self.nodes.clear();
        for (at, joint) in joints.iter().enumerate() {
            let below = self.sums[at];
            self.nodes.push(if joint.is_root {
                Node { above: source, share: 1.0, resistance: 0.0 }
            } else if let Some(above) = joint.above() {
                let y = below + joint.run.lower.y;
                let total = joint.run.through + y;
                let share = joint.run.through / total;
                self.sums[above as usize] += joint.run.upper.y + share * y;
                Node { above, share, resistance: 1.0 / total }
            } else {
                // Cut off: a piece without a bed has run dry.
                Node { above: nothing, share: 0.0, resistance: if below > 0.0 { 1.0 / below } else { 0.0 } }
            });
        }
    }

    /// Begins a solution without currents.
    pub fn begin(&mut self) {
        self.values.clear();
        self.values.resize(self.nodes.len() + 2, 0.0);
    }

    /// Adds a current into a joint.
    pub fn give(&mut self, joint: u32, current: f64) {
        self.values[joint as usize] += current;
    }

    /// Finds the pressures of all joints, with roots held at `source` above the bed's.
    pub fn solve(&mut self, source: f64) {
        for (at, node) in self.nodes.iter().enumerate() {
            let given = node.share * self.values[at];
            self.values[node.above as usize] += given;
        }
        let joints = self.nodes.len();
        self.values[joints] = source;
        self.values[joints + 1] = 0.0;
        for (at, node) in self.nodes.iter().enumerate().rev() {
            self.values[at] = node.share * self.values[node.above as usize] + node.resistance * self.values[at];
        }
    }

    /// Pressure of a joint relative to the bed's.
    pub fn pressure(&self, joint: u32) -> f64 {
        self.values[joint as usize]
    }
}
