//! Statistics of a tree, as papers on vascular networks report them.
//!
//! In: a finished [`VesselTree`]. Out: [`TreeStatistics`], and two measures against the tissue, [`coverage`] and
//! [`outside`]. Nothing here fails: values that are undefined for a tree, such as angles without bifurcations, are
//! `None`. Lengths are in tissue lengths, sums are computed in f64.
//!
//! Sources: orders and their ratios after Horton 1945 and Strahler 1957, on vessels after Jiang, Kassab & Fung,
//! "Diameter-defined Strahler system and connectivity matrix of the pulmonary arterial tree" (1994), without its
//! definition by diameter; the set of measures after Rauch & Harders 2021, section 5.

use super::{VesselTree, sweep::Children};
use crate::synthesis::space::point_grid::PointGrid;
use bevy_math::{Vec3, Vec3A, bounding::Aabb3d, ops};

/// Distribution of a measure over a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Number of values.
    pub count: usize,
    /// Their arithmetic mean.
    pub mean: f64,
    /// Their standard deviation: the root of the mean squared deviation.
    pub standard_deviation: f64,
    /// The middle value, or the mean of the two in the middle.
    pub median: f64,
    /// The least value.
    pub minimum: f64,
    /// The greatest value.
    pub maximum: f64,
}

impl Summary {
    /// Summary of values in any order, `None` without a value. Sorts them.
    pub fn of(values: &mut [f64]) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let (&minimum, &maximum) = (values.first()?, values.last()?);
        let count = values.len();
        let mean = values.iter().sum::<f64>() / count as f64;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count as f64;
        let median = f64::midpoint(values[(count - 1) / 2], values[count / 2]);
        Some(Self { count, mean, standard_deviation: variance.sqrt(), median, minimum, maximum })
    }
}

/// All vessels of one Strahler order.
///
/// A stream (element in Jiang 1994) is a longest run of segments of one order. Streams also end at a root: one that
/// several vessels leave starts a stream for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrahlerOrder {
    /// Number `N_k` of streams.
    pub streams: usize,
    /// Mean length of a stream, in tissue lengths.
    pub mean_length: f64,
    /// Mean over the streams of their mean diameter along their length, in tissue lengths.
    pub mean_diameter: f64,
}

/// Numbers that describe a tree, or all trees of a forest together.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeStatistics {
    /// Number of nodes, roots included.
    pub nodes: usize,
    /// Number of roots.
    pub roots: usize,
    /// Number of terminals: segments without a following one. A single root is not one.
    pub leaves: usize,
    /// Number of nodes with two children.
    pub bifurcations: usize,
    /// Number of nodes with three children or more.
    pub multifurcations: usize,
    /// Summed length of all segments, in tissue lengths.
    pub total_length: f64,
    /// Summed volume πr²l of all segments, in cubic tissue lengths.
    pub volume: f64,
    /// Radius of the thickest root, in tissue lengths.
    pub root_radius: Option<f64>,
    /// Radii of the leaves, in tissue lengths. They differ if the terminal radius shrinks as the tissue grows.
    pub terminal_radius: Option<Summary>,
    /// Angles between the two daughter segments of each bifurcation, in degrees.
    pub bifurcation_angle: Option<Summary>,
    /// Area ratios `(r_1² + r_2²) / r_p²` of each bifurcation.
    pub area_ratio: Option<Summary>,
    /// Asymmetry ratios `r_s / r_l` of each bifurcation: smaller over larger daughter radius.
    pub asymmetry: Option<Summary>,
    /// Tortuosity of the path to each leaf: its length along the vessels divided by the straight distance from the
    /// root.
    pub tortuosity: Option<Summary>,
    /// Streams by Strahler order, from order 1 on. Empty without segments.
    pub strahler: Vec<StrahlerOrder>,
    /// Branching ratio `R_B`: 10 to the negative slope of log₁₀ `N_k` over k. Needs two orders.
    pub branching_ratio: Option<f64>,
    /// Length ratio `R_L`: 10 to the slope of log₁₀ of the mean stream length over k. Needs two orders.
    pub length_ratio: Option<f64>,
    /// Diameter ratio `R_D`: 10 to the slope of log₁₀ of the mean stream diameter over k. Needs two orders.
    pub diameter_ratio: Option<f64>,
    /// Mean diameter of the branches, in tissue lengths, by the number of splits between them and their root. A branch
    /// counts once, with its mean diameter along its length.
    pub diameters_by_level: Vec<f64>,
}

