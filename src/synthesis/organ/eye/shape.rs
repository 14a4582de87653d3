//! The dimensions of an eye, and where its surfaces lie.

use super::settings::EyeSettings;
use crate::synthesis::{
    organ::{Laterality, smooth_step},
    random::VesselRng,
};
use bevy_math::{Vec3, ops};
use rand::RngExt;
use std::f32::consts::{FRAC_PI_2, PI};

/// Width and height of the eyeball, as shares of its axial length.
const WIDTH: f32 = 24.2 / 24.0;
const HEIGHT: f32 = 23.7 / 24.0;
/// Shares by which axial length, width, height, corneal diameter and radius, limbus and chamber vary. With them, eyes of
/// the default size stay within published ranges.
const VARIES: [f32; 7] = [0.03, 0.015, 0.015, 0.03, 0.03, 0.1, 0.08];
/// Angle, in radians, from which on the eyeball is as wide and as high as it gets: at the limbus it is round.
const FULL_WIDTH: f32 = 1.3;

/// How far the root of the iris lies behind the pupil's plane, and at least behind the limbus, as shares of the limbus'
/// radius.
const SLOPE: f32 = 0.03;
const BEHIND_LIMBUS: f32 = 0.12;

/// Angles between the back of the eyeball and the middle of the optic nerve: 15° to the nose, 3° up.
const NERVE: [f32; 2] = [15.0, 3.0];
/// Radius of the optic nerve in its sheath, its length from the eyeball to where it is cut, and the width of its rounded
/// edges, as shares of the axial length: 2 mm, 1.7 mm and 0.7 mm.
const NERVE_RADIUS: f32 = 0.083;
const NERVE_LENGTH: f32 = 0.07;
const NERVE_EDGE: f32 = 0.03;

/// The dimensions of an eye. Lengths are in metres, and the origin is the middle of the eyeball.
pub(super) struct Shape {
    pub side: Laterality,
    pub axial_length: f32,
    /// Half width and half height of the eyeball.
    across: [f32; 2],
    /// From the middle to the back, and to the front that the eyeball would have without a cornea.
    along: f32,
    /// Radius of the limbus and its distance before the middle.
    pub limbus_radius: f32,
    pub limbus_z: f32,
    pub limbus_width: f32,
    pub corneal_radius: f32,
    /// Thickness of the cornea at its apex and at the limbus.
    pub corneal_thickness: [f32; 2],
    pub pupil_radius: f32,
    /// The plane of the pupil, and that in which the iris ends in the eyeball's wall.
    pub pupil_z: f32,
    pub root_z: f32,
    /// Direction from the middle to where the optic nerve leaves.
    pub nerve: Vec3,
}

impl Shape {
    pub fn new(settings: &EyeSettings, rng: &mut VesselRng) -> Self {
        let vary = VARIES.map(|limit| 1.0 + settings.variation * rng.random_range(-limit..=limit));
        let axial_length = settings.axial_length * vary[0];
        let across = [WIDTH * vary[1], HEIGHT * vary[2]].map(|share| 0.5 * share * axial_length);
        let limbus_radius = 0.5 * settings.corneal_diameter * vary[3];
        let corneal_radius = settings.corneal_radius * vary[4];
        let bulge = corneal_radius - depth(corneal_radius, limbus_radius);
        // The back of the eyeball, the plane of the limbus and the apex add up to the axial length.
        let round = 0.5 * (across[0] + across[1]);
        let along = (axial_length - bulge) / (1.0 + depth(1.0, limbus_radius / round));
        let limbus_z = along * depth(1.0, limbus_radius / round);
        let corneal_thickness = [0.54, 0.67].map(|millimetres| millimetres / 24.0 * axial_length);
        let [to_nose, up] =
            NERVE.map(|degrees| (degrees + settings.variation * rng.random_range(-1.5..=1.5)).to_radians());
        let pupil_z = limbus_z + bulge - corneal_thickness[0] - settings.chamber_depth * vary[6];
        Self {
            side: settings.side,
            axial_length,
            across,
            along,
            limbus_radius,
            limbus_z,
            limbus_width: settings.limbus_width * vary[5],
            corneal_radius,
            corneal_thickness,
            pupil_radius: 0.5 * settings.pupil_diameter,
            pupil_z,
            root_z: (pupil_z - SLOPE * limbus_radius).min(limbus_z - BEHIND_LIMBUS * limbus_radius),
            nerve: Vec3::new(settings.side.medial() * ops::sin(to_nose), ops::sin(up), -ops::cos(to_nose)).normalize(),
        }
    }

