//! What is reported of an organ.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::Colonization,
    random::Stream,
    tree::{VesselKind, statistics},
};
use serde::Serialize;

/// Points drawn from the tissue to measure coverage: its standard error is below 0.4 %.
const COVERAGE_SAMPLES: usize = 20_000;

/// One organ. Its fields are those of the JSON line, in this order.
#[derive(Debug, Serialize)]
pub struct Line {
    /// The option `--tissue`.
    pub tissue: String,
    /// Name of the preset, or of the file of settings without its ending.
    pub preset: String,
    /// The organ's seed.
    pub seed: u64,
    /// Growth steps taken.
    pub steps: u32,
    /// Wall time of the growth alone, in milliseconds.
    pub grow_ms: f64,
    /// Hash of both centre-line trees.
    pub hash: String,
    /// The arteries.
    pub arterial: Measures,
    /// The veins.
    pub venous: Measures,
    /// Files that were written.
    pub files: Vec<String>,
}

impl Line {
    /// The line of `--json`.
    pub fn json(&self) -> String {
        // Fails only on maps with keys that are no strings, of which there are none.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// The line for people.
    pub fn text(&self) -> String {
        let [arteries, veins] =
            [&self.arterial, &self.venous].map(|m| format!("{} nodes, {} leaves", m.nodes, m.leaves));
        let Self { tissue, preset, seed, grow_ms, hash, .. } = self;
        format!("{tissue} {preset} seed {seed}: arteries {arteries}; veins {veins}; {grow_ms:.1} ms; {hash}")
    }
}

/// Statistics of one system's centre lines. What a tree does not have is null.
#[derive(Debug, Serialize)]
pub struct Measures {
    nodes: usize,
    leaves: usize,
    bifurcations: usize,
    total_length: f64,
    root_radius: Option<f32>,
    terminal_radius: Option<f32>,
    angle_mean_deg: Option<f64>,
    angle_sd_deg: Option<f64>,
    strahler_orders: usize,
    branching_ratio: Option<f64>,
    tortuosity_median: Option<f64>,
    coverage: Option<f32>,
    outside: usize,
}

impl Measures {
    /// Measures a system of a finished growth.
    ///
    /// The terminal radius is the median over the leaves. Coverage is the share of the tissue within the last birth
    /// distance of a node.
    pub fn of(growth: &Colonization, system: VesselKind, seed: u64) -> Self {
        let tree = growth.tree(system);
        let measured = tree.statistics();
        let tissue = growth.tissue().at_step(growth.steps_done());
        let mut rng = Stream::Statistics.rng(seed);
        let samples: Vec<Vec3> = (0..COVERAGE_SAMPLES).filter_map(|_| tissue.sample(&mut rng)).collect();
        let reach = growth.settings().system(system).node_birth_distance * growth.length_scale(system);
        Self {
            nodes: measured.nodes,
            leaves: measured.leaves,
            bifurcations: measured.bifurcations,
            total_length: measured.total_length,
            root_radius: measured.root_radius.map(|radius| radius as f32),
            terminal_radius: measured.terminal_radius.map(|radius| radius.median as f32),
            angle_mean_deg: measured.bifurcation_angle.map(|angle| angle.mean),
            angle_sd_deg: measured.bifurcation_angle.map(|angle| angle.standard_deviation),
            strahler_orders: measured.strahler_orders(),
            branching_ratio: measured.branching_ratio,
            tortuosity_median: measured.tortuosity.map(|tortuosity| tortuosity.median),
            coverage: statistics::coverage(tree, &samples, reach),
            outside: statistics::outside(tree, |node| growth.tissue().contains(node)),
        }
    }
}
