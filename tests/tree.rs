//! Sweeps, validation, statistics and hash of trees, against shapes with known numbers and brute force.

use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::random::Stream;
use bevy_vessels::synthesis::tree::{
    NO_PARENT, TreeError, VesselTree, hash_trees,
    statistics::{Summary, coverage, outside},
    sweep::Children,
};
use rand::{Rng, RngExt};

fn tree(positions: Vec<Vec3>, parents: Vec<u32>, radii: Vec<f32>) -> VesselTree {
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected} ± {tolerance}");
}

/// A trunk of length 1, then `levels` of bifurcations at `angle` degrees between daughters, each of half the length,
/// radii after Murray's law with κ = 3.
fn symmetric(levels: u32, angle: f32) -> VesselTree {
    let half = (angle / 2.0).to_radians();
    let (mut positions, mut parents, mut radii) = (vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![1.0f32; 2]);
    let mut directions = vec![Vec3::X; 2];
    let mut tips = vec![1usize];
    for level in 1..=levels {
        let mut next = Vec::new();
        for &tip in &tips {
            for turn in [-half, half] {
                let (sin, cos) = turn.sin_cos();
                let d = directions[tip];
                let direction = vec3(d.x * cos - d.y * sin, d.x * sin + d.y * cos, 0.0);
                next.push(positions.len());
                positions.push(positions[tip] + direction * 0.5f32.powi(level as i32));
                parents.push(tip as u32);
                radii.push(2.0f32.powf(-(level as f32) / 3.0));
                directions.push(direction);
            }
        }
        tips = next;
    }
    tree(positions, parents, radii)
}

/// A spine of `n` nodes, each but the root with a side vessel.
fn caterpillar(n: u32) -> VesselTree {
    let (mut positions, mut parents) = (vec![Vec3::ZERO], vec![NO_PARENT]);
    let mut spine = 0;
    for step in 1..=n {
        positions.push(vec3(step as f32, 0.0, 0.0));
        parents.push(spine);
        spine = positions.len() as u32 - 1;
        positions.push(vec3(step as f32, 1.0, 0.0));
        parents.push(spine);
    }
    let radii = vec![0.1; positions.len()];
    tree(positions, parents, radii)
}

/// A random forest: some nodes are roots, the others have any earlier node as parent, mostly a late one.
fn random(seed: u64, size: usize) -> VesselTree {
    let mut rng = Stream::Statistics.rng(seed);
    let mut parents = Vec::new();
    for node in 0..size as u32 {
        let root = node == 0 || rng.random_range(0..20) == 0;
        let reach = if rng.random_range(0..2) == 0 { node } else { node.min(3) };
        parents.push(if root { NO_PARENT } else { node - 1 - rng.random_range(0..reach.max(1)) });
    }
    let positions = (0..size).map(|_| vec3(rng.random(), rng.random(), rng.random())).collect();
    let radii = (0..size).map(|_| 0.01 + rng.random::<f32>()).collect();
    tree(positions, parents, radii)
}

fn brute_children(tree: &VesselTree, node: usize) -> Vec<usize> {
    (0..tree.len()).filter(|&other| tree.parents()[other] == node as u32).collect()
}

fn brute_strahler(tree: &VesselTree, node: usize) -> u32 {
    let orders: Vec<u32> = brute_children(tree, node).into_iter().map(|child| brute_strahler(tree, child)).collect();
    match orders.iter().max() {
        None => 1,
        Some(&highest) if orders.iter().filter(|&&order| order == highest).count() > 1 => highest + 1,
        Some(&highest) => highest,
    }
}

/// Splits below the root, segments, length and root above a node, by walking upwards.
fn brute_way(tree: &VesselTree, node: usize) -> (u32, u32, f64, u32) {
    let (mut level, mut depth, mut length, mut at) = (0, 0, 0.0, node);
    while tree.parents()[at] != NO_PARENT {
        let parent = tree.parents()[at] as usize;
        length += f64::from(tree.positions()[at].distance(tree.positions()[parent]));
        depth += 1;
        level += u32::from(tree.parents()[parent] != NO_PARENT && brute_children(tree, parent).len() > 1);
        at = parent;
    }
    (level, depth, length, at as u32)
}

