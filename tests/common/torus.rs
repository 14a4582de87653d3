//! An organ of triangles with positive and negative curvature.

use bevy_math::{Quat, Vec3};
use bevy_vessels::synthesis::mesh::TriangleMesh;
use std::f32::consts::TAU;

/// A closed mesh with positive and negative curvature.
pub fn torus() -> TriangleMesh {
    const AROUND: u32 = 40;
    const ACROSS: u32 = 20;
    let angle = |step: u32, steps: u32| TAU * step as f32 / steps as f32;
    let ring = |i: u32| {
        let turned = Quat::from_rotation_z(angle(i, AROUND));
        (0..ACROSS).map(move |j| {
            let tube = Quat::from_rotation_y(-angle(j, ACROSS)) * Vec3::X;
            turned * (0.35 * Vec3::X + 0.15 * tube)
        })
    };
    let corner = |i: u32, j: u32| (i % AROUND) * ACROSS + j % ACROSS;
    let quads = (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j)));
    let triangles = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    TriangleMesh::new((0..AROUND).flat_map(ring).collect(), triangles.collect(), None).expect("a torus")
}
