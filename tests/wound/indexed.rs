//! The ledger with the index, while the tree grows and moves, against the ledger with all segments.

use crate::common::{all, forest, random_point, rng};
use bevy_math::{Affine3A, Mat3, Vec3};
use bevy_vessels::synthesis::random::VesselRng;
use bevy_vessels::synthesis::tree::{NodeId, VesselTree};
use bevy_vessels::synthesis::{
    segment_index::{Region, SegmentIndex},
    wound::{Blade, Wounds},
};
use rand::RngExt;

fn by(index: &SegmentIndex) -> impl Fn(&Region, &mut dyn FnMut(NodeId)) + Copy {
    move |region, visit| index.candidates_in(region, visit)
}

fn random_blade(rng: &mut VesselRng) -> Blade {
    let mut point = || random_point(rng);
    let [a, b, c, d] = [point(), point(), point(), point()];
    let radius = 0.2 * a.distance(c);
    let blade = match rng.random_range(0..5) {
        0 => Blade::sweep([a, b], [c, d]),
        1 => Blade::disc(a, b - a, radius),
        2 => Blade::triangles(vec![[a, b, c], [b, c, d], [c, d, a]]),
        3 => Blade::ball(a, radius),
        _ => Blade::capsule(a, b, 0.3 * radius),
    };
    blade.expect("a blade")
}

/// A tree of the first nodes, after all nodes were moved.
fn part(whole: &VesselTree, nodes: usize, stir: Vec3) -> VesselTree {
    let moved = |at: &Vec3| *at + stir * at.length_squared();
    let positions = whole.positions()[..nodes].iter().map(moved).collect();
    VesselTree::from_arrays(positions, whole.parents()[..nodes].to_vec(), whole.radii()[..nodes].to_vec())
        .expect("the beginning of a tree")
}

#[test]
fn the_index_changes_nothing() {
    let mut rng = rng(61);
    let whole = forest(7, 3_000);
    let (mut index, mut stir, mut nodes) = (SegmentIndex::default(), Vec3::ZERO, 10);
    let [mut fast, mut slow] = [Wounds::default(), Wounds::default()];
    let mut tree = part(&whole, nodes, stir);
    index.extend(&tree);
    let mut severed = 0;
    for step in 0..600 {
        if step % 10 == 0 {
            stir += 0.05 * random_point(&mut rng);
            tree = part(&whole, nodes, stir);
            index.refit(&tree);
        }
        nodes = (nodes + 5).min(whole.len());
        tree = part(&whole, nodes, stir);
        index.extend(&tree);
        let blade = random_blade(&mut rng);
        let expected = slow.cut(&blade, &tree, all(&tree));
        assert_eq!(fast.cut(&blade, &tree, by(&index)), expected, "step {step}");
        severed += expected.severed;
        if step % 7 == 0 && blade.is_volume() {
            let expected = slow.cauterise(&blade, 0.03, &tree, all(&tree)).expect("a volume");
            assert_eq!(fast.cauterise(&blade, 0.03, &tree, by(&index)), Ok(expected), "step {step}");
        }
        let (point, reach) = (random_point(&mut rng), rng.random_range(0.0..0.3));
        let expected = slow.nearest_place(&tree, all(&tree), point, reach);
        assert_eq!(fast.nearest_place(&tree, by(&index), point, reach), expected, "step {step}");
    }
    assert!(severed > 5_000, "only {severed} severed");
    assert_eq!(fast.undo_all(&tree), slow.undo_all(&tree));
}

#[test]
fn blades_aslant_and_far_away_miss_nothing() {
    let mut rng = rng(62);
    let (near, mut severed) = (forest(11, 3_000), 0);
    for distance in [0.0, 30.0, 4_000.0] {
        let away = Vec3::new(distance, -0.5 * distance, 0.3 * distance);
        let positions = near.positions().iter().map(|&at| at + away).collect();
        let tree = VesselTree::from_arrays(positions, near.parents().to_vec(), near.radii().to_vec()).expect("a tree");
        let index = SegmentIndex::new(&tree);
        let [mut fast, mut slow] = [Wounds::default(), Wounds::default()];
        for step in 0..200 {
            // Stretched and sheared about the tree's middle, like world blades in an organ's space.
            let shear = Mat3::from_cols(Vec3::new(1.0, 0.4, 0.0), 0.3 * Vec3::Y, Vec3::new(0.2, 0.0, 1.5));
            let to_world = Affine3A::from_mat3(shear) * Affine3A::from_translation(-away);
            let blade = random_blade(&mut rng).to_local(&to_world).expect("a blade");
            let expected = slow.cut(&blade, &tree, all(&tree));
            assert_eq!(fast.cut(&blade, &tree, by(&index)), expected, "{distance} away, step {step}");
            severed += expected.severed;
        }
    }
    assert!(severed > 1_000, "only {severed} places");
}

#[test]
fn little_is_asked_about_a_long_edge_that_lies_aslant() {
    let tree = forest(12, 5_000);
    let index = SegmentIndex::new(&tree);
    let edge =
        Blade::sweep([Vec3::splat(-0.7), Vec3::splat(0.7)], [Vec3::new(-0.7, -0.7, -0.68), Vec3::new(0.7, 0.7, 0.72)]);
    let (mut of_region, mut of_box) = (0, 0);
    Wounds::default().cut(&edge.expect("a blade"), &tree, |region: &Region, _: &mut dyn FnMut(NodeId)| {
        index.candidates_in(region, |_| of_region += 1);
        index.candidates(region.min(), region.max(), |_| of_box += 1);
    });
    assert!(of_region > 0 && 10 * of_region < of_box, "{of_region} of {of_box}");
}
