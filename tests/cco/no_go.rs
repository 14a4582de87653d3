//! No segment leads through what is forbidden, between its nodes either.

use crate::{arteries, common::torus::torus, oracle::check, settings};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    mesh::IndexedMesh,
    tissue::{Ball, Disc, MeshVolume, NoGoField, NoGoRegion, NoGoTissue, Tissue},
};
use std::sync::Arc;

fn grow(name: &str, tissue: Arc<dyn Tissue>, field: NoGoField, terminals: u32, root: Vec3) {
    let settings = settings(&*tissue, terminals);
    let tissue = Arc::new(NoGoTissue::new(tissue, field).expect("a field over a tissue"));
    let mut growth = arteries(tissue, settings, root, 3);
    growth.run().unwrap_or_else(|error| panic!("{name}: {error}"));
    check(name, &growth);
}

#[test]
fn vessels_go_around_walls_that_are_thinner_than_they_are_long() {
    // A wall with a gap, which nearly every way from the root would cross.
    let wall = |size: Vec3| NoGoRegion::Cuboid { center: Vec3::Y * 0.2, size };
    let disc: Arc<dyn Tissue> = Arc::new(Disc::flat(0.5).expect("a disc"));
    let thin = NoGoField::regions([wall(Vec3::new(0.7, 0.002, 0.1))]).expect("a wall");
    grow("a wall in a disc", disc, thin, 120, Vec3::Y * 0.5);
    let ball: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    let plate = NoGoField::regions([wall(Vec3::new(0.6, 0.002, 0.6))]).expect("a plate");
    grow("a plate in a ball", Arc::clone(&ball), plate, 150, Vec3::Y * 0.5);
    let core = NoGoField::regions([NoGoRegion::Ball { center: Vec3::ZERO, radius: 0.25 }]).expect("a core");
    grow("a core", Arc::clone(&ball), core, 150, Vec3::Y * 0.5);
    let slab = NoGoField::function(|at| (0.1..0.11).contains(&at.y) && at.x < 0.2);
    grow("a function", ball, slab, 150, Vec3::Y * 0.5);
}

#[test]
fn vessels_keep_out_of_what_is_painted() {
    let mesh = torus();
    let indexed = IndexedMesh::new(mesh.clone());
    // A quarter of the ring.
    let painted: Vec<bool> = mesh.positions().iter().map(|at| at.x > 0.0 && at.y > 0.0).collect();
    let field = NoGoField::on_vertices(&indexed, &painted).expect("painted vertices");
    let tissue: Arc<dyn Tissue> = Arc::new(MeshVolume::new(&mesh, 40).expect("a volume"));
    grow("painted", tissue, field, 80, Vec3::new(-0.5, 0.0, 0.0));
}