#[test]
fn sweeps_equal_brute_force_on_random_forests() {
    let mut reused = Children::default();
    for seed in 0..60 {
        let tree = random(seed, 1 + (seed as usize * 7) % 160);
        let (children, tips) = (tree.children(), tree.tips());
        let (orders, depths) = (tree.strahler_orders(), tree.depths());
        let (lengths, levels, roots) = (tree.path_lengths(), tree.bifurcation_levels(), tree.root_of_nodes());
        reused.rebuild(&tree);
        assert_eq!(reused, children, "seed {seed}");
        assert_eq!(children.len(), tree.len());
        for node in 0..tree.len() {
            let own: Vec<usize> = children.of(node).iter().map(|&child| child as usize).collect();
            assert_eq!(own, brute_children(&tree, node), "seed {seed} node {node}");
            assert_eq!(tree.child_counts()[node] as usize, own.len());
            assert_eq!(tips.contains(&(node as u32)), own.is_empty(), "seed {seed} node {node}");
            assert_eq!(orders[node], brute_strahler(&tree, node), "seed {seed} node {node}");
            let (level, depth, length, root) = brute_way(&tree, node);
            assert_eq!((levels[node], depths[node], roots[node]), (level, depth, root), "seed {seed} node {node}");
            near(lengths[node], length, 1e-9);
        }
    }
}

#[test]
fn branches_cover_every_segment_once_and_break_at_splits() {
    for seed in 0..60 {
        let tree = random(seed, 1 + (seed as usize * 11) % 200);
        let branches = tree.branches();
        let orders = tree.strahler_orders();
        let mut of_segment = vec![None; tree.len()];
        for (index, nodes) in branches.iter().enumerate() {
            assert!(nodes.len() >= 2, "seed {seed}");
            for pair in nodes.windows(2) {
                assert_eq!(tree.parents()[pair[1] as usize], pair[0], "seed {seed}");
                assert_eq!(of_segment[pair[1] as usize].replace(index), None, "seed {seed}");
                assert_eq!(branches.of_nodes()[pair[1] as usize], index as u32);
                assert_eq!(branches.strahler_orders(&orders)[index], orders[pair[1] as usize]);
            }
            let is_inner = |&&node: &&u32| brute_children(&tree, node as usize).len() == 1;
            let inner = nodes[1..nodes.len() - 1].iter().filter(is_inner).count();
            assert_eq!(inner, nodes.len() - 2, "seed {seed}: a branch runs over a split");
            assert_ne!(brute_children(&tree, nodes[nodes.len() - 1] as usize).len(), 1, "seed {seed}: broken early");
            let start = nodes[0] as usize;
            assert_eq!(branches.parent(index), of_segment[start], "seed {seed}");
            assert_eq!(branches.parent(index).is_none(), tree.parents()[start] == NO_PARENT);
        }
        for (node, of_segment) in of_segment.iter().enumerate() {
            assert_eq!(of_segment.is_none(), tree.parents()[node] == NO_PARENT, "seed {seed} node {node}");
        }
    }
}

#[test]
fn folds_visit_children_before_and_after_their_parents() {
    let tree = random(5, 120);
    let mut sizes = vec![1u32; tree.len()];
    tree.fold_to_roots(&mut sizes, |parent, child| *parent += child);
    let total: u32 = tree.roots().map(|root| sizes[root]).sum();
    assert_eq!(total as usize, tree.len(), "every node is below exactly one root");
    let mut trail = vec![String::new(); tree.len()];
    tree.fold_to_tips(&mut trail, |node, parent, child| *child = format!("{parent}/{node}"));
    for (node, depth) in tree.depths().into_iter().enumerate() {
        assert_eq!(trail[node].matches('/').count(), depth as usize);
    }
}

