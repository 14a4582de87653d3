//! Where a lateral leaves its trunk: the room that the opening needs.
//!
//! A lateral of radius r, at an angle θ to a trunk of radius R, breaks through the trunk's surface R·cot θ further along
//! the trunk, over a length of r / sin θ to both sides, and is clear of it (R + r·|cos θ|) / sin θ from the trunk's centre
//! line, measured along the lateral: the room of Skjermo & Eidheim 2005, equation 4.
//!
//! One that leaves so flat that this lies far away is followed along both curves to where it is clear.

use super::curve::Curve;
use super::direction::{across, unit};
use super::parting::{CLEAR, Parting};
use super::spline::Station;
use bevy_math::{Vec3, ops};
use std::f32::consts::FRAC_1_SQRT_2;

/// The least sine of the angle between trunk and lateral that counts: 20°.
const LEAST_SLOPE: f32 = 0.35;
/// Half the edge of a square with the circumference of a circle of radius 1.
pub(super) const HALF_EDGE: f32 = std::f32::consts::FRAC_PI_4;
/// Length from a joint, in sums of both radii, at which trunk and lateral should be apart: at an angle of 20°, and of
/// twice as much.
const APART: f32 = 3.0;
const WELL_APART: f32 = 1.5;
/// Height of the first ring above the trunk, in radii of the lateral.
const CLEARANCE: f32 = CLEAR - 1.0;

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
    /// Where it is clear of its trunk, if it leaves so flat that it runs beside it for some way.
    pub parting: Option<Parting>,
    /// Whether its faces may meet those of the trunk: it leaves near to one side of it, or ends near to it.
    pub is_tight: bool,
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
        let runs_beside = |way: f32| {
            let way = way * (here.radius + radius);
            let is_near = |station: &Station| curve.at(way).center.distance(station.center) < station.radius + radius;
            is_near(&trunk.at(joint + way)) || is_near(&trunk.at(joint - way))
        };
        let half = HALF_EDGE * radius / slope.max(0.5);
        let is_tight = runs_beside(WELL_APART);
        let mut exit = Self { lateral, length, radius, point, half, slope, parting: None, is_tight };
        if curve.length() < exit.usual_reach(here.radius) {
            exit.is_tight = true;
            exit.follow(trunk, joint, curve);
        } else if slope <= LEAST_SLOPE || runs_beside(APART) {
            exit.follow(trunk, joint, curve);
        }
        exit
    }

    /// Length of the lateral within which it is clear of a trunk of this radius, unless one of both bends.
    fn usual_reach(&self, radius: f32) -> f32 {
        2.0 * (radius + self.radius) / self.slope
    }

    /// Moves the opening to where the lateral parts from the trunk, if that is farther away.
    fn follow(&mut self, trunk: &Curve, joint: f32, curve: &Curve) {
        let parting = Parting::find(trunk, joint, curve);
        let is_far = parting.on_lateral > self.usual_reach(trunk.at(joint).radius);
        if parting.is_clear && self.slope > LEAST_SLOPE && !is_far {
            return;
        }
        let station = trunk.at(parting.on_trunk);
        let center = curve.at(parting.on_lateral).center;
        let out = across(center - station.center, station.ahead);
        // It leaves by a stub that rises at 45° or more.
        self.slope = self.slope.max(FRAC_1_SQRT_2);
        let onward = curve.at(parting.on_lateral).ahead.dot(station.ahead).signum();
        let run = (1.0 - self.slope * self.slope).max(0.0).sqrt() / self.slope;
        self.length = (parting.on_trunk - onward * run * self.radius * CLEAR).clamp(0.0, trunk.length());
        let opening = trunk.at(self.length);
        self.point = opening.center + across(out, opening.ahead) * opening.radius;
        self.half = HALF_EDGE * self.radius / self.slope;
        self.parting = Some(parting);
    }

    /// Whether the lateral's centre line ends within the trunk.
    pub fn ends_within(&self, trunk: &Curve, curve: &Curve) -> bool {
        if let Some(parting) = self.parting {
            return parting.ends_within;
        }
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
        station.angle_of(across(self.point - station.center, station.ahead))
    }

    /// Length along the lateral at which it is clear of a trunk of this radius around a station.
    pub fn lift(&self, curve: &Curve, station: &Station, radius: f32) -> f32 {
        if let Some(parting) = self.parting {
            return parting.on_lateral;
        }
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
