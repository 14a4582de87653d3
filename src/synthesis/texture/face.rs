//! A triangle while it is painted.

use super::atlas::{Atlas, Placement, Tensor};
use super::canvas::Canvas;
use super::gauss::SEEN;
use super::meeting::{LANES, Spots, ZERO, roots};
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
    /// The largest blur of its texels.
    pub blur: f32,
}

impl Face {
    /// The triangle of a placement, in a texture of some size.
    pub fn of(canvas: &Canvas, atlas: &Atlas, placement: &Placement, size: u32) -> Self {
        let triangle = placement.triangle as usize;
        let vertices = canvas.mesh.triangles()[triangle].map(|vertex| vertex as usize);
        let scale = 1.0 / (size as f32 * size as f32);
        let footprints = vertices.map(|vertex| atlas.footprints[vertex].map(|value| value * scale));
        Self {
            placed: Placed::of(canvas, placement, size),
            triangle,
            corners: canvas.mesh.corners(triangle),
            smooth: vertices.map(|vertex| atlas.smooth[vertex]),
            blur: footprints.iter().map(|[xx, yy, zz, ..]| xx + yy + zz).fold(0.0, f32::max).sqrt(),
            footprints,
        }
    }

    /// A box around its points in a tile, widened by what their blur reaches.
    pub fn region(&self, tile: &[Range<i64>; 2]) -> Bounds {
        let corners = self.placed.part(tile.clone()).map(|at| self.at(self.placed.weights(at)) + self.corners[0]);
        let Bounds { min, max } = Bounds::around(&corners);
        let blur = self.blur;
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

    /// Sets the points of those texels that it owns, by the weights of its corners, with their places from some origin.
    pub fn set_spots(&self, weights: &[Vec3; LANES], owns: &[bool; LANES], origin: Vec3, spots: &mut Spots) {
        let [a, b, c] = self.corners;
        let (first, second, third) = (a - origin, b - a, c - a);
        let [na, nb, nc] = &self.smooth;
        let [ta, tb, tc] = &self.footprints;
        let (mut lengths, mut normals) = (ZERO, [ZERO; 3]);
        for axis in 0..3 {
            for k in 0..LANES {
                let at = first[axis] + second[axis] * weights[k].y + third[axis] * weights[k].z;
                let normal = na[axis] * weights[k].x + nb[axis] * weights[k].y + nc[axis] * weights[k].z;
                spots.at[axis][k] = if owns[k] { at } else { spots.at[axis][k] };
                normals[axis][k] = normal;
                lengths[k] += normal * normal;
            }
        }
        for (length, k) in roots(&lengths).into_iter().zip(0..) {
            // Corner normals may cancel out; then that of the first one has to do.
            let (share, rest) = if length > f32::MIN_POSITIVE { (1.0 / length, 0.0) } else { (0.0, 1.0) };
            for axis in 0..3 {
                let normal = normals[axis][k] * share + na[axis] * rest;
                spots.normal[axis][k] = if owns[k] { normal } else { spots.normal[axis][k] };
            }
        }
        for (entry, footprint) in spots.footprint.iter_mut().enumerate() {
            for k in 0..LANES {
                let value = ta[entry] * weights[k].x + tb[entry] * weights[k].y + tc[entry] * weights[k].z;
                footprint[k] = if owns[k] { value } else { footprint[k] };
            }
        }
    }
}
