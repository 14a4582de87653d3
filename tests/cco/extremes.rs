//! Odd requests: growth starts or reports what is wrong, always ends, and what it has grown is sound.

use crate::{
    common,
    oracle::{check, check_inside, check_overlaps},
};
use bevy_math::{UVec2, UVec3, Vec2, Vec3};
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings, VesselFlow},
    random::{Stream, VesselRng},
    roots::{RootPlacement, RootPlacements},
    tissue::{Ball, Cuboid, Disc, Mask, Tissue},
    tree::{ByKind, VesselKind},
    units::{Flow, Pressure, Viscosity},
};
use rand::RngExt;
use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, mpsc},
    thread,
    time::Duration,
};

const REQUESTS: u64 = 300;
/// Far longer than the slowest growth on any machine.
const HANGS_AFTER: Duration = Duration::from_secs(120);

fn one_root(artery: RootPlacement) -> RootPlacements {
    RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() }
}

#[test]
fn one_terminal_and_two_are_trees() {
    for case in common::tissues().into_iter().filter(|case| case.name != "mesh surface") {
        for terminals in [1, 2] {
            let settings = CcoSettings { flow_spread: 0.9, ..crate::settings(&*case.tissue, terminals) };
            let roots = one_root(RootPlacement::Spread(1)).into();
            let mut growth = Cco::new(Arc::clone(&case.tissue), settings, &roots, 5).expect("a growth");
            growth.run().unwrap_or_else(|error| panic!("{}: {error}", case.name));
            check_overlaps(case.name, &growth);
            check_inside(case.name, &growth);
            assert_eq!(growth.tree(VesselKind::Artery).len(), 2 * terminals as usize, "{}", case.name);
        }
    }
}

#[test]
fn a_mask_of_one_cell_holds_a_tree() {
    let flat = Mask::image(UVec2::ONE, Vec2::ONE, Vec3::ZERO, &[true]).expect("an image");
    let solid = Mask::voxels(UVec3::ONE, Vec3::new(1.0, 2.0, 0.5), Vec3::ZERO, &[true]).expect("a voxel");
    for tissue in [Arc::new(flat) as Arc<dyn Tissue>, Arc::new(solid)] {
        for terminals in [1, 2, 60] {
            let settings = crate::settings(&*tissue, terminals);
            let roots = one_root(RootPlacement::Spread(1)).into();
            let mut growth = Cco::new(Arc::clone(&tissue), settings, &roots, 1).expect("a growth");
            growth.run().expect("room for all");
            if terminals > 1 {
                check("one cell", &growth);
            }
        }
    }
}

#[test]
fn units_of_any_size_give_the_same_tree() {
    // Powers of two, which change no digit.
    let grow = |unit: f32| {
        let ball: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5 * unit).expect("a ball"));
        let roots = one_root(RootPlacement::Nearest(vec![Vec3::Y * unit])).into();
        let settings = CcoSettings { terminals: 60, perfusion: 200_000.0, ..CcoSettings::default() };
        let mut growth = Cco::new(ball, settings, &roots, 4).expect("a growth");
        growth.run().expect("room for all");
        check("units", &growth);
        let tree = growth.tree(VesselKind::Artery);
        (tree.parents().to_vec(), tree.positions().iter().map(|&at| at / unit).collect::<Vec<_>>())
    };
    let (parents, places) = grow(1.0);
    for unit in [-20, -3, 10, 20].map(|power: i32| 2.0_f32.powi(power)) {
        let (others, there) = grow(unit);
        assert_eq!(others, parents, "{unit}");
        assert!(places.iter().zip(&there).all(|(a, b)| a.distance(*b) < 1e-3), "{unit}");
    }
}

#[test]
fn a_tissue_too_far_from_the_origin_is_refused() {
    let start = |distance: f32| {
        let ball = Arc::new(Ball::new(Vec3::X * distance, 0.5).expect("a ball"));
        let roots = one_root(RootPlacement::Spread(1)).into();
        Cco::new(ball.clone(), crate::settings(&*ball, 30), &roots, 1)
    };
    let error = start(1.0e7).expect_err("too far away").to_string();
    assert!(error.contains("10000000") && error.contains("move it"), "{error}");
    let mut growth = start(5000.0).expect("a growth");
    growth.run().expect("room for all");
    check_overlaps("far away", &growth);
}

#[test]
fn a_growth_may_be_left_and_started_again_at_every_step() {
    let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    let settings = CcoSettings { polish_sweeps: 1, ..crate::settings(&*tissue, 40) };
    let roots: RootPlacements = one_root(RootPlacement::Spread(1));
    let mut whole = Cco::new(Arc::clone(&tissue), settings.clone(), &roots.clone().into(), 2).expect("a growth");
    whole.run().expect("room for all");
    let mut growth = Cco::new(tissue, settings.clone(), &roots.clone().into(), 2).expect("a growth");
    for left_after in 0..60 {
        growth.restart(settings.clone(), &roots.clone().into(), 2).expect("a growth");
        (0..left_after).for_each(|_| growth.advance());
        growth.settle();
        growth.tree(VesselKind::Artery).validate().expect("a valid tree");
        check_overlaps("left early", &growth);
        let mut copy = Cco::new(Arc::clone(growth.tissue()), settings.clone(), &roots.clone().into(), 2).expect("one");
        (0..left_after).for_each(|_| copy.advance());
        copy.run().expect("room for all");
        assert_eq!(copy.tree(VesselKind::Artery), whole.tree(VesselKind::Artery), "left after {left_after} steps");
    }
}

