//! One growth step of one system: associate, grow, kill (Rauch & Harders 2021, section 3).

use super::SystemReport;
use super::direction::{Decision, decide};
use super::forest::Forest;
use super::lengths::Lengths;
use super::perception::{self, Pull, Search};
use super::settings::SystemSettings;
use crate::synthesis::attraction::Drains;
#[cfg(test)]
use crate::synthesis::attraction::Nearest;
use crate::synthesis::tissue::{Tissue, TissuePoint};
use crate::synthesis::tree::{NO_PARENT, VesselTree};
use bevy_math::{Vec3, bounding::Aabb3d};

/// Where new nodes may be put in a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground<'a> {
    /// The tissue in force.
    pub tissue: &'a dyn Tissue,
    /// Whether nodes that leave it are brought back.
    pub confine: bool,
    /// Whether nodes need the tissue's normal although they are not brought back.
    pub normals: bool,
}

impl Ground<'_> {
    fn place(&self, position: Vec3) -> TissuePoint {
        if self.confine {
            return self.tissue.closest_point(position);
        }
        let normal = if self.normals { self.tissue.closest_point(position).normal } else { Vec3::ZERO };
        TissuePoint { position, normal }
    }
}

/// The forest and the drains of one system, with the lengths in force.
#[derive(Debug)]
pub(crate) struct SystemGrowth {
    pub forest: Forest,
    pub drains: Drains,
    pub lengths: Lengths,
    /// Size σ_t of the tissue as this system sees it.
    size: f32,
    settings: SystemSettings,
    search: Search,
    pulls: Vec<Pull>,
    /// Positions of the drains that pull at one node.
    pulling: Vec<Vec3>,
    /// Drains supplied in the last step.
    supplied: Vec<Vec3>,
}

/// A new node nearer than this share of a step length to another one is not made.
const LEAST_SEPARATION: f32 = 1e-3;
/// Cells are laid anew once their side has left this range of the side that fits.
const FITTING_CELLS: std::ops::Range<f32> = 0.6..1.5;

impl SystemGrowth {
    /// A system without nodes or drains.
    pub fn new(settings: &SystemSettings, bounds: &Aabb3d) -> Self {
        let lengths = Lengths::at_size(settings, 1.0);
        let mut system = Self {
            forest: Forest::default(),
            drains: Drains::default(),
            lengths,
            size: 1.0,
            settings: settings.clone(),
            search: Search::default(),
            pulls: Vec::new(),
            pulling: Vec::new(),
            supplied: Vec::new(),
        };
        system.restart(settings, bounds);
        system
    }

    /// Removes all nodes and drains and takes new settings, keeping memory.
    pub fn restart(&mut self, settings: &SystemSettings, bounds: &Aabb3d) {
        self.settings.clone_from(settings);
        self.size = 1.0;
        self.lengths = Lengths::at_size(settings, 1.0);
        self.forest.reset(bounds, self.lengths.node_cell(), settings.terminal_radius, settings.bifurcation_exponent);
        self.drains.reset(bounds, self.lengths.drain_cell());
        self.supplied.clear();
    }

    /// Adds roots, and trees to go on growing from.
    pub fn plant(&mut self, roots: &[TissuePoint], given: Option<&VesselTree>, ground: Ground<'_>) {
        for &root in roots {
            self.forest.add_root(root, self.settings.terminal_radius);
        }
        let first = self.forest.tree.len() as u32;
        if let Some(tree) = given {
            for (node, &parent) in tree.parents().iter().enumerate() {
                let (position, radius) = (tree.positions()[node], tree.radii()[node]);
                let at = TissuePoint { position, normal: ground.tissue.closest_point(position).normal };
                match parent {
                    NO_PARENT => self.forest.add_root(at, radius),
                    parent => _ = self.forest.add_child(first + parent, at, radius, 0),
                }
            }
        }
        self.forest.sweep(0);
    }

    /// Takes a candidate drain, unless it lies in supplied tissue (`supplied`) or too near another drain.
    pub fn offer_drain(&mut self, position: Vec3) -> bool {
        let born = !self.drains.any_within(position, self.lengths.drain_birth);
        if born {
            self.drains.add(position);
        }
        born
    }

    /// Whether tissue at a point is supplied: within the birth distance of a node.
    pub fn supplies(&self, position: Vec3) -> bool {
        self.forest.index().any_within(position, self.lengths.node_birth)
    }

    /// Takes drains that the other system has supplied.
    pub fn receive(&mut self, drains: &[Vec3]) {
        for &drain in drains {
            self.drains.add(drain);
        }
    }

    /// Drains supplied in the last step.
    pub fn supplied(&self) -> &[Vec3] {
        &self.supplied
    }

