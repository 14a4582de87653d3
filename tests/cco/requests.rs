//! Requests that cannot be fulfilled are refused by name, and a growth that gets stuck keeps what it has.

use crate::{arteries, common, oracle::check_overlaps};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoError, CcoSettings, VesselFlow},
    growth::Growth,
    roots::{RootPlacement, RootPlacements},
    tissue::{Ball, Disc, Tissue},
    tree::VesselKind,
    units::{Flow, Pressure, Viscosity},
};
use std::sync::Arc;

fn disc() -> Arc<dyn Tissue> {
    Arc::new(Disc::flat(0.5).expect("a disc"))
}

#[test]
fn settings_outside_their_limits_are_named() {
    let base = CcoSettings::default();
    let with_flow = |change: fn(&mut VesselFlow)| {
        let mut settings = base.clone();
        change(&mut settings.flow.artery);
        settings
    };
    let cases = [
        ("terminals", CcoSettings { terminals: 0, ..base.clone() }),
        ("terminals", CcoSettings { terminals: u32::MAX, ..base.clone() }),
        ("perfusion", CcoSettings { perfusion: 0.0, ..base.clone() }),
        ("perfusion", CcoSettings { perfusion: f32::NAN, ..base.clone() }),
        ("bifurcation_exponent", CcoSettings { bifurcation_exponent: 0.0, ..base.clone() }),
        ("bifurcation_exponent", CcoSettings { bifurcation_exponent: f32::INFINITY, ..base.clone() }),
        ("viscosity", with_flow(|flow| flow.viscosity = Viscosity::ZERO)),
        ("rate", with_flow(|flow| flow.rate = Flow::ZERO)),
        ("terminal_pressure", with_flow(|flow| flow.terminal_pressure = Pressure::from_mmhg(120.0))),
        ("root_pressure", with_flow(|flow| flow.root_pressure = Pressure::from_mmhg(f64::NAN))),
        ("flow_spread", CcoSettings { flow_spread: 1.0, ..base.clone() }),
        ("flow_spread", CcoSettings { flow_spread: f32::NAN, ..base.clone() }),
        ("border_distance", CcoSettings { border_distance: -1.0, ..base.clone() }),
        ("candidates", CcoSettings { candidates: 0, ..base.clone() }),
        ("tolerance", CcoSettings { tolerance: f32::NAN, ..base.clone() }),
        ("polish_sweeps", CcoSettings { polish_sweeps: 1000, ..base.clone() }),
    ];
    for (name, settings) in cases {
        let error = settings.validate().expect_err(name).to_string();
        assert!(error.contains(name), "{error}");
        let roots = RootPlacements { vein: RootPlacement::None, ..RootPlacements::default() };
        assert!(matches!(Cco::new(disc(), settings, &roots.into(), 1), Err(CcoError::Settings(_))), "{name}");
    }
    assert!(base.validate().expect("defaults are valid").is_empty());
}

#[test]
fn a_surface_a_distant_root_and_no_root_are_refused() {
    let surface = common::tissues().into_iter().find(|case| case.name == "mesh surface").expect("a surface");
    let error = Cco::new(surface.tissue, CcoSettings::default(), &surface.roots, 1).expect_err("a surface");
    assert!(error.to_string().contains("curved surface"), "{error}");
    let start = |artery| {
        let roots = RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() };
        Cco::new(disc(), CcoSettings::default(), &roots.into(), 1).expect_err("no growth")
    };
    assert!(matches!(start(RootPlacement::Exact(vec![Vec3::X * 3.0])), CcoError::Roots(_)));
    assert!(matches!(start(RootPlacement::Exact(vec![Vec3::NAN])), CcoError::Roots(_)));
    assert_eq!(start(RootPlacement::None), CcoError::NoRoot);
    let error = start(RootPlacement::Spread(2000));
    assert!(matches!(error, CcoError::TooFewTerminals { needed: 2000, .. }), "{error}");
}

#[test]
fn a_vessel_wider_than_the_tissue_is_refused() {
    let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    let settings = CcoSettings { perfusion: 0.001, ..CcoSettings::default() };
    let roots = RootPlacements { vein: RootPlacement::None, ..RootPlacements::default() };
    let error = Cco::new(tissue, settings, &roots.into(), 1).expect_err("no room");
    assert!(matches!(error, CcoError::NoFirstVessel { kind: VesselKind::Artery, .. }), "{error}");
}

#[test]
fn a_full_tissue_keeps_a_valid_tree_and_says_what_was_reached() {
    let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    // Vessels so thick that few fit.
    let settings = CcoSettings { perfusion: 150.0, terminals: 2000, ..CcoSettings::default() };
    let mut growth = arteries(tissue, settings, Vec3::Y * 0.5, 1);
    let error = growth.run().expect_err("no room for all");
    let CcoError::NoRoom { reached, wanted: 2000, .. } = error else { panic!("{error}") };
    assert!(reached > 1 && reached < 2000, "{error}");
    assert_eq!(growth.tree(VesselKind::Artery).len(), 2 * reached as usize);
    assert_eq!((&growth as &dyn Growth).progress().done, (&growth as &dyn Growth).progress().all);
    check_overlaps("full", &growth);
}

#[test]
fn a_growth_left_early_has_a_valid_tree() {
    let mut growth = arteries(disc(), CcoSettings::default(), Vec3::Y * 0.5, 1);
    for _ in 0..100 {
        growth.advance();
    }
    growth.settle();
    let tree = growth.tree(VesselKind::Artery);
    tree.validate().expect("a valid tree");
    assert!(tree.len() > 50);
    assert!(tree.murray_residual(3.0) <= 1e-6);
}
