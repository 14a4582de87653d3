//! Vessels are cut, closed and healed on organs in a Bevy world.

use super::operating_field::*;
use super::*;
use bevy::math::Affine3A;
use bevy_vessels::{
    plugin::{
        Cuttable, CuttableVessels, OpenEnd, OpenEndEntities, OperationError, OperationKind, StrokeId, VesselAction,
        VesselCommand, VesselIndex, VesselOperation, VesselOperationFailed, VesselPicker, VesselSite, VesselWounds,
        WoundedGrowth,
    },
    synthesis::{
        tree::{NodeId, Place},
        wound::{Blade, EndSide, Retraction},
    },
};

const FRAME: Duration = Duration::from_millis(16);

/// Transform of an organ in these tests: rotated, mirrored and scaled non-uniformly, as is its parent.
fn hang_askew(app: &mut App, organ: Entity) {
    let turn = Quat::from_euler(EulerRot::XYZ, 0.4, -1.1, 2.0);
    let parent = Transform { translation: Vec3::new(3.0, -2.0, 5.0), rotation: turn, scale: Vec3::new(2.0, 0.5, 1.5) };
    let parent = app.world_mut().spawn(parent).id();
    let own = Transform::from_xyz(0.3, 0.1, -0.2).with_rotation(turn.inverse()).with_scale(Vec3::new(-1.0, 3.0, 0.7));
    app.world_mut().entity_mut(organ).insert((own, ChildOf(parent)));
    app.update();
}

fn to_world(app: &App, organ: Entity, kind: VesselKind) -> Affine3A {
    let vessels = vessel_entity(app.world(), organ, kind).expect("the kind has vessels");
    app.world().get::<GlobalTransform>(vessels).expect("vessels are somewhere").affine()
}

/// Ends that stay where they are cut. Those that draw back may leave a segment, since vessels on a bent surface have short
/// ones.
fn that_stay() -> Cuttable {
    Cuttable { retraction: Retraction { radii: 0.0, length: 0.0 }, ..default() }
}

/// Segments that cross a plane of the world.
fn across_plane(app: &App, organ: Entity, kind: VesselKind, point: Vec3, normal: Vec3) -> Vec<NodeId> {
    let (vessels, to_world) = (published(app.world(), organ, kind), to_world(app, organ, kind));
    let side = |node: usize| (to_world.transform_point3(vessels.tree().positions()[node]) - point).dot(normal) > 0.0;
    let crossed = vessels.tree().segments().filter(|&(node, parent)| side(node) != side(parent));
    crossed.map(|(node, _)| NodeId(node as u32)).collect()
}

#[test]
fn a_blade_of_the_world_severs_what_it_crosses_however_the_organ_hangs() {
    let mut app = timed_app(FRAME);
    let organ = grown(&mut app, ());
    app.world_mut().entity_mut(organ).insert(that_stay());
    hang_askew(&mut app, organ);
    let to_world_now = to_world(&app, organ, VesselKind::Artery);
    assert!(to_world_now.matrix3.determinant() < 0.0, "the organ is mirrored");
    for (number, normal) in [Vec3::new(1.0, 0.2, -0.4), Vec3::new(-0.3, 1.0, 0.5)].into_iter().enumerate() {
        let point = to_world_now.transform_point3(Vec3::new(0.03, -0.05 * number as f32, 0.02));
        let expected = KINDS.map(|kind| across_plane(&app, organ, kind, point, normal));
        cut(&mut app, square(point, normal, 100.0));
        for kind in KINDS {
            assert!(!expected[kind.index()].is_empty());
            assert_eq!(severed(app.world(), organ, kind), expected[kind.index()], "{}", kind.name());
        }
        operate(&mut app, CuttableVessels::undo);
        assert!(KINDS.iter().all(|&kind| wounds(app.world(), organ, kind).is_empty()));
    }
}

