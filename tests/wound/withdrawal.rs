//! Retraction of ends on a vessel of many segments: as far as on one of few segments, until something holds them.

use crate::common::{all, flat_ends, rng, stumps, tree};
use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::haemodynamics::{FlowSettings, Network};
use bevy_vessels::synthesis::instances::{SegmentColors, SegmentInstance, write_segments};
use bevy_vessels::synthesis::random::VesselRng;
use bevy_vessels::synthesis::tree::{NO_PARENT, NodeId, Place, VesselTree};
use bevy_vessels::synthesis::{
    segment_index::SegmentIndex,
    wound::{Blade, EndSide, Retraction, SeveredEnd, WoundError, Wounds},
};
use rand::RngExt;

const RADIUS: f32 = 0.4;
const LENGTH: f32 = 10.0;

/// A vessel along x from 0 to 10, with nodes at some places in between.
fn tube(joints: &[f32]) -> VesselTree {
    let nodes = [0.0].iter().chain(joints).chain(&[LENGTH]);
    let positions: Vec<Vec3> = nodes.map(|&x| Vec3::X * x).collect();
    let parents = (0..positions.len() as u32).map(|node| node.wrapping_sub(1)).collect();
    let radii = vec![RADIUS; positions.len()];
    tree(positions, parents, radii)
}

fn divided(parts: usize) -> VesselTree {
    tube(&(1..parts).map(|joint| LENGTH * joint as f32 / parts as f32).collect::<Vec<_>>())
}

/// A vessel with random nodes, many of them closer to each other than its width.
fn randomly_divided(rng: &mut VesselRng) -> VesselTree {
    let mut joints: Vec<f32> = (0..60).map(|_| rng.random_range(0.01..LENGTH - 0.01)).collect();
    joints.sort_by(f32::total_cmp);
    tube(&joints)
}

fn across(places: &[f32]) -> Blade {
    let triangle = |&x: &f32| [vec3(x, -1.0, -1.0), vec3(x, 2.0, -1.0), vec3(x, -1.0, 2.0)];
    Blade::triangles(places.iter().map(triangle).collect()).expect("valid numbers")
}

fn wounds(radii: f32) -> Wounds {
    Wounds::new(Retraction { radii, length: 0.0 }).expect("valid numbers")
}

fn assert_near(found: &[f32], expected: &[f32], what: &str) {
    let near = found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(near, "{what}: {found:?}, not {expected:?}");
}

/// Positions of all ends of a vessel along x, from root to tip, and whether each is open.
fn ends(wounds: &Wounds, tree: &VesselTree) -> (Vec<f32>, Vec<(EndSide, bool)>) {
    let mut ends: Vec<SeveredEnd> = wounds.ends(tree).collect();
    // Two may touch.
    ends.sort_by(|a, b| a.position.x.total_cmp(&b.position.x).then(a.side.cmp(&b.side)));
    ends.iter().map(|end| (end.position.x, (end.side, end.is_open))).unzip()
}

/// A straight vessel, described by its length alone, without nodes.
#[derive(Default)]
struct Line {
    /// Gaps, and whether the vessel has an end on either side.
    gaps: Vec<([f32; 2], [bool; 2])>,
    clamps: Vec<f32>,
}

impl Line {
    fn gap_at(&self, x: f32) -> Option<([f32; 2], [bool; 2])> {
        self.gaps.iter().find(|([from, to], _)| *from <= x && x <= *to).copied()
    }

    /// Rest positions of ends that are severed at a place, with others severed at the same time.
    fn rest(&self, x: f32, others: &[f32], wish: f32) -> [f32; 2] {
        let gaps = self.gaps.iter().map(|(gap, _)| *gap);
        let holds = || others.iter().chain(&self.clamps).copied().filter(|&hold| hold != x);
        let below = holds().chain(gaps.clone().map(|gap| gap[1])).filter(|&hold| hold <= x).fold(0.0, f32::max);
        let above = holds().chain(gaps.map(|gap| gap[0])).filter(|&hold| hold >= x).fold(LENGTH, f32::min);
        [x - wish.min(0.45 * (x - below)), x + wish.min(0.45 * (above - x))]
    }

