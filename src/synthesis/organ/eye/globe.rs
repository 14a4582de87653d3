//! The eyeball: sclera, the stump of the optic nerve, and the dish behind cornea and iris, as one closed surface.
//!
//! Two charts: seen from the front, the dish and round it the sclera to beyond its equator; and the back. Around the
//! optical axis they are polar, with texels near square over all of the sclera that lids uncover.

use super::shape::Shape;
use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{linear, mix, noise::Noise, rings::Rings, smooth_step},
};
use bevy_math::{Vec2, Vec3, ops};
use std::{
    f32::consts::{PI, TAU},
    ops::Range,
};

/// Angle from the optical axis at which the front chart ends, in radians: beyond the fornices.
const BORDER: f32 = 1.75;
/// Middle and radius of the charts.
const FRONT: (Vec2, f32) = (Vec2::new(0.409, 0.409), 0.405);
const BACK: (Vec2, f32) = (Vec2::new(0.831, 0.831), 0.165);
/// Between a polar chart of true distances (0) and one of true angles (1): texels are up to 1.2 times as wide as long, and
/// those at the equator half as large as those at the limbus.
const CONFORMAL: f32 = 0.75;
/// Depth of the dish behind the root of the iris, as a share of the limbus' radius.
const DISH: f32 = 0.35;

/// The mesh of the eyeball. The triangles of the conjunctiva's side, from the limbus to the end of the front chart, are
/// the range.
pub(super) fn globe(shape: &Shape, edge: f32, colours: Noise) -> (ShadedMesh, Range<usize>) {
    let mut rings = Rings::default();
    let limbus = shape.limbus_angle();
    let add = |rings: &mut Rings, at: Place| {
        let count = count(at.length_around(shape), edge);
        rings.add((0..count).map(|place| {
            let around = TAU * place as f32 / count as f32;
            let point = at.point(shape, around);
            (point, at.uv(shape, around), at.colour(shape, point, around, colours))
        }));
        count
    };
    // More rings towards the edge of the dish, where it turns.
    let dish = steps(1.35 * shape.limbus_radius, edge).max(4);
    for step in 0..dish {
        add(&mut rings, Place::Dish(step as f32 / dish as f32));
    }
    let front = steps(shape.distance_from_limbus(BORDER), edge).max(4);
    let mut outer = 0..0;
    let mut on_border = 0;
    for step in 0..=front {
        on_border = add(&mut rings, Place::Front(limbus + (BORDER - limbus) * step as f32 / front as f32));
        outer.start = if step == 0 { rings.triangles() } else { outer.start };
    }
    outer.end = rings.triangles();
    rings.begin_chart(|place| Place::Back(BORDER).uv(shape, TAU * place as f32 / on_border as f32));
    let back = steps(shape.distance_from_limbus(PI) - shape.distance_from_limbus(BORDER), edge).max(4);
    for step in 1..=back {
        add(&mut rings, Place::Back(BORDER + (PI - BORDER) * step as f32 / back as f32));
    }
    (rings.finish(), outer)
}

/// Steps of a way, so that triangles are about equilateral.
fn steps(way: f32, edge: f32) -> usize {
    (way / (0.866 * edge)).round() as usize
}

/// Vertices of a ring: a multiple of 6, or one at a pole.
fn count(length: f32, edge: f32) -> usize {
    if length < 1e-3 * edge { 1 } else { 6 * ((length / (6.0 * edge)).round() as usize).max(1) }
}

/// A ring of the eyeball.
#[derive(Clone, Copy)]
enum Place {
    /// In the dish, at a share of the way from its middle to the limbus.
    Dish(f32),
    /// On the sclera, at an angle from the optical axis.
    Front(f32),
    /// The same, in the chart of the back.
    Back(f32),
}

