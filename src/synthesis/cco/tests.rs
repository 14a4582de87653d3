//! The choice of a candidate, and the sums that it rests on, against plain computations.

use super::{
    candidates::{Attempt, Candidates},
    distance::{squared_between, squared_to_segment},
    domain::Domain,
    forest::{Forest, NONE},
    paths::Paths,
    power::Exponent,
    space::Space,
    sums::{Below, Sums},
};
use crate::synthesis::{
    parallel::Help,
    random::{Stream, VesselRng},
    tissue::{Ball, Disc, Tissue},
};
use bevy_math::{DVec3, Vec3};
use rand::RngExt;
use std::sync::Arc;

/// Polishes one node.
fn polish(space: &mut Space, rng: &mut VesselRng) {
    let node = rng.random_range(0..space.forest.nodes.len() as u32);
    space.polish(node..node + 1, 1e-4, &mut Help::default());
}

fn space(tissue: Arc<dyn Tissue>, gamma: f64, unit: f64) -> Space {
    let domain = Domain::new(tissue).expect("a domain");
    let mut space = Space::new(domain, Forest::new(Exponent::new(gamma)));
    space.begin();
    let [_, segment] = space.plant(DVec3::Y * 0.5, DVec3::ZERO, unit);
    assert!(space.has_room(&[segment]));
    space
}

/// The best connection to the `count` nearest segments, each searched in full, and tried in the order of their costs.
fn connect_by_brute_force(space: &mut Space, place: DVec3, count: usize) -> bool {
    let forest = &space.forest;
    let mut near: Vec<(f64, u32)> = (0..forest.nodes.len() as u32)
        .filter(|&node| forest.node(node).parent != NONE)
        .map(|node| (squared_to_segment(place, forest.place(forest.node(node).parent), forest.place(node)), node))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(count);
    let mut paths = Paths::default();
    paths.clear();
    let search = |&(_, segment): &(f64, u32)| space.search(&space.guess(segment, place, &mut paths), 1e-4);
    let mut costs: Vec<_> = near.iter().filter_map(search).collect();
    costs.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.segment.cmp(&b.segment)));
    costs.iter().any(|candidate| space.connect(candidate, place))
}

