//! The effect of each action on a vessel along x with simple numbers.

use crate::common::{all, straight, tree};
use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::tree::{NO_PARENT, NodeId, Place, VesselTree};
use bevy_vessels::synthesis::wound::{
    Blade, BladeError, EndId, EndSide, PieceKind, Retraction, SeveredEnd, WoundError, Wounds,
};

/// A blade across the x axis at each of some places.
fn across(places: &[f32]) -> Blade {
    let triangle = |&x: &f32| [vec3(x, -1.0, -1.0), vec3(x, 2.0, -1.0), vec3(x, -1.0, 2.0)];
    Blade::triangles(places.iter().map(triangle).collect()).expect("valid numbers")
}

fn ball(x: f32, radius: f32) -> Blade {
    Blade::ball(Vec3::X * x, radius).expect("valid numbers")
}

/// A ledger whose ends retract by `length`.
fn drawing_back(length: f32) -> Wounds {
    Wounds::new(Retraction { radii: 0.0, length }).expect("valid numbers")
}

fn place(node: u32, along: f32) -> Place {
    Place::new(NodeId(node), along)
}

fn near(found: f32, expected: f32) {
    assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
}

/// Positions along x of some ends.
fn at<'a>(ends: impl IntoIterator<Item = &'a SeveredEnd>) -> Vec<f32> {
    ends.into_iter().map(|end| end.position.x).collect()
}

fn assert_at(ends: &[SeveredEnd], expected: &[f32]) {
    let found = at(ends);
    assert_eq!(found.len(), expected.len(), "{found:?}, not {expected:?}");
    found.into_iter().zip(expected).for_each(|(found, &expected)| near(found, expected));
}

fn ids(ends: &[SeveredEnd]) -> Vec<EndId> {
    ends.iter().map(|end| end.id).collect()
}

fn open(wounds: &Wounds, tree: &VesselTree) -> Vec<f32> {
    at(&wounds.ends(tree).filter(|end| end.is_open).collect::<Vec<_>>())
}

#[test]
fn a_cut_opens_an_end_on_either_side_which_draw_back() {
    let tree = straight(3);
    let mut wounds = Wounds::new(Retraction { radii: 2.0, length: 0.03 }).unwrap();
    let report = wounds.cut(&across(&[1.5]), &tree, all(&tree));
    assert_eq!((report.severed, report.changed.as_slice()), (1, [NodeId(2)].as_slice()));
    assert_at(&report.opened, &[1.37, 1.63]);
    let [proximal, distal] = report.opened[..] else { unreachable!() };
    assert_eq!((proximal.side, proximal.direction), (EndSide::Proximal, Vec3::X));
    assert_eq!((distal.side, distal.direction), (EndSide::Distal, Vec3::NEG_X));
    assert!(proximal.radius == 0.05 && proximal.id != distal.id && proximal.id.generation == 1);
    assert_eq!(wounds.end(proximal.id, &tree), Some(proximal));
}

#[test]
fn what_crosses_a_gap_severs_nothing_and_a_stump_is_cut_again() {
    let tree = straight(1);
    let mut wounds = drawing_back(0.1);
    wounds.cut(&across(&[0.5]), &tree, all(&tree));
    for x in [0.5, 0.41, 0.59] {
        let report = wounds.cut(&across(&[x]), &tree, all(&tree));
        assert!(report.is_empty() && report.severed == 0, "at {x}");
    }
    assert_eq!((wounds.generation(), wounds.actions()), (1, 1), "nothing happened since");
    let report = wounds.cut(&across(&[0.2]), &tree, all(&tree));
    // The floating piece is 0.2 long: its end retracts by 45 % of that.
    assert_at(&report.opened, &[0.11, 0.29]);
    assert!(report.closed.is_empty());
    let blockage = wounds.blockage(NodeId(1)).unwrap();
    near(blockage.first, 0.11);
    near(blockage.last, 0.6);
    assert_eq!(blockage.proximal, Some(report.opened[0].id));
}