    /// Angle of the limbus from the optical axis, in radians, as [`sclera`](Self::sclera) takes it.
    pub fn limbus_angle(&self) -> f32 {
        ops::asin(self.limbus_radius / self.mean_radius())
    }

    fn mean_radius(&self) -> f32 {
        0.5 * (self.across[0] + self.across[1])
    }

    /// The outer surface of the sclera at an angle from the optical axis and one around it, from x to y.
    pub fn sclera(&self, angle: f32, around: f32) -> Vec3 {
        let wide = smooth_step(self.limbus_angle(), FULL_WIDTH, angle);
        let mean = self.mean_radius();
        let [x, y] = self.across.map(|half| mean + (half - mean) * wide);
        let sine = ops::sin(angle);
        let point = Vec3::new(x * sine * ops::cos(around), y * sine * ops::sin(around), self.along * ops::cos(angle));
        point + point.normalize_or(-Vec3::Z) * self.nerve_height(point)
    }

    /// Height of the optic nerve's stump over the sclera.
    fn nerve_height(&self, point: Vec3) -> f32 {
        let away = self.away_from_nerve(point);
        let [radius, edge] = [NERVE_RADIUS, NERVE_EDGE].map(|share| share * self.axial_length);
        NERVE_LENGTH * self.axial_length * (1.0 - smooth_step(radius - edge, radius + edge, away))
    }

    /// Share of a point that belongs to the nerve and its sheath, not to the sclera.
    pub fn nerve_share(&self, point: Vec3) -> f32 {
        let [radius, edge] = [NERVE_RADIUS, NERVE_EDGE].map(|share| share * self.axial_length);
        1.0 - smooth_step(radius, radius + 1.5 * edge, self.away_from_nerve(point))
    }

    /// Distance of a point of the sclera from the nerve's middle, along the sclera; far away where it cannot matter.
    fn away_from_nerve(&self, point: Vec3) -> f32 {
        let direction = point.normalize_or(Vec3::Z);
        if direction.dot(self.nerve) < 0.0 {
            FRAC_PI_2 * self.along
        } else {
            direction.distance(self.nerve) * self.along
        }
    }

    /// The point of the sclera in a direction from the middle, in which there is no cornea.
    pub fn sclera_towards(&self, direction: Vec3) -> Vec3 {
        let [x, y] = self.across;
        let scaled = direction / Vec3::new(x, y, self.along);
        self.sclera(ops::acos((scaled.z / scaled.length()).clamp(-1.0, 1.0)), ops::atan2(scaled.y, scaled.x))
    }

    /// The sclera at a distance from the limbus along its surface, and an angle around the optical axis.
    pub fn beyond_limbus(&self, distance: f32, around: f32) -> Vec3 {
        self.sclera(self.angle_beyond_limbus(distance), around)
    }

    /// Angle from the optical axis at a distance from the limbus.
    pub fn angle_beyond_limbus(&self, distance: f32) -> f32 {
        (self.limbus_angle() + distance / self.mean_radius()).min(PI)
    }

    /// Distance of an angle from the limbus along the sclera, in metres; negative within.
    pub fn distance_from_limbus(&self, angle: f32) -> f32 {
        (angle - self.limbus_angle()) * self.mean_radius()
    }

    /// Distance of the cornea's front from the optical axis and along it, at a share of the way from apex to limbus.
    pub fn cornea(&self, share: f32) -> [f32; 2] {
        let angle = ops::asin(self.limbus_radius / self.corneal_radius);
        let radius = self.corneal_radius * ops::sin(share * angle);
        let height = depth(self.corneal_radius, radius) - depth(self.corneal_radius, self.limbus_radius);
        [radius, self.limbus_z + height]
    }
}

/// The other leg of a right triangle, given its longest side and one leg.
fn depth(hypotenuse: f32, leg: f32) -> f32 {
    (hypotenuse * hypotenuse - leg * leg).max(0.0).sqrt()
}