#[test]
fn an_action_goes_to_all_organs_or_to_the_one_that_it_names() {
    let mut app = timed_app(FRAME);
    let tree = tube(10.0, 0.1, 5);
    let both = [(VesselKind::Artery, &tree), (VesselKind::Vein, &tree)];
    let organs = [(); 3].map(|()| organ_of(&mut app, &both, Cuttable::default()));
    let blade = square(Vec3::X * 3.0, Vec3::X, 1.0);
    let mut messages = MessageCursor::default();
    cut(&mut app, blade.clone());
    let done: Vec<VesselOperation> = drain(app.world(), &mut messages);
    assert_eq!(done.len(), 6, "two kinds of three organs");
    assert!(done.iter().all(|operation| (operation.operation, operation.report.severed) == (OperationKind::Cut, 1)));
    assert!(organs.iter().all(|organ| done.iter().filter(|operation| operation.organ == *organ).count() == 2));
    operate(&mut app, |vessels| vessels.request(VesselCommand::new(VesselAction::UndoAll).on(organs[1])));
    let is_whole = |app: &App, organ| severed(app.world(), organ, VesselKind::Vein).is_empty();
    assert_eq!(organs.map(|organ| is_whole(&app, organ)), [false, true, false]);
    operate(&mut app, |vessels| vessels.request(VesselCommand::new(VesselAction::Cut(blade)).on(organs[1])));
    assert_eq!(organs.map(|organ| severed(app.world(), organ, VesselKind::Artery).len()), [1, 1, 1]);
    // The last action changed only the second organ, the one before it the rest of the first.
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(organs.map(|organ| is_whole(&app, organ)), [false, true, false]);
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(organs.map(|organ| is_whole(&app, organ)), [true; 3]);
    assert_eq!(app.world().resource::<CuttableVessels>().actions(), 0);
}

#[test]
fn messages_and_the_resource_do_the_same() {
    let actions = || {
        let near = VesselSite::Near { point: Vec3::new(0.0, 0.45, 0.1), reach: 0.3 };
        [
            VesselAction::Cut(square(Vec3::Y * 0.1, Vec3::Y, 3.0)),
            VesselAction::Clamp(near),
            VesselAction::Cauterise { volume: Blade::ball(Vec3::Y * 0.1, 0.45).unwrap(), max_calibre: 1.0 },
            VesselAction::Cut(Blade::capsule(Vec3::ZERO, Vec3::new(0.5, 0.1, 0.1), 0.05).unwrap()),
            VesselAction::Undo,
            VesselAction::Ligate(near),
        ]
    };
    let results = [true, false].map(|by_message| {
        let mut app = timed_app(FRAME);
        let organ = grown(&mut app, ());
        let mut messages = MessageCursor::default();
        for action in actions() {
            let command = VesselCommand::new(action);
            if by_message {
                app.world_mut().write_message(command);
                app.update();
            } else {
                operate(&mut app, |vessels| vessels.request(command));
            }
        }
        let reports = drain::<VesselOperation>(app.world(), &mut messages).into_iter().map(|done| done.report);
        let left = KINDS.map(|kind| {
            wounds(app.world(), organ, kind).ends(published(app.world(), organ, kind).tree()).collect::<Vec<_>>()
        });
        (reports.collect::<Vec<_>>(), left)
    });
    assert_eq!(results[0], results[1]);
    assert!(results[0].1.iter().all(|ends| ends.len() > 4), "{:?}", results[0].1);
}

/// A scalpel's sweeps along x over some of a tube's segments, one per frame, each with the node of its segment.
fn sweeps(segments: std::ops::Range<u32>) -> impl Iterator<Item = (NodeId, Blade)> {
    segments.map(|node| (NodeId(node), square(Vec3::X * (node as f32 - 0.5), Vec3::X, 1.0)))
}

