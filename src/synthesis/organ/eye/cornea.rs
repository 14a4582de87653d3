//! The cornea: a closed shell of clear tissue, thicker at its rim, which lies in the sclera.
//!
//! Two charts: its front and its back, each seen from its own side.

use super::shape::Shape;
use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{linear, mix, rings::Rings, smooth_step},
};
use bevy_math::{Vec2, Vec3, ops};
use std::f32::consts::TAU;

/// Middle of the charts, and their radius.
const FRONT: Vec2 = Vec2::new(0.25, 0.5);
const BACK: Vec2 = Vec2::new(0.75, 0.5);
const RADIUS: f32 = 0.24;
/// How far the rim reaches into the sclera, and how far below its surface it lies there, as shares of the limbus' radius.
const RIM: f32 = 0.03;

/// The shell, with edges of about a length.
pub(super) fn cornea(shape: &Shape, edge: f32) -> ShadedMesh {
    let steps = ((1.15 * shape.limbus_radius / (0.866 * edge)).round() as usize).max(4);
    let mut rings = Rings::default();
    let add = |rings: &mut Rings, [radius, z]: [f32; 2], share: f32, chart: Vec2| {
        let count = match radius > 0.0 {
            true => 6 * ((TAU * radius / (6.0 * edge)).round() as usize).max(1),
            false => 1,
        };
        let color = mix(linear([250, 252, 252]), linear([150, 158, 166]), smooth_step(0.82, 1.0, share));
        rings.add((0..count).map(|place| {
            let around = TAU * place as f32 / count as f32;
            let [sine, cosine] = [ops::sin(around), ops::cos(around)];
            (Vec3::new(radius * cosine, radius * sine, z), uv(chart, share, around), color)
        }));
        count
    };
    // The rim is the last ring of the front.
    let share = |step: usize| step as f32 / (steps + 1) as f32;
    for step in 0..=steps {
        add(&mut rings, shape.cornea(step as f32 / steps as f32), share(step), FRONT);
    }
    let on_rim = add(&mut rings, rim(shape), 1.0, FRONT);
    rings.begin_chart(|place| uv(BACK, 1.0, TAU * place as f32 / on_rim as f32));
    for step in (0..=steps).rev() {
        add(&mut rings, inner(shape, step as f32 / steps as f32), share(step), BACK);
    }
    rings.finish()
}

/// Where the rim lies in the sclera.
fn rim(shape: &Shape) -> [f32; 2] {
    let reach = RIM * shape.limbus_radius;
    let point = shape.beyond_limbus(reach, 0.0);
    [point.x, point.z - reach]
}

/// The back of the cornea, below a point of its front.
fn inner(shape: &Shape, share: f32) -> [f32; 2] {
    let [radius, z] = shape.cornea(share);
    let [centre, rim] = shape.corneal_thickness;
    let thickness = centre + (rim - centre) * share * share;
    let sine = radius / shape.corneal_radius;
    [radius - thickness * sine, z - thickness * (1.0 - sine * sine).max(0.0).sqrt()]
}

/// Not mirrored, seen from the chart's own side; v points down.
fn uv(chart: Vec2, share: f32, around: f32) -> Vec2 {
    let side = if chart == BACK { -1.0 } else { 1.0 };
    chart + RADIUS * share * Vec2::new(side * ops::cos(around), -ops::sin(around))
}
