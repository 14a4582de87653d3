//! One of the two networks of a circulation, reduced to its linked nodes.

use super::{
    Network, NetworkEnd,
    circuit::{FIRST, SOURCE, node_slot},
    open_ends::OpenEnds,
    quotient::Quotient,
    skeleton::Joint,
};
use crate::synthesis::{pace::Pace, tree::NodeId};

/// A pressure as good as none, in Pa: a hundred-thousandth of a mmHg. A patient without blood has no more, and then
/// nothing is large enough to measure an error by.
pub(super) const LEAST_PRESSURE: f64 = 1e-3;

/// Leak from the links of a node into the bed's pool, in conductances of the links or the node's segment, whichever
/// conducts less. It fixes the pressure of pieces that only links connect, and is below the accuracy of every flow.
const LEAK: f64 = 1e-11;

/// The linked nodes of one network, and its response to currents into them.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// Slots of the nodes, in rising order.
    pub slots: Vec<u32>,
    /// For every link, the index of its node in `slots`.
    pub of_links: Vec<u32>,
    pub quotient: Quotient,
    /// The joint of each slot.
    joints: Vec<u32>,
    /// The revision of the network that was traced.
    traced: Option<u64>,
    /// Pressures of the slots as of the last solution, relative to the bed's.
    pub pressures: Vec<f64>,
    /// Pressures of all joints, relative to that outside.
    from_outside: Vec<f64>,
}

impl Side {
    pub fn new(nodes: impl Iterator<Item = NodeId> + Clone) -> Self {
        let mut slots: Vec<u32> = nodes.clone().map(|node| node_slot(node.index()) as u32).collect();
        slots.sort_unstable();
        slots.dedup();
        let place = |node: NodeId| slots.partition_point(|&slot| slot < node_slot(node.index()) as u32) as u32;
        let of_links = nodes.map(place).collect();
        Self { slots, of_links, ..Self::default() }
    }

    /// Traces the network if it has changed, and takes the pressures of its last solution. Returns whether it has.
    pub async fn prepare(&mut self, network: &mut Network, pace: &Pace) -> bool {
        let has_changed = self.traced != Some(network.revision);
        if has_changed {
            self.quotient.trace(network, &self.slots, pace).await;
            self.joints = self.slots.iter().map(|&slot| self.quotient.joint_at(slot)).collect();
            self.traced = Some(network.revision);
        }
        self.pressures.clear();
        self.pressures.extend(self.slots.iter().map(|&slot| network.circuit.slots[slot as usize].pressure));
        has_changed
    }

    /// All joints, below before above.
    pub fn joints(&self) -> &[Joint] {
        self.quotient.joints()
    }

    /// The joint of a slot with a link or an attached end.
    pub fn joint_at(&self, slot: u32) -> u32 {
        self.quotient.joint_at(slot)
    }

    /// The linked slots with their joints.
    pub fn linked(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.slots.iter().copied().zip(self.joints.iter().copied())
    }

