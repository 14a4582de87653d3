//! The ends of vessels: some narrowing rings, and a grid of quads that closes the last one. There is never a pole.

use super::cage::{Cage, uv_of};
use super::rings::Ring;
use super::settings::TipCap;
use bevy_math::{Vec2, Vec3};

/// Which end of a trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Base,
    Tip,
}

/// Heights and widths of the rings of a round end, in radii, by the logarithm of the sides over 4; fitted so that the
/// limit is nearest to half a ball.
const ROUND: [&[[f32; 2]]; 3] =
    [&[[0.987, 1.002]], &[[0.329, 1.022], [0.987, 0.472]], &[[0.420, 1.023], [0.978, 0.372]]];
/// The same of a pointed end.
const POINTED: [&[[f32; 2]]; 3] = [
    &[[1.2, 0.72], [2.6, 0.3], [3.0, 0.12]],
    &[[1.2, 0.72], [2.6, 0.26], [3.0, 0.1]],
    &[[1.2, 0.7], [2.6, 0.24], [3.0, 0.1]],
];

/// Closes a ring.
pub(super) fn add(cage: &mut Cage, ring: &Ring, base: u32, end: End, tip: TipCap, node: u32) {
    let sign = if end == End::Tip { 1.0 } else { -1.0 };
    let size = (ring.sides.ilog2() as usize - 2).min(2);
    let profile = match tip {
        TipCap::Round => ROUND[size],
        TipCap::Pointed => POINTED[size],
    };
    let radius = ring.station.radius;
    let (sides, mut below, mut length) = (ring.sides, base, ring.length);
    let (ahead, center) = (ring.station.ahead * sign, ring.station.center);
    let rim: Vec<Vec3> = (0..sides).map(|side| cage.vertices.positions[(base + side) as usize] - center).collect();
    for &[height, width] in profile {
        let above = cage.vertices.positions.len() as u32;
        for out in &rim {
            // The rim may be slanted; the rings above it stand straighter.
            let flat = *out - ahead * ahead.dot(*out) * height.min(1.0);
            cage.vertices.push(center + flat * width + ahead * (height * radius), radius * width, node);
        }
        let next_length = ring.length + sign * height * radius;
        for line in 0..sides {
            let next = (line + 1) % sides;
            let corners = [below + line, below + next, above + next, above + line];
            let [low, high] = [length, next_length];
            let uv = |length: f32, line: u32| uv_of(&ring.station, length, line, sides);
            face(cage, end, corners, [uv(low, line), uv(low, line + 1), uv(high, line + 1), uv(high, line)]);
        }
        (below, length) = (above, next_length);
    }
    close(cage, end, below, length, ring, node);
}

fn face(cage: &mut Cage, end: End, mut corners: [u32; 4], mut uvs: [Vec2; 4]) {
    if end == End::Base {
        corners.reverse();
        uvs.reverse();
    }
    cage.face(corners, uvs);
}

/// Fills a ring of 4w vertices with w × w quads.
fn close(cage: &mut Cage, end: End, base: u32, length: f32, ring: &Ring, node: u32) {
    let sides = ring.sides;
    let width = sides / 4;
    let at = |cage: &Cage, line: u32| cage.vertices.positions[(base + line % sides) as usize];
    let inner = cage.vertices.positions.len() as u32;
    for y in 1..width {
        for x in 1..width {
            let [s, t] = [x, y].map(|step| step as f32 / width as f32);
            // Transfinite interpolation of the four edges.
            let edges = at(cage, x) * (1.0 - t)
                + at(cage, 3 * width - x) * t
                + at(cage, 4 * width - y) * (1.0 - s)
                + at(cage, width + y) * s;
            let corners = (at(cage, 0) * (1.0 - s) + at(cage, width) * s) * (1.0 - t)
                + (at(cage, 3 * width) * (1.0 - s) + at(cage, 2 * width) * s) * t;
            let radius = ring.station.radius * 0.3;
            cage.vertices.push(edges - corners, radius, node);
        }
    }
    let vertex = |x: u32, y: u32| match (x, y) {
        (x, 0) => base + x,
        (x, y) if x == width => base + width + y,
        (x, y) if y == width => base + 3 * width - x,
        (0, y) => base + (4 * width - y) % sides,
        (x, y) => inner + (y - 1) * (width - 1) + x - 1,
    };
    let uv = |cage: &Cage, vertex: u32| {
        let station = ring.station;
        let out = cage.vertices.positions[vertex as usize] - station.center;
        Vec2::new(out.dot(station.right), length + out.dot(station.up()))
    };
    for y in 0..width {
        for x in 0..width {
            let corners = [vertex(x, y), vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)];
            let uvs = corners.map(|corner| uv(cage, corner));
            face(cage, end, corners, uvs);
        }
    }
}
