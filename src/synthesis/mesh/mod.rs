//! Meshes: triangles of organs, checked once; meshes with all drawing attributes; tetrahedra of soft bodies.
//!
//! In: positions and indices, as in a file or an engine's mesh. Out: a [`TriangleMesh`] that every later stage can use,
//! its [`topology`], an index of its triangles ([`TriangleIndex`]) and its voxels.

pub(crate) mod bit_grid;
pub(crate) mod crossing;
mod indexed;
mod shaded;
pub(crate) mod tet_mesh;
pub mod topology;
pub mod triangle_index;
mod triangle_mesh;
mod vertex_normals;
pub(crate) mod voxels;
mod welding;
pub(crate) mod winding;

pub use indexed::IndexedMesh;
pub use shaded::ShadedMesh;
pub use tet_mesh::{TetMesh, TetMeshError};
pub use topology::MeshTopology;
pub use triangle_index::{SurfacePoint, TriangleIndex};
pub use triangle_mesh::{MAX_COORDINATE, MAX_TRIANGLES, MeshError, TriangleMesh};
pub use welding::Welding;

pub use voxels::VoxelError;

pub(crate) use triangle_mesh::{doubled_normal, is_usable, tetrahedron_volume, unit};