#[test]
fn branch_and_bound_chooses_as_a_full_evaluation_does() {
    let cases: [(Arc<dyn Tissue>, bool); 2] = [
        (Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball")), false),
        (Arc::new(Disc::flat(0.5).expect("a disc")), true),
    ];
    for (tissue, is_flat) in cases {
        for (gamma, unit) in [(3.0, 1e-12), (2.6, 1e-11)] {
            let mut rng = Stream::Statistics.rng(5);
            let (mut space, mut candidates, mut connected) =
                (space(Arc::clone(&tissue), gamma, unit), Candidates::default(), 0);
            for _ in 0..600 {
                let mut place = tissue.sample(&mut rng).expect("a point").as_dvec3();
                place.z = if is_flat { 0.0 } else { place.z };
                let near = |node: u32| space.forest.place(node).distance(place) < 0.02;
                if (0..space.forest.nodes.len() as u32).any(near) {
                    continue;
                }
                let mut twin = space.clone();
                let by_force = connect_by_brute_force(&mut twin, place, 20);
                candidates.rank(&space, place, [0, 20], 1e-4, |_| true);
                match candidates.connect(&mut space, place, 1e-4) {
                    // Such places are refused before anything is tried.
                    Attempt::Hopeless => continue,
                    attempt => assert_eq!(attempt == Attempt::Connected, by_force),
                }
                let shape = |space: &Space| -> Vec<_> {
                    space.forest.nodes.iter().map(|node| (node.at.to_array(), node.parent, node.flow)).collect()
                };
                assert_eq!(shape(&space), shape(&twin));
                connected += usize::from(by_force);
            }
            assert!(connected > 200, "only {connected} terminals were connected");
        }
    }
}

/// Sums of all segments, computed anew from the ends to the roots.
fn sums_anew(space: &Space) -> Vec<(f64, Sums)> {
    fn of(forest: &Forest, node: u32, found: &mut Vec<(f64, Sums)>) {
        let own = forest.node(node);
        for child in own.children.into_iter().filter(|&child| child != NONE) {
            of(forest, child, found);
        }
        let below = match own.children {
            [NONE, _] => Below::default(),
            [a, b] => Below::join(&found[a as usize].1, &found[b as usize].1, forest.exponent),
        };
        let flow = if own.is_terminal() { 1.0 } else { own.children.map(|child| found[child as usize].0).iter().sum() };
        let length = forest.place(node).distance(forest.place(own.parent));
        found[node as usize] = (flow, Sums::of(flow, length, &below, forest.exponent));
    }
    let mut found = vec![(0.0, Sums::default()); space.forest.nodes.len()];
    of(&space.forest, space.root_segment(0), &mut found);
    found
}

#[test]
fn sums_and_strains_stay_exact_through_changes_and_undoing() {
    let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    let (mut space, mut candidates, mut rng) =
        (space(Arc::clone(&tissue), 3.0, 1e-12), Candidates::default(), Stream::Statistics.rng(8));
    for round in 0..500 {
        let place = tissue.sample(&mut rng).expect("a point").as_dvec3();
        let before = space.forest.nodes.clone();
        candidates.rank(&space, place, [0, 10], 1e-4, |_| true);
        if candidates.connect(&mut space, place, 1e-4) != Attempt::Connected {
            for (now, before) in space.forest.nodes.iter().zip(&before) {
                assert_eq!(
                    (now.load, now.volume, now.bound, now.strain),
                    (before.load, before.volume, before.bound, before.strain)
                );
            }
        }
        if round % 3 == 0 {
            polish(&mut space, &mut rng);
        }
        let anew = sums_anew(&space);
        for node in (0..space.forest.nodes.len() as u32).filter(|&node| space.forest.node(node).parent != NONE) {
            let (own, (flow, sums)) = (space.forest.node(node), anew[node as usize]);
            assert_eq!(own.flow, flow);
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-11 * b.abs();
            assert!(close(own.load, sums.load) && close(own.volume, sums.volume), "{own:?} {sums:?}");
            assert_eq!(own.strain, space.forest.strain_of(node), "node {node}");
            assert!(space.radius(node) <= f64::from(own.bound), "node {node}");
        }
    }
    assert!(space.forest.nodes.len() > 500);
}

#[test]
fn bounds_of_no_two_segments_reach_into_each_other() {
    let tissue: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"));
    let mut pairs = 0;
    for (seed, unit) in (0..).zip([1e-7, 1e-8, 1e-9, 1e-10, 1e-12]) {
        let mut rng = Stream::Statistics.rng(seed);
        let (mut space, mut candidates) = (space(Arc::clone(&tissue), 2.6, unit), Candidates::default());
        // Vessels a hundred times as wide beside the others.
        space.begin();
        let [_, segment] = space.plant(DVec3::new(0.05, 0.49, 0.0), DVec3::new(0.1, -0.1, 0.1), unit * 1e-8);
        assert!(space.has_room(&[segment]));
        for round in 0..120 {
            let place = tissue.sample(&mut rng).expect("a point").as_dvec3();
            let tree = round % 2;
            candidates.rank(&space, place, [0, 10], 1e-4, |other| other == tree);
            let attempt = candidates.connect(&mut space, place, 1e-4);
            if let (Attempt::Failed, Some(blocked)) = (attempt, space.blocked.take()) {
                space.relieve(blocked);
            }
            polish(&mut space, &mut rng);
            let segments = (0..space.forest.nodes.len() as u32).filter(|&node| space.forest.node(node).parent != NONE);
            let cone = |node: u32| {
                let own = space.forest.node(node);
                space.cone(node, own.bound.into(), own.flare)
            };
            let cones: Vec<_> = segments.map(|node| (node, cone(node))).collect();
            for (number, (segment, cone)) in cones.iter().enumerate() {
                let (parent, radius) = (space.forest.node(*segment).parent, space.radius(*segment));
                let is_entrance = space.forest.node(parent).parent == NONE;
                let above = if is_entrance { radius } else { space.radius(parent) };
                assert!(radius <= cone.end_radius, "{segment} is wider than its bound");
                assert!(Forest::start_radius(above, radius) <= cone.start_radius, "the start of {segment} is wider");
                for (other, beside) in &cones[..number] {
                    // Far from each other, that is plain.
                    let reach = cone.widest() + beside.widest();
                    let ends = [[cone.start, cone.end], [beside.start, beside.end]];
                    let is_near = squared_between(ends[0], ends[1]) < reach * reach;
                    if is_near && !space.forest.are_incident(*segment, *other) {
                        let depth = cone.depth_in(beside, f64::INFINITY);
                        assert!(depth <= 1e-12 * reach, "{segment} and {other} by {depth:e} of {reach:e}");
                        pairs += 1;
                    }
                }
            }
        }
    }
    assert!(pairs > 1000, "{pairs} pairs near each other");
}
