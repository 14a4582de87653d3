//! Invariants of the vessels after every single step, for every tissue, every kind of settings and several seeds.

mod common;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::{AngleSpread, Colonization, ColonizationSettings, StepReport, SystemSettings},
    tissue::{Extent, TissueGrowth},
    tree::{NO_PARENT, VesselKind, VesselTree},
};
use common::{Case, tissues};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Steps of each run, fewer than the default so that the matrix stays quick, at the default lengths.
const STEPS: u32 = 50;
const SAMPLES: u32 = 500;
/// Largest distance from the tissue of a node that is brought back, for a tissue of size 1: only rounding.
const ON_TISSUE: f32 = 1e-5;

/// Default settings with one change for both systems.
fn varied(change: impl Fn(&mut SystemSettings)) -> ColonizationSettings {
    let mut settings = ColonizationSettings { steps: STEPS, samples: SAMPLES, ..ColonizationSettings::default() };
    change(&mut settings.arterial);
    change(&mut settings.venous);
    settings
}

/// Every switch, and every number at both ends of its limits.
fn settings() -> Vec<(&'static str, ColonizationSettings)> {
    let growing = |law: TissueGrowth| varied(|system| system.tissue_growth = law.clone());
    let unconfined = ColonizationSettings { confine: false, ..varied(|_| {}) };
    let dense = ColonizationSettings { samples: 3000, steps: 12, ..varied(|_| {}) };
    vec![
        ("default", varied(|_| {})),
        ("unconfined", unconfined),
        ("many samples", dense),
        ("direction weight 0", varied(|system| system.direction_weight = 0.0)),
        ("direction weight 1", varied(|system| system.direction_weight = 1.0)),
        ("perception 0°", varied(|system| system.perception_angle = 0.0)),
        ("perception 360°", varied(|system| system.perception_angle = 360.0)),
        ("always bifurcating", varied(|system| system.bifurcation_threshold = 0.0)),
        ("never bifurcating", varied(|system| system.bifurcation_threshold = f32::INFINITY)),
        ("root of summed squares", varied(|system| system.angle_spread = AngleSpread::RootSumOfSquares)),
        ("exponent 2.05", varied(|system| system.bifurcation_exponent = 2.05)),
        ("exponent 3.95", varied(|system| system.bifurcation_exponent = 3.95)),
        ("no lateral sprouts", varied(|system| system.lateral_sprouts = false)),
        ("root with five vessels", varied(|system| system.root_children = 5)),
        ("terminal radius kept", varied(|system| system.scale_terminal_radius = false)),
        ("no tissue growth", growing(TissueGrowth::None)),
        ("exponential tissue growth", growing(TissueGrowth::Exponential(0.05))),
        ("shrinking tissue", growing(TissueGrowth::Linear(-0.01))),
        ("tissue growth by table", growing(TissueGrowth::Table(vec![1.5, 0.7, 2.0]))),
        ("overshooting steps", varied(|system| system.step_length = 0.08)),
        ("no birth distances", varied(|system| (system.drain_birth_distance, system.node_birth_distance) = (0.0, 0.0))),
    ]
}

/// One run, with its state before the present step.
struct Run<'a> {
    case: &'a Case,
    growth: Colonization,
    before: [VesselTree; 2],
    normals_before: [Vec<Vec3>; 2],
    births_before: [Vec<u32>; 2],
    drains_before: [usize; 2],
    scales: [f32; 2],
}

impl<'a> Run<'a> {
    fn new(case: &'a Case, settings: ColonizationSettings, seed: u64) -> Self {
        let growth =
            Colonization::new(case.tissue.clone(), settings, &case.roots, seed).expect("settings within limits");
        let mut run = Self {
            case,
            growth,
            before: Default::default(),
            normals_before: Default::default(),
            births_before: Default::default(),
            drains_before: [0; 2],
            scales: [1.0; 2],
        };
        run.remember();
        run
    }

    fn remember(&mut self) {
        let growth = &self.growth;
        self.before = Colonization::KINDS.map(|kind| growth.tree(kind).clone());
        self.normals_before = Colonization::KINDS.map(|kind| growth.normals(kind).to_vec());
        self.births_before = Colonization::KINDS.map(|kind| growth.birth_steps(kind).to_vec());
        self.drains_before = Colonization::KINDS.map(|kind| growth.drains_left(kind));
        self.scales = Colonization::KINDS.map(|kind| growth.length_scale(kind));
    }