    fn open(&mut self, gap: [f32; 2], tips: [bool; 2]) {
        self.gaps.retain(|(other, _)| other[1] < gap[0] || other[0] > gap[1]);
        self.clamps.retain(|&clamp| clamp <= gap[0] || clamp >= gap[1]);
        self.gaps.push((gap, tips));
    }

    fn cut(&mut self, places: &[f32], wish: f32) {
        let places: Vec<f32> = places.iter().copied().filter(|&x| self.gap_at(x).is_none()).collect();
        let gaps: Vec<_> = places.iter().map(|&x| self.rest(x, &places, wish)).collect();
        gaps.into_iter().for_each(|gap| self.open(gap, [true; 2]));
    }

    fn take_out(&mut self, [from, to]: [f32; 2], wish: f32) {
        let (start, first) = match self.gap_at(from) {
            _ if from < 0.0 => (0.0, false),
            Some((gap, tips)) => (gap[0], tips[0]),
            None => (self.rest(from, &[], wish)[0], true),
        };
        let (end, last) = match self.gap_at(to) {
            _ if to > LENGTH => (LENGTH, false),
            Some((gap, tips)) => (gap[1], tips[1]),
            None => (self.rest(to, &[], wish)[1], true),
        };
        self.clamps.retain(|&clamp| !((from < 0.0 && clamp <= to) || (to > LENGTH && clamp >= from)));
        self.open([start, end], [first, last]);
    }

    fn ends(&self) -> (Vec<f32>, Vec<EndSide>) {
        let mut gaps = self.gaps.clone();
        gaps.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        let ends = gaps
            .iter()
            .flat_map(|(gap, tips)| [(gap[0], tips[0], EndSide::Proximal), (gap[1], tips[1], EndSide::Distal)]);
        ends.filter(|(_, is_there, _)| *is_there).map(|(x, _, side)| (x, side)).unzip()
    }
}

/// Everything that is drawn: whole segments in their slots, and pieces in place of others.
fn drawn(wounds: &Wounds, tree: &VesselTree) -> Vec<SegmentInstance> {
    let mut all = vec![SegmentInstance::HIDDEN; tree.len()];
    let white = SegmentColors::Uniform([1.0; 3]);
    write_segments(tree, &[], 0..tree.len(), &white, &mut all);
    let flat = flat_ends(wounds, tree);
    flat.redrawn_within(wounds, 0..tree.len()).for_each(|node| all[node.index()] = SegmentInstance::HIDDEN);
    all.extend(stumps(wounds, tree, &white));
    all.retain(SegmentInstance::is_visible);
    all
}

/// The range along x in which a segment is drawn, round ends included.
fn reach(segment: &SegmentInstance) -> [f32; 2] {
    let ([start, end], [starts_open, ends_open]) = (segment.radii(), segment.is_open());
    let dome = |height: f32, is_open: bool| if is_open { 0.0 } else { height };
    [segment.start[0] - dome(0.4 * start, starts_open), segment.end[0] + dome(end, ends_open)]
}

#[test]
fn a_vessel_of_many_segments_is_cut_as_its_length_alone() {
    for seed in 0..20 {
        let mut rng = rng(500 + seed);
        let tree = randomly_divided(&mut rng);
        let index = SegmentIndex::new(&tree);
        let radii = [0.1, 1.5, 4.0, 40.0][seed as usize % 4];
        let (mut line, mut wounds, wish) = (Line::default(), wounds(radii), radii * RADIUS);
        for step in 0..12 {
            let what = format!("seed {seed}, step {step}");
            let x = rng.random_range(0.0..LENGTH);
            match rng.random_range(0..4) {
                0 => {
                    let half = rng.random_range(0.05..0.6);
                    let ball = Blade::ball(Vec3::X * x, half).expect("valid numbers");
                    wounds.cut(&ball, &tree, all(&tree));
                    line.take_out([x - half, x + half], wish);
                }
                1 => {
                    let near = wounds.nearest_place(&tree, all(&tree), Vec3::X * x, 0.0);
                    if let Some((place, _)) = near.filter(|(_, distance)| (distance + RADIUS).abs() < 1e-6) {
                        wounds.clamp(place, &tree).expect("there is a vessel");
                        line.clamps.push(x);
                    }
                }
                _ => {
                    let places: Vec<f32> = (0..rng.random_range(1..4)).map(|_| rng.random_range(0.0..LENGTH)).collect();
                    let expected = places.iter().filter(|&&x| line.gap_at(x).is_none()).count();
                    let search = |region: &_, visit: &mut dyn FnMut(NodeId)| index.candidates_in(region, visit);
                    assert_eq!(wounds.cut(&across(&places), &tree, search).severed, expected, "{what}");
                    line.cut(&places, wish);
                }
            }
            let ((found, kinds), (expected, sides)) = (ends(&wounds, &tree), line.ends());
            assert_near(&found, &expected, &what);
            assert!(kinds.iter().map(|(side, _)| *side).eq(sides), "{what}");
        }
    }
}

