//! The region of an index query: a box, and within it the slabs between three pairs of planes.
//!
//! In: the extent of a shape along any direction. Out: a [`Region`] that holds the shape. The box of a long oblique
//! edge is mostly empty; slabs across the shape's own axes leave little of it.

use crate::synthesis::space::packed_boxes::{Corners, Slabs};
use bevy_math::{DVec3, Vec3};

/// A part of space that holds a blade, or a part of one, for a query of an index.
///
/// It may hold more. Code without an index may use only the box from [`min`](Self::min) to [`max`](Self::max), or take
/// all segments.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    corners: Corners,
    slabs: Option<Slabs>,
}

impl Region {
    /// The box between two corners.
    pub fn between(min: Vec3, max: Vec3) -> Self {
        Self { corners: (min, max), slabs: None }
    }

    /// The region of a shape with three axes of its own, of any length. `reach` gives the extent of the shape along a
    /// direction: the least and the greatest product of a point with it.
    pub(crate) fn of(axes: [DVec3; 3], reach: impl Fn(DVec3) -> [f64; 2]) -> Self {
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(&reach);
        // Rounded outwards, so that the box becomes no smaller.
        let min = DVec3::new(x[0], y[0], z[0]).as_vec3().map(f32::next_down);
        let max = DVec3::new(x[1], y[1], z[1]).as_vec3().map(f32::next_up);
        let axes = axes.map(|axis| axis.normalize_or_zero().as_vec3());
        let slabs = Slabs::new((min, max), axes.map(|axis| (axis, reach(axis.as_dvec3()))));
        Self { corners: (min, max), slabs: Some(slabs) }
    }

    /// Lowest coordinates.
    pub fn min(&self) -> Vec3 {
        self.corners.0
    }

    /// Highest coordinates.
    pub fn max(&self) -> Vec3 {
        self.corners.1
    }

    pub(super) fn corners(&self) -> Corners {
        self.corners
    }

    pub(super) fn slabs(&self) -> Option<&Slabs> {
        self.slabs.as_ref()
    }
}

/// Three axes of a shape that is flat, or long, or both: the normal first, then two across it, the first of them as far
/// as possible along a direction. Zero if the shape has none.
pub(crate) fn axes(normal: DVec3, along: DVec3) -> [DVec3; 3] {
    let normal = normal.normalize_or_zero();
    let along = (along - normal * normal.dot(along)).normalize_or_zero();
    [normal, along, normal.cross(along)]
}
