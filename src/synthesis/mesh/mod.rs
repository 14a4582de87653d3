//! Meshes: triangles of organs, checked once; meshes with all drawing attributes; tetrahedra of soft bodies.
//!
//! In: positions and indices, as in a file or an engine's mesh. Out: a [`TriangleMesh`] that every later stage can use,
//! its [`topology`], an index of its triangles ([`TriangleIndex`]) and its voxels. Of any triangles: whether they close a
//! surface ([`Closure`]), and which of them intersect ([`self_intersections`]).

pub(crate) mod bit_grid;
pub mod closure;
pub(crate) mod crossing;
pub(crate) mod disjoint_sets;
pub(crate) mod facing;
mod indexed;
pub mod intersections;
mod neighbours;
mod separation;
mod shaded;
#[cfg(test)]
mod test_shapes;
pub(crate) mod tet_mesh;
pub mod topology;
pub mod triangle_index;
mod triangle_mesh;
pub(crate) mod triangle_pair;
mod vertex_normals;
pub(crate) mod voxels;
pub(crate) mod way;
mod welding;
pub(crate) mod winding;

pub use closure::Closure;
pub use indexed::IndexedMesh;
pub use intersections::{self_intersections, self_intersections_paced};
pub use shaded::ShadedMesh;
pub use tet_mesh::{TetMesh, TetMeshError};
pub use topology::MeshTopology;
pub use triangle_index::{SurfacePoint, TriangleIndex};
pub use triangle_mesh::{MAX_COORDINATE, MAX_TRIANGLES, MeshError, TriangleMesh};
pub use welding::Welding;

pub use voxels::VoxelError;

pub(crate) use triangle_mesh::{doubled_normal, is_usable, tetrahedron_volume, unit};
