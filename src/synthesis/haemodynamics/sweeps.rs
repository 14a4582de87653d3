//! The solution: sums from the tips to the roots, then pressures from the roots to the tips, or along one path.

use super::{
    FlowError, Network,
    circuit::{FIRST, REFERENCE, SOURCE, node_slot},
};
use crate::synthesis::{
    pace::{Pace, at_once},
    tree::NodeId,
    units::Pressure,
};

impl Network {
    /// Brings pressures and flows of all nodes up to date.
    ///
    /// # Errors
    /// If the flow through the open ends did not converge.
    pub fn solve(&mut self) -> Result<(), FlowError> {
        at_once(self.solve_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub async fn solve_paced(&mut self, pace: &Pace) -> Result<(), FlowError> {
        if std::mem::take(&mut self.sums_stale) {
            self.circuit.sum_all(&pace.part(0.0..0.5)).await;
        }
        self.settle()?;
        self.spread_pressures(&pace.part(0.5..1.0)).await;
        Ok(())
    }

    /// Brings open ends and sums up to date, without pressures and flows of all nodes.
    ///
    /// The cost is the length of the paths from the open ends to the roots, not the size of the tree, unless the tree
    /// itself has changed.
    ///
    /// # Errors
    /// If the flow through the open ends did not converge.
    pub fn settle(&mut self) -> Result<(), FlowError> {
        self.solve_ends()?;
        self.ends.add_to_sums(&mut self.circuit);
        Ok(())
    }

    /// Brings only the flow at open ends up to date, but no sums or other pressures.
    ///
    /// # Errors
    /// If it did not converge.
    pub fn solve_ends(&mut self) -> Result<(), FlowError> {
        if std::mem::take(&mut self.sums_stale) {
            at_once(self.circuit.sum_all(&Pace::default()));
        }
        self.ends.trace(&self.circuit);
        self.ends.solve(self.source, self.ambient(), self.bed)
    }

    /// Pressure of one node, found along its path to the root.
    ///
    /// # Errors
    /// If there is no such node, or the flow through the open ends did not converge.
    pub fn pressure_at(&mut self, node: NodeId) -> Result<Pressure, FlowError> {
        self.check(node)?;
        self.settle()?;
        let mut path = std::mem::take(&mut self.path);
        path.clear();
        let mut slot = node_slot(node.index()) as u32;
        while slot > SOURCE {
            path.push(slot);
            slot = self.circuit.links[slot as usize].upstream;
        }
        let mut pressure = if slot == SOURCE { self.source } else { 0.0 };
        for &slot in path.iter().rev() {
            let slot = &self.circuit.slots[slot as usize];
            pressure = slot.through * (pressure + slot.resistance * slot.below.s);
        }
        self.path = path;
        Ok(Pressure::from_pascals(pressure + self.bed))
    }

    /// Computes pressures and flows of all nodes from the sums.
    pub(super) async fn spread_pressures(&mut self, pace: &Pace) {
        self.circuit.slots[REFERENCE as usize].pressure = 0.0;
        self.circuit.slots[SOURCE as usize].pressure = self.source;
        let spread = |node: usize| {
            let above = self.circuit.slots[self.circuit.links[node + FIRST].upstream as usize].pressure;
            let slot = &mut self.circuit.slots[node + FIRST];
            slot.pressure = slot.through * (above + slot.resistance * slot.below.s);
            self.pressures[node] = slot.pressure + self.bed;
            self.flows[node] = slot.through * (slot.below.y * above - slot.below.s);
        };
        pace.each(self.radii.len(), spread).await;
        for &(node, _) in &self.interruptions {
            self.flows[node as usize] = 0.0;
        }
        for end in self.ends.all().iter().filter(|end| end.is_proximal()) {
            self.flows[end.node.index()] = end.flow;
        }
    }
}
