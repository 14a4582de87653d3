//! Segments that overlap though nothing joins them.
//!
//! In: a [`VesselTree`] and its [`SegmentIndex`]. Out: every pair of segments whose round cones share space without need:
//! where a tree runs through itself, no surface around it can be free of intersections.
//!
//! Segments of one joint always overlap, and so do those that follow each other in a vessel that is wider than its
//! segments are long. So a pair counts only if the way along the tree from one to the other is longer than the sum of
//! their radii. It is 0 for segments with a common node: parent and child, and siblings.

use crate::synthesis::{
    segment_index::{
        SegmentIndex,
        round_cone::{RoundCone, box_around},
    },
    tree::{NO_PARENT, NodeId, VesselTree},
};

/// Depth, as a share of the sum of both radii, up to which an overlap counts as a touch, which is none.
///
/// It is far above the errors of rounding and of the search, for segments up to ten thousand radii long.
const TOUCH: f64 = 1.0e-6;

/// All pairs of segments that overlap though they are not neighbours, the lower node first, in order.
///
/// A segment is named by its end node, and is the round cone that it is drawn as. It overlaps another one if they are
/// inside each other by more than a millionth of the sum of their radii, measured between their axes: |a − b| − r(a) −
/// r(b), at its least over both axes. Neighbours are those between which the way along the tree is at most the sum of
/// their largest radii, as between any two with a common node. Segments of different trees of a forest are never
/// neighbours.
///
/// Takes time in proportion to the segments and the pairs whose boxes overlap. Segments that the index does not have
/// yet are left out.
///
/// # Panics
/// If the tree has fewer nodes than the index.
pub fn overlaps(tree: &VesselTree, index: &SegmentIndex) -> Vec<[NodeId; 2]> {
    let (mut found, mut near) = (Vec::new(), Vec::new());
    for node in 0..index.len() as u32 {
        let (Some(cone), Some((min, max))) = (RoundCone::of(tree, node), box_around(tree, node)) else { continue };
        near.clear();
        index.candidates(min, max, |NodeId(other)| near.push(other));
        near.sort_unstable();
        for &other in near.iter().filter(|&&other| other > node) {
            let Some(second) = RoundCone::of(tree, other) else { continue };
            if are_apart(tree, [node, other], cone.widest() + second.widest()) && do_overlap(&cone, &second) {
                found.push([NodeId(node), NodeId(other)]);
            }
        }
    }
    found
}

/// Whether the way along the tree between two segments is longer than `most`.
///
/// The higher of two nodes is never the other's ancestor, so it climbs, until they meet.
fn are_apart(tree: &VesselTree, ends: [u32; 2], most: f64) -> bool {
    let [mut low, mut high] = ends;
    let mut way = 0.0;
    while low != high && way <= most {
        (low, high) = (low.min(high), low.max(high));
        match tree.parents()[high as usize] {
            NO_PARENT => return true,
            parent => {
                if !ends.contains(&high) {
                    way += tree.segment_length(high as usize);
                }
                high = parent;
            }
        }
    }
    way > most
}