    /// One step, and everything that must hold after it.
    fn step(&mut self) {
        let done = self.growth.steps_done();
        let report = self.growth.step();
        assert_eq!(report.step, done + 1);
        assert_eq!(self.growth.steps_done(), report.step);
        self.check_report(&report);
        for kind in Colonization::KINDS {
            self.growth.tree(kind).validate().unwrap_or_else(|error| panic!("{} tree: {error}", kind.name()));
            self.check_append_only(kind, report.step);
            self.check_new_segments(kind);
            self.check_radii(kind);
            self.check_tissue(kind);
            self.check_vessels(kind);
        }
        self.remember();
    }

    fn check_report(&self, report: &StepReport) {
        assert_eq!(report.sampled, self.growth.settings().samples);
        assert!(report.born <= report.sampled);
        let (arterial, venous) = (&report.arterial, &report.venous);
        for (kind, of) in Colonization::KINDS.into_iter().zip([arterial, venous]) {
            assert_eq!(of.first_new_node as usize, self.before[kind.index()].len());
            assert_eq!((of.first_new_node + of.new_nodes) as usize, self.growth.tree(kind).len());
            assert_eq!(of.drains_left as usize, self.growth.drains_left(kind));
            assert_eq!(self.growth.drains(kind).count(), self.growth.drains_left(kind));
        }
        let [arterial_before, venous_before] = self.drains_before.map(|drains| drains as u32);
        // Written as sums, so that a count below zero cannot hide.
        assert_eq!(arterial_before + report.born, arterial.drains_left + arterial.supplied);
        assert_eq!(venous_before + arterial.supplied, venous.drains_left + venous.supplied);
    }

    /// Old nodes are unchanged; every channel has one entry per node.
    fn check_append_only(&self, kind: VesselKind, step: u32) {
        let (index, growth) = (kind.index(), &self.growth);
        let (before, now) = (&self.before[index], growth.tree(kind));
        assert!(now.positions().starts_with(before.positions()), "positions changed");
        assert!(now.parents().starts_with(before.parents()), "parents changed");
        assert!(growth.normals(kind).starts_with(&self.normals_before[index]), "normals changed");
        let births = growth.birth_steps(kind);
        assert!(births.starts_with(&self.births_before[index]), "birth steps changed");
        assert!(births[before.len()..].iter().all(|&birth| birth == step), "a new node of another step");
        assert_eq!((now.len(), now.len()), (births.len(), growth.normals(kind).len()));
    }

    /// New segments are as long as a step, and leave from nodes that may have another child. On a bent surface, several
    /// make up a step.
    fn check_new_segments(&self, kind: VesselKind) {
        let (growth, tree) = (&self.growth, self.growth.tree(kind));
        let settings = growth.settings().system(kind).expect("it is grown");
        let step = settings.step_length * self.scales[kind.index()];
        let first_new = self.before[kind.index()].len();
        let grown_from = self.before[kind.index()].child_counts();
        let (children, mut way) = (tree.child_counts(), vec![0.0; tree.len()]);
        for (node, parent) in tree.segments().filter(|&(node, _)| node >= first_new) {
            let length = tree.segment_vector(node).length();
            assert!(length > 0.0, "node {node} lies on its parent");
            if growth.settings().confine {
                // Its free end is one step from its parent, hence at most one step from the tissue.
                assert!(length <= 2.0 * step * 1.001, "segment {node} of length {length}, step {step}");
            } else {
                assert!((length / step - 1.0).abs() < 1e-3, "segment {node} of length {length}, step {step}");
            }
            let bends = self.case.tissue.has_facets() && growth.settings().confine;
            if bends && parent >= first_new {
                // Each goes on from the one before.
                assert_eq!((parent, children[parent]), (node - 1, 1), "node {node} is beside a bend");
                way[node] = way[parent] + length;
            } else {
                assert!(parent < first_new, "node {node} grew from a node of the same step");
                way[node] = length;
            }
            assert!(!bends || way[node] <= step * 1.001, "a way of {} to node {node}, step {step}", way[node]);
            if parent < first_new && !settings.lateral_sprouts && tree.parents()[parent] != NO_PARENT {
                assert_eq!(grown_from[parent], 0, "node {node} sprouts sideways");
            }
        }
        for (node, count) in tree.child_counts().into_iter().enumerate() {
            // A root without children may bifurcate, too.
            let most = if tree.parents()[node] == NO_PARENT { settings.root_children.max(2) } else { 2 };
            assert!(count <= most, "node {node} has {count} children");
        }
    }

