//! What OpenCCO's authors left for later: unequal flows, densities, masks, given trees, kinds with flows of their own,
//! and blood that goes through.

use crate::{
    arteries, arteries_and_veins,
    oracle::{check, check_overlaps},
    settings,
};
use bevy_math::{UVec2, UVec3, Vec2, Vec3};
use bevy_vessels::synthesis::{
    cco::{Cco, CcoError, GivenTreeError},
    growth::Growth,
    roots::{RootPlacement, RootPlacements, Roots},
    tissue::{Ball, DensityField, DensityTissue, Disc, Mask, Tissue},
    tree::{ByKind, NO_PARENT, NodeId, VesselKind, VesselTree, hash_trees},
    units::{Flow, Pressure},
};
use std::sync::Arc;

fn ball() -> Arc<dyn Tissue> {
    Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball"))
}

/// Pressures at the terminals of arteries, if flows are those of Poiseuille's law from the root's pressure on, and the
/// flow of each terminal in that of a mean one.
fn terminal_flows(growth: &Cco) -> Vec<f64> {
    let tree = growth.tree(VesselKind::Artery);
    let settings = growth.settings();
    let flow = settings.flow.artery;
    // A tree in which all have one pressure loss: a terminal's flow is its loss over its resistance.
    let mut pressures = vec![flow.root_pressure.pascals(); tree.len()];
    let (mm, tips) = (growth.millimetres(), tree.tips());
    let resistance = |node: usize, parent: usize| {
        let length = f64::from(tree.positions()[node].distance(tree.positions()[parent])) * mm;
        8.0 * flow.viscosity.pascal_seconds() * length
            / (std::f64::consts::PI * (f64::from(tree.radii()[node]) * mm).powi(4))
    };
    // Resistances of subtrees, from the tips up, give the flows from the root down.
    let mut below = vec![0.0f64; tree.len()];
    let parts: Vec<(usize, usize)> = tree.segments().collect();
    for &(node, parent) in parts.iter().rev() {
        let whole = resistance(node, parent) + if below[node] > 0.0 { 1.0 / below[node] } else { 0.0 };
        below[parent] += 1.0 / whole;
    }
    let mut through = vec![0.0; tree.len()];
    for &(node, parent) in &parts {
        let whole = resistance(node, parent) + if below[node] > 0.0 { 1.0 / below[node] } else { 0.0 };
        through[node] = (pressures[parent] - flow.terminal_pressure.pascals()) / whole;
        pressures[node] = pressures[parent] - through[node] * resistance(node, parent);
    }
    let mean = flow.rate.cubic_metres_per_second() * 1e9 / f64::from(settings.terminals);
    tips.into_iter().map(|tip| through[tip as usize] / mean).collect()
}

#[test]
fn terminals_have_flows_as_different_as_asked_for_which_sum_to_the_whole() {
    for terminals in [300, 301] {
        let mut settings = settings(&*ball(), terminals);
        settings.flow_spread = 0.6;
        let mut growth = arteries(ball(), settings, Vec3::Y * 0.5, 3);
        growth.run().expect("room for all");
        check_overlaps("unequal flows", &growth);
        let tree = growth.tree(VesselKind::Artery);
        assert!(tree.murray_residual(3.0) <= 1e-6);
        let flows = terminal_flows(&growth);
        let sum: f64 = flows.iter().sum();
        assert!((sum / f64::from(terminals) - 1.0).abs() < 1e-4, "{sum} instead of {terminals}");
        let (least, most) = flows.iter().fold((f64::MAX, 0.0f64), |(a, b), &flow| (a.min(flow), b.max(flow)));
        assert!((0.39..0.45).contains(&least) && (1.55..1.61).contains(&most), "{least} to {most}");
    }
}

#[test]
fn terminals_are_as_dense_as_the_tissue_asks_for() {
    // Four times as dense on one side, and none in a quarter of the other.
    let field = |point: Vec3| match point.x {
        x if x > 0.0 => 1.0,
        _ if point.y > 0.0 => 0.25,
        _ => 0.0,
    };
    for tissue in [ball(), Arc::new(Disc::flat(0.5).expect("a disc"))] {
        let dense = DensityTissue::new(Arc::clone(&tissue), DensityField::function(field)).expect("a density");
        let mut growth = arteries(Arc::new(dense), settings(&*tissue, 600), Vec3::X * 0.5, 5);
        growth.run().expect("room for all");
        check("density", &growth);
        let tree = growth.tree(VesselKind::Artery);
        let places = tree.tips().into_iter().map(|tip| tree.positions()[tip as usize]);
        let (right, left) = places.partition::<Vec<Vec3>, _>(|place| place.x > 0.0);
        assert!(left.iter().all(|place| place.y >= -1e-6), "a terminal where there should be none");
        // Half of the tissue at density 1, a quarter at 1/4: 8 to 1.
        let ratio = right.len() as f64 / left.len() as f64;
        assert!((6.0..10.5).contains(&ratio), "{} to {}", right.len(), left.len());
    }
}

