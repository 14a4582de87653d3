//! The vessel tree: three arrays.
//!
//! Node `i` and the segment from its parent to it share the index `i`. Nothing that can be derived is stored: tips and
//! roots, children and branches come from the folds in [`sweep`]. A tree may have several roots and thus be a forest.

use bevy_math::Vec3;

mod bed_links;
mod error;
mod hash;
mod kind;
pub mod murray;
mod place;
pub mod statistics;
pub mod sweep;
pub mod validate;

pub use bed_links::BedLink;
pub use error::TreeError;
pub use hash::{hash_bytes, hash_trees};
pub use kind::{ByKind, VesselKind};
pub use place::Place;
pub use statistics::TreeStatistics;

/// A node of a [`VesselTree`], and the segment that ends in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct NodeId(pub u32);

impl NodeId {
    /// Index of the node in the tree's arrays.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Value of [`VesselTree::parents`] for a root.
pub const NO_PARENT: u32 = u32::MAX;

/// A tree, or forest, of vessel segments.
///
/// Positions and radii are in tissue lengths. A parent always comes before its children: `parents[i] < i`. So a reverse
/// loop goes from the tips to the roots and a forward loop from the roots to the tips.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(try_from = "TreeArrays"))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct VesselTree {
    positions: Vec<Vec3>,
    parents: Vec<u32>,
    radii: Vec<f32>,
}

/// A tree read from a file, still unchecked.
#[cfg(feature = "serialize")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TreeArrays {
    positions: Vec<Vec3>,
    parents: Vec<u32>,
    radii: Vec<f32>,
}

#[cfg(feature = "serialize")]
impl TryFrom<TreeArrays> for VesselTree {
    type Error = TreeError;

    fn try_from(arrays: TreeArrays) -> Result<Self, TreeError> {
        let TreeArrays { positions, parents, radii } = arrays;
        Self::from_arrays(positions, parents, radii)
    }
}

impl VesselTree {
    /// A tree without nodes.
    pub const fn new() -> Self {
        Self { positions: Vec::new(), parents: Vec::new(), radii: Vec::new() }
    }

    /// A tree from arrays, checked by [`validate`](Self::validate).
    ///
    /// All three have one entry per node; a root's parent is [`NO_PARENT`].
    ///
    /// # Errors
    /// The first broken invariant, with the node and the value.
    pub fn from_arrays(positions: Vec<Vec3>, parents: Vec<u32>, radii: Vec<f32>) -> Result<Self, TreeError> {
        let tree = Self { positions, parents, radii };
        tree.validate()?;
        Ok(tree)
    }

    /// Number of nodes, roots included.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Position of every node.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Parent of every node, [`NO_PARENT`] for a root.
    pub fn parents(&self) -> &[u32] {
        &self.parents
    }

    /// Radius of the segment that ends in each node; a root's is that of a parent segment under Murray's law.
    pub fn radii(&self) -> &[f32] {
        &self.radii
    }

    /// The largest radius, in tissue lengths; 0 for an empty tree.
    pub fn widest_radius(&self) -> f32 {
        self.radii.iter().copied().fold(0.0, f32::max)
    }

    /// The parent of a node, `None` for a root.
    ///
    /// # Panics
    /// If the node is not in this tree.
    pub fn parent(&self, node: NodeId) -> Option<NodeId> {
        let parent = self.parents[node.index()];
        (parent != NO_PARENT).then_some(NodeId(parent))
    }

    /// The segments as `(child, parent)` index pairs, in the order of the child.
    pub fn segments(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.parents.iter().enumerate().filter(|&(_, &parent)| parent != NO_PARENT).map(|(i, &p)| (i, p as usize))
    }

    /// The roots' indices.
    pub fn roots(&self) -> impl Iterator<Item = usize> + '_ {
        self.parents.iter().enumerate().filter(|&(_, &parent)| parent == NO_PARENT).map(|(i, _)| i)
    }

    /// Vector from a node's parent to the node, zero for a root.
    pub fn segment_vector(&self, node: usize) -> Vec3 {
        match self.parents[node] {
            NO_PARENT => Vec3::ZERO,
            parent => self.positions[node] - self.positions[parent as usize],
        }
    }

    /// Appends a root.
    pub(crate) fn push_root(&mut self, position: Vec3, radius: f32) -> NodeId {
        self.push(position, NO_PARENT, radius)
    }

    /// Appends a node with an existing parent.
    pub(crate) fn push_child(&mut self, parent: NodeId, position: Vec3, radius: f32) -> NodeId {
        debug_assert!(parent.index() < self.len());
        self.push(position, parent.0, radius)
    }

    fn push(&mut self, position: Vec3, parent: u32, radius: f32) -> NodeId {
        let id = NodeId(u32::try_from(self.len()).expect("a tree holds fewer than 2^32 nodes"));
        self.positions.push(position);
        self.parents.push(parent);
        self.radii.push(radius);
        id
    }

    pub(crate) fn radii_mut(&mut self) -> &mut [f32] {
        &mut self.radii
    }

    pub(crate) fn positions_mut(&mut self) -> &mut [Vec3] {
        &mut self.positions
    }

    /// Takes memory for exactly so many nodes, where there are fewer.
    pub(crate) fn reserve_exact(&mut self, nodes: usize) {
        let more = nodes.saturating_sub(self.len());
        self.positions.reserve_exact(more);
        self.parents.reserve_exact(more);
        self.radii.reserve_exact(more);
    }

    /// Empties the tree and keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.positions.clear();
        self.parents.clear();
        self.radii.clear();
    }
}