    /// Murray's law at every node, in f64 and with the powers of std, and the list of changed radii.
    fn check_radii(&self, kind: VesselKind) {
        let (tree, before) = (self.growth.tree(kind), &self.before[kind.index()]);
        let exponent = f64::from(self.growth.settings().system(kind).expect("it is grown").bifurcation_exponent);
        let mut sums = vec![0.0; tree.len()];
        for (node, parent) in tree.segments() {
            sums[parent] += (f64::from(tree.radii()[node]) / f64::from(tree.radii()[parent])).powf(exponent);
        }
        for (node, &sum) in sums.iter().enumerate().filter(|&(_, &sum)| sum > 0.0) {
            assert!((sum - 1.0).abs() <= 1e-5, "Murray's residual at node {node} is {}", sum - 1.0);
        }

        let changed = self.growth.changed_radii(kind);
        assert!(changed.windows(2).all(|pair| pair[0] > pair[1]), "changed radii are not from the tips to the roots");
        let mut upstream_of_new = vec![false; tree.len()];
        upstream_of_new[before.len()..].fill(true);
        for (node, parent) in tree.segments().collect::<Vec<_>>().into_iter().rev() {
            upstream_of_new[parent] |= upstream_of_new[node];
        }
        for (node, &radius) in tree.radii().iter().enumerate() {
            let differs = before.radii().get(node).is_none_or(|old| old.to_bits() != radius.to_bits());
            let listed = changed.binary_search_by(|other| (node as u32).cmp(other)).is_ok();
            assert!(listed || !differs, "the radius of node {node} changed and is not listed");
            assert!(!listed || upstream_of_new[node], "node {node} is listed, yet nothing grew downstream of it");
        }
    }

    fn check_tissue(&self, kind: VesselKind) {
        let (growth, tissue) = (&self.growth, self.case.tissue.at_step(self.growth.steps_done()));
        let step = growth.settings().system(kind).expect("it is grown").step_length * self.scales[kind.index()];
        let limit = if growth.settings().confine { ON_TISSUE } else { step };
        let is_surface = matches!(tissue.extent(), Extent::Area(_));
        for node in self.before[kind.index()].len()..growth.tree(kind).len() {
            let position = growth.tree(kind).positions()[node];
            let nearest = tissue.closest_point(position);
            let distance = nearest.position.distance(position);
            assert!(distance <= limit, "node {node} at {position} lies {distance} beside the tissue, over {limit}");
            let normal = growth.normals(kind)[node];
            let length = if is_surface { 1.0 } else { 0.0 };
            assert!((normal.length() - length).abs() < 1e-4, "node {node} has the normal {normal}");
        }
    }

    /// The drawn tree, lifted off a surface by its radius.
    fn check_vessels(&self, kind: VesselKind) {
        let (tree, normals) = (self.growth.tree(kind), self.growth.normals(kind));
        let vessels = self.growth.vessels(kind);
        assert_eq!((vessels.parents(), vessels.radii()), (tree.parents(), tree.radii()));
        for (node, position) in vessels.positions().iter().enumerate() {
            let expected = tree.positions()[node] + normals[node] * tree.radii()[node];
            assert_eq!(*position, expected, "node {node} is not lifted by its radius");
        }
    }
}

/// Grows to the end, checks every step, and counts the nodes.
fn grow(case: &Case, settings: &ColonizationSettings, seed: u64) -> usize {
    let mut run = Run::new(case, settings.clone(), seed);
    while !run.growth.is_finished() {
        run.step();
    }
    Colonization::KINDS.map(|kind| run.growth.tree(kind).len()).iter().sum()
}

#[test]
fn every_step_of_every_growth_is_well_formed() {
    let mut nodes = 0;
    let mut failed = Vec::new();
    for case in &tissues() {
        for (name, settings) in settings() {
            for seed in 1..=3 {
                match catch_unwind(AssertUnwindSafe(|| grow(case, &settings, seed))) {
                    Ok(grown) => nodes += grown,
                    Err(_) => failed.push(format!("{} with {name}, seed {seed}", case.name)),
                }
            }
        }
    }
    println!("{nodes} nodes checked");
    assert!(failed.is_empty(), "{} growths broke an invariant, see above:\n{}", failed.len(), failed.join("\n"));
    assert!(nodes > 50_000, "only {nodes} nodes grew: the matrix checks little");
}