#[test]
fn a_stroke_of_many_frames_is_undone_at_once() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tube(20.0, 0.1, 20))], Cuttable::default());
    cut(&mut app, square(Vec3::X * 18.5, Vec3::X, 1.0));
    let before: Vec<_> = open_ends(&mut app);
    let mut messages = MessageCursor::default();
    let stroke = StrokeId::begin();
    for (number, (node, blade)) in sweeps(1..7).enumerate() {
        if number % 2 == 0 {
            operate(&mut app, |vessels| vessels.in_stroke(stroke).cut(blade));
        } else {
            let command = VesselCommand::new(VesselAction::Cut(blade)).on(organ).in_stroke(stroke);
            app.world_mut().write_message(command);
            app.update();
        }
        let done: Vec<VesselOperation> = drain(app.world(), &mut messages);
        assert!(done.iter().any(|done| done.stroke == Some(stroke) && done.report.changed == [node]), "{done:?}");
        assert_eq!(app.world().resource::<CuttableVessels>().actions(), 2, "what was before, and the stroke");
    }
    let opened: Vec<_> = open_ends(&mut app).iter().filter(|end| !before.contains(end)).map(|end| end.id).collect();
    operate(&mut app, CuttableVessels::undo);
    let undone: Vec<VesselOperation> = drain(app.world(), &mut messages);
    let [VesselOperation { operation: OperationKind::Undone, stroke: None, report, .. }] = &undone[..] else {
        panic!("one operation, not {undone:?}")
    };
    assert_eq!((report.changed.len(), &report.opened), (6, &Vec::new()));
    assert_eq!(report.closed, opened);
    assert_eq!(open_ends(&mut app), before);
    // It may go on after an undo.
    operate(&mut app, |vessels| vessels.in_stroke(stroke).cut(square(Vec3::X * 0.5, Vec3::X, 1.0)));
    (0..2).for_each(|_| operate(&mut app, CuttableVessels::undo));
    assert_eq!(open_ends(&mut app), []);
}

#[test]
fn strokes_of_two_hands_are_undone_apart_unless_they_meet() {
    let mut app = timed_app(FRAME);
    let tree = tube(20.0, 0.1, 20);
    let organs = [(); 2].map(|()| organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default()));
    let severed_of = |app: &App| organs.map(|organ| severed(app.world(), organ, VesselKind::Artery).len());
    let hands = organs.map(|organ| (organ, StrokeId::begin()));
    for (_, blade) in sweeps(1..5) {
        operate(&mut app, |vessels| {
            for (organ, stroke) in hands {
                vessels.request(VesselCommand::new(VesselAction::Cut(blade.clone())).on(organ).in_stroke(stroke));
            }
        });
    }
    assert_eq!(severed_of(&app), [4, 4]);
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(severed_of(&app), [4, 0], "the one that began last");
    // The scalpel goes on over sealed parts of the same vessel: neither stroke can be undone without the other.
    let cautery = StrokeId::begin();
    for (node, blade) in sweeps(6..9) {
        let ball = Blade::ball(Vec3::X * (node.0 as f32 + 4.5), 0.3).expect("a ball");
        operate(&mut app, |vessels| {
            vessels.in_stroke(cautery).cauterise(ball, f32::INFINITY);
            vessels.request(VesselCommand::new(VesselAction::Cut(blade)).on(organs[0]).in_stroke(hands[0].1));
        });
    }
    let sealed = wounds(app.world(), organs[0], VesselKind::Artery).injured().count();
    assert_eq!((severed_of(&app), sealed), ([7, 0], 10));
    assert_eq!(app.world().resource::<CuttableVessels>().actions(), 1);
    operate(&mut app, |vessels| vessels.request(VesselCommand::new(VesselAction::Undo).on(organs[0])));
    assert!(wounds(app.world(), organs[0], VesselKind::Artery).is_empty());
    assert!(!wounds(app.world(), organs[1], VesselKind::Artery).is_empty(), "the cautery reached the other organ too");
    operate(&mut app, CuttableVessels::undo);
    assert!(wounds(app.world(), organs[1], VesselKind::Artery).is_empty());
}