impl TreeStatistics {
    /// Measures a tree. Takes a few passes over its nodes.
    pub fn of(tree: &VesselTree) -> Self {
        let children = tree.children();
        let at_bifurcations = Bifurcations::of(tree, &children);
        let mut leaf_radii = Vec::new();
        let mut tortuosities = Vec::new();
        let roots = tree.root_of_nodes();
        let paths = tree.path_lengths();
        let (mut total_length, mut volume) = (0.0, 0.0);
        for (node, _) in tree.segments() {
            let radius = f64::from(tree.radii()[node]);
            let length = tree.segment_length(node);
            total_length += length;
            volume += std::f64::consts::PI * radius * radius * length;
            if children.of(node).is_empty() {
                leaf_radii.push(radius);
                let root = tree.positions()[roots[node] as usize];
                let straight = f64::from(tree.positions()[node].distance(root));
                if straight > 0.0 {
                    tortuosities.push(paths[node] / straight);
                }
            }
        }
        let strahler = strahler(tree);
        let [streams, lengths, diameters] = regressions(&strahler);
        Self {
            nodes: tree.len(),
            roots: tree.roots().count(),
            leaves: leaf_radii.len(),
            bifurcations: at_bifurcations.count,
            multifurcations: at_bifurcations.larger,
            total_length,
            volume,
            root_radius: tree.roots().map(|root| f64::from(tree.radii()[root])).reduce(f64::max),
            terminal_radius: Summary::of(&mut leaf_radii),
            bifurcation_angle: at_bifurcations.angles,
            area_ratio: at_bifurcations.area_ratios,
            asymmetry: at_bifurcations.asymmetries,
            tortuosity: Summary::of(&mut tortuosities),
            branching_ratio: streams.map(f64::recip),
            length_ratio: lengths,
            diameter_ratio: diameters,
            strahler,
            diameters_by_level: diameters_by_level(tree),
        }
    }

    /// The highest Strahler order of a segment; 0 without segments.
    pub fn strahler_orders(&self) -> usize {
        self.strahler.len()
    }
}

impl VesselTree {
    /// Statistics of this tree. See [`TreeStatistics`].
    pub fn statistics(&self) -> TreeStatistics {
        TreeStatistics::of(self)
    }

    /// The angle between the two children of each bifurcation, in degrees, in the order of the nodes: for a histogram.
    ///
    /// Bifurcations with a child of no length are left out.
    pub fn bifurcation_angles(&self) -> Vec<f64> {
        let children = self.children();
        let pairs = (0..self.len()).filter_map(|node| <&[u32; 2]>::try_from(children.of(node)).ok());
        pairs.filter_map(|&[first, second]| self.angle_between(first, second)).collect()
    }

    fn angle_between(&self, first: u32, second: u32) -> Option<f64> {
        angle_degrees(self.segment_vector(first as usize), self.segment_vector(second as usize))
    }
}

/// Measures at nodes with two children.
struct Bifurcations {
    count: usize,
    larger: usize,
    angles: Option<Summary>,
    area_ratios: Option<Summary>,
    asymmetries: Option<Summary>,
}

impl Bifurcations {
    fn of(tree: &VesselTree, children: &Children) -> Self {
        let (mut angles, mut area_ratios, mut asymmetries) = (Vec::new(), Vec::new(), Vec::new());
        let (mut count, mut larger) = (0, 0);
        for node in 0..tree.len() {
            let &[first, second] = children.of(node) else {
                larger += usize::from(children.of(node).len() > 2);
                continue;
            };
            count += 1;
            angles.extend(tree.angle_between(first, second));
            let [first, second] = [first as usize, second as usize];
            let [parent, a, b] = [node, first, second].map(|node| f64::from(tree.radii()[node]));
            area_ratios.push((a * a + b * b) / (parent * parent));
            asymmetries.push(a.min(b) / a.max(b));
        }
        Self {
            count,
            larger,
            angles: Summary::of(&mut angles),
            area_ratios: Summary::of(&mut area_ratios),
            asymmetries: Summary::of(&mut asymmetries),
        }
    }
}

/// Angle between two vectors in degrees, accurate for small and for straight angles, too; `None` if one has no length.
fn angle_degrees(a: Vec3, b: Vec3) -> Option<f64> {
    let (a, b) = (a.try_normalize()?, b.try_normalize()?);
    Some(f64::from(2.0 * ops::atan2((a - b).length(), (a + b).length())).to_degrees())
}

/// Length and mean diameter of a run of segments, summed segment by segment.
#[derive(Clone, Copy, Default)]
struct Run {
    length: f64,
    weighted_diameter: f64,
    diameter: f64,
    segments: f64,
}

impl Run {
    fn add(&mut self, tree: &VesselTree, node: usize) {
        let length = tree.segment_length(node);
        let diameter = 2.0 * f64::from(tree.radii()[node]);
        self.length += length;
        self.weighted_diameter += diameter * length;
        self.diameter += diameter;
        self.segments += 1.0;
    }

    /// Mean along the length, or over the segments if they have no length.
    fn mean_diameter(&self) -> f64 {
        if self.length > 0.0 { self.weighted_diameter / self.length } else { self.diameter / self.segments }
    }
}

