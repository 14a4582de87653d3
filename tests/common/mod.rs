//! Tissues for several tests.

pub mod torus;

use bevy_math::{Vec2, Vec3};
use bevy_vessels::synthesis::{
    roots::{RootPlacement, RootPlacements, Roots},
    tissue::{Ball, Cuboid, Disc, Ellipsoid, MeshSurface, MeshVolume, Rectangle, Tissue},
};
use std::sync::Arc;
use torus::torus;

/// A tissue of about unit size, with a root for each kind of vessels.
pub struct Case {
    /// Its name in messages.
    pub name: &'static str,
    /// The tissue.
    pub tissue: Arc<dyn Tissue>,
    /// One arterial root, and a venous one beside it.
    pub roots: Roots,
}

impl Case {
    fn new(name: &'static str, tissue: impl Tissue + 'static) -> Self {
        let artery = RootPlacement::Nearest(vec![Vec3::new(-0.5, 0.0, 0.0)]);
        let vein = RootPlacement::Nearest(vec![Vec3::new(-0.495, 0.05, 0.0)]);
        let roots = RootPlacements { artery, vein, ..RootPlacements::default() }.into();
        Self { name, tissue: Arc::new(tissue), roots }
    }
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