impl Place {
    /// Length of the ring.
    fn length_around(self, shape: &Shape) -> f32 {
        match self {
            Self::Dish(share) => TAU * dish(shape, share)[0],
            Self::Front(angle) | Self::Back(angle) if angle < PI => {
                let point = shape.sclera(angle, 0.0);
                TAU * (point.x * point.x + point.y * point.y).sqrt()
            }
            Self::Front(_) | Self::Back(_) => 0.0,
        }
    }

    fn point(self, shape: &Shape, around: f32) -> Vec3 {
        match self {
            Self::Dish(share) => {
                let [radius, z] = dish(shape, share);
                Vec3::new(radius * ops::cos(around), radius * ops::sin(around), z)
            }
            Self::Front(angle) | Self::Back(angle) => shape.sclera(angle, around),
        }
    }

    /// Not mirrored: u is that of a picture from the front or from behind, v points down.
    fn uv(self, shape: &Shape, around: f32) -> Vec2 {
        let right = Vec2::new(ops::cos(around), -ops::sin(around));
        let reach = |angle: f32| ops::tan(0.5 * CONFORMAL * angle);
        match self {
            Self::Dish(share) => FRONT.0 + right * (FRONT.1 * share * reach(shape.limbus_angle()) / reach(BORDER)),
            Self::Front(angle) => FRONT.0 + right * (FRONT.1 * reach(angle) / reach(BORDER)),
            Self::Back(angle) => {
                BACK.0 + Vec2::new(-right.x, right.y) * (BACK.1 * reach(PI - angle) / reach(PI - BORDER))
            }
        }
    }

    fn colour(self, shape: &Shape, point: Vec3, around: f32, noise: Noise) -> [f32; 4] {
        let veil = linear([120, 128, 138]);
        let angle = match self {
            // The wall before the iris is the limbus from within.
            Self::Dish(_) => {
                let down = (shape.limbus_z - point.z) / (shape.limbus_z - shape.root_z);
                return mix(veil, linear([7, 4, 4]), smooth_step(0.4, 1.4, down));
            }
            Self::Front(angle) | Self::Back(angle) => angle,
        };
        let beyond = shape.distance_from_limbus(angle);
        let mottle = noise.rough(point / (0.15 * shape.axial_length));
        let white = mix(linear([238, 232, 224]), linear([232, 226, 214]), 0.5 + 0.5 * mottle);
        // Yellower and redder towards the corners of the eye; bluish where the sclera is thin, near the limbus.
        let corner = ops::cos(around) * ops::cos(around) * smooth_step(0.15, 0.4, beyond / shape.axial_length);
        let yellow = mix(white, linear([230, 206, 176]), 0.6 * corner);
        let thin = 1.0 - smooth_step(0.0, 0.12 * shape.axial_length, beyond);
        let bluish = mix(yellow, linear([214, 218, 224]), 0.45 * thin);
        let ragged = 1.0 + 0.25 * noise.at(point / (0.05 * shape.axial_length));
        let limbus = 1.0 - smooth_step(-0.1, 0.9, beyond / (shape.limbus_width * ragged));
        let sclera = mix(bluish, veil, 0.85 * limbus);
        let behind = mix(sclera, linear([216, 184, 164]), smooth_step(1.5, 2.1, angle));
        mix(behind, linear([226, 208, 186]), shape.nerve_share(point))
    }
}

/// Distance from the optical axis and along it, in the dish: flat in the middle, upright at the limbus.
fn dish(shape: &Shape, share: f32) -> [f32; 2] {
    let depth = shape.limbus_z - shape.root_z + DISH * shape.limbus_radius;
    // Points of a superellipse, x⁴ + y⁴ = 1, at equal angles from its middle: dense where it turns.
    let angle = share * std::f32::consts::FRAC_PI_2;
    let [x, y] = [ops::sin(angle), ops::cos(angle)];
    let scale = 1.0 / ((x * x * x * x + y * y * y * y).sqrt().sqrt());
    if share >= 1.0 {
        return [shape.limbus_radius, shape.limbus_z];
    }
    [shape.limbus_radius * x * scale, shape.limbus_z - depth * (y * scale).max(0.0)]
}