#[test]
fn the_gap_is_the_same_however_finely_a_vessel_is_divided() {
    let coarse = divided(1);
    let mut whole = wounds(1.5);
    whole.cut(&across(&[4.321]), &coarse, all(&coarse));
    let expected = ends(&whole, &coarse);
    assert_near(&expected.0, &[4.321 - 0.6, 4.321 + 0.6], "as far as is wished");
    for parts in [7, 50, 1_000, 1_001] {
        let fine = divided(parts);
        let mut many = wounds(1.5);
        assert_eq!(many.cut(&across(&[4.321]), &fine, all(&fine)).severed, 1);
        let found = ends(&many, &fine);
        assert_near(&found.0, &expected.0, "the same gap");
        assert_eq!(found.1, expected.1);
    }
}

#[test]
fn nothing_drawn_reaches_into_a_gap_or_a_lumen() {
    for (parts, x) in [(1, 4.321), (7, 4.3), (50, 5.0), (50, 5.13), (400, 4.321), (400, 0.31)] {
        let tree = divided(parts);
        let mut wounds = wounds(1.5);
        let before = drawn(&wounds, &tree);
        wounds.cut(&across(&[x]), &tree, all(&tree));
        let ([from, to], depth) = (<[f32; 2]>::try_from(ends(&wounds, &tree).0).expect("two ends"), 1.2 * RADIUS);
        for segment in drawn(&wounds, &tree) {
            let [start, end] = reach(&segment);
            let (is_before, is_after) = (end <= from + 1e-5, start >= to - 1e-5);
            assert!(is_before || is_after, "{parts} parts: {start} to {end} fills the gap {from} to {to}");
            // A round end that reaches into the lumen would be visible in it.
            let in_first = is_before && !segment.is_open()[1] && end > (from - depth).max(0.0);
            let in_last = is_after && !segment.is_open()[0] && start < (to + depth).min(LENGTH);
            assert!(!in_first && !in_last, "{parts} parts: {start} to {end} fills a lumen of {from} to {to}");
        }
        wounds.undo(&tree);
        assert!(wounds.is_empty());
        assert_eq!(drawn(&wounds, &tree), before, "undo leaves no trace");
    }
}

#[test]
fn where_vessel_is_gone_with_an_end_there_is_none() {
    let tree = divided(100);
    let mut wounds = wounds(1.5);
    let report = wounds.cut(&across(&[5.05]), &tree, all(&tree));
    assert_eq!((report.severed, report.opened.len()), (1, 2));
    assert_eq!(report.opened.iter().map(|end| end.side).collect::<Vec<_>>(), [EndSide::Proximal, EndSide::Distal]);
    for x in [4.46, 4.75, 5.0, 5.05, 5.1, 5.64] {
        let node = NodeId((x / 0.1_f32).ceil() as u32);
        let place = Place::new(node, (x - 0.1 * (node.0 - 1) as f32) / 0.1);
        assert_eq!(wounds.clamp(place, &tree), Err(WoundError::NoVessel { place }), "at {x}");
        assert_eq!(wounds.cut(&across(&[x]), &tree, all(&tree)).severed, 0, "at {x}");
    }
    let (place, distance) = wounds.nearest_place(&tree, all(&tree), Vec3::X * 5.04, 1.0).expect("one of the ends");
    assert!((tree.position_at(place).x - 4.45).abs() < 1e-5 && (distance + RADIUS - 0.59).abs() < 1e-5);
    // The ends are cut again, at their present positions.
    assert_eq!(wounds.cut(&across(&[4.4, 5.7]), &tree, all(&tree)).severed, 2);
    wounds.undo_all(&tree);
    assert!(wounds.is_empty());
    assert_eq!(flat_ends(&wounds, &tree).redrawn_within(&wounds, 0..tree.len()).count(), 0);
}

