//! Volume and radii in comparison with those of OpenCCO.
//!
//! OpenCCO lets a volume grow by the law for areas, so that its final ball is k^(1/6) times as large as its perfusion
//! volume says, and its vessels are as thin as in that. It measures lengths in the smaller ball. Here the perfusion
//! volume is √k times as large, which is the same tree, and volumes are divided by k^(1/6).

use crate::arteries;
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::CcoSettings,
    tissue::{Ball, Disc, Tissue},
    units::Pressure,
};
use std::{f32::consts::PI, sync::Arc};

/// OpenCCO's means: terminals, volume, radius of the root.
const DISC: [(u32, f64, f64); 2] = [(250, 1439.0, 1.35), (1000, 1506.5, 1.345)];
const BALL: [(u32, f64, f64); 2] = [(250, 386.0, 1.286), (1000, 516.5, 1.384)];

/// Mean volume and root radius over five seeds, in OpenCCO's units.
fn means(is_flat: bool, terminals: u32, polish_sweeps: u32) -> (f64, f64) {
    let enlarged = if is_flat { 1.0 } else { f64::from(terminals).powf(1.0 / 6.0) };
    let (mut volume, mut radius) = (0.0, 0.0);
    for seed in 1..=5 {
        let perfusion = 20_000.0 * enlarged.powi(3) as f32;
        let (size, tissue): (f32, Arc<dyn Tissue>) = if is_flat {
            let size = (perfusion / PI).sqrt();
            (size, Arc::new(Disc::flat(size).expect("a disc")))
        } else {
            let size = (0.75 * perfusion / PI).cbrt();
            (size, Arc::new(Ball::new(Vec3::ZERO, size).expect("a ball")))
        };
        let terminal_pressure = Pressure::from_pascals(if terminals > 250 { 7980.0 } else { 8400.0 });
        let mut settings = CcoSettings { terminals, perfusion, polish_sweeps, ..CcoSettings::default() };
        settings.flow.artery.terminal_pressure = terminal_pressure;
        let mut growth = arteries(tissue, settings, Vec3::Y * size, seed);
        growth.run().expect("room for all");
        let report = growth.reports().next().expect("arteries");
        volume += report.volume / enlarged / 5.0;
        radius += report.root_radius / 5.0;
    }
    (volume, radius)
}

fn compare(is_flat: bool, (terminals, volume, radius): (u32, f64, f64)) {
    for (sweeps, limit) in [(0, 1.02), (CcoSettings::DEFAULT_POLISH_SWEEPS, 0.98)] {
        let (ours, root) = means(is_flat, terminals, sweeps);
        let name = if is_flat { "disc" } else { "ball" };
        println!(
            "{name}, {terminals} terminals, {sweeps} sweeps: {:.4} of its volume, root {:.4}",
            ours / volume,
            root / radius
        );
        assert!(ours <= limit * volume, "{name} {terminals}, {sweeps} sweeps: {ours}, OpenCCO {volume}");
        assert!((root / radius - 1.0).abs() <= 0.05, "{name} {terminals}: root radius {root}, OpenCCO {radius}");
    }
}

#[test]
fn trees_in_a_disc_are_no_larger_than_those_of_opencco() {
    DISC.into_iter().for_each(|case| compare(true, case));
}

#[test]
fn trees_in_a_ball_are_no_larger_than_those_of_opencco() {
    BALL.into_iter().for_each(|case| compare(false, case));
}
