//! The report of an organ.

use super::bake::BakeFigures;
use super::mesh::{MeshFigures, Meshed};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::Cco,
    growth::{GrownTree, Growth},
    haemodynamics::Network,
    random::Stream,
    tissue::{Extent, Tissue},
    tree::{
        ByKind, VesselKind, VesselTree,
        statistics::{self, StrahlerOrder},
    },
};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::any::Any;
use std::collections::BTreeMap;

/// Points drawn from the tissue to measure coverage: its standard error is below 0.4 %.
const COVERAGE_SAMPLES: usize = 20_000;

/// Points of a tissue by which coverage is measured: the same for all organs, and drawn once.
#[derive(Default)]
pub struct Samples {
    /// The address of their tissue, which may be a stage of the whole.
    of: usize,
    points: Vec<Vec3>,
}

impl Samples {
    fn over(&mut self, tissue: &dyn Tissue) -> &[Vec3] {
        let address = std::ptr::from_ref(tissue).cast::<()>().addr();
        if self.of != address {
            let mut rng = Stream::Statistics.rng(0);
            self.of = address;
            self.points = (0..COVERAGE_SAMPLES).filter_map(|_| tissue.sample(&mut rng)).collect();
        }
        &self.points
    }
}

/// One organ. Its fields are those of the JSON line, in this order.
#[derive(Debug, Serialize, Deserialize)]
pub struct Line {
    /// The option `--tissue`.
    pub tissue: String,
    /// The seed of a procedural organ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub organ_seed: Option<u64>,
    /// Where on a mesh vessels grow; null for a shape.
    pub mode: Option<String>,
    /// Name of the preset, or of the settings file without its extension.
    pub preset: String,
    /// Hash of all that the organs of a run have in common, as in the names of its files.
    pub run: String,
    /// The option `--unit`; null without.
    pub unit: Option<String>,
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
    /// Textures, if any are made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bake: Option<BakeFigures>,
    /// Other written files.
    pub files: Vec<String>,
}

/// The size of a tissue: what a file became, so that a wrong unit or a missing part is seen.
#[derive(Debug, Serialize, Deserialize)]
pub struct Size {
    kind: SizeKind,
    /// In tissue lengths, square or cubic tissue lengths.
    value: f32,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum SizeKind {
    Length,
    Area,
    Volume,
}

impl From<Extent> for Size {
    fn from(extent: Extent) -> Self {
        let (kind, value) = match extent {
            Extent::Length(value) => (SizeKind::Length, value),
            Extent::Area(value) => (SizeKind::Area, value),
            Extent::Volume(value) | Extent::Sheet { volume: value, .. } => (SizeKind::Volume, value),
        };
        Self { kind, value }
    }
}

/// Figures of constrained constructive optimisation, over all kinds of vessels.
#[derive(Debug, Serialize, Deserialize)]
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
    /// `samples` are for the statistics; without, only nodes and leaves are counted. `meshes` are the surfaces to
    /// measure, `flows` the solved flows.
    pub fn of(
        growth: &dyn Growth,
        tissue: &dyn Tissue,
        samples: Option<&mut Samples>,
        meshes: &ByKind<Option<&Meshed>>,
        flows: &ByKind<Option<Network>>,
    ) -> Self {
        let samples = samples.map(|samples| samples.over(tissue.at_step(growth.progress().done)));
        Self(growth.trees().map(|kind, grown| {
            let mesh = meshes[kind].map(MeshFigures::of);
            let inflow_ml_per_min = flows[kind].as_ref().map(|network| network.inflow().ml_per_min());
            grown.map(|grown| Measures {
                nodes: grown.tree.len(),
                leaves: leaves(grown.tree),
                statistics: samples.map(|samples| Statistics::of(grown, tissue, samples)),
                inflow_ml_per_min,
                mesh,
            })
        }))
    }

    /// Whether all kinds with vessels have figures of their meshes.
    pub fn have_meshes(&self) -> bool {
        self.0.values().flatten().all(|measures| measures.nodes == 0 || measures.mesh.is_some())
    }

