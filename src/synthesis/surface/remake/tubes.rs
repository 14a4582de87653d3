//! Tubes: the round cones along a part of a trunk's curve, and the distance to their union.

use crate::synthesis::surface::curve::Curve;
use crate::synthesis::surface::spline::Station;
use bevy_math::Vec3;
use std::ops::Range;

/// Distance between the stations of a tube, in radii.
const STEP: f32 = 1.0;
/// The most round cones of one tube.
const MOST: f32 = 4096.0;

/// A round cone between two stations of a trunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    pub trunk: u32,
    /// Lengths along the trunk.
    pub lengths: [f32; 2],
    pub centers: [Vec3; 2],
    pub radii: [f32; 2],
}

impl Cone {
    /// Distance from a point to the surface, negative inside, and the share of the axis that is nearest.
    pub fn distance(&self, point: Vec3) -> (f32, f32) {
        let [a, b] = self.centers;
        let (along, to_point) = (b - a, point - a);
        let square = along.length_squared();
        let share = if square > 0.0 { (along.dot(to_point) / square).clamp(0.0, 1.0) } else { 0.0 };
        let radius = self.radii[0] + share * (self.radii[1] - self.radii[0]);
        ((to_point - along * share).length() - radius, share)
    }

    /// The corners of its box.
    pub fn bounds(&self) -> [Vec3; 2] {
        let [a, b] = self.centers;
        let [r, s] = self.radii;
        [(a - r).min(b - s), (a + r).max(b + s)]
    }
}

/// Adds the round cones of a part of a trunk.
pub(super) fn add(cones: &mut Vec<Cone>, trunk: u32, curve: &Curve, lengths: Range<f32>) {
    let radius = curve.radius_at(lengths.start).min(curve.radius_at(lengths.end));
    let span = (lengths.end - lengths.start).max(0.0);
    let count = (span / (STEP * radius)).ceil().clamp(1.0, MOST) as u32;
    let at = |step: u32| {
        let length = lengths.start + span * step as f32 / count as f32;
        (length, curve.at(length))
    };
    let mut before = at(0);
    for step in 1..=count {
        let here = at(step);
        let [(from, a), (to, b)] = [before, here];
        let cone = |a: &Station, b: &Station| Cone {
            trunk,
            lengths: [from, to],
            centers: [a.center, b.center],
            radii: [a.radius, b.radius],
        };
        cones.push(cone(&a, &b));
        before = here;
    }
}
