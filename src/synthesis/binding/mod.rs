//! Vessels bound to a deforming organ: nodes follow its surface, or the tetrahedra of its volume.
//!
//! In: a [`VesselTree`] and the organ at rest, a [`TriangleMesh`] or a [`TetMesh`]; then, each frame, the positions of
//! the organ's vertices from a soft body. Out: positions of the nodes.
//!
//! On a surface a node is bound to the nearest triangle: by the weights of its corners, and by the node's offset in a
//! frame of the triangle's longest edge and the interpolated normal. So a node on the surface stays on it under any
//! stretching, and one above or below it keeps its distance. In tetrahedra a node is bound by its weights for the four
//! corners of the one that contains it, so it follows any affine motion exactly; a node outside all of them follows the
//! nearest by extrapolation.
//!
//! The closed surface of the vessels is bound to their nodes in turn, by a [`Skin`].
//!
//! Radii stay as they are: the narrowing of a stretched vessel depends on its pressure, which is not known here. Cuts
//! are not known, either. A [`Place`](crate::synthesis::tree::Place) on a segment moves with the segment's ends, so a
//! cut stays at the same spot of the vessel.

mod frames;
mod skin;
mod surface;
mod tetrahedra;
mod vertices;

use crate::synthesis::{
    mesh::{TetMesh, TriangleMesh},
    pace::{Pace, at_once},
    tree::VesselTree,
};
use bevy_math::Vec3;
pub use skin::{Skin, SkinVertex};
use surface::SurfaceBonds;
use tetrahedra::SolidBonds;

/// The reason why nodes could not follow. Nothing has moved then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BindingError {
    /// A number of vertices that differs from the organ's.
    #[error(
        "{given} vertex positions for an organ of {bound} vertices; give one for each vertex of the mesh that was bound to"
    )]
    VertexCount {
        /// Vertices of the bound organ.
        bound: usize,
        /// Positions given.
        given: usize,
    },
    /// A number of nodes that differs from the bound ones.
    #[error("{given} nodes to move, but {bound} are bound; call extend with the tree at rest after it grew")]
    NodeCount {
        /// Nodes bound.
        bound: usize,
        /// Nodes given.
        given: usize,
    },
    /// A vertex of a vessel's surface that belongs to a node that the tree doesn't have.
    #[error(
        "vertex {vertex} of the surface belongs to node {node}, but the tree has {nodes}; give the tree that it was made of"
    )]
    VertexNode {
        /// The first such vertex.
        vertex: usize,
        /// Its node.
        node: u32,
        /// Nodes of the tree.
        nodes: usize,
    },
    /// A vertex that is infinite or NaN.
    #[error(
        "vertex {vertex} moved to {position}; every coordinate must be finite: the soft body may have become unstable"
    )]
    Vertex {
        /// The first such vertex.
        vertex: usize,
        /// Its given position.
        position: Vec3,
    },
}

/// The nodes of one tree, bound to one organ.
///
/// It keeps the organ at rest, so that nodes which grow later can be bound: growth goes on at rest, and a copy of the
/// positions follows the organ. Memory: 32 bytes per node, and about 200 bytes per triangle or tetrahedron.
#[derive(Clone, Debug)]
pub struct Binding {
    bonds: Bonds,
}

#[derive(Clone, Debug)]
enum Bonds {
    Surface(Box<SurfaceBonds>),
    Solid(SolidBonds),
}