fn strahler(tree: &VesselTree) -> Vec<StrahlerOrder> {
    let orders = tree.strahler_orders();
    let mut stream_of = vec![usize::MAX; tree.len()];
    let mut streams: Vec<(u32, Run)> = Vec::new();
    for (node, parent) in tree.segments() {
        // A root is the end of no segment, so it has no stream to continue.
        let continues = stream_of[parent] != usize::MAX && orders[parent] == orders[node];
        stream_of[node] = if continues { stream_of[parent] } else { streams.len() };
        if !continues {
            streams.push((orders[node], Run::default()));
        }
        streams[stream_of[node]].1.add(tree, node);
    }
    let highest = streams.iter().map(|&(order, _)| order).max().unwrap_or(0);
    let none = StrahlerOrder { streams: 0, mean_length: 0.0, mean_diameter: 0.0 };
    let mut table = vec![none; highest as usize];
    for (order, run) in streams {
        let row = &mut table[order as usize - 1];
        row.streams += 1;
        row.mean_length += run.length;
        row.mean_diameter += run.mean_diameter();
    }
    for row in &mut table {
        row.mean_length /= row.streams as f64;
        row.mean_diameter /= row.streams as f64;
    }
    table
}

/// Factors per order of the number, the mean length and the mean diameter of streams.
fn regressions(strahler: &[StrahlerOrder]) -> [Option<f64>; 3] {
    let measures: [fn(&StrahlerOrder) -> f64; 3] =
        [|order| order.streams as f64, |order| order.mean_length, |order| order.mean_diameter];
    measures.map(|measure| factor_per_step(strahler.iter().map(measure)))
}

/// 10 to the least-squares slope of log₁₀ of the values over their index.
fn factor_per_step(values: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = values.len();
    if count < 2 {
        return None;
    }
    let mean_index = (count - 1) as f64 / 2.0;
    let (mut covariance, mut variance) = (0.0, 0.0);
    for (index, value) in values.enumerate() {
        if value <= 0.0 {
            return None;
        }
        let offset = index as f64 - mean_index;
        covariance += offset * f64::from(ops::log10(value as f32));
        variance += offset * offset;
    }
    let factor = f64::from(ops::powf(10.0, (covariance / variance) as f32));
    (factor.is_finite() && factor > 0.0).then_some(factor)
}

fn diameters_by_level(tree: &VesselTree) -> Vec<f64> {
    let levels = tree.bifurcation_levels();
    let mut sums: Vec<(f64, f64)> = Vec::new();
    for nodes in tree.branches().iter() {
        let mut run = Run::default();
        for &node in &nodes[1..] {
            run.add(tree, node as usize);
        }
        let level = levels[nodes[1] as usize] as usize;
        if sums.len() <= level {
            sums.resize(level + 1, (0.0, 0.0));
        }
        sums[level].0 += run.mean_diameter();
        sums[level].1 += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}

/// Share, between 0 and 1, of sample points that lie within `distance` of a node, itself included.
///
/// With samples spread over the tissue and the final birth distance, it is the share of the tissue supplied by the
/// vessels. Sample points that are not finite count as uncovered. `None` without samples.
pub fn coverage(tree: &VesselTree, samples: &[Vec3], distance: f32) -> Option<f32> {
    if samples.is_empty() {
        return None;
    }
    if tree.is_empty() {
        return Some(0.0);
    }
    let index = nodes_within(tree, distance);
    let mut covered = vec![false; samples.len()];
    // Most samples of a well-supplied tissue have a node in their own cell.
    index.mark_beside(samples, distance, &mut covered);
    let is_near = |sample: Vec3, marked: bool| marked || index.any_within(sample, distance);
    let is_covered = |&(&sample, &marked): &(&Vec3, &bool)| sample.is_finite() && is_near(sample, marked);
    Some(samples.iter().zip(&covered).filter(is_covered).count() as f32 / samples.len() as f32)
}

/// A grid of the nodes, for questions within a distance.
fn nodes_within(tree: &VesselTree, distance: f32) -> PointGrid {
    let finite = || tree.positions().iter().copied().filter(|position| position.is_finite()).map(Vec3A::from);
    let min = finite().reduce(Vec3A::min).unwrap_or_default();
    let max = finite().reduce(Vec3A::max).unwrap_or_default();
    // Many more cells than nodes would only take memory.
    let coarse = (max - min).max_element() / (2.0 * ops::cbrt(tree.len() as f32));
    let cell = (PointGrid::CELL * distance.abs()).max(0.1 * coarse);
    let mut index = PointGrid::new(&Aabb3d { min, max }, cell);
    tree.positions().iter().for_each(|&position| _ = index.push(position));
    index
}

/// Number of nodes for which `contains` is false: with a tissue's test, those outside it.
pub fn outside(tree: &VesselTree, contains: impl Fn(Vec3) -> bool) -> usize {
    tree.positions().iter().filter(|&&position| !contains(position)).count()
}