/// A trunk along x of short segments, with a branch at 5.
fn branched(branch_radius: f32) -> VesselTree {
    let trunk = divided(50);
    let mut positions = trunk.positions().to_vec();
    positions.push(vec3(5.0, 3.0, 0.0));
    let (mut parents, mut radii) = (trunk.parents().to_vec(), trunk.radii().to_vec());
    parents.push(25);
    radii.push(branch_radius);
    tree(positions, parents, radii)
}

#[test]
fn a_branching_holds_an_end_and_keeps_a_lumen() {
    let tree = branched(0.1);
    let mut wounds = wounds(1.5);
    let opened = wounds.cut(&across(&[5.3]), &tree, all(&tree)).opened;
    assert_eq!(opened.len(), 2);
    let found: Vec<f32> = opened.iter().map(|end| end.position.x).collect();
    assert_near(&found, &[5.3 - 0.45 * 0.3, 5.9], "upwards to the branching, downwards as far as is wished");
    assert!(!wounds.is_severed(NodeId(51)), "the branch is whole");
    let opened = wounds.cut(&Blade::ball(vec3(5.0, 1.0, 0.0), 0.2).expect("a ball"), &tree, all(&tree)).opened;
    let found: Vec<f32> = opened.iter().map(|end| end.position.y).collect();
    assert_near(&found, &[0.8 - 0.15, 1.2 + 0.15], "an end of the branch");
}

#[test]
fn the_trunk_is_drawn_flat_beside_a_thin_branch_and_round_beside_a_wide_one() {
    for (radius, is_flat) in [(0.1, true), (0.35, false)] {
        let tree = branched(radius);
        let mut wounds = wounds(1.5);
        wounds.cut(&across(&[5.3]), &tree, all(&tree));
        assert_eq!(flat_ends(&wounds, &tree).is_redrawn(&wounds, NodeId(25)), is_flat, "a branch of {radius}");
        assert!(!wounds.is_severed(NodeId(25)) && wounds.blockage(NodeId(25)).is_none());
        assert_eq!(wounds.blockages().count(), wounds.injured().count());
    }
}

#[test]
fn a_round_end_goes_on_where_the_vessel_bends() {
    let positions = vec![Vec3::ZERO, Vec3::X * 4.0, vec3(4.0, 4.0, 0.0)];
    let tree = tree(positions, vec![NO_PARENT, 0, 1], vec![RADIUS; 3]);
    let mut wounds = wounds(1.5);
    let blade = Blade::rectangle(vec3(4.0, 0.8, 0.0), Vec3::X, Vec3::Z).expect("a blade");
    wounds.cut(&blade, &tree, all(&tree));
    let stump = drawn(&wounds, &tree);
    // The first segment ends flat in the bend; the stump begins early enough to cover its rim.
    assert!(stump.iter().any(|s| s.end == [4.0, 0.0, 0.0] && s.is_open() == [false, true]));
    assert!(stump.iter().any(|s| s.start == [4.0, -RADIUS, 0.0] && s.is_open() == [false, true]), "{stump:?}");
}

#[test]
fn blood_leaves_a_finely_divided_vessel_as_a_coarse_one() {
    let flows = |tree: &VesselTree| {
        let mut wounds = wounds(1.5);
        wounds.cut(&across(&[4.321]), tree, all(tree));
        let mut network = Network::new(tree, FlowSettings::default()).expect("a network");
        network.set_interruptions(&wounds.interruptions(tree).collect::<Vec<_>>()).expect("gaps");
        network.solve().expect("a solution");
        network.open_ends().iter().map(|end| (end.side, end.flow().ml_per_min())).collect::<Vec<_>>()
    };
    let (coarse, fine) = (flows(&divided(1)), flows(&divided(300)));
    assert_eq!(coarse.len(), 2);
    assert!(coarse[0].1 > 0.0);
    for ((side, expected), (fine_side, found)) in coarse.into_iter().zip(fine) {
        assert_eq!(side, fine_side);
        assert!((found - expected).abs() <= 1e-5 * expected.abs(), "{found} mL/min, not {expected}");
    }
}
