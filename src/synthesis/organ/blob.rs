//! Ellipsoids that blend into each other, and smooth cuts: the fields that solid organs are the zero of.

use bevy_math::{Quat, Vec3, ops};

/// An ellipsoid that is added to an organ or cut from it.
pub(super) struct Blob {
    pub centre: Vec3,
    pub radii: Vec3,
    pub turn: Quat,
    /// Distance over which it blends with the rest, in metres; below 0 it is cut out.
    pub blend: f32,
}

impl Blob {
    /// Approximate distance to the ellipsoid's surface, in metres; negative inside.
    pub fn distance(&self, point: Vec3) -> f32 {
        let local = self.turn * (point - self.centre);
        let scaled = (local / self.radii).length();
        let gradient = (local / (self.radii * self.radii)).length();
        scaled * (scaled - 1.0) / gradient.max(1e-6)
    }

    /// Distance to what is left of a field's solid once this one is added or cut out.
    pub fn applied(&self, field: f32, point: Vec3) -> f32 {
        let distance = self.distance(point);
        if self.blend < 0.0 {
            smooth_cut(field, distance, -self.blend)
        } else {
            smooth_min(field, distance, self.blend)
        }
    }
}

/// A turn about z, in degrees.
pub(super) fn turn_about_z(degrees: f32) -> Quat {
    let half = -0.5 * degrees.to_radians();
    Quat::from_xyzw(0.0, 0.0, ops::sin(half), ops::cos(half))
}

/// Smooth minimum of two numbers, blended if they are within `blend` of each other: the union of two solids.
pub(super) fn smooth_min(a: f32, b: f32, blend: f32) -> f32 {
    let near = (blend - (a - b).abs()).max(0.0) / blend.max(f32::MIN_POSITIVE);
    a.min(b) - 0.25 * near * near * blend
}

/// A solid without another one, with rounded edges.
pub(super) fn smooth_cut(solid: f32, cut: f32, blend: f32) -> f32 {
    -smooth_min(-solid, cut, blend)
}

/// Distance from `middle` at which a ray inside a solid meets its surface, by sphere tracing. `field` is about the
/// distance to the surface, negative inside; `tolerance` is how near is near enough, all in metres.
pub(super) fn trace(field: impl Fn(Vec3) -> f32, middle: Vec3, direction: Vec3, tolerance: f32) -> f32 {
    const MOST_STEPS: usize = 64;
    let mut reach = 0.0;
    for _ in 0..MOST_STEPS {
        let distance = field(middle + direction * reach);
        if distance > -tolerance {
            break;
        }
        reach -= 0.8 * distance;
    }
    reach
}
