//! Files: trees are written as SWC, GXL, OBJ and CSV, and as SVG and EPS pictures, and read from SWC; closed surfaces of vessels are
//! written as GLB, STL, PLY, OBJ and OFF, baked textures as KTX2 and PNG; organ meshes are read from GLB, glTF and OBJ. GLB,
//! and the reading of meshes, need the feature `mesh_files`, PNG needs `texture_files`.
//!
//! Every format has a function that writes to any [`std::io::Write`], such as [`write_swc`], and one that writes a
//! file, such as [`save_swc`]. Files are written whole or not at all, by [`write_atomically`].
//!
//! What is read has a function that takes bytes, such as [`read_swc`], and one that takes a path, such as [`load_swc`].
//! Files may come from anywhere: what a reader takes follows from the file's size, only regular files are read, and
//! errors name places, extensions and missing files, but repeat nothing else that a file holds.
//!
//! ```
//! use bevy_vessels::synthesis::{
//!     io::{SwcOptions, SwcReadOptions, load_swc, save_swc},
//!     tree::{NO_PARENT, VesselTree},
//! };
//! use bevy_math::Vec3;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let path = std::env::temp_dir().join(format!("bevy_vessels_io_{}.swc", std::process::id()));
//! let tree = VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![0.2, 0.1])?;
//! save_swc(&path, &tree, &SwcOptions::default())?;
//! assert_eq!(load_swc(&path, &SwcReadOptions::default())?, tree);
//! # std::fs::remove_file(path)?;
//! # Ok(())
//! # }
//! ```
//!
//! Numbers are written with a decimal point in any locale, with as many digits as needed to read the same value back,
//! so the same tree gives the same bytes everywhere.

mod atomic;
mod lines;
mod mesh;
mod picture;
mod regular_file;
mod surface;
mod texture;
mod tree;

pub use atomic::{WriteError, remove_stale, write_atomically};
#[cfg(feature = "mesh_files")]
pub use mesh::{MeshDataError, MeshReadError, load_mesh, read_glb, read_obj_mesh};
pub use mesh::{ObjOptions, save_obj, write_obj};
pub use picture::{save_eps, save_svg, write_eps, write_svg};
pub use surface::{
    SurfaceFormat, SurfaceOptions, SurfacePart, save_surface, save_surface_obj, save_surface_off, save_surface_ply,
    save_surface_stl, write_surface, write_surface_obj, write_surface_off, write_surface_ply, write_surface_stl,
};
#[cfg(feature = "mesh_files")]
pub use surface::{save_surface_glb, write_surface_glb};
pub use texture::{save_ktx2, write_ktx2};
#[cfg(feature = "texture_files")]
pub use texture::{save_png, write_png};
pub use tree::{
    CsvOptions, GxlOptions, ReadError, SwcOptions, SwcReadOptions, kind_of_swc_structure, load_swc, read_swc, save_csv,
    save_gxl, save_levels, save_swc, swc_structure, write_csv, write_gxl, write_levels, write_swc,
};
