//! Everything that makes vessels, without an engine: no world, clock, GPU or handle.
//!
//! # The pipeline
//!
//! 1. An organ's [`mesh`] becomes a [`tissue`]: its surface, its volume, or both in turn, with guides and a density.
//!    The tissue may also be a plain shape or a mask.
//! 2. [`roots`] say where vessels enter it.
//! 3. [`colonization`] samples the tissue for drains and grows the trees towards them, by the laws in [`murray`](tree::murray);
//!    or [`cco`] adds terminal after terminal, each where the tree stays smallest.
//! 4. The [`tree`]s are measured, checked, drawn through [`instances`] and written by [`io`].
//! 5. [`haemodynamics`] computes blood flow, [`wound`] cuts vessels, [`binding`] moves them with a deforming organ.
//! 6. [`surface`] makes closed meshes of vessels, [`texture`] bakes them into maps of the organ's mesh.
//!
//! Besides these, [`preset`] names settings with their source, [`organ`] makes procedural organs, [`random`] provides
//! random streams, [`space`] finds points and boxes by position, and [`units`] turn lengths into metres.
//!
//! # Words
//!
//! - **Node**: a point of a centre line. **Segment**: the piece from a node's parent to it. **Branch**: a run of
//!   segments between splits. **Terminal**: a segment whose node has no child. **Root**: a node without a parent.
//! - **Attraction point**: a point that attracts vessels. **Drain**: one that lacks oxygen, and attracts arteries; once
//!   supplied it attracts veins as a carbon-dioxide source.
//! - **Birth**, **influence** and **kill distance**: how near to others a drain may be born, how far it acts, and how
//!   near a node must come to supply it. **Step length**: the length of a new segment.
//! - **Bifurcation exponent** κ: the exponent of Murray's law, r_p^κ = r_l^κ + r_r^κ.
//!
//! # Example
//!
//! ```
//! use bevy_vessels::synthesis::{
//!     colonization::{Colonization, ColonizationSettings},
//!     io::{SwcOptions, save_swc},
//!     roots::Roots,
//!     tissue::{Disc, Tissue},
//!     tree::VesselKind,
//! };
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let tissue = Arc::new(Disc::flat(50.0)?);
//! let settings = ColonizationSettings::default().fit(tissue.extent());
//! let mut growth = Colonization::new(tissue, settings, &Roots::default(), 7)?;
//! growth.run();
//! let arteries = growth.vessels(VesselKind::Artery);
//! println!("{} nodes, {} tips", arteries.len(), arteries.tips().len());
//! # let path = std::env::temp_dir().join("bevy_vessels_doctest.swc");
//! save_swc(&path, &arteries, &SwcOptions::default())?;
//! # std::fs::remove_file(path)?;
//! # Ok(())
//! # }
//! ```

pub mod binding;
pub mod cco;
pub mod colonization;
mod exponential;
pub mod generator;
pub mod growth;
pub mod haemodynamics;
pub mod instances;
pub mod io;
pub mod mesh;
pub mod organ;
pub mod pace;
mod parallel;
pub mod preset;
pub mod random;
pub mod recipe;
pub mod roots;
pub mod segment_index;
pub mod space;
pub mod surface;
pub mod texture;
pub mod tissue;
pub mod tree;
pub mod units;
pub mod wound;
