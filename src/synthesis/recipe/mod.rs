//! Vessels in several layers that make a picture together: what grows where, from what seed, and how it looks.
//!
//! In: a procedural organ. Out: [`RecipeLayer`]s. Each is grown for itself, on the part of the organ that its density
//! leaves it, and knows nothing of the others; all are baked into one texture, in their order.
//!
//! ```
//! use bevy_vessels::synthesis::{
//!     organ::EyeSettings,
//!     recipe::conjunctiva,
//!     texture::{Bake, BakeSettings, Canvas, Layer},
//!     tissue::MeshSurface,
//!     tree::{VesselKind, VesselTree},
//! };
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let eye = EyeSettings { triangles: 6_000, ..Default::default() }.generate()?;
//! let surface = Arc::new(MeshSurface::new(eye.globe.part(eye.conjunctiva.clone()).triangle_mesh()?)?);
//! let layers = conjunctiva(&eye, 7);
//! # let layers = &layers[..3];
//! let mut trees: Vec<VesselTree> = Vec::new();
//! for layer in layers {
//!     let tissue = layer.tissue(&surface)?;
//!     let mut growth = layer.preset.generator.start(tissue, &layer.preset.roots(), layer.seed)?;
//!     growth.run();
//!     trees.extend(growth.trees()[VesselKind::Artery].map(|grown| grown.tree.clone()));
//! }
//! let looks = layers.iter().map(|layer| layer.look.clone());
//! let painted: Vec<Layer<'_>> = trees.iter().zip(looks).map(|(tree, look)| Layer { tree, look }).collect();
//! let settings = BakeSettings { size: 256, ..BakeSettings::default() };
//! let bake = Bake::new(&Canvas::of_shaded(&eye.globe)?, &painted, None, &settings)?;
//! # assert!(bake.report.texels > 256 * 256 / 2);
//! # Ok(())
//! # }
//! ```

mod conjunctiva;
mod layer;

pub use conjunctiva::{SCLERA_COLOR, conjunctiva};
pub use layer::RecipeLayer;
