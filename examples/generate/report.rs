//! The report of an organ.

use super::mesh::{MeshFigures, Meshed};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::Cco,
    growth::{GrownTree, Growth},
    random::Stream,
    tissue::{Extent, Tissue},
    tree::{ByKind, statistics},
};
use serde::{Serialize, Serializer};
use std::any::Any;

/// Points drawn from the tissue to measure coverage: its standard error is below 0.4 %.
const COVERAGE_SAMPLES: usize = 20_000;

/// One organ. Its fields are those of the JSON line, in this order.
#[derive(Debug, Serialize)]
pub struct Line {
    /// The option `--tissue`.
    pub tissue: String,
    /// Name of the preset, or of the settings file without its extension.
    pub preset: String,
    /// The size of the tissue.
    pub extent: Size,
    /// The organ's seed.
    pub seed: u64,
    /// Growth steps taken.
    pub steps: u32,
    /// Wall time of the growth alone, in milliseconds.
    pub grow_ms: f64,
    /// Hash of all centre-line trees.
    pub hash: String,
    /// Each kind of vessels, under its name: `arterial`, `venous`, `portal`, `ductal`.
    #[serde(flatten)]
    pub kinds: KindMeasures,
    /// Constrained constructive optimisation, if that is the method.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cco: Option<CcoFigures>,
    /// Written files.
    pub files: Vec<String>,
}

/// The size of a tissue: what a file became, so that a wrong unit or a missing part is seen.
#[derive(Debug, Serialize)]
pub struct Size {
    /// `length`, `area` or `volume`.
    kind: &'static str,
    /// In tissue lengths, square or cubic tissue lengths.
    value: f32,
}

impl From<Extent> for Size {
    fn from(extent: Extent) -> Self {
        let (kind, value) = match extent {
            Extent::Length(value) => ("length", value),
            Extent::Area(value) => ("area", value),
            Extent::Volume(value) => ("volume", value),
        };
        Self { kind, value }
    }
}

/// Figures of constrained constructive optimisation, over all kinds of vessels.
#[derive(Debug, Serialize)]
pub struct CcoFigures {
    /// Terminals that were placed.
    terminals: u32,
    /// Volume of all vessels, in mm³.
    volume: f64,
    /// Radius of the widest root, in mm.
    root_radius: f64,
    /// Pairs of vessels that overlap though they share no node.
    overlaps: usize,
    /// Places of terminals that could not be connected.
    rejected: u64,
}

impl CcoFigures {
    /// Measures a growth; `None` for other methods.
    pub fn of(growth: &dyn Growth) -> Option<Self> {
        let growth = (growth as &dyn Any).downcast_ref::<Cco>()?;
        let mm = growth.millimetres();
        let none = Self { terminals: 0, volume: 0.0, root_radius: 0.0, overlaps: growth.overlaps(), rejected: 0 };
        Some(growth.reports().fold(none, |sum, kind| Self {
            terminals: sum.terminals + kind.terminals,
            volume: sum.volume + kind.volume * mm * mm * mm,
            root_radius: sum.root_radius.max(kind.root_radius * mm),
            rejected: sum.rejected + kind.rejected,
            ..sum
        }))
    }
}

impl Line {
    /// The line of `--json`.
    pub fn json(&self) -> String {
        // Fails only on maps with keys that are not strings, and there are none.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// The line for people.
    pub fn text(&self) -> String {
        let Self { tissue, preset, seed, grow_ms, hash, .. } = self;
        let kinds = self.kinds.0.iter().filter_map(|(kind, measures)| {
            let Measures { nodes, leaves, mesh, .. } = measures.as_ref()?;
            let mesh = mesh.as_ref().map_or(String::new(), |mesh| format!(", {} triangles", mesh.triangles));
            Some(format!("{} {nodes} nodes, {leaves} leaves{mesh}; ", kind.plural().to_lowercase()))
        });
        format!("{tissue} {preset} seed {seed}: {}{grow_ms:.1} ms; {hash}", kinds.collect::<String>())
    }
}

/// Measures of each kind of vessels that the generator grows.
#[derive(Debug)]
pub struct KindMeasures(ByKind<Option<Measures>>);

impl KindMeasures {
    /// Measures the vessels of a finished growth.
    ///
    /// `meshes` are the surfaces to measure.
    pub fn of(growth: &dyn Growth, tissue: &dyn Tissue, seed: u64, meshes: &ByKind<Option<&Meshed>>) -> Self {
        let mut rng = Stream::Statistics.rng(seed);
        let supplied = tissue.at_step(growth.progress().done);
        let samples: Vec<Vec3> = (0..COVERAGE_SAMPLES).filter_map(|_| supplied.sample(&mut rng)).collect();
        Self(growth.trees().map(|kind, grown| {
            let mesh = meshes[kind].map(MeshFigures::of);
            grown.map(|grown| Measures { mesh, ..Measures::of(grown, tissue, &samples) })
        }))
    }
}

impl Serialize for KindMeasures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().filter_map(|(kind, measures)| Some((kind.name(), measures.as_ref()?))))
    }
}

/// Statistics of the centre lines of one kind. Values that a tree does not have are null.
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
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<MeshFigures>,
}

impl Measures {
    /// Measures the vessels of one kind.
    ///
    /// The terminal radius is the median over the leaves. Coverage is the share of the samples that count as supplied.
    fn of(GrownTree { tree, reach, .. }: GrownTree, tissue: &dyn Tissue, samples: &[Vec3]) -> Self {
        let measured = tree.statistics();
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
            coverage: statistics::coverage(tree, samples, reach),
            outside: statistics::outside(tree, |node| tissue.contains(node)),
            mesh: None,
        }
    }
}