    /// The kinds with vessels.
    pub fn grown(&self) -> Vec<VesselKind> {
        let has_nodes = |measures: &Option<Measures>| measures.as_ref().is_some_and(|measures| measures.nodes > 0);
        self.0.iter().filter(|(_, measures)| has_nodes(measures)).map(|(kind, _)| kind).collect()
    }
}

impl Serialize for KindMeasures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().filter_map(|(kind, measures)| Some((kind.name(), measures.as_ref()?))))
    }
}

impl<'de> Deserialize<'de> for KindMeasures {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut by_name = BTreeMap::<String, Measures>::deserialize(deserializer)?;
        Ok(Self(ByKind::from_fn(|kind| by_name.remove(kind.name()))))
    }
}

/// Measures of one kind of vessels.
#[derive(Debug, Serialize, Deserialize)]
pub struct Measures {
    nodes: usize,
    leaves: usize,
    /// Only where they are reported.
    #[serde(flatten)]
    statistics: Option<Statistics>,
    /// Flow through the roots, negative out of the tissue.
    #[serde(skip_serializing_if = "Option::is_none")]
    inflow_ml_per_min: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<MeshFigures>,
}

/// Statistics of the centre lines of one kind. Values that a tree does not have are null.
#[derive(Debug, Serialize, Deserialize)]
struct Statistics {
    bifurcations: usize,
    total_length: f64,
    root_radius: Option<f32>,
    terminal_radius: Option<f32>,
    angle_mean_deg: Option<f64>,
    angle_sd_deg: Option<f64>,
    strahler_orders: usize,
    /// Order by order, from 1.
    strahler: Vec<OrderMeasures>,
    branching_ratio: Option<f64>,
    length_ratio: Option<f64>,
    diameter_ratio: Option<f64>,
    tortuosity_median: Option<f64>,
    coverage: Option<f32>,
    outside: usize,
}

/// Ends of vessels; a root that has not grown is none.
fn leaves(tree: &VesselTree) -> usize {
    let roots: Vec<usize> = tree.roots().collect();
    tree.tips().iter().filter(|&&tip| roots.binary_search(&(tip as usize)).is_err()).count()
}

/// The vessels of one Strahler order.
#[derive(Debug, Serialize, Deserialize)]
struct OrderMeasures {
    /// Number of runs of this order from end to end.
    streams: usize,
    mean_length: f64,
    mean_diameter: f64,
}

impl From<&StrahlerOrder> for OrderMeasures {
    fn from(&StrahlerOrder { streams, mean_length, mean_diameter }: &StrahlerOrder) -> Self {
        Self { streams, mean_length, mean_diameter }
    }
}

impl Statistics {
    /// Measures the vessels of one kind.
    ///
    /// The terminal radius is the median over the leaves. Coverage is the share of the samples that count as supplied.
    fn of(GrownTree { tree, reach, .. }: GrownTree, tissue: &dyn Tissue, samples: &[Vec3]) -> Self {
        let measured = tree.statistics();
        Self {
            bifurcations: measured.bifurcations,
            total_length: measured.total_length,
            root_radius: measured.root_radius.map(|radius| radius as f32),
            terminal_radius: measured.terminal_radius.map(|radius| radius.median as f32),
            angle_mean_deg: measured.bifurcation_angle.map(|angle| angle.mean),
            angle_sd_deg: measured.bifurcation_angle.map(|angle| angle.standard_deviation),
            strahler_orders: measured.strahler_orders(),
            strahler: measured.strahler.iter().map(OrderMeasures::from).collect(),
            branching_ratio: measured.branching_ratio,
            length_ratio: measured.length_ratio,
            diameter_ratio: measured.diameter_ratio,
            tortuosity_median: measured.tortuosity.map(|tortuosity| tortuosity.median),
            coverage: statistics::coverage(tree, samples, reach),
            outside: statistics::outside(tree, |node| tissue.contains(node)),
        }
    }
}
