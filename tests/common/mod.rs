//! Tissues that several tests grow vessels in.

use bevy_math::{Quat, Vec2, Vec3};
use bevy_vessels::synthesis::{
    mesh::TriangleMesh,
    roots::{RootPlacement, Roots},
    tissue::{Ball, Cuboid, Disc, Ellipsoid, MeshSurface, MeshVolume, Rectangle, Tissue},
};
use std::{f32::consts::TAU, sync::Arc};

/// A tissue of about unit size, with a root for each system.
pub struct Case {
    /// What messages call it.
    pub name: &'static str,
    /// The tissue.
    pub tissue: Arc<dyn Tissue>,
    /// One arterial root, and a venous one beside it.
    pub roots: Roots,
}

impl Case {
    fn new(name: &'static str, tissue: impl Tissue + 'static) -> Self {
        let arterial = RootPlacement::Nearest(vec![Vec3::new(-0.5, 0.0, 0.0)]);
        let venous = RootPlacement::Nearest(vec![Vec3::new(-0.495, 0.05, 0.0)]);
        Self { name, tissue: Arc::new(tissue), roots: Roots { arterial, venous, given: [None, None] } }
    }
}

/// A closed mesh that bends both ways.
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

/// One tissue of each kind.
pub fn tissues() -> Vec<Case> {
    vec![
        Case::new("disc", Disc::flat(0.5).expect("a disc")),
        Case::new("rectangle", Rectangle::flat(Vec2::new(1.0, 0.6)).expect("a rectangle")),
        Case::new("ball", Ball::new(Vec3::ZERO, 0.5).expect("a ball")),
        Case::new("box", Cuboid::new(Vec3::ZERO, Vec3::new(1.0, 0.5, 0.3)).expect("a box")),
        Case::new("ellipsoid", Ellipsoid::new(Vec3::ZERO, Vec3::new(0.5, 0.3, 0.2)).expect("an ellipsoid")),
        Case::new("mesh surface", MeshSurface::new(torus()).expect("a surface")),
        Case::new("mesh volume", MeshVolume::new(&torus(), 40).expect("a volume")),
    ]
}