#[test]
fn an_end_keeps_more_than_half_of_its_piece() {
    let tree = straight(1);
    let mut wounds = drawing_back(50.0);
    let report = wounds.cut(&across(&[0.4, 0.6]), &tree, all(&tree));
    assert_eq!(report.severed, 2);
    assert_at(&report.opened, &[0.4 - 0.18, 0.4 + 0.09, 0.6 - 0.09, 0.6 + 0.18]);
    let kinds: Vec<_> = wounds.pieces(NodeId(1)).map(|piece| piece.kind).collect();
    assert_eq!(kinds, [PieceKind::Proximal, PieceKind::Floating, PieceKind::Distal]);
}

#[test]
fn without_retraction_the_same_cut_severs_once() {
    let tree = straight(2);
    let mut wounds = drawing_back(0.0);
    assert_eq!(wounds.cut(&across(&[0.3, 1.0]), &tree, all(&tree)).severed, 2);
    assert_eq!(wounds.cut(&across(&[0.3, 1.0]), &tree, all(&tree)).severed, 0);
    assert_eq!(wounds.ends(&tree).count(), 4);
}

#[test]
fn a_volume_takes_out_what_lies_within_it() {
    let tree = straight(4);
    let mut wounds = drawing_back(0.1);
    let inner = wounds.cut(&across(&[1.5]), &tree, all(&tree));
    let report = wounds.cut(&ball(2.0, 1.25), &tree, all(&tree));
    assert_eq!(report.severed, 2, "it enters and leaves");
    assert_at(&report.opened, &[0.65, 3.35]);
    assert_eq!(report.closed, ids(&inner.opened), "these are gone with their vessel");
    assert_eq!(wounds.end(inner.opened[0].id, &tree), None);
    let left: Vec<_> = (1..5).map(|node| wounds.pieces(NodeId(node)).count()).collect();
    assert_eq!(left, [1, 0, 0, 1]);
    let whole = wounds.blockage(NodeId(2)).unwrap();
    assert_eq!((whole.first, whole.last, whole.proximal, whole.distal), (0.0, 1.0, None, None));
    assert!(wounds.cut(&ball(2.0, 1.3), &tree, all(&tree)).is_empty(), "all of that is gap by now");
}

#[test]
fn a_volume_within_one_segment_severs_it_twice_and_joins_gaps_that_it_meets() {
    let tree = straight(1);
    let mut wounds = drawing_back(0.0);
    assert_at(&wounds.cut(&ball(0.5, 0.125), &tree, all(&tree)).opened, &[0.375, 0.625]);
    let report = wounds.cut(&ball(0.375, 0.125), &tree, all(&tree));
    assert_at(&report.opened, &[0.25]);
    assert_eq!((report.closed.len(), report.severed), (1, 1));
    assert_eq!(open(&wounds, &tree), [0.25, 0.625]);
    assert_eq!(wounds.blockage(NodeId(1)).unwrap().last, 0.625);
}

#[test]
fn a_clamp_stops_blood_and_closes_the_ends_of_its_piece() {
    let tree = straight(1);
    let mut wounds = drawing_back(0.1);
    let (clamp, report) = wounds.clamp(place(1, 0.25), &tree).unwrap();
    assert_eq!((report.clamped.as_slice(), report.opened.len()), ([clamp].as_slice(), 0));
    let blockage = wounds.blockage(NodeId(1)).unwrap();
    assert_eq!((blockage.first, blockage.last, blockage.proximal, blockage.distal), (0.25, 0.25, None, None));
    let cut = wounds.cut(&across(&[0.5]), &tree, all(&tree));
    assert_at(&cut.opened, &[0.6]);
    assert_eq!(wounds.ends(&tree).filter(|end| !end.is_open).count(), 1, "the end behind the clamp");
    assert_eq!(wounds.blockage(NodeId(1)).unwrap().proximal, None);
    let off = wounds.unclamp(clamp, &tree).unwrap();
    assert_at(&off.opened, &[0.4]);
    assert_eq!(off.unclamped, [clamp]);
    assert_eq!(wounds.blockage(NodeId(1)).unwrap().proximal, Some(off.opened[0].id));
    assert_eq!(wounds.unclamp(clamp, &tree), Err(WoundError::NoSuchClamp { clamp }));
}