/// Set cells whose middle is in a double ball.
fn double_ball(count: u32, layers: u32) -> Vec<bool> {
    let cells = (0..layers).flat_map(|z| (0..count).flat_map(move |y| (0..count).map(move |x| [x, y, z])));
    let middle = |[x, y, z]: [u32; 3]| Vec3::new(x as f32, y as f32, z as f32) + 0.5;
    let center = |side: f32| Vec3::new(0.5 + side, 0.5, 0.5) * count as f32;
    cells
        .map(middle)
        .map(|at| if layers == 1 { at.with_z(0.5 * count as f32) } else { at })
        .map(|at| [-0.2, 0.2].iter().any(|&side| at.distance(center(side)) < 0.27 * count as f32))
        .collect()
}

#[test]
fn masks_have_trees_that_keep_their_distance_from_the_border() {
    let image = Mask::image(UVec2::splat(96), Vec2::splat(1.0 / 96.0), Vec3::ZERO, &double_ball(96, 1));
    let voxels = Mask::voxels(UVec3::splat(40), Vec3::splat(1.0 / 40.0), Vec3::ZERO, &double_ball(40, 40));
    for (name, mask) in [("image", image), ("voxels", voxels)] {
        let tissue: Arc<dyn Tissue> = Arc::new(mask.expect("a mask"));
        let mut settings = settings(&*tissue, 400);
        settings.border_distance = 0.01;
        let mut growth = arteries(tissue, settings, Vec3::new(0.0, 0.5, 0.5), 2);
        growth.run().unwrap_or_else(|error| panic!("{name}: {error}"));
        check(name, &growth);
    }
}

#[test]
fn the_depth_in_a_mask_is_the_distance_to_the_nearest_cell_of_the_other_sort() {
    let set = double_ball(20, 20);
    let mask = Mask::voxels(UVec3::splat(20), Vec3::new(1.0, 0.5, 2.0), Vec3::splat(-3.0), &set).expect("a mask");
    let spacing = Vec3::new(1.0, 0.5, 2.0);
    let distance_to = |point: Vec3, wanted: bool| {
        // One ring of cells around the grid, which are not set.
        let cells = (-1..=20).flat_map(|z| (-1..=20).flat_map(move |y| (-1..=20).map(move |x| [x, y, z])));
        let is_set = |[x, y, z]: [i32; 3]| {
            [x, y, z].iter().all(|&at| (0..20).contains(&at)) && set[((z * 20 + y) * 20 + x) as usize]
        };
        let to = |cell: [i32; 3]| {
            let low = Vec3::splat(-3.0) + spacing * Vec3::from_array(cell.map(|at| at as f32));
            point.distance(point.clamp(low, low + spacing))
        };
        cells.filter(|&cell| is_set(cell) == wanted).map(to).fold(f32::INFINITY, f32::min)
    };
    for number in 0..200u32 {
        let share = |salt: u32| (number.wrapping_mul(2_654_435_761).wrapping_add(salt) % 1000) as f32 / 1000.0;
        let point = Vec3::splat(-3.0) + spacing * 20.0 * Vec3::new(share(1), share(77_777), share(123_456_789));
        let expected = match mask.contains(point) {
            true => distance_to(point, false),
            false => -distance_to(point, true),
        };
        let depth = mask.depth(point).expect("a depth");
        assert!((depth - expected).abs() < 1e-4, "{point}: {depth} instead of {expected}");
    }
}

