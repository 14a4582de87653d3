//! A tree of resistances with shunts at its nodes, summed from the tips to the roots.
//!
//! There are two slots more than the tree has nodes: slot 0 is the reference, held at the bed's pressure, to which
//! pressures are relative; slot 1 is the source, held at the root pressure, and the parent of every root. So every
//! node's slot has one above it, and no loop tests whether a node is a root or cut off.

use crate::synthesis::{
    pace::{Pace, STRETCH},
    tree::NO_PARENT,
};
use std::{collections::BinaryHeap, ops::Range};

/// Slot held at the bed's pressure. Also stands for "none" in lists of slots.
pub(super) const REFERENCE: u32 = 0;
/// Slot held at the root pressure.
pub(super) const SOURCE: u32 = 1;
/// Slots before that of node 0.
pub(super) const FIRST: usize = 2;

/// Resistance that lets nothing through. Far from the limits of `f64`, so that products with it stay finite.
pub(super) const CLOSED: f64 = 1e200;

/// The place of a slot in the tree.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Link {
    /// The slot that feeds the segment: the parent, or the reference if the segment is interrupted.
    pub upstream: u32,
    /// The parent's slot, even if the segment is interrupted.
    pub parent: u32,
    /// Child with the highest index, or none.
    pub first_child: u32,
    /// The parent's next child in falling order of index, or none.
    pub next_sibling: u32,
}

/// A current Y·p − S out of a node of pressure p.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Shunt {
    /// Conductance, in m³/(s·Pa).
    pub y: f64,
    /// Negative of the current at pressure 0, in m³/s.
    pub s: f64,
}

impl Shunt {
    /// The same current, for pressures relative to `pressure`.
    pub fn counted_from(self, pressure: f64) -> Self {
        Self { y: self.y, s: self.s - self.y * pressure }
    }
}

/// State of a segment and its end node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slot {
    /// Resistance of the segment, in Pa·s/m³.
    pub resistance: f64,
    /// All currents that leave the node downwards.
    pub below: Shunt,
    /// 1/(1 + R·Y): share of `below` that the segment passes on.
    pub through: f64,
    /// Pressure of the node relative to the bed's, in Pa, as of the last solution.
    pub pressure: f64,
}

/// The slots of a tree: each is a segment with its end node. A new circuit must be [cleared](Self::clear).
#[derive(Clone, Debug, Default)]
pub(super) struct Circuit {
    pub links: Vec<Link>,
    pub slots: Vec<Slot>,
    /// The bed below each slot's node.
    pub beds: Vec<Shunt>,
    /// The bed, plus the open ends as of the last solution.
    pub shunts: Vec<Shunt>,
}

impl Circuit {
    /// Removes all nodes, except the reference and the source.
    pub fn clear(&mut self) {
        self.links.clear();
        self.links.resize(FIRST, Link::default());
        self.slots.clear();
        self.slots.resize(FIRST, Slot::default());
        for shunts in [&mut self.beds, &mut self.shunts] {
            shunts.clear();
            shunts.resize(FIRST, Shunt::default());
        }
    }

    /// Adds a node below a slot. Its segment has no resistance yet, and there is no bed below it.
    pub fn push(&mut self, parent: u32) {
        let slot = self.links.len() as u32;
        let next_sibling = std::mem::replace(&mut self.links[parent as usize].first_child, slot);
        self.links.push(Link { upstream: parent, parent, first_child: REFERENCE, next_sibling });
        self.slots.push(Slot::default());
        self.beds.push(Shunt::default());
        self.shunts.push(Shunt::default());
    }

    /// Sums of all nodes, children in falling order of their index.
    pub async fn sum_all(&mut self, pace: &Pace) {
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

    /// Sums one node again, from its children, with the same bits as [`sum_all`](Self::sum_all).
    pub fn sum_at(&mut self, index: u32) {
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

    /// Sums a node and all above it.
    pub fn sum_path(&mut self, mut index: u32) {
        while index > SOURCE {
            self.sum_at(index);
            index = self.links[index as usize].upstream;
        }
    }

    /// Sums some nodes and all above them, each once: a parent's slot is lower than its children's.
    pub fn sum_paths(&mut self, slots: Vec<u32>) {
        let mut due = BinaryHeap::from(slots);
        while let Some(slot) = due.pop().filter(|&slot| slot > SOURCE) {
            if due.peek() != Some(&slot) {
                self.sum_at(slot);
                due.push(self.links[slot as usize].upstream);
            }
        }
    }
}

/// Slot of a node, or of the source for a root's missing parent.
pub(super) fn slot_of(node: u32) -> u32 {
    if node == NO_PARENT { SOURCE } else { node + FIRST as u32 }
}

/// Slot of a node.
pub(super) fn node_slot(node: usize) -> usize {
    node + FIRST
}