#[test]
fn a_symmetric_tree_has_the_textbook_numbers() {
    for levels in 1..=9 {
        let tree = symmetric(levels, 74.9);
        let statistics = tree.statistics();
        let (leaves, splits) = (1usize << levels, (1usize << levels) - 1);
        assert_eq!(
            (statistics.nodes, statistics.leaves, statistics.bifurcations),
            (2 * leaves, leaves, splits),
            "{levels} levels"
        );
        assert_eq!((statistics.roots, statistics.multifurcations), (1, 0));
        // The trunk, and 2^k segments of length 2^-k on each level.
        near(statistics.total_length, f64::from(levels + 1), 1e-5);
        assert_eq!(statistics.strahler_orders(), levels as usize + 1);
        for (index, order) in statistics.strahler.iter().enumerate() {
            assert_eq!(order.streams, leaves >> index);
            near(order.mean_length, 0.5f64.powi(levels as i32 - index as i32), 1e-6);
        }
        near(statistics.branching_ratio.expect("two orders"), 2.0, 1e-5);
        near(statistics.length_ratio.expect("two orders"), 2.0, 1e-5);
        near(statistics.diameter_ratio.expect("two orders"), 2f64.powf(1.0 / 3.0), 1e-5);
        let angle = statistics.bifurcation_angle.expect("bifurcations");
        near(angle.mean, 74.9, 1e-3);
        assert!(angle.standard_deviation < 1e-3);
        near(statistics.area_ratio.expect("bifurcations").mean, 2f64.powf(1.0 / 3.0), 1e-5);
        near(statistics.asymmetry.expect("bifurcations").minimum, 1.0, 1e-6);
        near(statistics.root_radius.expect("a root"), 1.0, 0.0);
        near(statistics.terminal_radius.expect("leaves").median, 2f64.powf(-f64::from(levels) / 3.0), 1e-6);
        assert_eq!(statistics.diameters_by_level.len(), levels as usize + 1);
        for (level, &diameter) in statistics.diameters_by_level.iter().enumerate() {
            near(diameter, 2.0 * 2f64.powf(-(level as f64) / 3.0), 1e-5);
        }
        assert_eq!(tree.branches().len(), 2 * leaves - 1);
        assert!(tree.murray_residual(3.0) < 1e-6, "{}", tree.murray_residual(3.0));
        near(f64::from(tree.murray_residual(2.0)), 2f64.powf(1.0 / 3.0) - 1.0, 1e-5);
    }
}

#[test]
fn volume_and_tortuosity_of_a_bent_vessel() {
    let bent = tree(vec![Vec3::ZERO, Vec3::X * 3.0, vec3(3.0, 4.0, 0.0)], vec![NO_PARENT, 0, 1], vec![2.0, 2.0, 1.0]);
    let statistics = bent.statistics();
    near(statistics.volume, std::f64::consts::PI * (4.0 * 3.0 + 1.0 * 4.0), 1e-9);
    near(statistics.tortuosity.expect("a leaf").median, 7.0 / 5.0, 1e-9);
    assert_eq!(statistics.bifurcation_angle, None);
    assert_eq!(statistics.branching_ratio, None, "one order has no ratio");
}

#[test]
fn a_caterpillar_has_two_orders_however_long() {
    let tree = caterpillar(400);
    let statistics = tree.statistics();
    assert_eq!((statistics.bifurcations, statistics.leaves), (399, 400));
    assert_eq!(statistics.strahler_orders(), 2);
    assert_eq!(statistics.strahler[0].streams, 400);
    assert_eq!(statistics.strahler[1].streams, 1);
    near(statistics.branching_ratio.expect("two orders"), 400.0, 1e-2);
    // The last spine node has only one side vessel, which starts where order 2 ends, one segment early.
    near(statistics.strahler[1].mean_length, 399.0, 1e-9);
    near(statistics.strahler[0].mean_length, (399.0 + 2.0) / 400.0, 1e-9);
    assert_eq!(statistics.diameters_by_level.len(), 400);
}

