//! Closed meshes of vessel trees.
//!
//! In: a [`VesselTree`](crate::synthesis::tree::VesselTree) and [`SurfaceSettings`]. Out: a [`Surface`]: one closed, smooth [`SurfaceMesh`] for each tree,
//! whose tubes are joined without a gap, and a [`SurfaceReport`] of what could not be done as wished.
//!
//! The tree is taken apart into trunks, each a curve through its nodes. Rings of vertices along the curves make a cage of
//! quads, in which laterals leave through holes; Catmull–Clark subdivision makes it smooth. Closed it is by
//! construction: every edge is made with both of its faces.
//!
//! For views from afar there are [`Surface::coarse`], closed as well, and [`Surface::sketch`], a prism for each branch.
//!
//! Source: Skjermo & Eidheim, "Polygon mesh generation of branching structures" (2005), with two deviations. Their
//! cross-sections are squares; here they have more sides the wider the vessel is (with
//! [`most_sides`](SurfaceSettings::most_sides) 4, theirs). Their laterals leave from a face as wide as the trunk, which
//! makes a thin one a funnel; here from faces as wide as the lateral. Joints that are too close for this share their
//! rings.
//!
//! ```
//! use bevy_math::Vec3;
//! use bevy_vessels::synthesis::{surface::{Surface, SurfaceSettings}, tree::{NO_PARENT, VesselTree}};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let positions = vec![Vec3::ZERO, Vec3::Z, Vec3::new(0.5, 0.0, 2.0), Vec3::new(-0.6, 0.0, 1.8)];
//! let tree = VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 1], vec![0.2, 0.2, 0.16, 0.14])?;
//! let surface = Surface::new(&tree, &SurfaceSettings::default())?;
//! assert!(surface.mesh.closure().is_closed());
//! # Ok(())
//! # }
//! ```

mod build;
mod builder;
mod cage;
mod cage_mesh;
mod caps;
mod check;
mod coarse;
mod columns;
mod curve;
mod direction;
mod exit;
mod half_edges;
mod layout;
mod limit;
mod loops;
mod mesh;
mod parting;
mod remake;
mod report;
mod rings;
mod rows;
mod seams;
mod settings;
mod shape;
mod sketch;
mod spline;
mod trunks;

pub use build::Surface;
pub use check::SurfaceCheck;
pub use loops::ClosingVessel;
pub use mesh::SurfaceMesh;
pub use report::SurfaceReport;
pub use settings::{SurfaceError, SurfaceSettings, TipCap};