/// A number of any size, sometimes none that anything can have.
fn any(rng: &mut VesselRng, low: f64, high: f64) -> f64 {
    match rng.random_range(0..300) {
        0 => 0.0,
        1 => f64::NAN,
        2 => f64::INFINITY,
        3 => -1.0,
        _ => 10.0_f64.powf(rng.random_range(low..high)),
    }
}

fn any_flow(rng: &mut VesselRng) -> VesselFlow {
    let usual = VesselFlow::default();
    if rng.random_bool(0.5) {
        return usual;
    }
    VesselFlow {
        rate: Flow::from_cubic_metres_per_second(any(rng, -30.0, -2.0)),
        viscosity: Viscosity::from_pascal_seconds(any(rng, -9.0, 0.0)),
        root_pressure: Pressure::from_pascals(any(rng, 0.0, 9.0)),
        terminal_pressure: Pressure::from_pascals(any(rng, -9.0, 1.0)),
    }
}

/// A tissue, of any size and anywhere.
fn any_tissue(rng: &mut VesselRng) -> Option<Arc<dyn Tissue>> {
    let size = any(rng, -9.0, 9.0) as f32;
    let center = Vec3::new(any(rng, -9.0, 9.0) as f32, 0.0, [0.0, size][rng.random_range(0..2)]);
    Some(match rng.random_range(0..4) {
        0 => Arc::new(Disc::flat(size).ok()?),
        1 => Arc::new(Ball::new(center, size).ok()?),
        2 => Arc::new(Cuboid::new(center, Vec3::new(size, 0.001 * size, size)).ok()?),
        _ => {
            let set: Vec<bool> = (0..64).map(|_| rng.random_bool(0.4)).collect();
            Arc::new(Mask::voxels(UVec3::splat(4), Vec3::splat(size), center, &set).ok()?)
        }
    })
}

/// Grows what a seed asks for, or says why not.
fn try_request(seed: u64) -> Result<(), String> {
    let mut rng = Stream::Statistics.rng(seed);
    let tissue = any_tissue(&mut rng).ok_or("a tissue that cannot be")?;
    let settings = CcoSettings {
        terminals: [1, 2, 30, 30, 60, 300][rng.random_range(0..6)],
        perfusion: any(&mut rng, 0.0, 9.0) as f32,
        bifurcation_exponent: [2.0, 2.2, 3.0, 3.5, 4.0, any(&mut rng, 0.3, 0.7) as f32][rng.random_range(0..6)],
        flow: ByKind::from_fn(|_| any_flow(&mut rng)),
        flow_spread: [0.0, 0.0, 0.9, any(&mut rng, -2.0, 0.0) as f32][rng.random_range(0..4)],
        border_distance: [0.0, 0.0, 0.0, any(&mut rng, -30.0, 1.0) as f32][rng.random_range(0..4)],
        candidates: [1, 20, 100][rng.random_range(0..3)],
        polish_sweeps: rng.random_range(0..2),
        ..CcoSettings::default()
    };
    let artery = match rng.random_range(0..3) {
        0 => RootPlacement::Spread(rng.random_range(1..4)),
        1 => RootPlacement::Exact(vec![Vec3::from(tissue.bounds().min)]),
        _ => RootPlacement::Nearest(vec![Vec3::ZERO]),
    };
    let vein = [RootPlacement::None, RootPlacement::Beside][rng.random_range(0..2)].clone();
    let roots = RootPlacements { artery, vein, ..RootPlacements::default() };
    let mut growth = Cco::new(tissue, settings, &roots.into(), seed).map_err(|error| error.to_string())?;
    let outcome = growth.run();
    assert_eq!(growth.overlaps(), 0, "{:?}\n{:?}", growth.tissue(), growth.settings());
    for kind in VesselKind::ALL {
        growth.tree(kind).validate().expect("a valid tree");
        assert!(growth.tree(kind).radii().iter().all(|radius| radius.is_finite() && *radius > 0.0), "a radius of 0");
    }
    outcome.map_err(|error| error.to_string())
}

#[test]
fn every_request_ends_with_a_sound_tree_or_an_error() {
    let (sender, receiver) = mpsc::channel();
    let worker = thread::spawn(move || {
        for seed in 0..REQUESTS {
            let result = catch_unwind(AssertUnwindSafe(|| try_request(seed)));
            if sender.send((seed, result.map_err(drop))).is_err() {
                return;
            }
        }
    });
    let (mut grown, mut refused) = (0, 0);
    for seed in 0..REQUESTS {
        let (seed, result) = receiver.recv_timeout(HANGS_AFTER).unwrap_or_else(|_| panic!("seed {seed} hangs"));
        match result.unwrap_or_else(|()| panic!("seed {seed} panics")) {
            Ok(()) => grown += 1,
            Err(error) => {
                println!("seed {seed}: {error}");
                refused += 1;
            }
        }
    }
    worker.join().expect("the worker ends");
    assert!(grown > 50 && refused > 50, "{grown} grown, {refused} refused");
}
