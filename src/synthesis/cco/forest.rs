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
use crate::synthesis::segment_index::MAX_FLARE;
use bevy_math::{DVec3, Vec3};

/// No node.
pub(super) const NONE: u32 = u32::MAX;
/// The widest start of a segment that is drawn, in its own radii.
pub(super) const FLARE: f64 = MAX_FLARE as f64;

/// Steps from a flare of 1 to `FLARE`.
const FLARE_STEPS: f64 = u16::MAX as f64;

/// A ratio of the radius at a segment's start to that at its end, from 1 to `FLARE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Flare(u16);

impl Flare {
    /// The least one that is no less than a ratio, or `FLARE`.
    pub(super) fn at_least(ratio: f64) -> Self {
        Self(((ratio - 1.0) / (FLARE - 1.0) * FLARE_STEPS).ceil().clamp(0.0, FLARE_STEPS) as u16)
    }

    pub(super) fn ratio(self) -> f64 {
        1.0 + (FLARE - 1.0) * f64::from(self.0) / FLARE_STEPS
    }
}

/// A node, and the segment that ends in it. A root node has no parent, no segment and one child; only a given tree has
/// others with one child.
///
/// A walk to the root meets one node after the other, far apart in memory, so each is as large as a line of the
/// processor's cache. What follows from the rest at little cost is not stored: lengths, and powers of loads.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
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
    /// X of the [sums](Sums) of the segment with all below it.
    pub load: f64,
    /// W of them.
    pub volume: f64,
    /// Length of the segment, rounded up: the upper half of the bits of an f32.
    reach: u16,
    /// How much wider than the bound the segment may start.
    pub flare: Flare,
    /// A radius that the segment may have without touching another one or the border.
    pub bound: f32,
    /// The largest ratio of radius to bound in the subtree, for a segment of radius 1, rounded up. That of the radius
    /// with which a segment starts is included for all below the segment, but not for itself.
    pub strain: f32,
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
            load: 0.0,
            volume: 0.0,
            reach: 0,
            flare: Flare::default(),
            bound: f32::INFINITY,
            strain: 0.0,
        }
    }

    /// Stores the sums of the segment.
    pub(super) fn set(&mut self, sums: &Sums) {
        (self.load, self.volume) = (sums.load, sums.volume);
    }

    /// A length that is no less than the segment's: a quick proof that something is out of its reach.
    pub(super) fn reach(&self) -> f64 {
        f32::from_bits(u32::from(self.reach) << 16).into()
    }

    pub(super) fn set_reach(&mut self, length: f64) {
        self.reach = (rounded_up(length).to_bits().saturating_add(0xFFFF) >> 16) as u16;
    }

    pub(super) fn is_terminal(&self) -> bool {
        self.children[0] == NONE
    }
}

/// A number above 0 in f32 that is no smaller.
pub(super) fn rounded_up(value: f64) -> f32 {
    (value * (1.0 + 1.0e-7)) as f32
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

    /// Takes memory for two more nodes. By an eighth at a time, since there may be millions.
    pub(super) fn make_room(&mut self) {
        let nodes = &mut self.nodes;
        if nodes.capacity() - nodes.len() < 2 {
            nodes.reserve_exact((nodes.len() / 8).max(64));
        }
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

    /// Length of a segment.
    pub(super) fn length(&self, segment: u32) -> f64 {
        self.length_of(self.node(segment))
    }

    fn length_of(&self, segment: &Node) -> f64 {
        segment.at.as_dvec3().distance(self.place(segment.parent))
    }

    /// Sums of a segment with all below it; zero for `NONE`.
    pub(super) fn sums(&self, segment: u32) -> Sums {
        if segment == NONE {
            return Sums::default();
        }
        let Node { load, volume, .. } = *self.node(segment);
        Sums { load, power: self.exponent.raise(load, load.sqrt()), volume }
    }

    /// What is below a segment.
    pub(super) fn below(&self, segment: u32) -> Below {
        let own = self.node(segment);
        if own.is_terminal() {
            return Below::default();
        }
        let length = self.length_of(own);
        let load = own.load - own.flow * length;
        Below { load, power: self.exponent.raise(load, load.sqrt()), span: own.volume / own.load.sqrt() - length }
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
            let above = Sums::of(node.flow + gain, self.length_of(node), &below, self.exponent);
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
        self.node(node).load / (parent.load - parent.flow * self.length_of(parent))
    }

    /// The ratio of the radius of a segment's parent to its own; 1 for a root segment.
    pub(super) fn widening(&self, segment: u32) -> f64 {
        self.thinning(segment).sqrt().sqrt().recip()
    }

    /// The fourth power of a segment's radius, where the radius of a load of 1 at full pressure is 1.
    pub(super) fn fourth_power(&self, mut node: u32) -> f64 {
        let mut product = 1.0;
        loop {
            let parent = self.node(node).parent;
            if self.node(parent).parent == NONE {
                return product * self.node(node).load;
            }
            product *= self.thinning(node);
            node = parent;
        }
    }

    /// The radius with which a segment is drawn at its start, if it and its parent have these.
    pub(super) fn start_radius(parent: f64, own: f64) -> f64 {
        parent.min(FLARE * own)
    }

    /// The [strain](Node::strain) of a segment, from its bound and its children.
    pub(super) fn strain_of(&self, node: u32) -> f32 {
        let own = self.node(node);
        let of_children = own.children.iter().filter(|&&child| child != NONE).map(|&child| {
            let (radius, child) = (self.thinning(child).sqrt().sqrt(), self.node(child));
            let at_start = Self::start_radius(1.0, radius) / (child.flare.ratio() * f64::from(child.bound));
            at_start.max(radius * f64::from(child.strain))
        });
        rounded_up(of_children.fold(f64::from(own.bound).recip(), f64::max))
    }
}