#[test]
fn open_ends_are_entities_that_face_out_of_the_lumen() {
    let mut app = timed_app(FRAME);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &fork(0.05))], Cuttable::default());
    hang_askew(&mut app, organ);
    let to_world = to_world(&app, organ, VesselKind::Artery);
    let blade = square(Vec3::new(1.0, 0.5, 0.0), Vec3::Y, 0.5);
    cut(&mut app, blade.to_local(&to_world.inverse()).unwrap());
    let ends = open_ends(&mut app);
    let [proximal, distal] = ends[..] else { panic!("two ends, not {ends:?}") };
    assert_eq!((proximal.side, distal.side), (EndSide::Proximal, EndSide::Distal));
    for end in [&proximal, &distal] {
        assert_eq!((end.organ, end.kind, end.place.node, end.bifurcations), (organ, VesselKind::Artery, NodeId(2), 1));
    }
    assert!(proximal.position.y < 0.5 && distal.position.y > 0.5);
    assert!(proximal.direction.distance(Vec3::Y) < 1e-6 && distal.direction.distance(Vec3::NEG_Y) < 1e-6);
    let vessels = vessel_entity(app.world(), organ, VesselKind::Artery).unwrap();
    let entities = app.world().get::<OpenEndEntities>(vessels).unwrap().clone();
    assert_eq!(entities.iter().len(), 2);
    for (id, entity) in entities.iter() {
        let end = app.world().get::<OpenEnd>(entity).unwrap();
        let transform = app.world().get::<Transform>(entity).unwrap();
        assert_eq!((end.id, transform.translation), (id, end.position));
        assert!(transform.forward().distance(end.direction) < 1e-6);
        let global = app.world().get::<GlobalTransform>(entity).unwrap().translation();
        assert!(global.distance(to_world.transform_point3(end.position)) < 1e-5);
    }
    // A clamp on the far piece closes the far end, and taking it off opens it.
    operate(&mut app, |vessels_now| vessels_now.clamp_at(vessels, Place::new(NodeId(2), 0.9)));
    assert_eq!(open_ends(&mut app), [proximal]);
    let (clamp, _) = wounds(app.world(), organ, VesselKind::Artery).clamps().next().expect("a clamp is on");
    operate(&mut app, |vessels_now| vessels_now.unclamp(vessels, clamp));
    assert_eq!(open_ends(&mut app).len(), 2);
    operate(&mut app, CuttableVessels::undo_all);
    assert_eq!(open_ends(&mut app), []);
    assert!(app.world().get_entity(entities.iter().next().unwrap().1).is_err());
}

#[test]
fn clamps_find_the_nearest_vessel_of_the_world() {
    let mut app = timed_app(FRAME);
    let tree = tube(10.0, 0.1, 5);
    let [left, right] = [0.0, 4.0].map(|y| {
        let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
        app.world_mut().entity_mut(organ).insert(Transform::from_xyz(0.0, y, 0.0).with_scale(Vec3::new(1.0, 2.0, 1.0)));
        organ
    });
    operate(&mut app, |vessels| vessels.clamp(Vec3::new(3.0, 3.0, 0.0), 1.5));
    assert_eq!([left, right].map(|organ| wounds(app.world(), organ, VesselKind::Artery).clamps().count()), [0, 1]);
    let (_, place) = wounds(app.world(), right, VesselKind::Artery).clamps().next().unwrap();
    assert_eq!(place.node, NodeId(2));
    assert!((place.along - 0.5).abs() < 1e-6, "{place:?}");
    let mut failed = MessageCursor::default();
    operate(&mut app, |vessels| vessels.clamp(Vec3::new(3.0, 2.0, 3.0), 1.0));
    operate(&mut app, |vessels| vessels.unclamp_near(Vec3::new(5.0, 4.0, 0.0), 1.9));
    let errors: Vec<VesselOperationFailed> = drain(app.world(), &mut failed);
    let what = errors.iter().map(|failed| match failed.error {
        OperationError::NothingNear { what, .. } => what,
        _ => "something else",
    });
    assert_eq!(what.collect::<Vec<_>>(), ["vessel", "clamp"]);
    operate(&mut app, |vessels| vessels.unclamp_near(Vec3::new(5.0, 4.0, 0.0), 2.1));
    assert_eq!(wounds(app.world(), right, VesselKind::Artery).clamps().count(), 0);
}

