//! Attraction points: oxygen drains for the arteries, carbon-dioxide sources for the veins.
//!
//! A drain is born in tissue that no vessel supplies, acts on its nearest open node, and leaves once it is supplied. It
//! keeps that node between steps and asks the index again only when the node closes; a node that appears within reach
//! makes itself known. So a step's cost is one comparison per waiting drain, not one search.

use crate::synthesis::point_grid::PointGrid;
use bevy_math::{Vec3, bounding::Aabb3d};

/// The nearest open node of a drain, as far as is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Nearest {
    /// Nobody has looked yet.
    Unknown,
    /// No open node within reach.
    Nobody,
    /// This node, at this squared distance.
    Node(u32, f32),
}

/// The attraction points of one system.
#[derive(Debug, Default)]
pub(crate) struct Drains {
    grid: PointGrid,
    nearest: Vec<Nearest>,
    alive: Vec<bool>,
    /// Slots of drains that left, to be used again.
    free: Vec<u32>,
}

impl Drains {
    /// Removes all drains and covers a box with cells of a given side, keeping memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32) {
        self.grid.reset(bounds, cell);
        self.nearest.clear();
        self.alive.clear();
        self.free.clear();
    }

    /// Follows lengths that have changed: finer cells for shorter ones.
    pub fn resize_cells(&mut self, cell: f32) {
        self.grid.resize_cells(cell);
    }

    /// Side of the index's cells.
    pub fn cell(&self) -> f32 {
        self.grid.cell()
    }

    /// Number of living drains.
    pub fn len(&self) -> usize {
        self.alive.len() - self.free.len()
    }

    /// Adds a drain that has not looked for a node yet.
    pub fn add(&mut self, position: Vec3) {
        if let Some(slot) = self.free.pop() {
            self.grid.replace(slot, position);
            self.nearest[slot as usize] = Nearest::Unknown;
            self.alive[slot as usize] = true;
        } else {
            self.grid.push(position);
            self.nearest.push(Nearest::Unknown);
            self.alive.push(true);
        }
    }

    /// Removes a living drain.
    pub fn remove(&mut self, slot: u32) {
        self.grid.remove(slot);
        self.alive[slot as usize] = false;
        self.free.push(slot);
    }

    /// Where a drain is.
    pub fn position(&self, slot: u32) -> Vec3 {
        self.grid.point(slot)
    }

    /// Positions of all living drains, in the order of their slots.
    pub fn positions(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.slots().map(|slot| self.position(slot))
    }

    /// The living drains' slots, in order.
    pub fn slots(&self) -> impl Iterator<Item = u32> + '_ {
        self.alive.iter().enumerate().filter(|&(_, &alive)| alive).map(|(slot, _)| slot as u32)
    }

    /// Whether a drain lies within `distance` of a point.
    pub fn any_within(&self, point: Vec3, distance: f32) -> bool {
        self.grid.any_within(point, distance)
    }

    /// The nearest open node of a drain, as far as is known.
    pub fn nearest(&self, slot: u32) -> Nearest {
        self.nearest[slot as usize]
    }

    /// Remembers what a search for a drain's nearest open node found.
    pub fn set_nearest(&mut self, slot: u32, nearest: Nearest) {
        self.nearest[slot as usize] = nearest;
    }

    /// Forgets what drains know, for when reaches have grown.
    pub fn forget_nearest(&mut self) {
        self.nearest.fill(Nearest::Unknown);
    }

    /// Makes a new open node known to the drains within `reach` of it. Of two nodes at one distance the older stays.
    pub fn announce(&mut self, node: u32, position: Vec3, reach: f32) {
        let nearest = &mut self.nearest;
        self.grid.for_each_within(position, reach, |slot, distance| {
            let known = &mut nearest[slot as usize];
            let closer = match *known {
                Nearest::Unknown => false,
                Nearest::Nobody => true,
                Nearest::Node(_, least) => distance < least,
            };
            if closer {
                *known = Nearest::Node(node, distance);
            }
        });
    }
}