#[test]
fn a_clamp_holds_an_end_back_and_can_sit_on_its_tip() {
    let tree = straight(1);
    let mut wounds = drawing_back(0.1);
    wounds.clamp(place(1, 0.5), &tree).unwrap();
    let cut = wounds.cut(&across(&[0.5]), &tree, all(&tree));
    assert_at(&cut.opened, &[0.6]);
    let blockage = wounds.blockage(NodeId(1)).unwrap();
    assert_eq!((blockage.first, blockage.proximal, blockage.distal), (0.5, None, Some(cut.opened[0].id)));
    let (clamp, report) = wounds.clamp(cut.opened[0].place, &tree).unwrap();
    assert_eq!(report.closed, [cut.opened[0].id]);
    assert_eq!(wounds.blockage(NodeId(1)).unwrap().distal, None);
    let gone = wounds.cut(&ball(0.7, 0.15), &tree, all(&tree));
    assert_eq!(gone.unclamped, [clamp], "cut away with its vessel");
    assert_eq!(wounds.clamp_place(clamp), None);
    wounds.undo(&tree).unwrap();
    assert_eq!(wounds.clamp_place(clamp), Some(cut.opened[0].place));
}

#[test]
fn a_tie_is_only_undone() {
    let tree = straight(1);
    let mut wounds = drawing_back(0.1);
    let cut = wounds.cut(&across(&[0.5]), &tree, all(&tree));
    let tie = wounds.ligate(place(1, 0.2), &tree).unwrap();
    assert_eq!((tie.closed, tie.clamped.len()), (vec![cut.opened[0].id], 0));
    assert_eq!(open(&wounds, &tree).len(), 1);
    let undone = wounds.undo(&tree).unwrap();
    assert_eq!(undone.opened, [cut.opened[0]]);
}

#[test]
fn heat_seals_up_to_a_calibre_and_cuts_through_seals_stay_dry() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y * 0.1, vec3(1.0, 0.1, 0.0)];
    let tree = tree(positions, vec![NO_PARENT, 0, NO_PARENT, 2], vec![0.05, 0.05, 0.02, 0.02]);
    let mut wounds = drawing_back(0.1);
    let report = wounds.cauterise(&ball(0.5, 0.25), 0.05, &tree, all(&tree)).unwrap();
    assert_eq!(report.changed, [NodeId(3)], "the other is 0.1 wide");
    let blockage = wounds.blockage(NodeId(3)).unwrap();
    assert!(blockage.first < blockage.last && blockage.proximal.is_none() && blockage.distal.is_none());
    assert!(!wounds.is_severed(NodeId(3)));
    let cut = wounds.cut(&across(&[0.5]), &tree, all(&tree));
    assert_eq!((cut.severed, cut.changed.len()), (2, 2));
    assert!(cut.opened.iter().all(|end| end.place.node == NodeId(1)) && cut.opened.len() == 2);
    // Seals the ends of the thick one, with an instrument that can.
    let sealed = wounds.cauterise(&ball(0.5, 0.25), 0.1, &tree, all(&tree)).unwrap();
    assert_eq!(sealed.closed, ids(&cut.opened));
    assert!(wounds.cauterise(&ball(0.5, 0.25), 0.1, &tree, all(&tree)).unwrap().is_empty(), "done already");
    assert!(open(&wounds, &tree).is_empty());
    // Beside the sealed stretch the vessel still bleeds: the remaining end belongs to an open vessel.
    let beside = wounds.cut(&across(&[0.1]), &tree, all(&tree));
    assert_at(&beside.opened, &[0.055, 0.055]);
}

