//! One of the two networks of a circulation, reduced to its linked nodes.

use super::{
    Network,
    circuit::{SOURCE, node_slot},
    quotient::Quotient,
};
use crate::synthesis::{pace::Pace, tree::NodeId};

/// A pressure as good as none, in Pa: a hundred-thousandth of a mmHg. A patient without blood has no more, and then
/// nothing is large enough to measure an error by.
pub(super) const LEAST_PRESSURE: f64 = 1e-3;

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
    /// Pressures of the slots as of the last solution.
    pub pressures: Vec<f64>,
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

    /// Traces the network if it has changed, and takes the pressures of its last solution.
    pub async fn prepare(&mut self, network: &mut Network, pace: &Pace) {
        if self.traced != Some(network.revision) {
            self.quotient.trace(network, &self.slots, pace).await;
            self.joints = self.slots.iter().map(|&slot| self.quotient.joint_at(slot)).collect();
            self.traced = Some(network.revision);
        }
        self.pressures.clear();
        self.pressures.extend(self.slots.iter().map(|&slot| network.circuit.slots[slot as usize].pressure));
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
        for end in network.ends.all() {
            self.quotient.give(self.quotient.joint_at(end.attached), end.stump.s);
        }
        self.quotient.solve(network.source);
        for (pressure, &joint) in self.pressures.iter_mut().zip(&self.joints) {
            *pressure = self.quotient.pressure(joint);
        }
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

    /// Sets the ends' draw by their tangents, for pressures relative to the bed's.
    pub(super) fn linearise_ends(&mut self) {
        self.ends.linearise();
        self.ends.count_from(-self.ambient());
    }

    pub(super) fn accept_ends(&mut self, quotient: &Quotient, damped: bool) -> f64 {
        let ambient = self.ambient();
        self.ends.count_from(ambient);
        let rounding = 1e-11 * self.source.abs().max(ambient.abs()).max(LEAST_PRESSURE);
        self.ends.accept(|end| quotient.pressure(quotient.joint_at(end.attached)) - ambient, rounding, damped)
    }

    pub(super) fn finish_ends(&mut self, quotient: &Quotient) {
        let ambient = self.ambient();
        self.ends.finish(|end| quotient.pressure(quotient.joint_at(end.attached)) - ambient, ambient, self.bed);
    }
}
