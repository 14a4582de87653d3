//! Files of closed vessel surfaces: GLB, STL, PLY, OBJ and OFF.
//!
//! In: [`SurfacePart`]s, each a tree with its surface. Out: one file with all of them, in tissue lengths, written in one
//! pass without a copy of the meshes. Nothing is written before all parts have been checked.
//!
//! | format | for | texture coordinates | quads | measures of the vessels |
//! |---|---|---|---|---|
//! | [GLB](write_surface_glb) | engines, viewers | yes | no | per vertex |
//! | [STL](write_surface_stl) | printing, volume meshing | no | no | no |
//! | [PLY](write_surface_ply) | measuring, Python | no | yes, or divided | per vertex |
//! | [OBJ](write_surface_obj) | modelling | yes | yes, or divided | no |
//! | [OFF](write_surface_off) | geometry libraries | no | yes, or divided | no |
//!
//! A vertex on a texture's seam is stored in the mesh once for each of its texture coordinates. GLB repeats it likewise,
//! since its vertices have one index for all values. In the other formats it is written once, so that any program sees
//! a closed surface without welding vertices first.

#[cfg(feature = "mesh_files")]
mod glb;
mod notes;
mod obj;
mod off;
mod part;
mod ply;
mod save;
mod stl;
#[cfg(test)]
mod testing;

#[cfg(feature = "mesh_files")]
pub use glb::{save_surface_glb, write_surface_glb};
pub use notes::SurfaceOptions;
pub use obj::{save_surface_obj, write_surface_obj};
pub use off::{save_surface_off, write_surface_off};
pub use part::SurfacePart;
pub use ply::{save_surface_ply, write_surface_ply};
pub use save::{SurfaceFormat, save_surface, write_surface};
pub use stl::{save_surface_stl, write_surface_stl};
