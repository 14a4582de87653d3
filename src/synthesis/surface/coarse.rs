//! A closed surface for views from some distance: the cage without a subdivision, drawn in to the vessels' width.
//!
//! It has a quarter of the faces of a surface of level 1, and is closed as well. Its rings are polygons of the vessels'
//! mean width, so that outlines agree from afar with those of finer surfaces.

use super::build::Surface;
use super::settings::{SurfaceError, SurfaceSettings};
use super::shape::Shape;
use crate::synthesis::pace::{Pace, at_once};
use crate::synthesis::tree::VesselTree;
use bevy_math::ops;
use std::f32::consts::PI;

impl Surface {
    /// The coarse surface of a tree, with the sides and tips of these settings and without their subdivisions.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub fn coarse(tree: &VesselTree, settings: &SurfaceSettings) -> Result<Self, SurfaceError> {
        at_once(Self::coarse_paced(tree, settings, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn coarse_paced(
        tree: &VesselTree,
        settings: &SurfaceSettings,
        pace: &Pace,
    ) -> Result<Self, SurfaceError> {
        settings.validate()?;
        let settings = SurfaceSettings { level: 0, ..settings.clone() };
        let mut surface = Self::new_paced(tree, &settings, &pace.part(0.0..0.8)).await?;
        let (shape, mesh) = (Shape::new(&settings, tree.widest_radius()), &mut surface.mesh);
        let draw_in = |vertex: usize| {
            let radius = mesh.radii[vertex];
            let sides = shape.sides_of(radius);
            mesh.positions[vertex] -= mesh.normals[vertex] * (radius * (shape.swell(sides) - corner(sides)));
        };
        pace.part(0.8..1.0).each(mesh.radii.len(), draw_in).await;
        Ok(surface)
    }
}

/// Distance of the corners of a regular polygon from its middle, if its mean width is 2: its perimeter over π.
pub(super) fn corner(sides: u32) -> f32 {
    let half_angle = PI / sides as f32;
    half_angle / ops::sin(half_angle)
}