#[test]
fn a_vessel_of_a_million_nodes_needs_no_stack() {
    let n = 1_000_000u32;
    let positions = (0..n).map(|i| vec3(i as f32, 0.0, 0.0)).collect();
    let parents = (0..n).map(|i| i.checked_sub(1).unwrap_or(NO_PARENT)).collect();
    let statistics = tree(positions, parents, vec![1.0; n as usize]).statistics();
    near(statistics.total_length, f64::from(n - 1), 1e-6);
    assert_eq!(statistics.strahler_orders(), 1);
}

#[test]
fn nothing_is_undefined_on_no_node_and_on_one() {
    let empty = VesselTree::new();
    let one = tree(vec![Vec3::ONE], vec![NO_PARENT], vec![0.5]);
    for (tree, nodes) in [(&empty, 0), (&one, 1)] {
        let statistics = tree.statistics();
        assert_eq!((statistics.nodes, statistics.roots, statistics.leaves), (nodes, nodes, 0));
        assert_eq!(statistics.total_length, 0.0);
        assert_eq!(statistics.terminal_radius, None);
        assert_eq!(statistics.tortuosity, None);
        assert_eq!(statistics.strahler_orders(), 0);
        assert!(statistics.diameters_by_level.is_empty());
        assert!(tree.branches().is_empty());
        assert_eq!(tree.tips().len(), nodes);
        assert_eq!(tree.children().len(), nodes);
        assert_eq!(tree.murray_residual(3.0), 0.0);
    }
    assert_eq!(one.statistics().root_radius, Some(0.5));
    assert_eq!(empty.statistics().root_radius, None);
    assert_eq!(one.strahler_orders(), [1]);
}

#[test]
fn nodes_on_one_spot_give_no_nan() {
    let parents = vec![NO_PARENT, 0, 1, 1, 3, 3, 3];
    let tree = tree(vec![Vec3::ONE; 7], parents, vec![0.5; 7]);
    let statistics = tree.statistics();
    assert_eq!((statistics.bifurcations, statistics.multifurcations), (1, 1));
    assert_eq!(statistics.bifurcation_angle, None);
    assert_eq!(statistics.tortuosity, None);
    assert_eq!(statistics.length_ratio, None, "streams without length have no ratio of lengths");
    assert!(statistics.strahler.iter().all(|order| order.mean_diameter == 1.0));
}

#[test]
fn a_forest_counts_each_of_its_trees() {
    let one = symmetric(3, 60.0);
    let n = one.len() as u32;
    let shifted = one.parents().iter().map(|&p| if p == NO_PARENT { p } else { p + n });
    let parents = one.parents().iter().copied().chain(shifted).collect();
    let positions = one.positions().iter().copied().chain(one.positions().iter().map(|p| p + Vec3::Z)).collect();
    let both = tree(positions, parents, one.radii().repeat(2)).statistics();
    let single = one.statistics();
    assert_eq!(both.roots, 2);
    assert_eq!(both.leaves, 2 * single.leaves);
    near(both.total_length, 2.0 * single.total_length, 1e-5);
    assert_eq!(both.strahler_orders(), single.strahler_orders());
    near(both.branching_ratio.expect("orders"), 2.0, 1e-5);
    near(both.tortuosity.expect("leaves").median, single.tortuosity.expect("leaves").median, 1e-6);
}

#[test]
fn a_root_that_several_vessels_leave_is_no_split() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let star = tree(positions, vec![NO_PARENT, 0, 0, 0], vec![1.0; 4]);
    assert_eq!(star.bifurcation_levels(), [0; 4]);
    let statistics = star.statistics();
    assert_eq!((statistics.strahler_orders(), statistics.strahler[0].streams), (1, 3));
    assert_eq!(statistics.diameters_by_level, [2.0]);
    assert_eq!(statistics.multifurcations, 1);
}

