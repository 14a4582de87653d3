//! The forest of one system while it grows: the tree, and what growth needs to know of each node beside it.

use crate::synthesis::murray;
use crate::synthesis::point_grid::PointGrid;
use crate::synthesis::tissue::TissuePoint;
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use bevy_math::{Vec3, bounding::Aabb3d, ops};

/// A growing forest. All vectors have one entry per node.
#[derive(Debug, Default)]
pub(crate) struct Forest {
    pub tree: VesselTree,
    /// Unit direction of the segment that ends in the node, zero for a root.
    pub directions: Vec<Vec3>,
    /// Normal of the tissue's surface, zero in a volume.
    pub normals: Vec<Vec3>,
    /// Step in which the node was born, 0 for what was there at the start.
    pub birth_steps: Vec<u32>,
    children: Vec<u32>,
    /// r^κ in units of the full terminal radius: a tip's own, elsewhere the sum of the children's.
    sums: Vec<f32>,
    /// Scratch of the sweep, zero between sweeps.
    pending: Vec<f32>,
    index: PointGrid,
    /// Nodes whose radius the last sweep changed.
    changed: Vec<u32>,
    terminal_radius: f32,
    exponent: f32,
}

impl Forest {
    /// Empties the forest, keeping its memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32, terminal_radius: f32, exponent: f32) {
        self.tree.clear();
        self.directions.clear();
        self.normals.clear();
        self.birth_steps.clear();
        self.children.clear();
        self.sums.clear();
        self.pending.clear();
        self.changed.clear();
        self.index.reset(bounds, cell);
        self.terminal_radius = terminal_radius;
        self.exponent = exponent;
    }

    /// The index over all nodes.
    pub fn index(&self) -> &PointGrid {
        &self.index
    }

    /// Follows lengths that have changed: finer cells for shorter ones.
    pub fn resize_cells(&mut self, cell: f32) {
        self.index.resize_cells(cell);
    }

    /// Adds a root whose vessel would be of the given radius if it were a tip.
    pub fn add_root(&mut self, at: TissuePoint, radius: f32) {
        self.tree.push_root(at.position, radius);
        self.add_channels(at, Vec3::ZERO, radius, 0);
    }

    /// Adds a tip of the given radius to a node. The radii towards the root follow with the next [`sweep`](Self::sweep).
    pub fn add_child(&mut self, parent: u32, at: TissuePoint, radius: f32, step: u32) -> u32 {
        let direction = (at.position - self.tree.positions()[parent as usize]).normalize_or_zero();
        let id = self.tree.push_child(NodeId(parent), at.position, radius);
        self.children[parent as usize] += 1;
        self.add_channels(at, direction, radius, step);
        id.0
    }

    fn add_channels(&mut self, at: TissuePoint, direction: Vec3, radius: f32, step: u32) {
        self.directions.push(direction);
        self.normals.push(at.normal);
        self.birth_steps.push(step);
        self.children.push(0);
        self.sums.push(self.sum_of(radius));
        self.pending.push(0.0);
        self.index.push(at.position);
    }

    /// r^κ of a radius in units of the terminal one.
    fn sum_of(&self, radius: f32) -> f32 {
        if radius == self.terminal_radius { 1.0 } else { ops::powf(radius / self.terminal_radius, self.exponent) }
    }

    /// Number of children of a node.
    pub fn children(&self, node: u32) -> u32 {
        self.children[node as usize]
    }

    /// Whether a node is a root.
    pub fn is_root(&self, node: u32) -> bool {
        self.tree.parents()[node as usize] == NO_PARENT
    }

    /// Angle at which a branch of the given terminal radius leaves an inter-node beside its only child, in radians.
    pub fn sprout_angle(&self, node: u32, terminal_radius: f32) -> f32 {
        // With one child the sum at the node is the child's.
        murray::sprout_angle(self.sums[node as usize] / self.sum_of(terminal_radius), self.exponent)
    }

    /// Nodes whose radius the last sweep changed, from the tips to the roots.
    pub fn changed(&self) -> &[u32] {
        &self.changed
    }

    /// Forgets which radii changed.
    pub fn clear_changed(&mut self) {
        self.changed.clear();
    }

    /// Renews all radii by Murray's law, from the tips to the roots.
    ///
    /// Sums are added up afresh in one fixed order, so what has not changed comes out bit for bit the same, and is told
    /// from what has. Nodes from `first_new` on count as changed.
    pub fn sweep(&mut self, first_new: usize) {
        self.changed.clear();
        let inverse_exponent = self.exponent.recip();
        for node in (0..self.tree.len()).rev() {
            let gathered = std::mem::take(&mut self.pending[node]);
            let sum = if self.children[node] == 0 { self.sums[node] } else { gathered };
            let parent = self.tree.parents()[node];
            if parent != NO_PARENT {
                self.pending[parent as usize] += sum;
            }
            if sum != self.sums[node] || node >= first_new {
                self.sums[node] = sum;
                self.changed.push(node as u32);
                let radius = if sum == 1.0 { 1.0 } else { ops::powf(sum, inverse_exponent) };
                self.tree.radii_mut()[node] = self.terminal_radius * radius;
            }
        }
    }
}
