//! The solution of a network: pressures and flows by node, and values derived from them.

use super::{
    Network, NetworkEnd,
    circuit::{FIRST, REFERENCE, SOURCE},
};
use crate::synthesis::units::Flow;

impl Network {
    /// Pressure of every node in pascals, as of the last [`solve`](Self::solve).
    ///
    /// A node without a connection to a root or the bed has the bed's pressure.
    pub fn pressures(&self) -> &[f64] {
        &self.pressures
    }

    /// Flow into every segment at its upper end in m³/s, as of the last [`solve`](Self::solve), by its end node.
    /// Positive flow goes from the root to the terminals.
    ///
    /// At a root it is the flow into its tree. At an interrupted segment it is the flow out of the cut's proximal end;
    /// that of the distal end is in [`open_ends`](Self::open_ends).
    pub fn flows(&self) -> &[f64] {
        &self.flows
    }

    /// Flow from a node into the bed in m³/s, as of the last solution; negative if the bed feeds the vessel, and 0 if
    /// the node is no terminal.
    ///
    /// # Panics
    /// If the node is not in this network.
    pub fn bed_flow(&self, node: usize) -> f64 {
        let bed = self.circuit.beds[node + FIRST];
        bed.y * self.circuit.slots[node + FIRST].pressure - bed.s
    }

    /// Resistance of a node's segment while it is whole, in Pa·s/m³; 0 for a root.
    ///
    /// # Panics
    /// If the node is not in this network.
    pub fn resistance(&self, node: usize) -> f64 {
        self.whole_resistance(node)
    }

    /// Mean velocity in every segment in m/s, by its end node. See [`velocity`](Self::velocity).
    pub fn velocities(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.len()).map(|node| self.velocity(node))
    }

    /// Shear stress at every segment's wall in Pa, by its end node. See [`wall_shear_stress`](Self::wall_shear_stress).
    pub fn wall_shear_stresses(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.len()).map(|node| self.wall_shear_stress(node))
    }

    /// Resistance of every segment while it is whole, in Pa·s/m³, by its end node.
    pub fn resistances(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.len()).map(|node| self.resistance(node))
    }

    /// Mean velocity in a segment in m/s, as of the last solution, with the sign of its flow.
    ///
    /// # Panics
    /// If the node is not in this network.
    pub fn velocity(&self, node: usize) -> f64 {
        let radius = self.settings.scale.to_metres(self.radii[node]);
        self.flows[node] / (std::f64::consts::PI * radius * radius)
    }

    /// Shear stress at a segment's wall in Pa, as of the last solution: 4µ|Q|/(πr³).
    ///
    /// # Panics
    /// If the node is not in this network.
    pub fn wall_shear_stress(&self, node: usize) -> f64 {
        let radius = self.settings.scale.to_metres(self.radii[node]);
        // 8µ/(πr⁴)·r/2 is 4µ/(πr³).
        0.5 * self.per_length[node] * radius * self.flows[node].abs()
    }

    /// Flow through all roots together, as of the last [`settle`](Self::settle) or [`solve`](Self::solve).
    pub fn inflow(&self) -> Flow {
        let mut sum = 0.0;
        let mut root = self.circuit.links[SOURCE as usize].first_child;
        while root != REFERENCE {
            let below = self.circuit.slots[root as usize].below;
            sum += below.y * self.source - below.s;
            root = self.circuit.links[root as usize].next_sibling;
        }
        Flow::from_cubic_metres_per_second(sum)
    }

    /// The open ends, in the order of their segments, as of the last [`settle`](Self::settle) or
    /// [`solve`](Self::solve).
    pub fn open_ends(&self) -> &[NetworkEnd] {
        self.ends.all()
    }
}