/// Whether two round cones share more than a touch.
fn do_overlap(a: &RoundCone, b: &RoundCone) -> bool {
    let touch = TOUCH * (a.widest() + b.widest());
    a.depth_in(b, touch) > touch
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::{Stream, VesselRng};
    use bevy_math::{DVec3, Vec3};
    use rand::RngExt;

    fn any_point(rng: &mut VesselRng) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
    }

    /// A forest of two trees whose segments are about as long as they are wide, or much longer.
    fn thicket(nodes: usize, step: f32, rng: &mut VesselRng) -> VesselTree {
        let (mut positions, mut parents, mut radii) = (Vec::<Vec3>::new(), Vec::new(), Vec::new());
        for node in 0..nodes {
            let root = node < 2;
            let parent = if root { NO_PARENT } else { rng.random_range(node.saturating_sub(9)..node) as u32 };
            let from = if root { any_point(rng) } else { positions[parent as usize] };
            positions.push(if node % 31 == 30 { from } else { from + step * any_point(rng) });
            parents.push(parent);
            radii.push(rng.random_range(0.01..0.09));
        }
        VesselTree::from_arrays(positions, parents, radii).unwrap()
    }

    /// The greatest depth of two cones' balls, over a grid on both axes, and how much it may miss.
    fn sampled_depth(a: &RoundCone, b: &RoundCone) -> [f64; 2] {
        const SAMPLES: usize = 96;
        let balls = |cone: &RoundCone| -> Vec<(DVec3, f64)> {
            let share = |sample: usize| sample as f64 / SAMPLES as f64;
            let ball = |at: f64| {
                (cone.start.lerp(cone.end, at), cone.start_radius + at * (cone.end_radius - cone.start_radius))
            };
            (0..=SAMPLES).map(|sample| ball(share(sample))).collect()
        };
        let (first, second) = (balls(a), balls(b));
        let depths = first.iter().flat_map(|&(center, radius)| {
            second.iter().map(move |&(other, wide)| radius + wide - center.distance(other))
        });
        let reach = |cone: &RoundCone| cone.start.distance(cone.end) + (cone.end_radius - cone.start_radius).abs();
        [depths.fold(f64::NEG_INFINITY, f64::max), 0.5 * (reach(a) + reach(b)) / SAMPLES as f64]
    }

    /// The way along the tree between two segments, by the ancestors of both.
    fn way(tree: &VesselTree, [a, b]: [u32; 2]) -> f64 {
        let line = |node: u32| -> Vec<u32> {
            std::iter::successors(Some(node), |&node| Some(tree.parents()[node as usize]).filter(|&up| up != NO_PARENT))
                .collect()
        };
        let (from_a, from_b) = (line(a), line(b));
        let Some(&meeting) = from_a.iter().find(|node| from_b.contains(node)) else { return f64::INFINITY };
        let climbed = |line: &[u32]| -> f64 {
            let above = line.iter().take_while(|&&node| node != meeting).filter(|&&node| node != a && node != b);
            above.map(|&node| tree.segment_length(node as usize)).sum()
        };
        climbed(&from_a) + climbed(&from_b)
    }

    #[test]
    fn pairs_are_those_of_brute_force() {
        let [mut certain, mut doubtful] = [0, 0];
        for seed in 0..24 {
            let mut rng = Stream::Statistics.rng(seed);
            let tree = thicket(60, [0.08, 0.3, 1.2][seed as usize % 3], &mut rng);
            let found = overlaps(&tree, &SegmentIndex::new(&tree));
            assert!(found.is_sorted(), "seed {seed}");
            for (low, high) in (0..60).flat_map(|low| (low + 1..60).map(move |high| (low, high))) {
                let (Some(a), Some(b)) = (RoundCone::of(&tree, low), RoundCone::of(&tree, high)) else { continue };
                let said = found.binary_search(&[NodeId(low), NodeId(high)]).is_ok();
                let way = way(&tree, [low, high]);
                let [depth, margin] = sampled_depth(&a, &b);
                let is_clear = depth > 1e-4 || depth + margin < 0.0;
                let is_close = (way - a.widest() - b.widest()).abs() < 1e-6;
                if is_clear && !is_close {
                    let expected = depth > 0.0 && way > a.widest() + b.widest();
                    assert_eq!(said, expected, "seed {seed}: {low} and {high}, depth {depth}, way {way}");
                    certain += usize::from(expected);
                } else {
                    doubtful += 1;
                }
            }
        }
        assert!(certain > 200 && doubtful < 400, "{certain} overlaps were certain, and {doubtful} doubtful");
    }

    fn tree(positions: &[[f32; 3]], parents: &[u32], radius: f32) -> VesselTree {
        let positions = positions.iter().map(|&at| at.into()).collect();
        VesselTree::from_arrays(positions, parents.to_vec(), vec![radius; parents.len()]).unwrap()
    }

    fn pairs(tree: &VesselTree) -> Vec<[u32; 2]> {
        overlaps(tree, &SegmentIndex::new(tree)).into_iter().map(|pair| pair.map(|NodeId(node)| node)).collect()
    }

    #[test]
    fn joints_and_wide_vessels_are_no_overlaps() {
        // Two children and a grandchild, all within the trunk's radius.
        let joint = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.1, 0.0, 1.3], [-0.1, 0.0, 1.3], [0.1, 0.0, 1.6]];
        assert!(pairs(&tree(&joint, &[NO_PARENT, 0, 1, 1, 2], 0.5)).is_empty());
        // A straight vessel of short segments: only its bend back to the beginning counts.
        let line: Vec<[f32; 3]> = (0..40).map(|node| [0.0, 0.0, 0.1 * node as f32]).collect();
        let mut parents: Vec<u32> = (0..40).map(|node: u32| node.checked_sub(1).unwrap_or(NO_PARENT)).collect();
        assert!(pairs(&tree(&line, &parents, 1.0)).is_empty());
        let mut back = line;
        back.extend([[5.0, 0.0, 4.0], [5.0, 0.0, 0.05], [1.0, 0.0, 0.05]]);
        parents.extend([39, 40, 41]);
        let found = pairs(&tree(&back, &parents, 1.0));
        assert!(!found.is_empty() && found.iter().all(|pair| pair[1] == 42), "{found:?}");
    }

    #[test]
    fn a_touch_is_no_overlap_and_two_trees_are_never_neighbours() {
        let sides = |gap: f32| {
            let positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [gap, -1.0, 1.0], [gap, 1.0, 1.0]];
            pairs(&tree(&positions, &[NO_PARENT, 0, NO_PARENT, 2], 0.25))
        };
        assert!(sides(0.5).is_empty());
        assert!(sides(0.500_01).is_empty());
        assert_eq!(sides(0.499_99), [[1, 3]]);
        assert_eq!(sides(0.0), [[1, 3]]);
    }
}
