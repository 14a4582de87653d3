//! Plain computations of what a tree must be.

use bevy_math::DVec3;
use bevy_vessels::synthesis::{
    cco::{Cco, VesselFlow},
    growth::Growth,
    segment_index::MAX_FLARE,
    tissue::Extent,
    tree::{NO_PARENT, VesselKind, VesselTree},
};

/// A segment as it is drawn: two ends with their radii, the nodes there, and the number of the tree.
struct Tube {
    ends: [DVec3; 2],
    radii: [f64; 2],
    nodes: [usize; 2],
    tree: usize,
}

impl Tube {
    fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// Centre and radius at a share of the way.
    fn at(&self, share: f64) -> (DVec3, f64) {
        (self.ends[0].lerp(self.ends[1], share), self.radii[0] + share * (self.radii[1] - self.radii[0]))
    }
}

fn tubes(growth: &Cco) -> Vec<Tube> {
    let trees = VesselKind::ALL.map(|kind| growth.tree(kind));
    let tubes_of = |(number, tree): (usize, &VesselTree)| {
        let tube = |(node, parent): (usize, usize)| {
            let [above, own] = [parent, node].map(|node| tree.radii()[node]);
            Tube {
                ends: [parent, node].map(|node| tree.positions()[node].as_dvec3()),
                radii: [above.min(MAX_FLARE * own), own].map(f64::from),
                nodes: [parent, node],
                tree: number,
            }
        };
        tree.segments().map(tube).collect::<Vec<_>>()
    };
    trees.into_iter().enumerate().flat_map(tubes_of).collect()
}

/// Least of a convex function from 0 to 1, by thirds.
fn least(value: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let [first, second] = [(2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0];
        if value(first) <= value(second) { high = second } else { low = first }
    }
    [0.0, 1.0, 0.5 * (low + high)].into_iter().map(value).fold(f64::INFINITY, f64::min)
}

/// Least distance between the axes of two segments: of the ends of each from the other, or where their lines come
/// nearest.
fn between_axes(a: &Tube, b: &Tube) -> f64 {
    let to = |point: DVec3, [from, to]: [DVec3; 2]| {
        let way = to - from;
        let share = ((point - from).dot(way) / way.length_squared()).clamp(0.0, 1.0);
        (from + way * share).distance(point)
    };
    let ends = a.ends.map(|end| to(end, b.ends)).into_iter().chain(b.ends.map(|end| to(end, a.ends)));
    let least = ends.fold(f64::MAX, f64::min);
    let (u, v, w) = (a.ends[1] - a.ends[0], b.ends[1] - b.ends[0], b.ends[0] - a.ends[0]);
    let normal = u.cross(v);
    let square = normal.length_squared();
    if square < 1e-18 * u.length_squared() * v.length_squared() {
        return least;
    }
    let (s, t) = (w.cross(v).dot(normal) / square, w.cross(u).dot(normal) / square);
    let inner = [s, t].into_iter().all(|share| (0.0..=1.0).contains(&share));
    if inner { least.min(w.dot(normal).abs() / square.sqrt()) } else { least }
}

/// Least distance between the surfaces of two segments, negative if they overlap: of all balls of one from all of the
/// other.
fn distance(a: &Tube, b: &Tube) -> f64 {
    least(|share| {
        let (center, radius) = a.at(share);
        least(|share| {
            let (other, other_radius) = b.at(share);
            center.distance(other) - radius - other_radius
        })
    })
}

/// No two segments without a common node overlap as they are drawn, by comparing all with all.
pub fn check_overlaps(name: &str, growth: &Cco) {
    let tubes = tubes(growth);
    let box_of = |tube: &Tube| {
        let [a, b] = tube.ends;
        (a.min(b) - tube.radii[0], a.max(b) + tube.radii[0])
    };
    let boxes: Vec<(DVec3, DVec3)> = tubes.iter().map(box_of).collect();
    for (number, a) in tubes.iter().enumerate() {
        for (b, (min, max)) in tubes[..number].iter().zip(&boxes) {
            let is_joined = a.tree == b.tree && a.nodes.iter().any(|node| b.nodes.contains(node));
            let are_apart = boxes[number].0.cmpgt(*max).any() || boxes[number].1.cmplt(*min).any();
            // Where the axes are farther apart than the widest balls are large, nothing is to be searched for.
            if !is_joined && !are_apart && between_axes(a, b) < a.radii[0] + b.radii[0] {
                let gap = distance(a, b);
                assert!(gap >= 0.0, "{name}: {:?} and {:?} overlap by {}", a.nodes, b.nodes, -gap);
            }
        }
    }
}

/// All that holds for every tree.
pub fn check(name: &str, growth: &Cco) {
    check_overlaps(name, growth);
    assert_eq!(growth.overlaps(), 0, "{name}");
    for report in growth.reports() {
        check_tree(name, growth, report.kind);
    }
    check_inside(name, growth);
    let grown = growth.trees();
    assert!(VesselKind::ALL.iter().all(|&kind| grown[kind].is_none_or(|grown| grown.waiting == 0)), "{name}");
}

