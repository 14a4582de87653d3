//! Which texels of a tile a triangle has.

use super::atlas::{Placement, corner_uvs};
use super::canvas::Canvas;
use bevy_math::{DVec2, Vec3};
use std::ops::Range;

/// Texels along the side of a tile.
pub(super) const TILE: u32 = 32;
/// Texels in a tile.
pub(super) const TILE_TEXELS: usize = (TILE * TILE) as usize;
/// Texels by which charts are painted beyond their borders: what interpolation between texels sees.
pub(super) const MARGIN: f64 = 1.5;
/// Texels by which the inside of a triangle is widened, so that no texel on a shared edge falls between two.
const SLACK: f64 = 1.0e-4;

/// A triangle in the texture: the weights of its corners are linear over the texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Corners in texels: the centre of the first texel is at 0.5.
    corners: [DVec2; 3],
    /// Weight of each corner, as change to the right and down, and value at the first corner.
    slopes: [DVec2; 3],
}

impl Placed {
    pub fn of(canvas: &Canvas, placement: &Placement, size: u32) -> Self {
        let shift = DVec2::new(placement.shift[0].into(), placement.shift[1].into());
        let corners = corner_uvs(canvas, placement.triangle as usize);
        let corners = corners.map(|uv| (uv.as_dvec2() + shift) * f64::from(size));
        let doubled = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]);
        let slopes = std::array::from_fn(|corner| {
            let opposite = corners[(corner + 2) % 3] - corners[(corner + 1) % 3];
            DVec2::new(-opposite.y, opposite.x) / doubled
        });
        Self { corners, slopes }
    }

    /// Weights of the corners at a point of the texture, in texels. They also hold beyond the triangle.
    pub fn weights(&self, at: DVec2) -> Vec3 {
        let from = at - self.corners[0];
        let [_, second, third] = self.slopes.map(|slope| slope.dot(from));
        Vec3::new((1.0 - second - third) as f32, second as f32, third as f32)
    }

    /// The texels that it can reach, in columns and rows, with a margin.
    pub fn region(&self, margin: f64) -> [Range<i64>; 2] {
        let [a, b, c] = self.corners;
        let (low, high) = (a.min(b).min(c) - margin, a.max(b).max(c) + margin);
        let range = |low: f64, high: f64| (low - 0.5).ceil() as i64..(high - 0.5).floor() as i64 + 1;
        [range(low.x - SLACK, high.x + SLACK), range(low.y - SLACK, high.y + SLACK)]
    }

    /// The columns of a row of texels whose centres are inside.
    pub fn span(&self, row: i64) -> Range<i64> {
        let y = row as f64 + 0.5;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (corner, slope) in self.slopes.iter().enumerate() {
            // The weight of a corner is 0 along the edge opposite to it.
            let on_edge = self.corners[(corner + 1) % 3];
            let slack = SLACK * (slope.x.abs() + slope.y.abs());
            let beside = slope.y * (y - on_edge.y) + slack;
            if slope.x > 0.0 {
                low = low.max(on_edge.x - beside / slope.x);
            } else if slope.x < 0.0 {
                high = high.min(on_edge.x - beside / slope.x);
            } else if beside < 0.0 {
                return 0..0;
            }
        }
        if !(low <= high) {
            return 0..0;
        }
        (low - 0.5).ceil() as i64..(high - 0.5).floor() as i64 + 1
    }

    /// Squared distance of a point of the texture from the triangle, in texels, if it is outside.
    pub fn distance_squared(&self, at: DVec2) -> f64 {
        let to_edge = |corner: usize| {
            let (start, end) = (self.corners[corner], self.corners[(corner + 1) % 3]);
            let along = end - start;
            let share = ((at - start).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            (start + along * share).distance_squared(at)
        };
        to_edge(0).min(to_edge(1)).min(to_edge(2))
    }

    /// The corners of the part of the texture that it shares with a rectangle: of the rectangle around it, cut.
    pub fn part(&self, [columns, rows]: [Range<i64>; 2]) -> [DVec2; 4] {
        let [a, b, c] = self.corners;
        let (low, high) = (a.min(b).min(c) - MARGIN, a.max(b).max(c) + MARGIN);
        let low = low.max(DVec2::new(columns.start as f64, rows.start as f64));
        let high = high.min(DVec2::new(columns.end as f64, rows.end as f64));
        [low, DVec2::new(high.x, low.y), DVec2::new(low.x, high.y), high]
    }
}
