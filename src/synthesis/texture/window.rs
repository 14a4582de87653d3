//! The texels of a triangle from which a segment can be seen.

use super::cones::Cone;
use super::face::Face;
use super::gauss::SEEN;
use super::look::VesselLook;
use bevy_math::Vec3;
use std::f32::consts::PI;
use std::ops::Range;

/// Directions in which the blur of texels is measured.
const DIRECTIONS: u16 = 8;
/// Factor for directions between them.
const BETWEEN: f32 = 1.05;
/// Least cosine of the angle between a triangle and the smooth surface for which texels are counted.
const STEEPEST: f32 = 0.3;

/// From the surface of a triangle to its texels.
pub(super) struct Windows {
    /// How far it is to the right, and down, for a length on the surface.
    slopes: [Vec3; 2],
    /// Lengths of these.
    rates: [f32; 2],
    /// The first corner.
    origin: Vec3,
    at_origin: [f32; 2],
    /// Texels to which the blur of texels spreads a point.
    spread: [f32; 2],
    /// Unit normal of the triangle.
    normal: Vec3,
    /// Displacement by depth, since vessels are not projected along the triangle's normal.
    tilt: f32,
}

impl Windows {
    pub fn of(face: &Face) -> Self {
        let [a, b, c] = face.corners;
        let (first, second) = (b - a, c - a);
        let normal = first.cross(second);
        let dual = [second.cross(normal) / normal.length_squared(), normal.cross(first) / normal.length_squared()];
        let texels = face.placed.corners().map(|corner| corner.as_vec2());
        let (right, lower) = (texels[1] - texels[0], texels[2] - texels[0]);
        let slopes = [0, 1].map(|axis| dual[0] * right[axis] + dual[1] * lower[axis]);
        let unit = normal.normalize_or_zero();
        let cosine = face.smooth.iter().map(|smooth| smooth.dot(unit)).fold(1.0, f32::min);
        let tilt = if cosine > STEEPEST { (1.0 - cosine * cosine).max(0.0).sqrt() / cosine } else { f32::INFINITY };
        let mut spread = [0.0f32; 2];
        let across = first.normalize_or_zero();
        for direction in 0..DIRECTIONS {
            let (sin, cos) = bevy_math::ops::sin_cos(PI * f32::from(direction) / f32::from(DIRECTIONS));
            let along = across * cos + unit.cross(across) * sin;
            let blur = face.blur_along(along);
            for axis in 0..2 {
                spread[axis] = spread[axis].max(SEEN * BETWEEN * blur * along.dot(slopes[axis]).abs());
            }
        }
        let rates = slopes.map(Vec3::length);
        Self { slopes, rates, origin: a, at_origin: texels[0].to_array(), spread, normal: unit, tilt }
    }

    /// The columns and rows of texels from which a segment can be seen, within those of a tile; and how far from its axis
    /// it can be seen there, besides the blur of the texels. `None` if it can be seen from none.
    pub fn of_cone(&self, cone: &Cone, look: &VesselLook, tile: &[Range<i64>; 2]) -> Option<([Range<i64>; 2], f32)> {
        // How deep it lies, between its ends and with any normal of the triangle.
        let from = -self.normal.dot(cone.start - self.origin);
        let to = from - self.normal.dot(cone.along);
        let turned = self.tilt * cone.reach;
        let (low, high) = (from.min(to) - turned, from.max(to) + turned);
        let limit = cone.max_depth + cone.chord;
        if low > limit || high < -limit {
            return None;
        }
        let widest = cone.start_radius.max(cone.start_radius + cone.widening);
        let depth = (high.min(limit) - cone.chord).max(0.0) + look.depth * widest;
        let reach = widest + SEEN * look.with_mound(look.blur_at(widest, depth), widest);
        let moved = reach + self.tilt * high.abs().max(low.abs()).min(limit);
        let window = [0, 1].map(|axis| {
            let start = self.at_origin[axis] + self.slopes[axis].dot(cone.start - self.origin);
            let end = start + self.slopes[axis].dot(cone.along);
            let room = self.rates[axis] * moved + self.spread[axis];
            // `as` holds infinity at the largest number. The centre of a texel is half of it from its edge.
            let (low, high) = ((start.min(end) - room - 0.5) as i64, (start.max(end) + room + 0.5) as i64);
            low.max(tile[axis].start)..high.min(tile[axis].end)
        });
        (!window.iter().any(Range::is_empty)).then_some((window, reach))
    }
}