/// Murray's law, flow, and what is reported of a kind.
pub fn check_tree(name: &str, growth: &Cco, kind: VesselKind) {
    for report in growth.reports().filter(|report| report.kind == kind) {
        let tree = growth.tree(report.kind);
        tree.validate().unwrap_or_else(|error| panic!("{name}: {error}"));
        let gamma = growth.settings().bifurcation_exponent;
        let residual = tree.murray_residual(gamma);
        assert!(residual <= 1e-6, "{name}: Murray's residual is {residual}");
        check_flow(name, growth, report.kind);
        let volume: f64 = tree
            .segments()
            .map(|(node, parent)| {
                let length = f64::from(tree.positions()[node].distance(tree.positions()[parent]));
                std::f64::consts::PI * f64::from(tree.radii()[node]).powi(2) * length
            })
            .sum();
        assert!((volume / report.volume - 1.0).abs() < 1e-5, "{name}: volume {volume}, reported {}", report.volume);
        assert!((f64::from(tree.widest_radius()) / report.root_radius - 1.0).abs() < 1e-6);
        assert_eq!(tree.tips().len(), report.terminals as usize, "{name}");
    }
}

/// Blood that enters at the root's pressure, and leaves equally from all terminals, arrives at each with the terminals'
/// pressure: Poiseuille's law along every way, with radii and lengths in millimetres.
fn check_flow(name: &str, growth: &Cco, kind: VesselKind) {
    let tree = growth.tree(kind);
    let settings = growth.settings();
    let extent = growth.tissue().extent();
    let share = f64::from(settings.perfusion);
    let scale = match extent {
        Extent::Volume(volume) | Extent::Sheet { volume, .. } => (share / f64::from(volume)).cbrt(),
        Extent::Area(area) => (share / f64::from(area)).sqrt(),
        Extent::Length(_) => unreachable!("it has no inside"),
    };
    let mut terminals = vec![0u32; tree.len()];
    for tip in tree.tips().into_iter().map(|tip| tip as usize) {
        terminals[tip] = 1;
    }
    for node in (0..tree.len()).rev() {
        if let Some(parent) = tree.parent(bevy_vessels::synthesis::tree::NodeId(node as u32)) {
            terminals[parent.index()] += terminals[node];
        }
    }
    let all: u32 = tree.roots().map(|root| terminals[root]).sum();
    assert_eq!(all, settings.terminals, "{name}");
    let VesselFlow { rate, viscosity, root_pressure, terminal_pressure } = settings.flow[kind];
    let flow = rate.cubic_metres_per_second() * 1e9 / f64::from(settings.terminals);
    let mut pressures = vec![root_pressure.pascals(); tree.len()];
    for (node, parent) in tree.segments() {
        let length = f64::from(tree.positions()[node].distance(tree.positions()[parent])) * scale;
        let radius = f64::from(tree.radii()[node]) * scale;
        let resistance = 8.0 * viscosity.pascal_seconds() * length / (std::f64::consts::PI * radius.powi(4));
        pressures[node] = pressures[parent] - resistance * flow * f64::from(terminals[node]);
    }
    let expected = terminal_pressure.pascals();
    let drop = root_pressure.pascals() - expected;
    for tip in tree.tips().into_iter().map(|tip| tip as usize) {
        let error = (pressures[tip] - expected).abs() / drop;
        assert!(error <= 1e-3, "{name}: terminal {tip} has {} Pa instead of {expected}", pressures[tip]);
    }
}

/// Every segment keeps its whole width inside and out of what is forbidden, by points along it. A root's may be nearer
/// to the border where it enters.
pub fn check_inside(name: &str, growth: &Cco) {
    let tissue = growth.tissue();
    let trees: Vec<&VesselTree> = VesselKind::ALL.iter().map(|&kind| growth.tree(kind)).collect();
    for tube in tubes(growth) {
        let is_entrance = trees[tube.tree].parents()[tube.nodes[0]] == NO_PARENT;
        let border = f64::from(growth.settings().border_distance);
        for step in 0..=40 {
            let share = f64::from(step) / 40.0;
            let (center, radius) = tube.at(share);
            let (point, need) = (center.as_vec3(), radius + border);
            let is_forbidden = tissue.no_go().is_some_and(|field| field.forbids(point));
            assert!(!is_forbidden, "{name}: {:?} leads through {point}", tube.nodes);
            if is_entrance && share * tube.length() < 2.0 * need {
                continue;
            }
            let depth = f64::from(tissue.depth(point).expect("a depth"));
            assert!(depth >= need * (1.0 - 1e-5), "{name}: {:?} is {depth} deep, not {need}", tube.nodes);
        }
    }
}