#[test]
fn angles_are_exact_from_straight_on_to_straight_back() {
    for degrees in [0.0f32, 0.01, 1.0, 45.0, 90.0, 179.9, 180.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let positions = vec![Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, vec3(1.0 + cos, sin, 0.0)];
        let fork = tree(positions, vec![NO_PARENT, 0, 1, 1], vec![1.0; 4]);
        near(fork.statistics().bifurcation_angle.expect("a fork").mean, f64::from(degrees), 2e-4);
    }
}

#[test]
fn summaries_follow_their_definitions() {
    assert_eq!(Summary::of(&mut []), None);
    let even = Summary::of(&mut [9.0, 2.0, 4.0, 5.0, 4.0, 7.0, 4.0, 5.0]).expect("values");
    assert_eq!((even.mean, even.standard_deviation, even.median), (5.0, 2.0, 4.5));
    assert_eq!((even.minimum, even.maximum, even.count), (2.0, 9.0, 8));
    assert_eq!(Summary::of(&mut [3.0, 1.0, 2.0]).expect("values").median, 2.0);
}

#[test]
fn every_broken_invariant_is_named() {
    let at = |positions: &[Vec3], parents: &[u32], radii: &[f32]| {
        VesselTree::from_arrays(positions.to_vec(), parents.to_vec(), radii.to_vec()).expect_err("a broken tree")
    };
    let [a, b] = [Vec3::ZERO, Vec3::X];
    assert_eq!(at(&[a, b], &[NO_PARENT], &[1.0]), TreeError::Lengths { positions: 2, parents: 1, radii: 1 });
    assert_eq!(
        at(&[a, b], &[NO_PARENT, 1], &[1.0; 2]),
        TreeError::ParentNotBefore { node: 1, parent: 1 },
        "its own parent"
    );
    assert_eq!(at(&[a, b], &[1, NO_PARENT], &[1.0; 2]), TreeError::ParentNotBefore { node: 0, parent: 1 });
    assert_eq!(at(&[a, b], &[NO_PARENT, 7], &[1.0; 2]), TreeError::ParentNotBefore { node: 1, parent: 7 });
    for bad in [0.0, -0.0, -1.0, f32::INFINITY] {
        assert_eq!(at(&[a, b], &[NO_PARENT, 0], &[1.0, bad]), TreeError::Radius { node: 1, radius: bad });
    }
    assert!(matches!(at(&[a], &[NO_PARENT], &[f32::NAN]), TreeError::Radius { node: 0, .. }));
    let far = vec3(0.0, f32::NEG_INFINITY, 0.0);
    let error = at(&[a, far], &[NO_PARENT, 0], &[1.0; 2]);
    assert_eq!(error, TreeError::Position { node: 1, position: far });
    assert!(error.to_string().contains("node 1 lies at [0, -inf, 0]"), "{error}");
    assert!(matches!(at(&[Vec3::NAN], &[NO_PARENT], &[1.0]), TreeError::Position { node: 0, .. }));
}

#[test]
fn murray_residual_is_the_worst_node_and_stands_small_radii() {
    let fork = |scale: f32, last: f32| {
        let positions = vec![Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, Vec3::ONE];
        tree(positions, vec![NO_PARENT, 0, 1, 1], [1.0, 1.0, 0.6, last].map(|r| r * scale).to_vec())
    };
    // 0.6³ + 0.8³ = 0.728, so Murray's law is missed by 0.272 at κ = 3 and kept at κ = 2.
    near(f64::from(fork(1.0, 0.8).murray_residual(3.0)), 0.272, 1e-6);
    near(f64::from(fork(1e-20, 0.8).murray_residual(3.0)), 0.272, 1e-6);
    assert!(fork(1e-20, 0.8).murray_residual(2.0) < 1e-6);
    near(f64::from(fork(1.0, 1.0).murray_residual(2.0)), 0.36, 1e-6);
}

