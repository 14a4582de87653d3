//! Meshes for tests.

use bevy_math::{Vec3, ops};
use std::f32::consts::TAU;

/// Positions and triangles.
pub(super) type Shape = (Vec<Vec3>, Vec<[u32; 3]>);

/// A torus around the z axis with radii 1 and 0.4, of `around` times `across` quads.
pub(super) fn torus(around: u32, across: u32) -> Shape {
    let vertex = |i: u32, j: u32| {
        let (sin, cos) = ops::sin_cos(TAU * i as f32 / around as f32);
        let (height, out) = ops::sin_cos(TAU * j as f32 / across as f32);
        let radius = 1.0 + 0.4 * out;
        Vec3::new(radius * cos, radius * sin, 0.4 * height)
    };
    let number = |i: u32, j: u32| i % around * across + j % across;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (i, j) in (0..around).flat_map(|i| (0..across).map(move |j| (i, j))) {
        positions.push(vertex(i, j));
        let [a, b, c, d] = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    (positions, triangles)
}

/// A cube of side 2 with its lowest corner at a place.
pub(super) fn cube(at: Vec3) -> Shape {
    let corner = |i: u32| at + 2.0 * Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

/// Two shapes in one mesh; vertices at the same position become one.
pub(super) fn joined(first: Shape, second: Shape) -> Shape {
    let (mut positions, mut triangles) = first;
    let mut number = |position: Vec3| {
        let found = positions.iter().position(|&other| other == position);
        found.unwrap_or_else(|| {
            positions.push(position);
            positions.len() - 1
        }) as u32
    };
    let numbers: Vec<u32> = second.0.into_iter().map(&mut number).collect();
    triangles.extend(second.1.iter().map(|corners| corners.map(|corner| numbers[corner as usize])));
    (positions, triangles)
}