    /// One step of growth.
    pub fn grow(&mut self, ground: Ground<'_>, step: u32) -> SystemReport {
        let first_new = self.forest.tree.len();
        perception::associate(&self.forest, &self.lengths, &mut self.drains, &mut self.search, &mut self.pulls);
        let mut start = 0;
        while start < self.pulls.len() {
            let node = self.pulls[start].node;
            let end = start + self.pulls[start..].iter().take_while(|pull| pull.node == node).count();
            self.pulling.clear();
            self.pulling.extend(self.pulls[start..end].iter().map(|pull| self.drains.position(pull.drain)));
            match decide(&self.forest, &self.lengths, node, &self.pulling) {
                Decision::Extend(direction) => self.extend(node, direction, ground, step),
                Decision::Bifurcate(directions) => {
                    for direction in directions {
                        self.extend(node, direction, ground, step);
                    }
                }
                Decision::Rest => {}
            }
            start = end;
        }
        self.announce(first_new);
        self.kill();
        if self.forest.tree.len() > first_new {
            self.forest.sweep(first_new);
        } else {
            self.forest.clear_changed();
        }
        SystemReport {
            first_new_node: first_new as u32,
            new_nodes: (self.forest.tree.len() - first_new) as u32,
            supplied: self.supplied.len() as u32,
            drains_left: self.drains.len() as u32,
        }
    }

    /// Adds a segment to a node, unless its end would lie on another node or nowhere.
    fn extend(&mut self, node: u32, direction: Vec3, ground: Ground<'_>, step: u32) {
        let from = self.forest.tree.positions()[node as usize];
        let at = ground.place(from + direction * self.lengths.step);
        let free = at.position.is_finite()
            && !self.forest.index().any_within(at.position, LEAST_SEPARATION * self.lengths.step);
        if free {
            self.forest.add_child(node, at, self.lengths.terminal_radius, step);
        }
    }

    /// Makes new nodes known to the drains around them.
    fn announce(&mut self, first_new: usize) {
        for node in first_new..self.forest.tree.len() {
            let position = self.forest.tree.positions()[node];
            self.drains.announce(node as u32, position, self.lengths.influence);
        }
    }

    /// Removes the drains that acted in this step and now have a node within the kill distance.
    fn kill(&mut self) {
        self.supplied.clear();
        for &Pull { drain, .. } in &self.pulls {
            let position = self.drains.position(drain);
            if self.forest.index().any_within(position, self.lengths.kill) {
                self.drains.remove(drain);
                self.supplied.push(position);
            }
        }
    }

    /// Lets the tissue grow, which shortens all lengths relative to it.
    pub fn advance_tissue(&mut self, step: u32) {
        self.size = self.settings.tissue_growth.advance(self.size, step);
        let before = self.lengths.influence;
        self.lengths = Lengths::at_size(&self.settings, self.size);
        if self.lengths.influence > before {
            self.drains.forget_nearest();
        }
        if !FITTING_CELLS.contains(&(self.lengths.node_cell() / self.forest.index().cell())) {
            self.forest.resize_cells(self.lengths.node_cell());
        }
        if !FITTING_CELLS.contains(&(self.lengths.drain_cell() / self.drains.cell())) {
            self.drains.resize_cells(self.lengths.drain_cell());
        }
    }

    /// Size σ_t of the tissue, 1 at the start.
    pub fn tissue_size(&self) -> f32 {
        self.size
    }
}

#[cfg(test)]
impl SystemGrowth {
    /// Compares what the drains know of their nearest open node with every drain asking every node.
    pub(crate) fn assert_association_exact(&mut self) {
        perception::associate(&self.forest, &self.lengths, &mut self.drains, &mut self.search, &mut self.pulls);
        let positions = self.forest.tree.positions();
        let reach = self.lengths.influence * self.lengths.influence;
        for drain in self.drains.slots() {
            let at = self.drains.position(drain);
            let nearest = (0..positions.len() as u32)
                .filter(|&node| perception::is_open(&self.forest, &self.lengths, node))
                .map(|node| (positions[node as usize].distance_squared(at), node))
                .filter(|&(distance, _)| distance <= reach)
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let known = match self.drains.nearest(drain) {
                Nearest::Node(node, distance) if distance <= reach => Some((distance, node)),
                _ => None,
            };
            assert_eq!(known, nearest, "drain {drain}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::murray;

    #[test]
    fn radii_of_a_tree_come_from_its_tips() {
        let settings = SystemSettings::default();
        let mut system = SystemGrowth::new(&settings, &Aabb3d::new(Vec3::ZERO, Vec3::ONE));
        let at = |x: f32| TissuePoint { position: Vec3::X * x, normal: Vec3::ZERO };
        system.forest.add_root(at(0.0), 0.01);
        for (parent, x) in [(0, 0.1), (1, 0.2), (1, 0.3)] {
            system.forest.add_child(parent, at(x), 0.01, 0);
        }
        system.forest.sweep(0);
        let radii = system.forest.tree.radii();
        let expected = murray::parent_radius(0.01, 0.01, settings.bifurcation_exponent);
        assert!((radii[1] - expected).abs() < 1e-7 && (radii[0] - expected).abs() < 1e-7);
        assert!((radii[2] - 0.01).abs() < 1e-8);
    }
}