#[test]
fn coverage_equals_brute_force() {
    for (seed, planar) in [(1, false), (2, true)] {
        let tree = random(seed, 500);
        let flatten = |p: Vec3| if planar { p.with_z(0.0) } else { p };
        let positions: Vec<Vec3> = tree.positions().iter().copied().map(flatten).collect();
        let tree = VesselTree::from_arrays(positions, tree.parents().to_vec(), tree.radii().to_vec()).expect("a tree");
        let mut rng = Stream::Attraction.rng(seed);
        let samples: Vec<Vec3> =
            (0..400).map(|_| flatten(vec3(rng.random(), rng.random(), rng.random()) * 1.4)).collect();
        for distance in [0.0, 0.05, 0.1, 0.3, 2.0, 0.02] {
            let near = |s: &&Vec3| tree.positions().iter().any(|p| p.distance_squared(**s) <= distance * distance);
            let expected = samples.iter().filter(near).count() as f32 / 400.0;
            assert_eq!(coverage(&tree, &samples, distance), Some(expected), "seed {seed} distance {distance}");
        }
    }
}

#[test]
fn coverage_without_samples_or_nodes_and_with_duplicates() {
    let same = tree(vec![Vec3::ONE; 300], vec![NO_PARENT; 300], vec![1.0; 300]);
    assert_eq!(coverage(&same, &[], 1.0), None);
    assert_eq!(coverage(&VesselTree::new(), &[Vec3::ONE], 1.0), Some(0.0));
    assert_eq!(coverage(&same, &[Vec3::ONE, Vec3::ZERO, Vec3::NAN, Vec3::INFINITY], 0.5), Some(0.25));
    assert_eq!(coverage(&same, &[Vec3::ZERO, Vec3::NAN, Vec3::INFINITY], f32::INFINITY), Some(1.0 / 3.0));
    assert_eq!(coverage(&same, &[Vec3::ONE], f32::NAN), Some(0.0));
    let far = tree(vec![Vec3::ZERO, Vec3::splat(1e6)], vec![NO_PARENT; 2], vec![1.0; 2]);
    assert_eq!(coverage(&far, &[Vec3::ZERO, Vec3::X * 1e-3, Vec3::splat(1e6), Vec3::ONE], 2e-3), Some(0.75));
    assert_eq!(outside(&same, |_| false), 300);
    assert_eq!(outside(&symmetric(1, 90.0), |p| p.y >= 0.0), 1);
}

#[test]
fn the_hash_sees_every_bit_and_the_order_of_trees() {
    let one = random(3, 50);
    let hash = one.hash64();
    assert_eq!(hash, one.clone().hash64());
    let mut rng = Stream::Roots.rng(1);
    for _ in 0..50 {
        let (mut positions, parents, mut radii) =
            (one.positions().to_vec(), one.parents().to_vec(), one.radii().to_vec());
        let node = rng.random_range(0..50);
        if rng.next_u32() & 1 == 0 {
            positions[node].y = f32::from_bits(positions[node].y.to_bits() ^ 1);
        } else {
            radii[node] = f32::from_bits(radii[node].to_bits() ^ 1);
        }
        assert_ne!(hash, tree(positions, parents, radii).hash64());
    }
    let two = random(4, 50);
    assert_ne!(hash_trees([&one, &two]), hash_trees([&two, &one]));
    assert_eq!(hash_trees([&one]), hash);
    assert_ne!(hash_trees([&one, &VesselTree::new()]), hash);
    let zero = |x: f32| tree(vec![vec3(x, 0.0, 0.0)], vec![NO_PARENT], vec![1.0]).hash64();
    assert_ne!(zero(0.0), zero(-0.0), "bits, not values");
}
