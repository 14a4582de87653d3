//! Files: trees are written as SWC, OBJ and CSV, and read from SWC; organ meshes are read from GLB, glTF and OBJ with the
//! feature `mesh_files`.
//!
//! Every format is a function that writes a tree to any [`std::io::Write`]. [`write_atomically`] puts its output in a
//! file that is there whole or not at all:
//!
//! ```
//! use bevy_vessels::synthesis::{io, tree::VesselTree};
//!
//! # fn main() -> Result<(), io::WriteError> {
//! # let path = std::env::temp_dir().join(format!("bevy_vessels_doc_{}.swc", std::process::id()));
//! # let path = path.as_path();
//! let tree = VesselTree::new();
//! io::write_atomically(path, |out| io::write_swc(out, &tree, &io::SwcOptions::default()))?;
//! # std::fs::remove_file(path).ok();
//! # Ok(())
//! # }
//! ```
//!
//! Numbers are written with a decimal point whatever the locale, with as many digits as it takes to read the same value
//! back, so the same tree gives the same bytes everywhere.

mod atomic;
mod csv;
#[cfg(feature = "mesh_files")]
mod glb;
mod obj;
#[cfg(feature = "mesh_files")]
mod obj_mesh;
#[cfg(feature = "mesh_files")]
mod read_mesh;
mod swc;
mod swc_read;

pub use atomic::{WriteError, write_atomically};
pub use csv::write_csv;
#[cfg(feature = "mesh_files")]
pub use glb::read_glb;
pub use obj::{ObjOptions, write_obj};
#[cfg(feature = "mesh_files")]
pub use obj_mesh::read_obj_mesh;
#[cfg(feature = "mesh_files")]
pub use read_mesh::{MeshReadError, read_mesh};
pub use swc::{SwcOptions, write_swc};
pub use swc_read::{ReadError, SwcReadOptions, read_swc, read_swc_file};