/// Compared with all segments, one by one, in the world.
#[test]
fn the_picker_finds_the_nearest_wall_under_uneven_scale() {
    let mut app = timed_app(FRAME);
    let organ = grown(&mut app, ());
    hang_askew(&mut app, organ);
    let nearest_place = app
        .world_mut()
        .register_system(|In((point, reach)): In<(Vec3, f32)>, picker: VesselPicker| picker.nearest(point, reach));
    let to_world = to_world(&app, organ, VesselKind::Artery);
    let scale = to_world.matrix3.determinant().abs().cbrt();
    let mut found = 0;
    for i in 0..60 {
        let angle = i as f32;
        let local = 0.5 * Vec3::new((1.3 * angle).sin(), (2.1 * angle).cos(), (0.7 * angle).sin());
        let (point, reach) = (to_world.transform_point3(local), 0.002 * angle);
        let mut nearest = f32::INFINITY;
        for kind in KINDS {
            let vessels = published(app.world(), organ, kind);
            for (node, parent) in vessels.tree().segments() {
                let [a, b] = [parent, node].map(|node| to_world.transform_point3(vessels.tree().positions()[node]));
                let share = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                let distance = a.lerp(b, share).distance(point) - scale * vessels.tree().radii()[node];
                nearest = nearest.min(distance);
            }
        }
        let place = app.world_mut().run_system_with(nearest_place, (point, reach)).unwrap();
        assert_eq!(place.is_some(), nearest <= reach, "point {i}");
        if let Some(place) = place {
            found += 1;
            assert!((place.distance - nearest).abs() < 1e-5, "point {i}: {} against {nearest}", place.distance);
        }
    }
    assert!((5..55).contains(&found), "{found} of 60 are too few or too many to tell");
}

#[test]
fn a_regrowth_has_no_wounds() {
    let mut app = timed_app(FRAME);
    let organ = grown(&mut app, ());
    app.world_mut().entity_mut(organ).insert(that_stay());
    cut(&mut app, square(Vec3::ZERO, Vec3::Y, 3.0));
    assert!(!open_ends(&mut app).is_empty());
    app.world_mut().get_mut::<Vasculature>(organ).unwrap().seed = 5;
    app.update();
    assert_eq!(open_ends(&mut app), [], "in the very frame in which the vessels are others");
    assert!(KINDS.iter().all(|&kind| wounds(app.world(), organ, kind).is_empty()));
    assert_eq!(app.world().resource::<CuttableVessels>().actions(), 0);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.update();
    let expected = across_plane(&app, organ, VesselKind::Artery, Vec3::Y * 0.01, Vec3::Y);
    cut(&mut app, square(Vec3::Y * 0.01, Vec3::Y, 3.0));
    assert_eq!(severed(app.world(), organ, VesselKind::Artery), expected, "the index is that of the new vessels");
}