impl Binding {
    /// Binds every node of a tree to the nearest triangle of a mesh, both at rest.
    ///
    /// Of equally near triangles, the first is used; degenerate ones are left out. Vertices at the same position share
    /// their normal, so that seams don't show.
    pub fn to_surface(tree: &VesselTree, mesh: &TriangleMesh) -> Self {
        at_once(Self::to_surface_paced(tree, mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn to_surface_paced(tree: &VesselTree, mesh: &TriangleMesh, pace: &Pace) -> Self {
        let bonds = SurfaceBonds::new(mesh, &pace.part(0.0..0.3)).await;
        let mut binding = Self { bonds: Bonds::Surface(Box::new(bonds)) };
        binding.extend_paced(tree, &pace.part(0.3..1.0)).await;
        binding
    }

    /// Binds every node of a tree to the tetrahedron that contains it, or else to the nearest, both at rest.
    ///
    /// Of several that contain it, on a common face, the first is used; degenerate ones are left out. A node outside is
    /// extrapolated: its weights leave the range from 0 to 1, and the farther outside it is, the more a tetrahedron's
    /// motion moves it.
    pub fn to_tetrahedra(tree: &VesselTree, mesh: &TetMesh) -> Self {
        at_once(Self::to_tetrahedra_paced(tree, mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn to_tetrahedra_paced(tree: &VesselTree, mesh: &TetMesh, pace: &Pace) -> Self {
        let mut binding = Self { bonds: Bonds::Solid(SolidBonds::new(mesh, &pace.part(0.0..0.3)).await) };
        binding.extend_paced(tree, &pace.part(0.3..1.0)).await;
        binding
    }

    /// Binds the nodes that were appended to the tree since the last call. The tree must be at rest, as before. A tree
    /// with fewer nodes than are bound counts as another tree, and is bound from the beginning.
    pub fn extend(&mut self, tree: &VesselTree) {
        at_once(self.extend_paced(tree, &Pace::default()));
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn extend_paced(&mut self, tree: &VesselTree, pace: &Pace) {
        let bound = if tree.len() < self.len() { 0 } else { self.len() };
        match &mut self.bonds {
            Bonds::Surface(bonds) => bonds.bind(bound, tree.positions(), pace).await,
            Bonds::Solid(bonds) => bonds.bind(bound, tree.positions(), pace).await,
        }
    }

    /// Number of nodes bound.
    pub fn len(&self) -> usize {
        match &self.bonds {
            Bonds::Surface(bonds) => bonds.len(),
            Bonds::Solid(bonds) => bonds.len(),
        }
    }

    /// Whether no node is bound.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of vertices of the organ.
    pub fn vertices(&self) -> usize {
        match &self.bonds {
            Bonds::Surface(bonds) => bonds.vertices(),
            Bonds::Solid(bonds) => bonds.vertices(),
        }
    }

    /// Moves the nodes with the organ, whose vertices are now at `vertices`; `positions` has one entry per node.
    ///
    /// If a triangle has collapsed, its nodes lie on it and lose their offset. With the feature `parallel`, many nodes
    /// are shared among the threads of the pool, with the same result.
    ///
    /// # Errors
    /// A number of vertices or nodes that differs from the bound ones, or a vertex that is not finite.
    pub fn follow_into(&mut self, vertices: &[Vec3], positions: &mut [Vec3]) -> Result<(), BindingError> {
        if vertices.len() != self.vertices() {
            return Err(BindingError::VertexCount { bound: self.vertices(), given: vertices.len() });
        }
        if positions.len() != self.len() {
            return Err(BindingError::NodeCount { bound: self.len(), given: positions.len() });
        }
        if let Some(vertex) = vertices.iter().position(|position| !position.is_finite()) {
            return Err(BindingError::Vertex { vertex, position: vertices[vertex] });
        }
        match &mut self.bonds {
            Bonds::Surface(bonds) => bonds.follow(vertices, positions),
            Bonds::Solid(bonds) => bonds.follow(vertices, positions),
        }
        Ok(())
    }

    /// Moves the nodes of a tree with the organ: [`follow_into`](Self::follow_into) its positions.
    ///
    /// If the tree at rest still grows, pass a copy of it.
    ///
    /// # Errors
    /// Those of [`follow_into`](Self::follow_into).
    pub fn follow(&mut self, vertices: &[Vec3], tree: &mut VesselTree) -> Result<(), BindingError> {
        self.follow_into(vertices, tree.positions_mut())
    }

    /// The organ's normal at a node, in the pose of the last `follow` call, or at rest before the first.
    ///
    /// Unit length; `Vec3::ZERO` if the organ has collapsed there, and for a node bound to tetrahedra.
    ///
    /// # Panics
    /// If the node is not bound.
    pub fn normal(&self, node: usize) -> Vec3 {
        match &self.bonds {
            Bonds::Surface(bonds) => bonds.normal(node),
            Bonds::Solid(_) => Vec3::ZERO,
        }
    }
}
