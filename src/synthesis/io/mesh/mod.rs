//! Mesh files: organs are read, vessels are written as tubes.

#[cfg(feature = "mesh_files")]
mod glb;
#[cfg(feature = "mesh_files")]
mod load;
mod obj;
#[cfg(feature = "mesh_files")]
mod obj_read;
#[cfg(feature = "mesh_files")]
mod read;

#[cfg(feature = "mesh_files")]
pub use glb::read_glb;
#[cfg(feature = "mesh_files")]
pub use load::load_mesh;
pub use obj::{ObjOptions, save_obj, write_obj};
#[cfg(feature = "mesh_files")]
pub use obj_read::read_obj_mesh;
#[cfg(feature = "mesh_files")]
pub use read::{MeshDataError, MeshReadError};