#[test]
fn wounds_stay_while_vessels_go_on_growing() {
    let mut app = timed_app(FRAME);
    app.insert_resource(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(Cuttable { growth: WoundedGrowth::GoesOn, ..that_stay() });
    run_until(&mut app, "half of the steps", |world| progress(world, organ).step == STEPS / 2);
    app.update();
    let (point, normal) = (Vec3::Y * 0.3, Vec3::Y);
    cut(&mut app, square(point, normal, 3.0));
    // A frame's step comes before its cuts, which also sever new segments.
    let first = across_plane(&app, organ, VesselKind::Artery, point, normal);
    assert_eq!(severed(app.world(), organ, VesselKind::Artery), first);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.update();
    assert_eq!(severed(app.world(), organ, VesselKind::Artery), first);
    let all = across_plane(&app, organ, VesselKind::Artery, point, normal);
    assert!(all.len() > first.len(), "vessels went on growing across the cut");
    for end in open_ends(&mut app) {
        let vessels = published(app.world(), organ, end.kind);
        assert_eq!(end.position, vessels.tree().position_at(end.place), "ends move with their vessels");
    }
    cut(&mut app, square(point + 1e-3, normal, 3.0));
    let now = severed(app.world(), organ, VesselKind::Artery);
    assert!(across_plane(&app, organ, VesselKind::Artery, point + 1e-3, normal).iter().all(|node| now.contains(node)));
}

#[test]
fn what_is_despawned_or_no_longer_cuttable_leaves_nothing() {
    let mut app = timed_app(FRAME);
    let organs = [(); 2].map(|()| grown(&mut app, ()));
    cut(&mut app, square(Vec3::ZERO, Vec3::Y, 3.0));
    let of = |app: &mut App, organ| open_ends(app).iter().filter(|end| end.organ == organ).count();
    assert!(organs.iter().all(|&organ| of(&mut app, organ) > 0));
    app.world_mut().entity_mut(organs[0]).despawn();
    app.update();
    assert_eq!(of(&mut app, organs[0]), 0);
    assert_eq!(app.world().resource::<CuttableVessels>().actions(), 1, "the other's can still be undone");
    app.world_mut().entity_mut(organs[1]).remove::<Cuttable>();
    app.update();
    assert_eq!(open_ends(&mut app), []);
    assert_eq!(app.world_mut().query::<&VesselWounds>().iter(app.world()).count(), 0);
    assert_eq!(app.world().resource::<CuttableVessels>().actions(), 0);
    app.world_mut().entity_mut(organs[1]).insert(Cuttable::default());
    app.update();
    assert!(wounds(app.world(), organs[1], VesselKind::Artery).is_empty());
}

#[test]
fn organs_that_cannot_be_cut_are_named_and_others_are_cut() {
    let mut app = timed_app(FRAME);
    let tree = tube(10.0, 0.1, 5);
    let flat = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
    let bare = organ_of(&mut app, &[(VesselKind::Artery, &tree)], ());
    app.world_mut().entity_mut(flat).insert(Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    let mut failed = MessageCursor::default();
    cut(&mut app, square(Vec3::X, Vec3::X, 1.0));
    let errors: Vec<VesselOperationFailed> = drain(app.world(), &mut failed);
    assert!(
        matches!(errors[..], [VesselOperationFailed { error: OperationError::Blade { organ, .. }, .. }] if organ == flat)
    );
    assert_eq!(severed(app.world(), organ, VesselKind::Artery), [NodeId(1)]);
    let command = VesselCommand::new(VesselAction::Cut(square(Vec3::X * 3.0, Vec3::X, 1.0)));
    operate(&mut app, |vessels| vessels.request(command.clone().on(bare)));
    let errors: Vec<VesselOperationFailed> = drain(app.world(), &mut failed);
    assert_eq!(
        errors,
        [VesselOperationFailed { command: command.on(bare), error: OperationError::NotCuttable { organ: bare } }]
    );
    let surface = square(Vec3::X, Vec3::X, 1.0);
    operate(&mut app, |vessels| vessels.cauterise(surface, 1.0));
    assert_eq!(
        drain::<VesselOperationFailed>(app.world(), &mut failed).len(),
        2,
        "one for the flat organ, one for all"
    );
    assert!(
        vessel_entity(app.world(), bare, VesselKind::Artery)
            .is_some_and(|entity| app.world().get::<VesselIndex>(entity).is_some_and(|index| index.indexed() == 0))
    );
}

#[test]
fn a_tree_that_can_be_cut_is_indexed_before_the_first_cut() {
    for segments in [5, 20_000] {
        let mut app = timed_app(FRAME);
        let tree = tube(segments as f32, 0.1, segments);
        let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
        let entity = vessel_entity(app.world(), organ, VesselKind::Artery).unwrap();
        run_until(&mut app, "the index", |world| {
            world.get::<VesselIndex>(entity).unwrap().is_complete(world.get::<Vessels>(entity).unwrap())
        });
    }
}

#[test]
fn a_large_tree_can_be_cut_before_its_index_is_ready() {
    let mut app = timed_app(FRAME);
    let tree = tube(30_000.0, 0.1, 30_000);
    let organ = organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default());
    let entity = vessel_entity(app.world(), organ, VesselKind::Artery).unwrap();
    for node in [7_u32, 15_000, 29_999] {
        cut(&mut app, square(Vec3::X * (node as f32 - 0.5), Vec3::X, 1.0));
        assert!(wounds(app.world(), organ, VesselKind::Artery).is_severed(NodeId(node)));
    }
    run_until(&mut app, "the index", |world| {
        world.get::<VesselIndex>(entity).unwrap().is_complete(world.get::<Vessels>(entity).unwrap())
    });
    cut(&mut app, square(Vec3::X * 20_000.5, Vec3::X, 1.0));
    let nodes = [7, 15_000, 20_001, 29_999].map(NodeId);
    assert_eq!(severed(app.world(), organ, VesselKind::Artery), nodes);
}