#[test]
fn undo_gives_back_every_state_and_no_id_twice() {
    let tree = straight(2);
    let mut wounds = drawing_back(0.1);
    let state = |wounds: &Wounds| {
        (wounds.ends(&tree).collect::<Vec<_>>(), wounds.blockages().collect::<Vec<_>>(), wounds.is_empty())
    };
    let mut states = vec![state(&wounds)];
    let first = wounds.cut(&across(&[0.5]), &tree, all(&tree));
    states.push(state(&wounds));
    wounds.clamp(place(1, 0.2), &tree).unwrap();
    states.push(state(&wounds));
    wounds.cauterise(&ball(0.5, 0.2), f32::INFINITY, &tree, all(&tree)).unwrap();
    states.push(state(&wounds));
    wounds.cut(&ball(0.6, 0.6), &tree, all(&tree));
    while let Some(expected) = states.pop() {
        assert!(wounds.undo(&tree).is_some());
        assert_eq!(state(&wounds), expected);
    }
    assert_eq!((wounds.undo(&tree), wounds.generation()), (None, 4));
    let again = wounds.cut(&across(&[0.5]), &tree, all(&tree));
    assert_eq!(again.opened[0].id, EndId { index: 0, generation: 5 });
    assert_eq!(wounds.end(first.opened[0].id, &tree), None, "an old id is not taken for the new end");
    wounds.clamp(place(2, 0.5), &tree).unwrap();
    let all_undone = wounds.undo_all(&tree);
    assert_eq!((all_undone.closed, all_undone.unclamped.len()), (ids(&again.opened), 1));
    assert!(wounds.is_empty() && wounds.actions() == 0);
}

#[test]
fn growth_and_movement_go_on_beneath_the_wounds() {
    let mut wounds = drawing_back(0.1);
    let young = straight(2);
    let cut = wounds.cut(&across(&[1.5]), &young, all(&young));
    let grown = straight(4);
    let positions = grown.positions().iter().map(|at| vec3(0.0, 3.0 * at.x, 0.0)).collect();
    let moved = tree(positions, grown.parents().to_vec(), vec![0.2; 5]);
    let end = wounds.end(cut.opened[0].id, &moved).unwrap();
    assert_eq!((end.place, end.direction, end.radius), (cut.opened[0].place, Vec3::Y, 0.2));
    near(end.position.y, 4.2);
    assert_eq!(wounds.undo(&moved).unwrap().closed, ids(&cut.opened));
    // A tree that lost the segment: no end, and no panic.
    let cut = wounds.cut(&across(&[3.5]), &grown, all(&grown));
    assert_eq!(wounds.end(cut.opened[0].id, &young), None);
    assert_eq!(wounds.ends(&young).count(), 0);
    wounds.undo_all(&young);
}

#[test]
fn bad_input_is_named() {
    let tree = straight(1);
    let mut wounds = drawing_back(0.1);
    wounds.cut(&across(&[0.5]), &tree, all(&tree));
    let before: Vec<_> = wounds.ends(&tree).collect();
    let mut fails = |node, along| wounds.clamp(place(node, along), &tree).unwrap_err();
    assert_eq!(fails(7, 0.1), WoundError::NoSuchNode { node: 7, nodes: 2 });
    assert_eq!(fails(0, 0.1), WoundError::OnRoot { node: 0 });
    assert_eq!(fails(1, 1.5), WoundError::Along { node: 1, along: 1.5 });
    assert!(matches!(fails(1, f32::NAN), WoundError::Along { .. }));
    assert_eq!(fails(1, 0.5), WoundError::NoVessel { place: place(1, 0.5) });
    let calibre = wounds.cauterise(&ball(0.5, 0.1), f32::NAN, &tree, all(&tree));
    assert!(matches!(calibre, Err(WoundError::Calibre { .. })));
    let surface = wounds.cauterise(&across(&[0.5]), 1.0, &tree, all(&tree));
    assert_eq!(surface, Err(WoundError::Blade(BladeError::NotAVolume)));
    for (radii, length) in [(-1.0, 0.0), (0.0, f32::NAN), (f32::INFINITY, 0.0)] {
        assert!(matches!(Wounds::new(Retraction { radii, length }), Err(WoundError::Retraction { .. })));
    }
    assert_eq!(wounds.ends(&tree).collect::<Vec<_>>(), before);
    assert_eq!(wounds.actions(), 1);
}
