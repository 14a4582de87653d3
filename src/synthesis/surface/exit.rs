//! Where a lateral leaves its trunk: the room that the opening needs.
//!
//! A lateral of radius r, at an angle θ to a trunk of radius R, breaks through the trunk's surface R·cot θ further along
//! the trunk, over a length of r / sin θ to both sides, and is clear of it (R + r·|cos θ|) / sin θ from the trunk's centre
//! line, measured along the lateral: the room of Skjermo & Eidheim 2005, equation 4.

use super::curve::{Curve, Station};
use super::direction::{across, unit};
use bevy_math::{Vec3, ops};

/// The least sine of the angle between trunk and lateral that counts: 20°. Flatter ones leave by a slanted stub.
const LEAST_SLOPE: f32 = 0.35;
/// Half the edge of a square with the circumference of a circle of radius 1.
pub(super) const HALF_EDGE: f32 = std::f32::consts::FRAC_PI_4;
/// Length from a joint, in sums of both radii, at which trunk and lateral should be apart.
const APART: f32 = 3.0;
/// Height of the first ring above the trunk, in radii of the lateral.
const CLEARANCE: f32 = 0.25;

/// Where a lateral leaves its trunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exit {
    /// The lateral.
    pub lateral: u32,
    /// Length along the trunk of the middle of the opening.
    pub length: f32,
    /// The lateral's radius where it begins.
    pub radius: f32,
    /// The point where the lateral's centre line breaks through.
    pub point: Vec3,
    /// Half the opening's length along the trunk.
    pub half: f32,
    /// Sine of the angle between trunk and lateral.
    pub slope: f32,
    /// Whether it stays so near the trunk that their surfaces meet some way from the joint.
    pub is_flat: bool,
}

impl Exit {
    /// The exit of a lateral from its trunk at a joint, which is a length along the trunk.
    pub fn new(lateral: u32, trunk: &Curve, joint: f32, curve: &Curve) -> Self {
        let (here, base) = (trunk.at(joint), curve.at(0.0));
        let radius = curve.radius_at(0.0);
        // The direction in which it leaves, not that of a first segment within the trunk.
        let aim = curve.at((here.radius + 0.5 * radius).min(curve.length()));
        let direction = unit(aim.center - base.center).unwrap_or(base.ahead);
        let cosine = direction.dot(here.ahead);
        let slope = (1.0 - cosine * cosine).max(0.0).sqrt().max(LEAST_SLOPE);
        let offset = (base.center - here.center).dot(here.ahead);
        let length = (joint + offset + here.radius * cosine / slope).clamp(0.0, trunk.length());
        let point = base.center + direction * (here.radius / slope);
        let runs_beside = |side: f32| {
            let way = APART * (here.radius + radius);
            let beside = trunk.at(joint + side * way);
            curve.at(way).center.distance(beside.center) < beside.radius + radius
        };
        let is_flat = slope <= LEAST_SLOPE || runs_beside(1.0) || runs_beside(-1.0);
        Self { lateral, length, radius, point, half: HALF_EDGE * radius / slope.max(0.5), slope, is_flat }
    }

    /// Whether the lateral's centre line ends within the trunk.
    pub fn ends_within(&self, trunk: &Curve, curve: &Curve) -> bool {
        let tip = curve.at(curve.length());
        let station = trunk.at(self.length);
        let out = tip.center - station.center;
        let along = out.dot(station.ahead);
        let aside = (out - station.ahead * along).length();
        let is_beside = (0.0..=trunk.length()).contains(&(self.length + along));
        curve.length() < 4.0 * station.radius && is_beside && aside < station.radius
    }

    /// The angle of the opening around a station of the trunk.
    pub fn angle(&self, station: &Station) -> f32 {
        let out = across(self.point - station.center, station.ahead);
        ops::atan2(out.dot(station.up()), out.dot(station.right))
    }

    /// Length along the lateral at which it is clear of a trunk of this radius around a station.
    pub fn lift(&self, curve: &Curve, station: &Station, radius: f32) -> f32 {
        // Half of the angle between the lateral and the way straight out: the first ring is tilted by that much.
        let tilt = 0.5 * ops::acos(self.slope.min(1.0));
        let height = radius + self.radius * (CLEARANCE + ops::sin(tilt));
        let most = 2.0 * height / self.slope;
        let mut lift = height / self.slope;
        // The lateral may bend: a few steps towards the length at which it has that height.
        for _ in 0..4 {
            let center = curve.at(lift).center - station.center;
            let out = (center - station.ahead * station.ahead.dot(center)).length();
            lift = (lift + (height - out) / self.slope).clamp(0.5 * height, most);
        }
        // A lateral that hardly leaves the trunk ends where it would end.
        lift.min(curve.length().max(height.min(most)))
    }
}
