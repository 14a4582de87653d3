//! The solution: sums from the tips to the roots, pressures from the roots to the tips, and both along one path.

use super::{
    FlowError, Network,
    network::{FIRST, REFERENCE, SOURCE, Shunt, node_slot},
};
use crate::synthesis::{
    pace::{Pace, STRETCH, at_once},
    tree::NodeId,
    units::Pressure,
};
use std::{collections::BinaryHeap, ops::Range};

impl Network {
    /// Brings pressures and flows of all nodes up to date.
    ///
    /// # Errors
    /// When the flow through the open ends did not converge.
    pub fn solve(&mut self) -> Result<(), FlowError> {
        at_once(self.solve_paced(&Pace::default()))
    }

    /// The same, with rests.
    ///
    /// # Errors
    /// Those of [`solve`](Self::solve).
    pub async fn solve_paced(&mut self, pace: &Pace) -> Result<(), FlowError> {
        if std::mem::take(&mut self.sums_stale) {
            self.sum_all(&pace.part(0.0..0.5)).await;
        }
        self.settle()?;
        self.spread_pressures(&pace.part(0.5..1.0)).await;
        Ok(())
    }

    /// Brings open ends and sums up to date, without pressures and flows of all nodes.
    ///
    /// Costs what the paths from the open ends to the roots are long; nothing that grows with the tree, unless the tree
    /// itself has changed.
    ///
    /// # Errors
    /// When the flow through the open ends did not converge.
    pub fn settle(&mut self) -> Result<(), FlowError> {
        self.solve_ends()?;
        self.load_ends();
        Ok(())
    }

    /// Brings the flow at open ends up to date, and no more: neither sums nor other pressures.
    ///
    /// # Errors
    /// When it did not converge.
    pub fn solve_ends(&mut self) -> Result<(), FlowError> {
        if std::mem::take(&mut self.sums_stale) {
            at_once(self.sum_all(&Pace::default()));
        }
        self.trace_ends();
        self.ends.solve(self.source, self.ambient(), self.bed)
    }

    /// Pressure of one node, found along its path to the root.
    ///
    /// # Errors
    /// When there is no such node, or the flow through the open ends did not converge.
    pub fn pressure_at(&mut self, node: NodeId) -> Result<Pressure, FlowError> {
        self.check(node)?;
        self.settle()?;
        let mut path = std::mem::take(&mut self.path);
        path.clear();
        let mut slot = node_slot(node.index()) as u32;
        while slot > SOURCE {
            path.push(slot);
            slot = self.links[slot as usize].upstream;
        }
        let mut pressure = if slot == SOURCE { self.source } else { 0.0 };
        for &slot in path.iter().rev() {
            let slot = &self.slots[slot as usize];
            pressure = slot.through * (pressure + slot.resistance * slot.below.s);
        }
        self.path = path;
        Ok(Pressure::from_pascals(pressure + self.bed))
    }

    /// Sums of all nodes, children in falling order of their index.
    pub(super) async fn sum_all(&mut self, pace: &Pace) {
        let Self { slots, shunts, links, .. } = self;
        let load = |stretch: Range<usize>| {
            for (slot, &shunt) in slots[stretch.clone()].iter_mut().zip(&shunts[stretch]) {
                slot.below = shunt;
            }
        };
        let count = shunts.len();
        pace.part(0.0..0.2).stretches(count, STRETCH, load).await;
        let sum = |number: usize| {
            let index = count - 1 - number;
            let slot = &mut slots[index];
            slot.through = 1.0 / (1.0 + slot.resistance * slot.below.y);
            let given = Shunt { y: slot.below.y * slot.through, s: slot.below.s * slot.through };
            let upstream = &mut slots[links[index].upstream as usize].below;
            upstream.y += given.y;
            upstream.s += given.s;
        };
        pace.part(0.2..1.0).each(count - FIRST, sum).await;
    }

    /// The sums of one node again, from its children, bit for bit as [`sum_all`](Self::sum_all) has them.
    pub(super) fn sum_at(&mut self, index: u32) {
        let mut below = self.shunts[index as usize];
        let mut child = self.links[index as usize].first_child;
        while child != REFERENCE {
            let link = self.links[child as usize];
            if link.upstream == index {
                let slot = &self.slots[child as usize];
                below.y += slot.below.y * slot.through;
                below.s += slot.below.s * slot.through;
            }
            child = link.next_sibling;
        }
        let slot = &mut self.slots[index as usize];
        slot.below = below;
        slot.through = 1.0 / (1.0 + slot.resistance * below.y);
    }

    /// The sums of a node and of all above it.
    pub(super) fn sum_path(&mut self, mut index: u32) {
        while index > SOURCE {
            self.sum_at(index);
            index = self.links[index as usize].upstream;
        }
    }

    /// The sums of some nodes and of all above them, each once: a parent's slot is below its children's.
    pub(super) fn sum_paths(&mut self, slots: Vec<u32>) {
        let mut due = BinaryHeap::from(slots);
        while let Some(slot) = due.pop().filter(|&slot| slot > SOURCE) {
            if due.peek() != Some(&slot) {
                self.sum_at(slot);
                due.push(self.links[slot as usize].upstream);
            }
        }
    }

    /// Pressures and flows of all nodes, from the sums.
    pub(super) async fn spread_pressures(&mut self, pace: &Pace) {
        self.slots[REFERENCE as usize].pressure = 0.0;
        self.slots[SOURCE as usize].pressure = self.source;
        let spread = |node: usize| {
            let above = self.slots[self.links[node + FIRST].upstream as usize].pressure;
            let slot = &mut self.slots[node + FIRST];
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
