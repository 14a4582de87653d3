//! Tissues of simple shape, sampled and measured exactly: disc and rectangle are surfaces; ball, box and ellipsoid are
//! solids.

mod flat;
mod solid;

pub use flat::{Disc, Rectangle};
pub use solid::{Ball, Cuboid, Ellipsoid};

use crate::synthesis::random::VesselRng;
use bevy_math::{Vec2, Vec3};
use rand::RngExt;

/// Tolerance for rounding of a shape's own points, relative to its size and distance from the origin.
const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Most tries at a uniform point by rejection. A ball accepts about half of them, so all fail once in 10²⁰ draws.
const TRIES: u32 = 64;

/// Distance within which a point counts as part of a shape.
fn tolerance(center: Vec3, size: f32) -> f32 {
    ROUNDING * (center.abs().max_element() + size)
}

/// A number drawn uniformly from −1 to 1.
fn signed(rng: &mut VesselRng) -> f32 {
    2.0 * rng.random::<f32>() - 1.0
}

/// A point drawn uniformly from the unit disc. Rejection takes fewer operations than a root, a sine and a cosine.
pub(in crate::synthesis::tissue) fn in_unit_disc(rng: &mut VesselRng) -> Option<Vec2> {
    (0..TRIES).map(|_| Vec2::new(signed(rng), signed(rng))).find(|point| point.length_squared() <= 1.0)
}

/// A point drawn uniformly from the unit ball.
pub(in crate::synthesis::tissue) fn in_unit_ball(rng: &mut VesselRng) -> Option<Vec3> {
    (0..TRIES).map(|_| Vec3::new(signed(rng), signed(rng), signed(rng))).find(|point| point.length_squared() <= 1.0)
}
