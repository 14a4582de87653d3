//! Constrained constructive optimisation: what every tree must be, in comparison with plain computations and with what
//! OpenCCO gives.

mod beyond;
mod extremes;
mod files;
mod given_radii;
mod no_go;
mod oracle;
mod organs;
mod quality;
mod radii;
mod requests;
mod steps;

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/shared.rs"]
mod shared;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings},
    roots::{RootPlacement, RootPlacements},
    tissue::{Ball, Extent, Tissue},
    tree::{VesselKind, hash_trees},
};
use oracle::check;
use std::sync::Arc;

/// Arteries from one root, the tissue's nearest point to `root`.
fn arteries(tissue: Arc<dyn Tissue>, settings: CcoSettings, root: Vec3, seed: u64) -> Cco {
    let artery = RootPlacement::Nearest(vec![root]);
    let roots = RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() };
    Cco::new(tissue, settings, &roots.into(), seed).expect("a growth")
}

/// Arteries and veins beside each other.
fn arteries_and_veins(tissue: Arc<dyn Tissue>, settings: CcoSettings, roots: [Vec3; 2], seed: u64) -> Cco {
    let [artery, vein] = roots.map(|root| RootPlacement::Nearest(vec![root]));
    let roots = RootPlacements { artery, vein, ..RootPlacements::default() };
    Cco::new(tissue, settings, &roots.into(), seed).expect("a growth")
}

/// Settings for a tissue of unit size: vessels as thin as those of OpenCCO in relation to it.
fn settings(tissue: &dyn Tissue, terminals: u32) -> CcoSettings {
    let perfusion = match tissue.extent() {
        Extent::Volume(_) => 20_000.0 * (terminals as f32).sqrt(),
        _ => 20_000.0,
    };
    CcoSettings { terminals, perfusion, ..CcoSettings::default() }
}

#[test]
fn every_tree_is_sound_in_every_tissue() {
    for case in common::tissues() {
        if case.name == "mesh surface" {
            continue;
        }
        for gamma in [3.0, 2.55] {
            let settings = CcoSettings { bifurcation_exponent: gamma, ..settings(&*case.tissue, 300) };
            println!("{}, exponent {gamma}", case.name);
            let mut growth = arteries(Arc::clone(&case.tissue), settings, Vec3::new(-0.5, 0.0, 0.0), 3);
            growth.run().unwrap_or_else(|error| panic!("{}: {error}", case.name));
            check(case.name, &growth);
        }
    }
}

#[test]
fn trees_of_two_kinds_avoid_each_other() {
    let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    let settings = settings(&*tissue, 400);
    let mut growth = arteries_and_veins(tissue, settings, [Vec3::Y * 0.5, Vec3::new(0.1, 0.49, 0.0)], 2);
    growth.run().expect("room for all");
    for kind in [VesselKind::Artery, VesselKind::Vein] {
        assert_eq!(growth.tree(kind).len(), 800);
    }
    check("two kinds", &growth);
}

#[test]
fn the_same_seed_gives_the_same_tree() {
    let grow = |seed| {
        let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
        let settings = settings(&*tissue, 200);
        let mut growth = arteries(tissue, settings, Vec3::Y * 0.5, seed);
        growth.run().expect("room for all");
        hash_trees([growth.tree(VesselKind::Artery)])
    };
    assert_eq!(grow(1), grow(1));
    assert_ne!(grow(1), grow(2));
}