#[test]
fn a_growth_continues_from_a_tree_whose_nodes_stay() {
    let mut first = arteries(ball(), settings(&*ball(), 100), Vec3::Y * 0.5, 6);
    first.run().expect("room for all");
    let given = first.tree(VesselKind::Artery).clone();
    let start = |given: VesselTree, terminals| {
        let placed = RootPlacements { artery: RootPlacement::None, vein: RootPlacement::None, ..Default::default() };
        let given = ByKind { artery: Some(given), ..ByKind::default() };
        Cco::new(ball(), settings(&*ball(), terminals), &Roots { placed, given }, 7)
    };
    let mut second = start(given.clone(), 400).expect("a growth");
    assert_eq!(second.tree(VesselKind::Artery).len(), given.len());
    second.run().expect("room for all");
    check("given", &second);
    let positions = second.tree(VesselKind::Artery).positions();
    assert!(given.positions().iter().all(|place| positions.contains(place)), "a given node moved");
    assert_eq!(second.tree(VesselKind::Artery).tips().len(), 400);
    assert!((&second as &dyn Growth).trees()[VesselKind::Artery].expect("arteries").birth_steps.contains(&0));

    let error = start(given.clone(), 50).expect_err("too few terminals");
    assert!(matches!(error, CcoError::TooFewTerminals { terminals: 50, needed: 100, .. }), "{error}");
    // A way of two pieces, then three children at one node, and vessels that cross.
    let tree = |ends: &[(Vec3, u32)]| {
        let (positions, parents) = ends.iter().copied().unzip();
        VesselTree::from_arrays(positions, parents, vec![0.01; ends.len()]).expect("a tree")
    };
    let (root, a, b) = (Vec3::Y * 0.5, Vec3::Y * 0.3, Vec3::Y * 0.1);
    let mut bent = start(tree(&[(root, NO_PARENT), (a, 0), (b, 1)]), 50).expect("a growth");
    bent.run().expect("room for all");
    check_overlaps("a bend", &bent);
    let fork = [(root, NO_PARENT), (a, 0), (b, 1), (b + 0.2 * Vec3::X, 1), (b - 0.2 * Vec3::X, 1)];
    let refused = |tree: VesselTree| match start(tree, 50).expect_err("refused") {
        CcoError::GivenTree { node, reason, .. } => (node, reason),
        error => panic!("{error}"),
    };
    assert_eq!(refused(tree(&fork)), (1, GivenTreeError::TooManyChildren { most: 2 }));
    let two = [(root, NO_PARENT), (b, 0), (a + 0.2 * Vec3::X, NO_PARENT), (a - 0.2 * Vec3::X, 2)];
    assert!(matches!(refused(tree(&two)), (_, GivenTreeError::Overlaps { .. })));
    assert_eq!(refused(tree(&[(root, NO_PARENT)])), (0, GivenTreeError::NoVessel));
}

#[test]
fn kinds_have_flows_of_their_own_and_blood_goes_through_linked_terminals() {
    let mut settings = settings(&*ball(), 300);
    settings.flow.vein.rate = Flow::from_cubic_metres_per_second(4.0e-6);
    settings.flow.vein.root_pressure = Pressure::from_mmhg(15.0);
    settings.flow.vein.terminal_pressure = Pressure::from_mmhg(5.0);
    let mut growth = arteries_and_veins(ball(), settings, [Vec3::Y * 0.5, Vec3::new(0.1, 0.49, 0.0)], 2);
    assert!(growth.bed_links().is_empty(), "links before the end");
    growth.run().expect("room for all");
    check("kinds", &growth);
    let (arteries, veins) = (growth.tree(VesselKind::Artery), growth.tree(VesselKind::Vein));
    let links = growth.bed_links();
    for tip in arteries.tips() {
        assert!(links.iter().any(|link| link.arterial == NodeId(tip)));
    }
    for tip in veins.tips() {
        assert!(links.iter().any(|link| link.venous == NodeId(tip)));
    }
    let between = |link: &bevy_vessels::synthesis::tree::BedLink| {
        arteries.positions()[link.arterial.index()].distance(veins.positions()[link.venous.index()])
    };
    let mean = links.iter().map(between).sum::<f32>() / links.len() as f32;
    assert!(mean < 0.1, "links are {mean} long");
}

#[test]
fn a_restart_gives_what_a_start_gives() {
    let roots = RootPlacements { artery: RootPlacement::Spread(1), vein: RootPlacement::None, ..Default::default() };
    let mut growth = Cco::new(ball(), settings(&*ball(), 200), &roots.clone().into(), 1).expect("a growth");
    growth.run().expect("room for all");
    let other = settings(&*ball(), 150);
    growth.restart(other.clone(), &roots.clone().into(), 2).expect("a growth");
    growth.run().expect("room for all");
    let mut anew = Cco::new(ball(), other, &roots.into(), 2).expect("a growth");
    anew.run().expect("room for all");
    let hash = |growth: &Cco| hash_trees([growth.tree(VesselKind::Artery)]);
    assert_eq!(hash(&growth), hash(&anew));
}

#[test]
fn any_number_of_threads_gives_the_same_tree() {
    let grow = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut growth = arteries(ball(), settings(&*ball(), 900), Vec3::Y * 0.5, 1);
            growth.run().expect("room for all");
            hash_trees([growth.tree(VesselKind::Artery)])
        })
    };
    let one = grow(1);
    assert_eq!([2, 3, 7].map(grow), [one; 3]);
}
