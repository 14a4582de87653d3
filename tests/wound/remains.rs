//! The tree that is left of a cut one: every remaining part of a segment is there once.

use crate::common::{all, forest, random_point, rng, straight};
use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::tree::{NO_PARENT, NodeId, Place, VesselTree};
use bevy_vessels::synthesis::wound::{Blade, Remains, Retraction, Wounds};
use rand::RngExt;

fn square(at: Vec3, normal: Vec3, half: f32) -> Blade {
    let a = half * normal.normalize().any_orthonormal_vector();
    let b = half * normal.cross(a).normalize();
    Blade::triangles(vec![[at - a - b, at + a - b, at + b]]).expect("a blade")
}

fn length(tree: &VesselTree) -> f64 {
    (0..tree.len()).map(|node| f64::from(tree.segment_vector(node).length())).sum()
}

/// The shares of every segment that remain, from the ledger alone.
fn left(wounds: &Wounds, tree: &VesselTree) -> Vec<(NodeId, [f32; 2])> {
    let segments = tree.segments().map(|(node, _)| NodeId(node as u32));
    let pieces = |node: NodeId| -> Vec<[f32; 2]> {
        if wounds.is_severed(node) {
            wounds.pieces(node).map(|piece| [piece.from, piece.to]).collect()
        } else {
            vec![[0.0, 1.0]]
        }
    };
    segments.flat_map(|node| pieces(node).into_iter().map(move |piece| (node, piece))).collect()
}

/// The same, from the tree that is left.
fn found(remains: &Remains, whole: &VesselTree) -> Vec<(NodeId, [f32; 2])> {
    let share = |segment: NodeId, node: usize| {
        let place = remains.places[node];
        if place.node == segment {
            return place.along;
        }
        assert_eq!((Some(place.node), place.along), (whole.parent(segment), 1.0), "it begins at its parent's node");
        0.0
    };
    let segments = remains.tree.segments().map(|(node, parent)| {
        let segment = remains.places[node].node;
        (segment, [share(segment, parent), share(segment, node)])
    });
    segments.collect()
}

#[test]
fn every_part_that_is_left_is_there_once_however_a_forest_is_cut() {
    for seed in 0..60 {
        let mut rng = rng(seed);
        let tree = forest(seed, 150);
        let mut wounds = Wounds::new(Retraction { radii: rng.random_range(0.0..4.0), length: 0.0 }).expect("limits");
        for _ in 0..6 {
            let blade = match rng.random_range(0..3) {
                0 => Blade::ball(random_point(&mut rng), rng.random_range(0.05..0.5)).expect("a ball"),
                _ => square(random_point(&mut rng), random_point(&mut rng), 1.0),
            };
            wounds.cut(&blade, &tree, all(&tree));
            let remains = Remains::of(&wounds, &tree, 0.0);
            assert_eq!(remains.tree.validate(), Ok(()), "seed {seed}");
            assert_eq!(remains.places.len(), remains.tree.len());
            assert_eq!(found(&remains, &tree), left(&wounds, &tree), "seed {seed}");
            let expected: f64 = left(&wounds, &tree)
                .iter()
                .map(|(node, [from, to])| f64::from((to - from) * tree.segment_vector(node.index()).length()))
                .sum();
            assert!((length(&remains.tree) - expected).abs() < 1e-4, "seed {seed}");
            let mut positions = Vec::new();
            remains.positions_into(&tree, &mut positions);
            for (at, expected) in positions.iter().zip(remains.tree.positions()) {
                assert!(at.distance(*expected) < 1e-6);
            }
        }
        wounds.undo_all(&tree);
        assert_eq!(Remains::of(&wounds, &tree, 1.0).tree, tree, "undo leaves no trace");
    }
}

#[test]
fn what_is_severed_is_a_tree_of_its_own() {
    let tree = straight(4);
    let mut wounds = Wounds::new(Retraction { radii: 2.0, length: 0.0 }).expect("limits");
    let whole = wounds.shape();
    wounds.cut(&square(vec3(1.5, 0.0, 0.0), Vec3::X, 1.0), &tree, all(&tree));
    assert_ne!(wounds.shape(), whole);
    let Remains { tree: left, places } = Remains::of(&wounds, &tree, 0.0);
    assert_eq!(left.parents(), [NO_PARENT, 0, 1, NO_PARENT, 3, 4, 5]);
    let xs: Vec<f32> = left.positions().iter().map(|at| at.x).collect();
    for (x, expected) in xs.iter().zip([0.0, 1.0, 1.4, 1.6, 2.0, 3.0, 4.0]) {
        assert!((x - expected).abs() < 1e-5, "{xs:?}");
    }
    assert!(places.iter().map(|place| place.node.0).eq([0, 1, 2, 2, 2, 3, 4]));
    let cut = wounds.shape();
    wounds.clamp(Place::new(NodeId(4), 0.5), &tree).expect("a vessel");
    assert_eq!(wounds.shape(), cut, "a clamp takes nothing away");
    wounds.undo_all(&tree);
    assert_eq!(wounds.shape(), whole);
}

#[test]
fn ends_are_drawn_in_but_stay_within_their_piece() {
    let tree = straight(2);
    let mut wounds = Wounds::new(Retraction { radii: 0.0, length: 0.0 }).expect("limits");
    for x in [1.2, 1.21] {
        wounds.cut(&square(vec3(x, 0.0, 0.0), Vec3::X, 1.0), &tree, all(&tree));
    }
    let left = Remains::of(&wounds, &tree, 1.0).tree;
    let xs: Vec<f32> = left.positions().iter().map(|at| at.x).collect();
    let expected = [0.0, 1.0, 1.15, 1.2045, 1.2055, 1.26, 2.0];
    assert_eq!(xs.len(), expected.len());
    assert!(xs.iter().zip(expected).all(|(x, expected)| (x - expected).abs() < 1e-4), "{xs:?}");
    assert!(left.radii().iter().all(|radius| (radius - 0.05).abs() < 1e-6));
}

#[test]
fn a_removed_tree_leaves_nothing_and_a_lone_root_stays() {
    let tree =
        VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X, 9.0 * Vec3::X], vec![NO_PARENT, 0, NO_PARENT], vec![0.1; 3])
            .expect("a forest");
    let mut wounds = Wounds::default();
    wounds.cut(&Blade::ball(Vec3::ZERO, 3.0).expect("a ball"), &tree, all(&tree));
    let remains = Remains::of(&wounds, &tree, 1.0);
    assert_eq!(remains.places, [Place::new(NodeId(2), 1.0)]);
    assert_eq!(Remains::of(&Wounds::default(), &VesselTree::new(), 1.0), Remains::default());
}
