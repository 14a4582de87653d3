//! The index over segments against brute force: segments in a box, the nearest one, and the first hit of a ray.

use bevy_math::{DVec3, Vec3};
use bevy_vessels::synthesis::{
    instances::MAX_FLARE,
    random::{Stream, VesselRng},
    segment_index::SegmentIndex,
    tree::{NO_PARENT, NodeId, Place, VesselTree},
};
use rand::RngExt;

/// Shapes of trees that are hard for indices.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Steps of about equal length, as in growth, in a forest of three trees.
    Grown,
    /// The same in the plane z = 0.
    Flat,
    /// Every third segment without a length.
    Coincident,
    /// One segment ten thousand times as long as the others, and as thick.
    Giant,
    /// Ends anywhere, so that nearly all boxes overlap.
    Scattered,
}

const SHAPES: [Shape; 5] = [Shape::Grown, Shape::Flat, Shape::Coincident, Shape::Giant, Shape::Scattered];

fn any_point(rng: &mut VesselRng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

fn arrays(shape: Shape, nodes: usize, seed: u64) -> (Vec<Vec3>, Vec<u32>, Vec<f32>) {
    let mut rng = Stream::Statistics.rng(seed);
    let (mut positions, mut parents, mut radii) = (Vec::new(), Vec::new(), Vec::new());
    for node in 0..nodes {
        let root = node == 0 || (node % 40 == 17 && node < 100);
        let parent = if root { NO_PARENT } else { rng.random_range(node.saturating_sub(30)..node) as u32 };
        let mut position = any_point(&mut rng);
        if !root && !matches!(shape, Shape::Scattered) {
            position = positions[parent as usize] + 0.1 * position;
        }
        match shape {
            Shape::Flat => position.z = 0.0,
            Shape::Coincident if node % 3 == 2 && !root => position = positions[parent as usize],
            Shape::Giant if node == nodes / 2 => position *= 1.0e4,
            _ => {}
        }
        positions.push(position);
        parents.push(parent);
        radii.push(if matches!(shape, Shape::Giant) && node == nodes / 2 {
            20.0
        } else {
            rng.random_range(0.001..0.03)
        });
    }
    (positions, parents, radii)
}

fn tree(shape: Shape, nodes: usize, seed: u64) -> VesselTree {
    let (positions, parents, radii) = arrays(shape, nodes, seed);
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

/// A tree of the first nodes.
fn beginning(tree: &VesselTree, nodes: usize) -> VesselTree {
    let (positions, parents, radii) = (tree.positions(), tree.parents(), tree.radii());
    VesselTree::from_arrays(positions[..nodes].to_vec(), parents[..nodes].to_vec(), radii[..nodes].to_vec())
        .expect("a tree")
}

/// The tree bent about the y axis, twisted, and with changed radii.
fn bent(tree: &VesselTree) -> VesselTree {
    let bend = |p: &Vec3| Vec3::new(p.x + 0.4 * p.y * p.y, p.y - 0.3 * p.x * p.z, 0.6 * p.z + 0.2 * p.x);
    let radii = tree.radii().iter().enumerate().map(|(i, r)| r * (0.5 + (i % 7) as f32 * 0.2)).collect();
    VesselTree::from_arrays(tree.positions().iter().map(bend).collect(), tree.parents().to_vec(), radii)
        .expect("a tree")
}

fn ends(tree: &VesselTree, node: usize, parent: usize) -> [(DVec3, f64); 2] {
    let radius = tree.radii()[node];
    let start = tree.radii()[parent].min(MAX_FLARE * radius);
    [(tree.positions()[parent].as_dvec3(), start.into()), (tree.positions()[node].as_dvec3(), radius.into())]
}

/// Nodes whose segment's box, radius included and widened by a margin, meets another box.
fn boxes_that_meet(tree: &VesselTree, min: Vec3, max: Vec3, margin: f64) -> Vec<NodeId> {
    let meets = |&(node, parent): &(usize, usize)| {
        let [(a, _), (b, radius)] = ends(tree, node, parent);
        let wide = f64::from(MAX_FLARE) * radius;
        let (low, high) = ((a - wide).min(b - radius) - margin, (a + wide).max(b + radius) + margin);
        low.cmple(max.as_dvec3()).all() && high.cmpge(min.as_dvec3()).all()
    };
    tree.segments().filter(meets).map(|(node, _)| NodeId(node as u32)).collect()
}

fn check_boxes(tree: &VesselTree, index: &SegmentIndex, rng: &mut VesselRng, what: &str) {
    for _ in 0..60 {
        let (center, size) = (any_point(rng), rng.random_range(0.0..0.3f32).powi(2));
        let half = size * any_point(rng).abs();
        let (min, max) = (center - half, center + half);
        let mut found = Vec::new();
        index.candidates(min, max, |node| found.push(node));
        found.sort_unstable();
        let slack = 1.0e-5 * f64::from(tree.positions().iter().fold(1.0f32, |most, p| most.max(p.abs().max_element())));
        let (sure, possible) = (boxes_that_meet(tree, min, max, -1e-6), boxes_that_meet(tree, min, max, slack));
        assert!(sure.iter().all(|node| found.binary_search(node).is_ok()), "{what}: a segment is missing");
        assert!(found.iter().all(|node| possible.binary_search(node).is_ok()), "{what}: a segment too many");
        assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "{what}: a segment twice");
        let mut again = Vec::new();
        index.candidates_where(|low, high| low.cmple(max).all() && high.cmpge(min).all(), |node| again.push(node));
        again.sort_unstable();
        assert_eq!(again, found, "{what}");
    }
}

/// Distance of the nearest segment, by an independent formula: the minimum of a quadratic over the share.
fn brute_nearest(tree: &VesselTree, point: Vec3) -> Option<f64> {
    let distance = |(node, parent)| {
        let [(a, _), (b, _)] = ends(tree, node, parent);
        let share = ((point.as_dvec3() - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        let share = if share.is_nan() { 0.0 } else { share };
        a.lerp(b, share).distance(point.as_dvec3())
    };
    tree.segments().map(distance).min_by(f64::total_cmp)
}

fn check_nearest(tree: &VesselTree, index: &SegmentIndex, rng: &mut VesselRng, what: &str) {
    for _ in 0..60 {
        let point = 1.3 * any_point(rng);
        let expected = brute_nearest(tree, point).expect("a segment");
        let (place, distance) = index.nearest(tree, point, f32::INFINITY).expect("a segment");
        assert!((f64::from(distance) - expected).abs() <= 1e-6 * expected.max(1.0), "{what}: {distance} {expected}");
        assert!((0.0..=1.0).contains(&place.along));
        let there = tree.position_at(place).distance(point);
        let size = tree.segment_vector(place.node.index()).length().max(1.0);
        assert!((there - distance).abs() <= 1e-5 * size, "{what}: {place:?} is {there} away, not {distance}");
        assert_eq!(index.nearest(tree, point, distance * 1.001), Some((place, distance)), "{what}");
        assert_eq!(index.nearest(tree, point, distance * 0.999), None, "{what}");
    }
}

/// Distance along a ray to a ball.
fn ball_entry(from: DVec3, direction: DVec3, center: DVec3, radius: f64) -> f64 {
    let to_center = center - from;
    if to_center.length() <= radius {
        return 0.0;
    }
    let closest = to_center.dot(direction);
    let aside = (to_center - closest * direction).length_squared();
    if closest < 0.0 || aside > radius * radius { f64::INFINITY } else { closest - (radius * radius - aside).sqrt() }
}

/// Distance along a ray to the first of many balls along every segment.
fn brute_hit(tree: &VesselTree, from: DVec3, direction: DVec3) -> f64 {
    let mut first = f64::INFINITY;
    for (node, parent) in tree.segments() {
        let [(a, start), (b, end)] = ends(tree, node, parent);
        let entry = |share: f64| ball_entry(from, direction, a.lerp(b, share), start + share * (end - start));
        let reaches = ball_entry(from, direction, 0.5 * (a + b), 0.5 * a.distance(b) + start.max(end)) < first;
        for step in 0..if reaches { 4000 } else { 0 } {
            first = first.min(entry(f64::from(step) / 3999.0));
        }
    }
    first
}

fn check_hits(tree: &VesselTree, index: &SegmentIndex, rng: &mut VesselRng, what: &str) {
    let mut hits = 0;
    for number in 0..60 {
        let from = 2.0 * any_point(rng);
        // Some rays along the axes, which are parallel to slabs.
        let at_vessel = tree.positions()[rng.random_range(0..tree.len())] - from + 0.01 * any_point(rng);
        let direction = if number % 4 == 0 { Vec3::AXES[number / 4 % 3] } else { at_vessel };
        let unit = direction.as_dvec3().normalize();
        let expected = brute_hit(tree, from.as_dvec3(), unit);
        let Some((place, distance)) = index.first_hit(tree, from, direction, f32::INFINITY) else {
            assert_eq!(expected, f64::INFINITY, "{what}: a hit is missing");
            continue;
        };
        hits += 1;
        // Balls between the samples may be hit a little earlier, or be the only ones hit.
        assert!(f64::from(distance) <= expected * (1.0 + 1e-6), "{what}: {distance}, and not {expected}");
        let point = from.as_dvec3() + f64::from(distance) * unit;
        let [(a, start), (b, end)] = ends(tree, place.node.index(), tree.parents()[place.node.index()] as usize);
        let share = f64::from(place.along);
        let off = a.lerp(b, share).distance(point) - (start + share * (end - start));
        let size = 1.0 + a.distance(b);
        assert!(
            if distance > 0.0 { off.abs() <= 1e-5 * size } else { off <= 1e-5 * size },
            "{what}: {off} off {place:?}"
        );
        assert_eq!(index.first_hit(tree, from, direction, distance * 0.9999 - 1e-6), None, "{what}");
    }
    assert!(hits > 20, "{what}: only {hits} rays hit");
}

fn check(tree: &VesselTree, index: &SegmentIndex, seed: u64, what: &str) {
    let mut rng = Stream::Roots.rng(seed);
    check_boxes(tree, index, &mut rng, what);
    check_nearest(tree, index, &mut rng, what);
    check_hits(tree, index, &mut rng, what);
}

#[test]
fn a_new_index_answers_like_brute_force() {
    for (seed, shape) in (0..).zip(SHAPES) {
        for nodes in [2, 9, 700] {
            let tree = tree(shape, nodes, seed);
            let index = SegmentIndex::new(&tree);
            assert_eq!(index.len(), nodes);
            let what = format!("{shape:?}, {nodes} nodes");
            let mut rng = Stream::Roots.rng(seed);
            check_boxes(&tree, &index, &mut rng, &what);
            check_nearest(&tree, &index, &mut rng, &what);
            if nodes > 2 {
                check_hits(&tree, &index, &mut rng, &what);
            }
        }
    }
}

#[test]
fn an_index_that_grew_in_batches_answers_like_brute_force() {
    for (seed, shape) in (20..).zip(SHAPES) {
        let whole = tree(shape, 900, seed);
        let mut rng = Stream::Organ.rng(seed);
        let mut index = SegmentIndex::default();
        let mut nodes = 0;
        while nodes < whole.len() {
            nodes = (nodes + rng.random_range(0..60)).min(whole.len());
            index.extend(&beginning(&whole, nodes));
            assert_eq!(index.len(), nodes);
        }
        check(&whole, &index, seed, &format!("{shape:?} in batches"));
    }
}

#[test]
fn an_index_follows_a_tree_that_bends_while_it_grows() {
    for (seed, shape) in (40..).zip(SHAPES) {
        let whole = tree(shape, 600, seed);
        let mut index = SegmentIndex::new(&beginning(&whole, 350));
        let bent = bent(&whole);
        index.extend(&bent);
        index.refit(&bent);
        check(&bent, &index, seed, &format!("{shape:?} bent"));
    }
}

#[test]
fn a_partial_refit_equals_a_whole_one() {
    for (seed, shape) in (60..).zip(SHAPES) {
        let (mut positions, parents, mut radii) = arrays(shape, 500, seed);
        let before = VesselTree::from_arrays(positions.clone(), parents.clone(), radii.clone()).unwrap();
        let mut index = SegmentIndex::new(&beginning(&before, 300));
        index.extend(&before);
        let mut rng = Stream::Organ.rng(seed);
        let mut touched = Vec::new();
        for node in (0..500usize).step_by(9) {
            positions[node] += 0.2 * any_point(&mut rng);
            touched.push(NodeId(node as u32));
            let is_child = |&other: &usize| parents[other] as usize == node;
            touched.extend((node..500).filter(is_child).map(|child| NodeId(child as u32)));
        }
        for node in (4..500).step_by(31) {
            radii[node] *= 3.0;
            touched.push(NodeId(node as u32));
        }
        let after = VesselTree::from_arrays(positions, parents, radii).unwrap();
        index.refit_nodes(&after, touched);
        check(&after, &index, seed, &format!("{shape:?}, moved in part"));
    }
}

#[test]
fn nearest_takes_the_lower_of_equally_near_segments() {
    // Four segments from one root, one of them twice: a point above the root is equally far from all.
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y, Vec3::X];
    let parents = vec![NO_PARENT, 0, 0, 0, 0, 0];
    let tree = VesselTree::from_arrays(positions, parents, vec![0.1; 6]).unwrap();
    let index = SegmentIndex::new(&tree);
    let above = Vec3::new(0.0, 0.0, 0.5);
    assert_eq!(index.nearest(&tree, above, 1.0), Some((Place::new(NodeId(1), 0.0), 0.5)));
    let beside = Vec3::new(0.5, 0.0, -0.25);
    assert_eq!(index.nearest(&tree, beside, 1.0), Some((Place::new(NodeId(1), 0.5), 0.25)));
    let (place, distance) = index.first_hit(&tree, beside * 2.0, Vec3::Z * 3.0, 1.0).unwrap();
    assert_eq!(place.node, NodeId(1));
    assert!((distance - 0.4).abs() < 1e-6, "{distance}");
}

#[test]
fn a_ray_meets_a_ball_that_holds_its_whole_segment() {
    // The end's radius exceeds the length, so that the end's ball contains the start's.
    let tree = VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X * 0.1], vec![NO_PARENT, 0], vec![0.2, 1.0]).unwrap();
    let index = SegmentIndex::new(&tree);
    let hit = index.first_hit(&tree, Vec3::X * -5.0, Vec3::X, 10.0);
    assert!(hit.is_some_and(|(place, distance)| place.along == 1.0 && (distance - 4.1).abs() < 1e-6), "{hit:?}");
    let inside = index.first_hit(&tree, Vec3::X * 0.5, Vec3::Y, 10.0);
    assert!(inside.is_some_and(|(_, distance)| distance == 0.0), "{inside:?}");
}

