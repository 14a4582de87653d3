//! A triangle while it is painted.

use super::atlas::{Atlas, Placement, Tensor};
use super::canvas::Canvas;
use super::gauss::SEEN;
use super::shade::{SurfaceSpot, quadratic};
use super::texels::{MARGIN, Placed};
use crate::synthesis::space::bvh::Bounds;
use bevy_math::{Vec3, Vec3A};
use std::ops::Range;

/// A triangle while it is painted.
pub(super) struct Face {
    pub placed: Placed,
    pub triangle: usize,
    pub corners: [Vec3; 3],
    pub smooth: [Vec3; 3],
    footprints: [Tensor; 3],
}

impl Face {
    /// The triangle of a placement, in a texture of some size.
    pub fn of(canvas: &Canvas, atlas: &Atlas, placement: &Placement, size: u32) -> Self {
        let triangle = placement.triangle as usize;
        let vertices = canvas.mesh.triangles()[triangle].map(|vertex| vertex as usize);
        let scale = 1.0 / (size as f32 * size as f32);
        Self {
            placed: Placed::of(canvas, placement, size),
            triangle,
            corners: canvas.mesh.corners(triangle),
            smooth: vertices.map(|vertex| atlas.smooth[vertex]),
            footprints: vertices.map(|vertex| atlas.footprints[vertex].map(|value| value * scale)),
        }
    }

    /// The largest blur of its texels in a direction.
    pub fn blur_along(&self, direction: Vec3) -> f32 {
        self.footprints.iter().map(|tensor| quadratic(tensor, direction)).fold(0.0, f32::max).sqrt()
    }

    /// The largest blur of its texels.
    pub fn blur(&self) -> f32 {
        self.footprints.iter().map(|[xx, yy, zz, ..]| xx + yy + zz).fold(0.0, f32::max).sqrt()
    }

    /// A box around its points in a tile, widened by what their blur reaches.
    pub fn region(&self, tile: &[Range<i64>; 2]) -> Bounds {
        let corners = self.placed.part(tile.clone()).map(|at| self.at(self.placed.weights(at)) + self.corners[0]);
        let Bounds { min, max } = Bounds::around(&corners);
        let blur = self.blur();
        // Texels beside the border lie in the triangle's plane, at most so many of them beyond.
        let beside = Bounds::around(&self.corners);
        let margin = Vec3A::splat(2.0 * MARGIN as f32 * blur);
        let wide = Vec3A::splat(SEEN * blur);
        Bounds { min: min.max(beside.min - margin) - wide, max: max.min(beside.max + margin) + wide }
    }

    /// A point by the weights of the corners, from the first corner.
    fn at(&self, weights: Vec3) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a) * weights.y + (c - a) * weights.z
    }

    /// A point by the weights of the corners.
    pub fn spot(&self, weights: Vec3) -> SurfaceSpot {
        let [x, y, z] = weights.to_array();
        let [a, b, c] = &self.smooth;
        let [ta, tb, tc] = &self.footprints;
        SurfaceSpot {
            at: self.at(weights),
            normal: (*a * x + *b * y + *c * z).normalize_or(*a),
            footprint: std::array::from_fn(|k| ta[k] * x + tb[k] * y + tc[k] * z),
        }
    }
}