    /// The joint of every link.
    pub fn linked_joints(&self) -> impl Iterator<Item = u32> + '_ {
        self.of_links.iter().map(|&at| self.joints[at as usize])
    }

    /// Takes a solution: pressures of all joints above `zero`. That and `ambient` are relative to the bed's.
    pub fn take(&mut self, pressures: impl Iterator<Item = f64>, zero: f64, ambient: f64) {
        self.from_outside.clear();
        self.from_outside.extend(pressures);
        for (taken, &joint) in self.pressures.iter_mut().zip(&self.joints) {
            *taken = self.from_outside[joint as usize] + zero;
        }
        self.from_outside.iter_mut().for_each(|pressure| *pressure -= ambient - zero);
    }

    /// Pressure at an open end's node, relative to that outside.
    pub fn from_outside(&self, end: &NetworkEnd) -> f64 {
        self.from_outside[self.joint_at(end.attached) as usize]
    }

    /// Eliminates all joints, with links that end in a given pressure and linearised ends.
    pub fn eliminate(&mut self, network: &Network, ends: &OpenEnds) {
        let leaks = self.slots.iter().zip(&self.joints).map(|(&slot, &joint)| (joint, leak(network, slot)));
        self.quotient.eliminate(ends, leaks);
    }

    /// Pressures at the linked nodes caused by currents into them, with everything else at pressure 0: T⁻¹.
    pub fn respond(&mut self, currents: &[f64], pressures: &mut [f64]) {
        self.quotient.begin();
        self.give(currents);
        self.quotient.solve(0.0);
        for (pressure, &joint) in pressures.iter_mut().zip(&self.joints) {
            *pressure = self.quotient.pressure(joint);
        }
    }

    /// Pressures at the linked nodes with everything that drives the network: its roots, its linearised open ends, and
    /// the currents of the links.
    pub fn settle(&mut self, network: &Network, currents: &[f64]) {
        self.quotient.begin();
        self.give(currents);
        let ambient = network.ambient();
        for end in network.ends.all() {
            self.quotient.give(self.quotient.joint_at(end.attached), end.stump.counted_from(-ambient).s);
        }
        self.quotient.solve(network.source);
        let pressures: Vec<f64> = (0..self.joints().len()).map(|joint| self.quotient.pressure(joint as u32)).collect();
        self.take(pressures.into_iter(), 0.0, ambient);
    }

    fn give(&mut self, currents: &[f64]) {
        for (&joint, &current) in self.joints.iter().zip(currents) {
            self.quotient.give(joint, current);
        }
    }

    /// Currents of the links into this side from pressures on the other: E.
    pub fn carry(&self, other: &Self, conductance: f64, pressures: &[f64], currents: &mut [f64]) {
        currents.fill(0.0);
        for (&here, &there) in self.of_links.iter().zip(&other.of_links) {
            currents[here as usize] += conductance * pressures[there as usize];
        }
    }

    /// Zeroes the currents of links into roots, whose pressure is given: there is nothing to balance.
    pub fn excuse_roots(&self, network: &Network, currents: &mut [f64]) {
        for (current, &slot) in currents.iter_mut().zip(&self.slots) {
            if network.circuit.links[slot as usize].upstream == SOURCE {
                *current = 0.0;
            }
        }
    }

    /// Sets the currents of the links, and solves the network with its loaded ends.
    pub async fn drive(&self, network: &mut Network, currents: &[f64], pace: &Pace) {
        for (&slot, &current) in self.slots.iter().zip(currents) {
            network.circuit.beds[slot as usize].s = current;
            network.circuit.shunts[slot as usize] = network.circuit.beds[slot as usize];
        }
        network.ends.load(&mut network.circuit);
        network.circuit.sum_all(&pace.part(0.0..0.5)).await;
        network.spread_pressures(&pace.part(0.5..1.0)).await;
        // A later solution of this network alone must start over.
        network.sums_stale = true;
        network.ends.is_untraced = true;
    }
}

/// Conductance between a linked slot and the bed's pool.
pub(super) fn leak(network: &Network, slot: u32) -> f64 {
    let segment = 1.0 / network.whole_resistance(slot as usize - FIRST);
    LEAK * segment.min(network.circuit.beds[slot as usize].y)
}

impl Network {
    /// Replaces the nodes that are joined to another network: each is joined as often as it is named. All must exist.
    pub(super) async fn set_links(&mut self, nodes: impl Iterator<Item = NodeId>, pace: &Pace) {
        self.link_counts.clear();
        self.link_counts.resize(self.len(), 0);
        for node in nodes {
            self.link_counts[node.index()] += 1;
        }
        self.set_beds(pace).await;
    }

    /// Sets the beds of all nodes.
    pub(super) async fn set_beds(&mut self, pace: &Pace) {
        pace.each(self.len(), |node| self.set_bed(node)).await;
        self.sums_stale = true;
        self.revision += 1;
        self.ends.is_untraced = true;
    }
}
