//! The remaining pieces of cut vessels, drawn and searched.

use crate::common::{all, flat_ends, forest, random_point, rng, straight, stumps};
use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::instances::{SegmentColors, SegmentInstance, write_segments, write_stumps_of};
use bevy_vessels::synthesis::tree::{NodeId, Place, VesselTree};
use bevy_vessels::synthesis::wound::{Blade, PieceEnd, Retraction, Wounds};
use rand::RngExt;

const RED: SegmentColors = SegmentColors::Uniform([1.0, 0.0, 0.0]);

fn cut_at(wounds: &mut Wounds, tree: &VesselTree, x: f32) {
    let blade = Blade::rectangle(Vec3::X * x, Vec3::Y, Vec3::Z).expect("a blade");
    assert_eq!(wounds.cut(&blade, tree, all(tree)).severed, 1, "at {x}");
}

/// The drawing of a vessel that was cut twice, against the ledger. `domes` are the heights of round ends, in radii.
fn assert_gaps(sealed: bool, domes: [f32; 2]) {
    for (radii, long) in [(1.5, 1.0), (0.5, 1.0), (1.5, 0.1), (0.0, 0.03)] {
        // Vessels from slender to thicker than long.
        let whole = straight(1);
        let positions = whole.positions().iter().map(|&at| at * long).collect();
        let tree =
            VesselTree::from_arrays(positions, whole.parents().to_vec(), whole.radii().to_vec()).expect("a tree");
        let mut wounds = Wounds::new(Retraction { radii, length: 0.0 }).expect("a retraction");
        cut_at(&mut wounds, &tree, 0.6 * long);
        cut_at(&mut wounds, &tree, 0.3 * long);
        if sealed {
            let everywhere = Blade::ball(Vec3::ZERO, 2.0).expect("a ball");
            wounds.cauterise(&everywhere, f32::INFINITY, &tree, all(&tree)).expect("a volume");
        }
        let drawn = stumps(&wounds, &tree, &RED);
        let pieces: Vec<_> = wounds.pieces(NodeId(1)).collect();
        assert_eq!((drawn.len(), pieces.len()), (3, 3));
        for (index, (instance, piece)) in drawn.iter().zip(&pieces).enumerate() {
            assert!(instance.is_visible(), "{instance:?}");
            let cut = [index > 0, index < 2];
            let at_cut = if sealed { PieceEnd::Sealed } else { PieceEnd::Open };
            assert_eq!(piece.ends, cut.map(|cut| if cut { at_cut } else { PieceEnd::Node }));
            assert_eq!(instance.is_open(), cut.map(|cut| cut && !sealed));
            let [start, end] = [0, 1].map(|side| if cut[side] { domes[side] * instance.radii()[side] } else { 0.0 });
            let (begins, ends) = (instance.start[0] - start, instance.end[0] + end);
            let tolerance = 1e-6;
            assert!((begins - piece.from * long).abs() < tolerance && (ends - piece.to * long).abs() < tolerance);
            assert!(instance.start[0] < instance.end[0]);
        }
        assert_eq!((drawn[0].start_radius, drawn[2].end_radius), (0.05, 0.05), "where it is whole it is as before");
    }
}

#[test]
fn the_gap_that_is_drawn_is_the_gap_of_the_ledger() {
    assert_gaps(false, [0.0, 0.0]);
}

#[test]
fn the_round_ends_of_sealed_cuts_stay_out_of_the_gap() {
    // The shader draws a full round end, and at the start a dome of 0.4 radii.
    assert_gaps(true, [0.4, 1.0]);
}

#[test]
fn pieces_share_colour_birth_and_taper_with_the_whole() {
    let positions = vec![Vec3::ZERO, Vec3::X, 3.0 * Vec3::X];
    let tree = VesselTree::from_arrays(positions, vec![u32::MAX, 0, 1], vec![0.06, 0.06, 0.05]).unwrap();
    let mut wounds = Wounds::new(Retraction { radii: 0.0, length: 0.4 }).unwrap();
    assert!(stumps(&wounds, &tree, &RED).is_empty());
    cut_at(&mut wounds, &tree, 2.0);
    let mut whole = [SegmentInstance::HIDDEN; 3];
    write_segments(&tree, &[0, 0, 7], 0..3, &RED, &mut whole);
    let mut out = Vec::new();
    let flat = flat_ends(&wounds, &tree);
    write_stumps_of(&wounds, &flat, NodeId(2), &tree, &[0, 0, 7], &RED, &mut out);
    write_stumps_of(&wounds, &flat, NodeId(1), &tree, &[0, 0, 7], &RED, &mut out);
    write_stumps_of(&wounds, &flat, NodeId(9), &tree, &[0, 0, 7], &RED, &mut out);
    assert_eq!(out.len(), 2, "nothing of a whole segment, or of none");
    for piece in &out {
        assert_eq!((piece.color, piece.birth), (whole[2].color, 7.0));
    }
    assert_eq!((out[0].start, out[0].start_radius), (whole[2].start, whole[2].start_radius));
    assert_eq!((out[1].end, out[1].end_radius), (whole[2].end, whole[2].end_radius));
    // Three tenths between 0.06 and 0.05.
    assert!((out[0].end_radius + 0.057).abs() < 1e-6, "open, so with a minus");
    wounds.undo_all(&tree);
    assert!(stumps(&wounds, &tree, &RED).is_empty());
}

