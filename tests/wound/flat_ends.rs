//! Segments with flat ends beside a cut: incremental updates equal a computation from scratch, in any order of actions.

use crate::common::{all, flat_ends, forest, random_point, rng, straight, stumps, tree};
use bevy_math::Vec3;
use bevy_vessels::synthesis::instances::{FlatEnds, SegmentColors, SegmentInstance, write_stumps_of};
use bevy_vessels::synthesis::random::VesselRng;
use bevy_vessels::synthesis::tree::{NO_PARENT, NodeId, VesselTree, sweep::Children};
use bevy_vessels::synthesis::wound::{Blade, Retraction, WoundReport, Wounds};
use rand::RngExt;
use std::collections::BTreeMap;

const WHITE: SegmentColors = SegmentColors::Uniform([1.0; 3]);

/// A forest whose segments are about as wide as they are long; with `tapers`, most of them continue their parents'
/// width.
fn thick_forest(rng: &mut VesselRng, seed: u64, tapers: bool) -> VesselTree {
    let slender = forest(seed, 300);
    let mut radii: Vec<f32> = (0..slender.len()).map(|_| rng.random_range(0.01..0.2)).collect();
    for (node, parent) in slender.segments().filter(|_| tapers) {
        if rng.random_range(0..4) != 0 {
            radii[node] = radii[parent] * rng.random_range(0.8..1.0);
        }
    }
    tree(slender.positions().to_vec(), slender.parents().to_vec(), radii)
}

fn random_cut(rng: &mut VesselRng) -> Blade {
    let center = 0.6 * random_point(rng);
    if rng.random_range(0..3) == 0 {
        return Blade::ball(center, 0.2).expect("a ball");
    }
    let (side, other) = (0.5 * random_point(rng), random_point(rng));
    Blade::rectangle(center, side, 0.5 * side.cross(other)).expect("a rectangle")
}

/// The state of a renderer that writes only the reported changes.
struct Drawn<'a> {
    tree: &'a VesselTree,
    children: Children,
    flat: FlatEnds,
    segments: BTreeMap<NodeId, Vec<SegmentInstance>>,
}

impl<'a> Drawn<'a> {
    fn new(tree: &'a VesselTree) -> Self {
        Self { tree, children: tree.children(), flat: FlatEnds::default(), segments: BTreeMap::new() }
    }

    /// Updates after an action, and returns the number of written segments besides those that it changed.
    fn hear(&mut self, wounds: &Wounds, report: &WoundReport) -> usize {
        let children = |node: NodeId| self.children.of(node.index()).iter().map(|&child| NodeId(child));
        let others = self.flat.update(wounds, self.tree, children, report.changed.iter().copied());
        assert!(others.is_sorted_by(|a, b| a < b), "each once, in their order: {others:?}");
        for &node in report.changed.iter().chain(&others) {
            let mut pieces = Vec::new();
            write_stumps_of(wounds, &self.flat, node, self.tree, &[], &WHITE, &mut pieces);
            self.segments.remove(&node);
            if self.flat.is_redrawn(wounds, node) {
                self.segments.insert(node, pieces);
            }
        }
        others.len()
    }

    fn assert_as_from_scratch(&self, wounds: &Wounds, what: &str) {
        let scratch = flat_ends(wounds, self.tree);
        assert!(self.flat == scratch, "{what}");
        let all = 0..self.tree.len();
        assert!(self.segments.keys().copied().eq(scratch.redrawn_within(wounds, all)), "{what}");
        let drawn: Vec<SegmentInstance> = self.segments.values().flatten().copied().collect();
        assert!(drawn == stumps(wounds, self.tree, &WHITE), "{what}");
    }
}

#[test]
fn what_is_kept_up_to_date_is_as_from_scratch() {
    let (mut others, mut flat) = (0, 0);
    for seed in 0..12 {
        let mut rng = rng(700 + seed);
        let tree = thick_forest(&mut rng, seed, seed % 2 == 0);
        let radii = [0.0, 0.1, 1.5, 4.0][seed as usize % 4];
        let mut wounds = Wounds::new(Retraction { radii, length: 0.0 }).expect("a retraction");
        let mut drawn = Drawn::new(&tree);
        for step in 0..60 {
            let report = match rng.random_range(0..5) {
                0 => wounds.undo_last(rng.random_range(1..4), &tree),
                1 => {
                    let ball = Blade::ball(random_point(&mut rng), 0.4).expect("a ball");
                    wounds.cauterise(&ball, f32::INFINITY, &tree, all(&tree)).expect("a volume")
                }
                _ => wounds.cut(&random_cut(&mut rng), &tree, all(&tree)),
            };
            others += drawn.hear(&wounds, &report);
            drawn.assert_as_from_scratch(&wounds, &format!("seed {seed}, step {step}"));
            flat += tree.segments().filter(|&(node, _)| drawn.flat.sides(NodeId(node as u32)) != [false; 2]).count();
        }
        let report = wounds.undo_all(&tree);
        drawn.hear(&wounds, &report);
        assert!(drawn.flat == FlatEnds::default() && drawn.segments.is_empty(), "undo leaves no trace");
    }
    assert!(others > 0 && flat > 0, "{others} and {flat}: these trees show nothing");
}

#[test]
fn the_order_of_cuts_makes_no_difference() {
    // Finely divided, so that many segments are flat, with two gaps a few radii apart.
    let positions = (0..200).map(|node| 0.05 * node as f32 * Vec3::X).collect();
    let parents = (0..200u32).map(|node| node.wrapping_sub(1)).collect();
    let tree = tree(positions, parents, vec![0.4; 200]);
    let blade = |x: f32| Blade::rectangle(Vec3::X * x, Vec3::Y, Vec3::Z).expect("a rectangle");
    let cut = |places: [f32; 2]| {
        let mut wounds = Wounds::new(Retraction { radii: 0.5, length: 0.0 }).expect("a retraction");
        places.into_iter().for_each(|x| assert_eq!(wounds.cut(&blade(x), &tree, all(&tree)).severed, 1));
        (stumps(&wounds, &tree, &WHITE), flat_ends(&wounds, &tree))
    };
    let (drawn, flat) = cut([4.01, 5.52]);
    assert!(drawn.len() > 20 && flat != FlatEnds::default());
    assert!((drawn, flat) == cut([5.52, 4.01]));
}

#[test]
fn a_tree_that_became_another_is_seen_by_a_rebuild() {
    let thin = straight(6);
    let wide = tree(thin.positions().to_vec(), thin.parents().to_vec(), vec![0.9; 7]);
    let mut wounds = Wounds::new(Retraction { radii: 0.0, length: 0.1 }).expect("a retraction");
    let blade = Blade::rectangle(3.5 * Vec3::X, Vec3::Y, Vec3::Z).expect("a rectangle");
    wounds.cut(&blade, &thin, all(&thin));
    let mut flat = flat_ends(&wounds, &thin);
    assert!(flat == FlatEnds::default(), "round ends are far from the gap");
    let children = wide.children();
    let children = |node: NodeId| children.of(node.index()).iter().map(|&child| NodeId(child));
    let changed = flat.rebuild(&wounds, &wide, children);
    assert_eq!(changed, [2, 3, 4, 5, 6].map(NodeId), "those that are near now, and what begins in them");
    assert!(flat == flat_ends(&wounds, &wide));
    let short = tree(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![0.9; 2]);
    flat.rebuild(&wounds, &short, |_| []);
    assert!(flat == FlatEnds::default(), "what the tree no longer has");
}
