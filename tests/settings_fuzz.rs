//! A thousand random settings, within and beyond their limits: growth starts or reports what is wrong, and always ends.

mod common;

use bevy_vessels::synthesis::{
    colonization::{AngleSpread, Colonization, ColonizationError, ColonizationSettings, SystemSettings},
    mesh::MAX_COORDINATE,
    random::{Stream, VesselRng},
    roots::RootError,
    tissue::TissueGrowth,
};
use common::{Case, tissues};
use rand::RngExt;
use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::mpsc,
    thread,
    time::Duration,
};

const SETTINGS: u64 = 1000;
const MOST_STEPS: u32 = 40;
const MOST_SAMPLES: u32 = 800;
/// Far longer than the slowest growth on any machine.
const HANGS_AFTER: Duration = Duration::from_secs(120);

/// Lengths within their limits: all of similar size, as a user's are, or each of any size, sometimes absurd.
#[derive(Clone, Copy)]
enum Lengths {
    About(f32),
    Any,
}

impl Lengths {
    fn new(rng: &mut VesselRng) -> Self {
        if rng.random_bool(0.6) { Self::About(rng.random_range(-1.7..-0.6)) } else { Self::Any }
    }

    fn length(self, rng: &mut VesselRng) -> f32 {
        let exponent = match self {
            Self::About(exponent) => exponent + rng.random_range(-0.3..0.3),
            Self::Any if rng.random_bool(0.9) => rng.random_range(-3.5..0.5),
            Self::Any => rng.random_range(-37.0..37.0),
        };
        10.0_f32.powf(exponent).min(MAX_COORDINATE)
    }

    fn length_or_zero(self, rng: &mut VesselRng) -> f32 {
        if rng.random_bool(0.1) { 0.0 } else { self.length(rng) }
    }
}

/// A number from a range, sometimes one of its ends.
fn number(rng: &mut VesselRng, low: f32, high: f32) -> f32 {
    match rng.random_range(0..10) {
        0 => low,
        1 => high,
        _ => rng.random_range(low..high),
    }
}

fn tissue_growth(rng: &mut VesselRng) -> TissueGrowth {
    match rng.random_range(0..5) {
        0 => TissueGrowth::None,
        1 => TissueGrowth::Linear(rng.random_range(-0.02..0.5)),
        2 => TissueGrowth::Exponential(rng.random_range(-0.2..0.5)),
        3 => TissueGrowth::Table(Vec::new()),
        _ => TissueGrowth::Table((0..rng.random_range(1..20)).map(|_| rng.random_range(0.05..20.0)).collect()),
    }
}

fn system_within_limits(rng: &mut VesselRng, lengths: Lengths) -> SystemSettings {
    SystemSettings {
        direction_weight: number(rng, 0.0, 1.0),
        drain_birth_distance: lengths.length_or_zero(rng),
        node_birth_distance: lengths.length_or_zero(rng),
        influence_distance: lengths.length(rng),
        kill_distance: lengths.length(rng),
        perception_angle: number(rng, 0.0, 360.0),
        terminal_radius: lengths.length(rng),
        scale_terminal_radius: rng.random_bool(0.5),
        step_length: lengths.length(rng),
        bifurcation_threshold: if rng.random_bool(0.1) { f32::INFINITY } else { number(rng, 0.0, 180.0) },
        angle_spread: if rng.random_bool(0.5) { AngleSpread::StandardDeviation } else { AngleSpread::RootSumOfSquares },
        bifurcation_exponent: rng.random_range(2.001..3.999),
        tissue_growth: tissue_growth(rng),
        lateral_sprouts: rng.random_bool(0.7),
        root_children: if rng.random_bool(0.1) { u32::MAX } else { rng.random_range(1..6) },
    }
}

fn within_limits(rng: &mut VesselRng) -> ColonizationSettings {
    let lengths = Lengths::new(rng);
    ColonizationSettings {
        steps: rng.random_range(1..=MOST_STEPS),
        samples: rng.random_range(0..=MOST_SAMPLES),
        arterial: system_within_limits(rng, lengths),
        venous: system_within_limits(rng, lengths),
        confine: rng.random_bool(0.5),
        idle_steps: rng.random_range(0..=4),
        stand_off: rng.random_bool(0.5),
    }
}

/// A field, its setter, and values beyond its limits.
type Break = (&'static str, fn(&mut SystemSettings, f32), &'static [f32]);

const NOT_A_LENGTH: &[f32] = &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-6, -1e30];
const NOT_ABOVE_ZERO: &[f32] = &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-6, -0.0, 0.0];