#[test]
fn severed_segments_are_found_by_range() {
    let tree = straight(5);
    let mut wounds = Wounds::default();
    [0.5, 2.5, 4.5].into_iter().for_each(|x| cut_at(&mut wounds, &tree, x));
    wounds.clamp(Place::new(NodeId(2), 0.5), &tree).unwrap();
    let within = |range| wounds.severed_within(range).map(|node| node.0).collect::<Vec<_>>();
    assert_eq!((within(0..9), within(2..5), within(3..4)), (vec![1, 3, 5], vec![3], vec![3]));
    assert!(within(2..3).is_empty() && within(4..4).is_empty());
    assert_eq!(wounds.severed_segments().count(), 3);
}

#[test]
fn what_is_taken_out_or_only_clamped_is_not_drawn_in_pieces() {
    let tree = straight(3);
    let mut wounds = Wounds::default();
    wounds.clamp(Place::new(NodeId(1), 0.5), &tree).unwrap();
    assert!(stumps(&wounds, &tree, &RED).is_empty() && !wounds.is_severed(NodeId(1)));
    wounds.cut(&Blade::ball(Vec3::X * 1.5, 0.8).unwrap(), &tree, all(&tree));
    assert!(wounds.is_severed(NodeId(2)));
    assert_eq!(stumps(&wounds, &tree, &RED).len(), 2, "the middle segment is gone");
}

/// The least distance from a point to the wall of the remaining pieces, by many points of every piece.
fn brute(wounds: &Wounds, tree: &VesselTree, point: Vec3) -> f32 {
    let distance = |node: usize, share: f32| {
        tree.position_at(Place::new(NodeId(node as u32), share)).distance(point) - tree.radii()[node]
    };
    let mut best = f32::INFINITY;
    for (node, _) in tree.segments() {
        let id = NodeId(node as u32);
        let pieces: Vec<_> = wounds.pieces(id).map(|piece| (piece.from, piece.to)).collect();
        let pieces = if wounds.is_severed(id) { pieces } else { vec![(0.0, 1.0)] };
        for (from, to) in pieces {
            let shares = (0..=400).map(|step| from + (to - from) * step as f32 / 400.0);
            best = shares.map(|share| distance(node, share)).fold(best, f32::min);
        }
    }
    best
}

#[test]
fn the_nearest_place_is_on_what_is_left() {
    let mut rng = rng(51);
    let tree = forest(5, 80);
    let mut wounds = Wounds::new(Retraction { radii: 0.0, length: 0.05 }).unwrap();
    for _ in 0..6 {
        wounds.cut(&Blade::ball(random_point(&mut rng), 0.3).unwrap(), &tree, all(&tree));
    }
    for _ in 0..400 {
        let point = 1.3 * random_point(&mut rng);
        let expected = brute(&wounds, &tree, point);
        let (place, distance) = wounds.nearest_place(&tree, all(&tree), point, 9.0).unwrap();
        let exact = tree.position_at(place).distance(point) - tree.radii()[place.node.index()];
        assert!((distance - exact).abs() < 1e-5 && distance < expected + 1e-5 && expected < distance + 1e-3);
        assert!(wounds.clamp(place, &tree).is_ok(), "a clamp holds at {place:?}");
        wounds.undo(&tree);
        let reach = rng.random_range(0.0..0.4);
        let found = wounds.nearest_place(&tree, all(&tree), point, reach);
        assert_eq!(found, (distance <= reach).then_some((place, distance)));
    }
    assert_eq!(wounds.nearest_place(&tree, all(&tree), vec3(f32::NAN, 0.0, 0.0), 1.0), None);
    assert_eq!(wounds.nearest_place(&tree, all(&tree), Vec3::ZERO, f32::NAN), None);
}