#[test]
fn nothing_is_found_in_nothing_nor_by_what_is_no_number() {
    let none = VesselTree::new();
    let roots = VesselTree::from_arrays(vec![Vec3::ZERO; 3], vec![NO_PARENT; 3], vec![1.0; 3]).unwrap();
    let whole = tree(Shape::Grown, 100, 3);
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    let count = |index: &SegmentIndex, min, max| {
        let mut count = 0;
        index.candidates(min, max, |_| count += 1);
        count
    };
    for tree in [&none, &roots] {
        let index = SegmentIndex::new(tree);
        assert_eq!((index.len(), index.is_empty()), (tree.len(), tree.is_empty()));
        assert_eq!(count(&index, Vec3::NEG_INFINITY, Vec3::INFINITY), 0);
        assert_eq!(index.nearest(tree, Vec3::ZERO, 9.0), None);
        assert_eq!(index.first_hit(tree, Vec3::ZERO, Vec3::X, 9.0), None);
    }
    let index = SegmentIndex::new(&whole);
    assert_eq!(count(&index, Vec3::NEG_INFINITY, Vec3::INFINITY), whole.segments().count());
    for (min, max) in [(nan, Vec3::INFINITY), (Vec3::NEG_INFINITY, nan), (Vec3::ONE, -Vec3::ONE)] {
        assert_eq!(count(&index, min, max), 0);
    }
    for (point, reach) in [(nan, 9.0), (Vec3::INFINITY, 9.0), (Vec3::ZERO, f32::NAN), (Vec3::ZERO, -1.0)] {
        assert_eq!(index.nearest(&whole, point, reach), None);
        assert_eq!(index.first_hit(&whole, point, Vec3::X, reach), None);
    }
    for direction in [nan, Vec3::ZERO, Vec3::INFINITY] {
        assert_eq!(index.first_hit(&whole, whole.positions()[5], direction, 9.0), None);
    }
}

#[test]
fn a_shorter_tree_is_taken_for_another() {
    let (long, short) = (tree(Shape::Grown, 300, 5), tree(Shape::Flat, 200, 6));
    let mut index = SegmentIndex::new(&long);
    index.extend(&short);
    assert_eq!(index.len(), 200);
    check(&short, &index, 7, "another tree");
}
