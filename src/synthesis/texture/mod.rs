//! Vessels in an organ's texture.
//!
//! In: a [`Canvas`], that is a mesh with texture coordinates, and networks, each a
//! [`VesselTree`](crate::synthesis::tree::VesselTree) with its [`VesselLook`]. Out: a [`Bake`]: maps of colour, normal,
//! height, roughness, vessel and depth, as any renderer takes them, with all their levels.
//!
//! Every texel is evaluated at its own point of the surface, in space: the vessels near it are projected along the
//! normal, as far as tissue lets them through. So charts decide only where samples lie, and vessels run on across their
//! borders, also where charts are mirrored. A vessel's edge is softened in closed form, by its depth and by half a
//! texel, which keeps it from flickering; images are blurred only along seams, as far as both sides differ. Beyond the
//! borders of charts, texels are evaluated for what interpolation sees, and filled from the nearest chart for what
//! smaller levels see.
//!
//! Source: Rauch & Harders (2021), section 4, who project vessels onto each triangle of the organ, blur the images, the
//! deeper the more, and combine them.
//!
//! ```
//! use bevy_math::{Vec2, Vec3};
//! use bevy_vessels::synthesis::{
//!     mesh::TriangleMesh,
//!     texture::{Bake, BakeSettings, Canvas, Layer, MapKind, VesselLook},
//!     tree::{NO_PARENT, VesselKind, VesselTree},
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let corners = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
//! let uvs = corners.iter().map(|corner| Vec2::new(corner.x, 1.0 - corner.y)).collect();
//! let canvas = Canvas::of_mesh(&TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]], Some(uvs))?)?;
//! let positions = vec![Vec3::new(0.1, 0.5, 0.0), Vec3::new(0.9, 0.5, 0.0)];
//! let tree = VesselTree::from_arrays(positions, vec![NO_PARENT, 0], vec![0.02; 2])?;
//! let layers = [Layer { tree: &tree, look: VesselLook::of(VesselKind::Artery) }];
//! let settings = BakeSettings { size: 64, ..BakeSettings::default() };
//! let bake = Bake::new(&canvas, &layers, None, &settings)?;
//! let albedo = bake.map(MapKind::Albedo).ok_or("no albedo")?;
//! assert_eq!((albedo.levels.len(), albedo.levels[0].len()), (7, 64 * 64 * 4));
//! # Ok(())
//! # }
//! ```

mod atlas;
mod bake;
mod bins;
mod bytes;
mod canvas;
mod cones;
mod error;
mod face;
mod gauss;
mod groups;
mod gutter;
mod limits;
mod look;
mod maps;
mod marks;
mod meeting;
mod mips;
mod owners;
mod paint;
mod profile;
mod report;
mod seams;
mod settings;
mod shade;
mod srgb;
mod tangents;
mod texels;
#[cfg(feature = "unwrap")]
mod unwrap;
mod welds;

pub use bake::Bake;
pub use canvas::{Canvas, CanvasAttributes, VertexColors};
pub use cones::Layer;
pub use error::{BakeError, BakeWarning};
pub use look::VesselLook;
pub use maps::{BakedMap, TexelFormat};
pub use report::BakeReport;
pub use settings::{BakeSettings, BaseImage, MapKind, Maps};
