//! The trees under construction, as one array of nodes.
//!
//! A node stands for the segment from its parent to it, as in a [`VesselTree`], and keeps what an insertion needs to
//! know of its subtree. Nodes stay in the order of their birth, so parents may come after their children: an insertion
//! splits a segment.
//!
//! [`VesselTree`]: crate::synthesis::tree::VesselTree

use super::{
    power::Exponent,
    sums::{Below, Slope, Sums},
};
use bevy_math::{DVec3, Vec3};

/// No node.
pub(super) const NONE: u32 = u32::MAX;

/// A node, and the segment that ends in it. A root node has no parent, no segment and one child; only a given tree has
/// others with one child.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Its position, in tissue lengths.
    pub at: Vec3,
    pub parent: u32,
    /// None, one or two.
    pub children: [u32; 2],
    /// Number of the tree.
    pub tree: u32,
    /// Flow of the terminals at and below it, in that of a mean terminal.
    pub flow: f64,
    /// Length of the segment.
    pub length: f64,
    /// Sums of the segment with all below it; for a root, of its child.
    pub sums: Sums,
    /// A radius that the segment may have without touching another one or the border.
    pub bound: f32,
    /// The largest ratio of radius to bound in the subtree, for a segment of radius 1.
    pub strain: f64,
}

impl Node {
    /// A node without children whose sums are not known yet.
    pub(super) fn new(at: Vec3, parent: u32, tree: u32, flow: f64) -> Self {
        Self {
            at,
            parent,
            children: [NONE; 2],
            tree,
            flow,
            length: 0.0,
            sums: Sums::default(),
            bound: f32::INFINITY,
            strain: 0.0,
        }
    }

    pub(super) fn is_terminal(&self) -> bool {
        self.children[0] == NONE
    }

    /// What is below the segment.
    pub(super) fn below(&self, exponent: Exponent) -> Below {
        if self.is_terminal() {
            return Below::default();
        }
        let load = self.sums.load - self.flow * self.length;
        let square = load.sqrt();
        let span = self.sums.volume / self.sums.load.sqrt() - self.length;
        Below { load, power: exponent.raise(load, square), span }
    }
}

/// All nodes of all trees.
#[derive(Clone, Debug)]
pub(super) struct Forest {
    pub nodes: Vec<Node>,
    pub exponent: Exponent,
}

/// What a walk from a changed segment to its root found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ascent {
    /// Sums of the root segment.
    pub root: Sums,
    /// How the tree's volume depends on the changed segment.
    pub slope: Slope,
    /// Product of β⁴ on the way: of the changed segment's radius to the root segment's.
    pub thinning: f64,
}

impl Forest {
    pub(super) fn new(exponent: Exponent) -> Self {
        Self { nodes: Vec::new(), exponent }
    }

    pub(super) fn node(&self, node: u32) -> &Node {
        &self.nodes[node as usize]
    }

    pub(super) fn node_mut(&mut self, node: u32) -> &mut Node {
        &mut self.nodes[node as usize]
    }

    pub(super) fn place(&self, node: u32) -> DVec3 {
        self.node(node).at.as_dvec3()
    }

    /// Sums of a node; zero for `NONE`.
    pub(super) fn sums(&self, node: u32) -> Sums {
        if node == NONE { Sums::default() } else { self.node(node).sums }
    }

    /// Sums of the other child of a segment's parent; zero without one.
    pub(super) fn sister(&self, node: u32) -> Sums {
        let [a, b] = self.node(self.node(node).parent).children;
        self.sums(if a == node { b } else { a })
    }

    /// Whether two segments share a node.
    pub(super) fn are_incident(&self, a: u32, b: u32) -> bool {
        let (a_parent, b_parent) = (self.node(a).parent, self.node(b).parent);
        a_parent == b_parent || a_parent == b || b_parent == a
    }

    /// Sums of the root segment if a segment, which gains so much flow, had other sums. Nothing is changed.
    pub(super) fn ascend(&self, mut child: u32, mut sums: Sums, gain: f64) -> Ascent {
        let (mut slope, mut thinning) = (Slope::ROOT, 1.0);
        loop {
            let parent = self.node(child).parent;
            let node = self.node(parent);
            if node.parent == NONE {
                return Ascent { root: sums, slope, thinning };
            }
            let below = Below::join(&sums, &self.sister(child), self.exponent);
            let above = Sums::of(node.flow + gain, node.length, &below, self.exponent);
            slope.rise(&sums, &below, &above);
            thinning *= sums.load / below.load;
            (child, sums) = (parent, above);
        }
    }

    /// The fourth power of β: of a segment's radius to its parent's. 1 for a root segment.
    pub(super) fn thinning(&self, node: u32) -> f64 {
        let parent = self.node(self.node(node).parent);
        if parent.parent == NONE {
            return 1.0;
        }
        self.node(node).sums.load / (parent.sums.load - parent.flow * parent.length)
    }

    /// The fourth power of a segment's radius, where the radius of a load of 1 at full pressure is 1.
    pub(super) fn fourth_power(&self, mut node: u32) -> f64 {
        let mut product = 1.0;
        loop {
            let parent = self.node(node).parent;
            if self.node(parent).parent == NONE {
                return product * self.node(node).sums.load;
            }
            product *= self.thinning(node);
            node = parent;
        }
    }

    /// The [strain](Node::strain) of a segment, from its bound and its children.
    pub(super) fn strain_of(&self, node: u32) -> f64 {
        let own = self.node(node);
        let of_children = own.children.iter().filter(|&&child| child != NONE);
        let strains = of_children.map(|&child| self.thinning(child).sqrt().sqrt() * self.node(child).strain);
        strains.fold(f64::from(own.bound).recip(), f64::max)
    }
}