const BREAKS: &[Break] = &[
    ("direction_weight", |system, value| system.direction_weight = value, &[f32::NAN, -0.01, 1.01, f32::INFINITY]),
    ("drain_birth_distance", |system, value| system.drain_birth_distance = value, NOT_A_LENGTH),
    ("node_birth_distance", |system, value| system.node_birth_distance = value, NOT_A_LENGTH),
    ("influence_distance", |system, value| system.influence_distance = value, NOT_ABOVE_ZERO),
    ("kill_distance", |system, value| system.kill_distance = value, NOT_ABOVE_ZERO),
    ("perception_angle", |system, value| system.perception_angle = value, &[f32::NAN, -1.0, 360.1, f32::INFINITY]),
    ("terminal_radius", |system, value| system.terminal_radius = value, NOT_ABOVE_ZERO),
    ("step_length", |system, value| system.step_length = value, NOT_ABOVE_ZERO),
    ("bifurcation_threshold", |system, value| system.bifurcation_threshold = value, &[f32::NAN, -0.1]),
    ("bifurcation_exponent", |system, value| system.bifurcation_exponent = value, &[f32::NAN, 2.0, 4.0, 0.0, -3.0]),
    ("root_children", |system, _| system.root_children = 0, &[0.0]),
    ("tissue_growth", |system, value| system.tissue_growth = TissueGrowth::Table(vec![value]), NOT_ABOVE_ZERO),
    ("tissue_growth", |system, value| system.tissue_growth = TissueGrowth::Linear(value), &[f32::NAN, -1.0, -1e9]),
    ("tissue_growth", |system, value| system.tissue_growth = TissueGrowth::Exponential(value), &[f32::NAN, -1.0, 1e38]),
];

/// Sets one value beyond its limits. Returns the name that the error must contain.
fn break_one(settings: &mut ColonizationSettings, rng: &mut VesselRng) -> &'static str {
    match rng.random_range(0..BREAKS.len() + 2) {
        index if index < BREAKS.len() => {
            let (name, set, values) = BREAKS[index];
            let systems = [&mut settings.arterial, &mut settings.venous];
            let system = systems.into_iter().nth(rng.random_range(0..2)).expect("one of two");
            set(system, values[rng.random_range(0..values.len())]);
            name
        }
        index if index == BREAKS.len() => {
            settings.steps = 0;
            "steps"
        }
        _ => {
            settings.samples = rng.random_range(ColonizationSettings::MAX_SAMPLES + 1..=u32::MAX);
            "samples"
        }
    }
}

/// Grows with the settings of a seed. Returns the number of nodes, or `None` if the settings were rightly rejected.
fn grow(cases: &[Case], seed: u64) -> Option<usize> {
    let mut rng = Stream::Statistics.rng(seed);
    let case = &cases[rng.random_range(0..cases.len())];
    let mut settings = within_limits(&mut rng);
    if rng.random_bool(0.3) {
        let name = break_one(&mut settings, &mut rng);
        let message = match Colonization::new(case.tissue.clone(), settings.clone(), &case.roots, seed) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{name} is beyond its limits, yet growth starts: {settings:?}"),
        };
        assert!(message.contains(name), "the error does not name {name}: {message}");
        assert!(settings.validate().is_err_and(|error| error.to_string() == message));
        return None;
    }
    settings.validate().unwrap_or_else(|error| panic!("{error}, yet all is within limits: {settings:?}"));
    let step = settings.arterial.step_length.min(settings.venous.step_length);
    let mut growth = match Colonization::new(case.tissue.clone(), settings, &case.roots, seed) {
        Ok(growth) => growth,
        // Two roots a ten-thousandth of a step apart coincide. All tissues here have about size 1.
        Err(ColonizationError::Roots(RootError::Coincide { .. })) if step > 100.0 => return None,
        Err(error) => panic!("growth does not start: {error}"),
    };
    while !growth.is_finished() {
        let report = growth.step();
        for (kind, of) in Colonization::KINDS.into_iter().zip([&report.arterial, &report.venous]) {
            let tree = growth.tree(kind);
            tree.validate().unwrap_or_else(|error| {
                let settings = growth.settings();
                panic!("{} tree in {} after step {}: {error}\n{settings:?}", kind.name(), case.name, report.step)
            });
            assert_eq!(of.drains_left as usize, growth.drains_left(kind));
        }
    }
    Some(Colonization::KINDS.map(|kind| growth.vessels(kind).len()).iter().sum())
}

#[test]
fn a_thousand_random_settings_neither_panic_nor_hang() {
    let (sender, results) = mpsc::channel();
    thread::spawn(move || {
        let cases = tissues();
        for seed in 0..SETTINGS {
            let result = catch_unwind(AssertUnwindSafe(|| grow(&cases, seed)));
            if sender.send(result).is_err() {
                break;
            }
        }
    });
    let (mut grew, mut rejected, mut panicked) = (0, 0, Vec::new());
    for seed in 0..SETTINGS {
        match results.recv_timeout(HANGS_AFTER) {
            Ok(Ok(Some(nodes))) => grew += usize::from(nodes > 10),
            Ok(Ok(None)) => rejected += 1,
            Ok(Err(_)) => panicked.push(seed),
            Err(error) => panic!("the settings of seed {seed} hang: {error}"),
        }
    }
    println!("{grew} grew more than 10 nodes, {rejected} were rejected");
    assert!(panicked.is_empty(), "the settings of these seeds panic, see above: {panicked:?}");
    assert!(grew > 120 && rejected > 200, "too few settings say anything: {grew} grew, {rejected} were rejected");
}
