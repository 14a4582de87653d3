//! No two segments overlap at any step, whatever their radii: compared pair by pair after each.

use crate::{
    arteries, common,
    oracle::{check, check_overlaps},
};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoError, CcoSettings},
    random::{Stream, VesselRng},
    tissue::{Ball, Disc, Tissue},
    units::Flow,
};
use rand::RngExt;
use std::sync::Arc;

const TREES: u64 = 40;

#[test]
fn no_segments_overlap_at_any_step() {
    let tissues: [Arc<dyn Tissue>; 2] =
        [Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball")), Arc::new(Disc::flat(0.5).expect("a disc"))];
    for tissue in tissues {
        // Thick vessels, which are often in each other's way.
        let settings = CcoSettings { terminals: 250, ..CcoSettings::default() };
        let mut growth = arteries(tissue, settings, Vec3::Y * 0.5, 4);
        while !growth.is_finished() {
            growth.advance();
            growth.settle();
            check_overlaps("step by step", &growth);
        }
        check("thick vessels", &growth);
    }
}

/// Settings with which vessels of two kinds may be a thousand times as wide as each other, and those of one kind of
/// very different widths, too.
fn settings(rng: &mut VesselRng) -> CcoSettings {
    let mut settings = CcoSettings {
        terminals: rng.random_range(2..30),
        perfusion: 10.0_f32.powf(rng.random_range(2.5..6.0)),
        bifurcation_exponent: [2.0, 2.1, 2.55, 3.0, 3.5, 4.0][rng.random_range(0..6)],
        flow_spread: [0.0, CcoSettings::MAX_FLOW_SPREAD][rng.random_range(0..2)],
        candidates: [1, 3, 20][rng.random_range(0..3)],
        polish_sweeps: rng.random_range(0..3),
        ..CcoSettings::default()
    };
    // Radii go with the fourth root of the flow.
    let rate = settings.flow.artery.rate.cubic_metres_per_second();
    let share = 10.0_f64.powf(rng.random_range(-12.0..0.0));
    settings.flow.vein.rate = Flow::from_cubic_metres_per_second(rate * share);
    settings
}

#[test]
fn no_two_segments_of_any_radii_overlap_at_any_step() {
    let (tissues, mut grown, mut steps) = (common::tissues(), 0, 0);
    for seed in 0..TREES {
        let mut rng = Stream::Statistics.rng(seed);
        let case = &tissues[seed as usize % tissues.len()];
        let name = format!("seed {seed}, {}", case.name);
        let settings = settings(&mut rng);
        let mut growth = match Cco::new(Arc::clone(&case.tissue), settings, &case.roots, seed) {
            Ok(growth) => growth,
            Err(CcoError::NoFirstVessel { .. } | CcoError::NoInside { .. }) => continue,
            Err(error) => panic!("{name}: {error}"),
        };
        while !growth.is_finished() {
            growth.advance();
            growth.settle();
            check_overlaps(&name, &growth);
            steps += 1;
        }
        assert_eq!(growth.overlaps(), 0, "{name}");
        grown += 1;
    }
    assert!(grown > TREES / 2 && steps > 500, "{grown} trees in {steps} steps");
}
