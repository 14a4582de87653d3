//! The interface of every generator of vessels: a growth that advances step by step.
//!
//! In: steps. Out: trees, each with its kind, and their changes in a step. Frames, batch jobs and files use this trait
//! alone, so none of them knows the generator. [`generator`](super::generator) lists all generators and starts them.

use crate::synthesis::tree::{BedLink, ByKind, NodeId, VesselKind, VesselTree};
use bevy_math::Vec3;
use std::{any::Any, fmt};

/// A growth of vessels under way.
///
/// Call [`advance`](Self::advance) until [`is_finished`](Self::is_finished), and [`settle`](Self::settle) before
/// looking at the trees; or [`run`](Self::run). A step depends on the settings and the seed alone, not on time, frames
/// or the number of threads.
///
/// To see more than this trait shows, such as the reports of a colonization, cast it to its own type:
/// `(growth as &dyn Any).downcast_ref::<Colonization>()`.
pub trait Growth: fmt::Debug + Send + Sync + Any {
    /// Does one step. Does nothing once growth is finished.
    fn advance(&mut self);

    /// Updates the trees after the steps since the last settling. One call may follow several steps, if the trees are
    /// not read in between. [`update`](Self::update) gives the changes.
    fn settle(&mut self);

    /// Does all remaining steps, and settles.
    fn run(&mut self) {
        while !self.is_finished() {
            self.advance();
        }
        self.settle();
    }

    /// Whether all steps are done. It must become true at last, since callers do steps until it is. It may be true from
    /// the start.
    fn is_finished(&self) -> bool;

    /// The number of steps done, which never falls, and of all steps.
    fn progress(&self) -> StepCount;

    /// The trees; `None` for a kind that has none. An empty tree has no root.
    fn trees(&self) -> ByKind<Option<GrownTree<'_>>>;

    /// What the last [`settle`](Self::settle) changed in the tree of a kind.
    fn update(&self, kind: VesselKind) -> TreeUpdate<'_>;

    /// Links through which blood flows from the arteries to the veins. They join the two trees to one circulation.
    fn bed_links(&self) -> &[BedLink] {
        &[]
    }

    /// Warnings about unusual settings of this growth.
    fn warnings(&self) -> Vec<GrowthWarning> {
        Vec::new()
    }
}

impl dyn Growth + '_ {
    /// The tree of a kind, on the tissue; `None` if there is none.
    pub fn tree(&self, kind: VesselKind) -> Option<&VesselTree> {
        self.trees()[kind].map(|grown| grown.tree)
    }

    /// Number of nodes of a kind.
    pub fn nodes(&self, kind: VesselKind) -> usize {
        self.tree(kind).map_or(0, VesselTree::len)
    }
}

/// The steps of a growth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCount {
    /// Steps done.
    pub done: u32,
    /// Upper limit of the steps. A growth may end earlier, if nothing is left to do.
    pub all: u32,
}

/// One tree of a growth.
#[derive(Clone, Copy, Debug)]
pub struct GrownTree<'a> {
    /// Centre lines, on the tissue.
    pub tree: &'a VesselTree,
    /// The step in which each node was born: 0 for initial nodes, and for nodes beyond the end of this list.
    pub birth_steps: &'a [u32],
    /// Offset of each node from the tissue when it is drawn or written, in its own radii: the normals of a surface.
    /// Empty if vessels lie on the tissue.
    pub lift: &'a [Vec3],
    /// Number of attraction points, terminals or other places that still need a vessel of this kind.
    pub waiting: usize,
    /// Present distance from a node within which tissue counts as supplied, in tissue lengths.
    pub reach: f32,
}

impl<'a> GrownTree<'a> {
    /// A tree that lies on the tissue, with all nodes initial and nothing waiting.
    pub fn of(tree: &'a VesselTree) -> Self {
        Self { tree, birth_steps: &[], lift: &[], waiting: 0, reach: 0.0 }
    }

    /// The position at which a node is drawn: lifted off the surface by its radius if the settings say so.
    ///
    /// # Panics
    /// If the node is not in this tree.
    pub fn lifted_position(&self, node: NodeId) -> Vec3 {
        let (position, node) = (self.tree.positions()[node.index()], node.index());
        self.lift.get(node).map_or(position, |&lift| position + lift * self.tree.radii()[node])
    }

    /// The vessels as drawn and written: the tree with every node at its [`lifted_position`](Self::lifted_position).
    pub fn vessels(&self) -> VesselTree {
        let mut vessels = self.tree.clone();
        for (node, position) in vessels.positions_mut().iter_mut().enumerate() {
            *position = self.lifted_position(NodeId(node as u32));
        }
        vessels
    }
}

/// The change of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeUpdate<'a> {
    /// Nodes were appended, and some radii changed.
    Grown {
        /// Nodes whose radius changed, new ones included, in any order. Each must be in the tree.
        changed: &'a [u32],
    },
    /// It is another tree: nodes were inserted, moved or removed. Data that refers to old nodes, such as a wound, is
    /// invalid.
    Replaced,
}

/// Something unusual about a growth, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrowthWarning(String);

impl GrowthWarning {
    /// A warning with this text.
    pub fn new(words: impl fmt::Display) -> Self {
        Self(words.to_string())
    }
}

impl fmt::Display for GrowthWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
