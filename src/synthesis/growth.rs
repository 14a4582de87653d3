//! What every generator of vessels gives: a growth that goes on step by step, whoever drives it.
//!
//! In: steps. Out: trees, each with its kind, and what a step changed in them. A frame, a batch job and a file are served
//! through this trait alone, so that none of them knows which generator is at work. [`generator`](super::generator) names
//! them all and starts them.

use crate::synthesis::tree::{BedLink, ByKind, NodeId, VesselKind, VesselTree};
use bevy_math::Vec3;
use std::{any::Any, fmt};

/// A growth of vessels under way.
///
/// Call [`advance`](Self::advance) until [`is_finished`](Self::is_finished), and [`settle`](Self::settle) before looking at
/// the trees; or [`run`](Self::run). What a step does depends on the settings and the seed alone: not on time, frames or the
/// number of threads.
///
/// To look at more than this trait tells, such as the reports of a colonization, turn it into its own type again:
/// `(growth as &dyn Any).downcast_ref::<Colonization>()`.
pub trait Growth: fmt::Debug + Send + Sync + Any {
    /// Does one step. Does nothing once growth is finished.
    fn advance(&mut self);

    /// Brings the trees up to date with the steps since the last settling, for several steps in a row that nobody looks at
    /// in between. What that changed is told by [`update`](Self::update).
    fn settle(&mut self);

    /// Does all steps that are left, and settles.
    fn run(&mut self) {
        while !self.is_finished() {
            self.advance();
        }
        self.settle();
    }

    /// Whether there is no step left to do.
    fn is_finished(&self) -> bool;

    /// How many steps are done, and how many there are.
    fn progress(&self) -> StepCount;

    /// The trees; `None` for a kind that has none. An empty tree is one that has no root.
    fn trees(&self) -> ByKind<Option<GrownTree<'_>>>;

    /// What the last [`settle`](Self::settle) changed in the tree of a kind.
    fn update(&self, kind: VesselKind) -> TreeUpdate<'_>;

    /// Where blood comes over from the arteries to the veins. Through these the two trees are one circulation.
    fn bed_links(&self) -> &[BedLink] {
        &[]
    }

    /// What is unusual about this growth, for whoever chose its settings.
    fn warnings(&self) -> Vec<GrowthWarning> {
        Vec::new()
    }
}

impl dyn Growth + '_ {
    /// The tree of a kind, on the tissue; `None` where it has none.
    pub fn tree(&self, kind: VesselKind) -> Option<&VesselTree> {
        self.trees()[kind].map(|grown| grown.tree)
    }

    /// Number of nodes of a kind.
    pub fn nodes(&self, kind: VesselKind) -> usize {
        self.tree(kind).map_or(0, VesselTree::len)
    }
}

/// How many steps of a growth are done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCount {
    /// Steps done.
    pub done: u32,
    /// Steps that there are at most. A growth may end earlier, where nothing is left to do.
    pub all: u32,
}

/// One tree of a growth.
#[derive(Clone, Copy, Debug)]
pub struct GrownTree<'a> {
    /// Centre lines, on the tissue.
    pub tree: &'a VesselTree,
    /// The step in which each node was born, 0 for those that growth began with, and for those beyond its end.
    pub birth_steps: &'a [u32],
    /// How far each node is to be lifted off the tissue before it is drawn or written, in its own radii: the normals of a
    /// surface. Empty where vessels lie on the tissue.
    pub lift: &'a [Vec3],
    /// Attraction points, terminals or whatever else still waits for a vessel of this kind.
    pub waiting: usize,
    /// Distance from a node within which tissue counts as supplied at present, in tissue lengths.
    pub reach: f32,
}

impl<'a> GrownTree<'a> {
    /// A tree that lies on the tissue, all of it there from the beginning, with nothing left to wait for.
    pub fn of(tree: &'a VesselTree) -> Self {
        Self { tree, birth_steps: &[], lift: &[], waiting: 0, reach: 0.0 }
    }

    /// Where a node is drawn: lifted off the surface by its radius where the settings say so.
    ///
    /// # Panics
    /// When the node is not of this tree.
    pub fn lifted_position(&self, node: NodeId) -> Vec3 {
        let (position, node) = (self.tree.positions()[node.index()], node.index());
        self.lift.get(node).map_or(position, |&lift| position + lift * self.tree.radii()[node])
    }

    /// The vessels as they are drawn and written: the tree with every node at its
    /// [`lifted_position`](Self::lifted_position).
    pub fn vessels(&self) -> VesselTree {
        let mut vessels = self.tree.clone();
        for (node, position) in vessels.positions_mut().iter_mut().enumerate() {
            *position = self.lifted_position(NodeId(node as u32));
        }
        vessels
    }
}

/// What became of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeUpdate<'a> {
    /// Nodes were added behind those that there were, and some have another radius.
    Grown {
        /// Nodes whose radius changed, new ones included, in any order.
        changed: &'a [u32],
    },
    /// It is another tree: nodes were put between others, moved or taken away. What is known by a node of the old one, such
    /// as a wound, has no place in it.
    Replaced,
}

/// Something unusual about a growth, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrowthWarning(String);

impl GrowthWarning {
    /// A warning of these words.
    pub fn new(words: impl fmt::Display) -> Self {
        Self(words.to_string())
    }
}

impl fmt::Display for GrowthWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
