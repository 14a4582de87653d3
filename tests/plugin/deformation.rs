//! Vessels follow a deformed organ, and are cut at their deformed positions.

#[path = "../common/solid_box.rs"]
mod solid_box;

use super::operating_field::*;
use super::*;
use bevy::math::Affine3A;
use bevy_vessels::{
    plugin::{ChangeLog, Cuttable, FollowsMesh, FollowsTetrahedra},
    synthesis::{tissue::TissueMode, tree::NodeId},
};
use solid_box::solid_box;

const FRAME: Duration = Duration::from_millis(16);

fn edit_mesh(app: &mut App, organ: Entity, edit: impl FnOnce(&mut Mesh)) {
    let id = app.world().get::<Mesh3d>(organ).map(|mesh| mesh.id()).expect("the organ has a mesh");
    edit(&mut app.world_mut().resource_mut::<Assets<Mesh>>().get_mut(id).expect("the mesh is there"));
}

fn move_vertices(app: &mut App, organ: Entity, to: impl Fn(Vec3) -> Vec3) {
    edit_mesh(app, organ, |mesh| {
        let positions =
            mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3()).expect("positions").to_vec();
        let moved: Vec<[f32; 3]> = positions.iter().map(|&at| to(Vec3::from(at)).to_array()).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, moved);
    });
}

fn following(app: &mut App) -> Entity {
    let organ = spawn(app, quick());
    app.world_mut().entity_mut(organ).insert((Cuttable::default(), FollowsMesh));
    run_to_phase(app, organ, GrowthPhase::Finished);
    (0..2).for_each(|_| app.update());
    organ
}

/// A shear that nearly keeps lengths across the surface.
fn shear(at: Vec3) -> Vec3 {
    at + Vec3::new(2.0 + 0.3 * at.y, -1.0, 0.5)
}

#[test]
fn vessels_follow_in_the_same_frame_and_nothing_grows_again() {
    let mut app = timed_app(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    let log = |app: &App, kind| {
        let entity = vessel_entity(app.world(), organ, kind).unwrap();
        app.world().get::<ChangeLog>(entity).unwrap().now()
    };
    let seen = KINDS.map(|kind| log(&app, kind));
    move_vertices(&mut app, organ, shear);
    app.update();
    assert!(KINDS.into_iter().zip(seen).all(|(kind, seen)| log(&app, kind) != seen), "they are drawn anew");
    for (kind, before) in KINDS.into_iter().zip(&before) {
        let vessels = published(app.world(), organ, kind);
        assert_eq!((vessels.tree().parents(), vessels.tree().radii()), (before.parents(), before.radii()));
        let (min, max) = (vessels.aabb().min(), vessels.aabb().max());
        for (now, before) in vessels.tree().positions().iter().zip(before.positions()) {
            // Nodes are lifted off the surface by their radius along its normal, which a shear turns.
            assert!(now.distance(shear(*before)) < 0.02, "{now} for {}", shear(*before));
            assert!(Vec3A::from(*now).cmpge(min).all() && Vec3A::from(*now).cmple(max).all());
        }
    }
    (0..5).for_each(|_| app.update());
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "a deformed mesh is no other mesh");
}

/// A mesh that cannot be an organ has no rest shape.
#[test]
fn new_vertices_mend_a_mesh_that_could_not_be_an_organ() {
    let mut app = timed_app(FRAME);
    let mut bad = sphere();
    let nowhere = vec![[f32::NAN; 3]; bad.count_vertices()];
    bad.insert_attribute(Mesh::ATTRIBUTE_POSITION, nowhere);
    let mesh = add_mesh(&mut app, bad);
    let organ = app.world_mut().spawn((Mesh3d(mesh), quick(), FollowsMesh)).id();
    run_to_phase(&mut app, organ, GrowthPhase::Failed);
    (0..3).for_each(|_| app.update());
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Failed);
    edit_mesh(&mut app, organ, |mesh| *mesh = sphere());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
}

#[test]
fn what_is_cut_is_where_the_organ_has_it() {
    let mut app = timed_app(FRAME);
    let organ = following(&mut app);
    let (point, normal) = (Vec3::Y * 0.2, Vec3::Y);
    cut(&mut app, square(point, normal, 3.0));
    let severed_before = KINDS.map(|kind| severed(app.world(), organ, kind));
    move_vertices(&mut app, organ, |at| at + 10.0 * Vec3::X);
    app.update();
    for end in open_ends(&mut app) {
        let vessels = published(app.world(), organ, end.kind);
        assert_eq!(end.position, vessels.tree().position_at(end.place));
        assert!(end.position.x > 9.0, "the end is at {}", end.position);
    }
    assert_eq!(severed_before, KINDS.map(|kind| severed(app.world(), organ, kind)), "the bond survives");
    cut(&mut app, square(-point, normal, 3.0));
    assert_eq!(severed_before, KINDS.map(|kind| severed(app.world(), organ, kind)), "nothing is there");
    let ends = |app: &App, kind: VesselKind| {
        let vessels = published(app.world(), organ, kind);
        wounds(app.world(), organ, kind).ends(vessels.tree()).count()
    };
    let ends_before = KINDS.map(|kind| ends(&app, kind));
    cut(&mut app, square(-point + 10.0 * Vec3::X, normal, 3.0));
    for kind in KINDS {
        let vessels = published(app.world(), organ, kind);
        let below = |node: usize| vessels.tree().positions()[node].y < -point.y;
        let crossed = vessels.tree().segments().filter(|&(node, parent)| below(node) != below(parent));
        let crossed: Vec<NodeId> = crossed.map(|(node, _)| NodeId(node as u32)).collect();
        assert!(!crossed.is_empty());
        assert!(crossed.iter().all(|&node| wounds(app.world(), organ, kind).is_severed(node)));
        // Others may be gone if an end retracted past their node, but each lumen still has two ends.
        assert_eq!(ends(&app, kind), ends_before[kind.index()] + 2 * crossed.len());
    }
}

#[test]
fn an_organ_that_comes_to_rest_has_its_vessels_exactly_as_they_grew() {
    let mut app = timed_app(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    let rest: Vec<[f32; 3]> = {
        let id = app.world().get::<Mesh3d>(organ).unwrap().id();
        let mesh = app.world().resource::<Assets<Mesh>>().get(id).unwrap();
        mesh.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3()).unwrap().to_vec()
    };
    move_vertices(&mut app, organ, shear);
    app.update();
    assert_ne!(before, trees(app.world(), organ));
    edit_mesh(&mut app, organ, |mesh| mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, rest));
    app.update();
    assert_eq!(before, trees(app.world(), organ));
    move_vertices(&mut app, organ, shear);
    app.update();
    app.world_mut().entity_mut(organ).remove::<FollowsMesh>();
    assert_eq!(before, trees(app.world(), organ), "nor do they follow without the component");
}

#[test]
fn vessels_grow_at_rest_while_their_organ_moves() {
    let mut app = timed_app(FRAME);
    app.insert_resource(GrowthBudget::Steps(2));
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(FollowsMesh);
    run_until(&mut app, "a start", |world| progress(world, organ).step > 3);
    while progress(app.world(), organ).phase != GrowthPhase::Finished {
        move_vertices(&mut app, organ, |at| at + 0.25 * Vec3::X);
        app.update();
    }
    (0..2).for_each(|_| app.update());
    let moved = app.world().get::<Mesh3d>(organ).unwrap().id();
    let moved = app.world().resource::<Assets<Mesh>>().get(moved).unwrap();
    let offset = moved.attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3()).unwrap()[0][0]
        - sphere().attribute(Mesh::ATTRIBUTE_POSITION).and_then(|values| values.as_float3()).unwrap()[0][0];
    assert!(offset > 1.0);
    let still = spawn(&mut app, quick());
    run_to_phase(&mut app, still, GrowthPhase::Finished);
    for (moved, still) in trees(app.world(), organ).iter().zip(&trees(app.world(), still)) {
        assert_eq!((moved.parents(), moved.radii()), (still.parents(), still.radii()), "the same vessels grew");
        for (moved, still) in moved.positions().iter().zip(still.positions()) {
            assert!(moved.distance(*still + offset * Vec3::X) < 1e-4, "{moved} for {still}");
        }
    }
}

#[test]
fn another_number_of_vertices_is_another_organ() {
    let mut app = timed_app(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    edit_mesh(&mut app, organ, |mesh| *mesh = Sphere::new(0.5).mesh().uv(40, 20));
    // A fast machine grows it again within one frame.
    let nodes = progress(app.world(), organ).nodes;
    run_until(&mut app, "a restart", |world| progress(world, organ).nodes != nodes);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    (0..2).for_each(|_| app.update());
    let grown = trees(app.world(), organ);
    assert_ne!(before, grown);
    move_vertices(&mut app, organ, |at| at + Vec3::X);
    app.update();
    for (now, grown) in trees(app.world(), organ).iter().zip(&grown) {
        let moves =
            now.positions().iter().zip(grown.positions()).all(|(now, grown)| now.distance(*grown + Vec3::X) < 1e-4);
        assert!(moves, "vessels follow the new mesh");
    }
}

#[test]
fn an_unstable_soft_body_moves_nothing_and_does_not_stop_the_app() {
    let mut app = timed_app(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    move_vertices(&mut app, organ, |at| at * f32::NAN);
    (0..2).for_each(|_| app.update());
    assert_eq!(before, trees(app.world(), organ));
}

/// Vessels through a box that follow its tetrahedra.
fn solid(app: &mut App) -> Entity {
    let mut vasculature = quick();
    vasculature.tissue = TissueMode::Volume.into();
    let mesh = add_mesh(app, Cuboid::from_length(1.0));
    let tetrahedra = FollowsTetrahedra::new(solid_box(4, 1.0));
    let organ = app.world_mut().spawn((Mesh3d(mesh), vasculature, Cuttable::default(), tetrahedra)).id();
    run_to_phase(app, organ, GrowthPhase::Finished);
    (0..2).for_each(|_| app.update());
    organ
}

fn move_tetrahedra(app: &mut App, organ: Entity, to: impl Fn(Vec3) -> Vec3) {
    let mut tetrahedra = app.world_mut().get_mut::<FollowsTetrahedra>(organ).expect("the organ has tetrahedra");
    tetrahedra.positions_mut().iter_mut().for_each(|at| *at = to(*at));
}

#[track_caller]
fn assert_moved(now: &[VesselTree; 2], before: &[VesselTree; 2], to: impl Fn(Vec3) -> Vec3) {
    for (now, before) in now.iter().zip(before) {
        assert!(before.len() > 100, "{} nodes are too few to tell", before.len());
        assert_eq!((now.parents(), now.radii()), (before.parents(), before.radii()));
        for (now, before) in now.positions().iter().zip(before.positions()) {
            assert!(now.distance(to(*before)) < 2e-6, "{now} for {}", to(*before));
        }
    }
}

#[test]
fn vessels_within_a_sheared_box_move_as_every_point_of_it() {
    let mut app = timed_app(FRAME);
    let organ = solid(&mut app);
    let before = trees(app.world(), organ);
    let inside = before[0].positions().iter().filter(|at| at.abs().max_element() < 0.4).count();
    assert!(inside > 50, "{inside} nodes are too few within the box");
    let (point, normal) = (Vec3::Y * 0.1, Vec3::Y);
    cut(&mut app, square(point, normal, 3.0));
    let ends_before = open_ends(&mut app);
    assert!(ends_before.len() > 8, "{}", ends_before.len());
    let mut map = Affine3A::from_translation(Vec3::new(0.2, -0.1, 0.3));
    map.matrix3.y_axis += Vec3A::new(0.6, 0.0, -0.2);
    map.matrix3.x_axis *= 1.3;
    move_tetrahedra(&mut app, organ, |at| map.transform_point3(at));
    app.update();
    assert_moved(&trees(app.world(), organ), &before, |at| map.transform_point3(at));
    for (now, before) in open_ends(&mut app).iter().zip(&ends_before) {
        assert_eq!((now.id, now.place), (before.id, before.place), "a cut stays at its spot of the vessel");
        assert!(now.position.distance(map.transform_point3(before.position)) < 2e-6);
        let direction = map.transform_vector3(before.direction).normalize();
        assert!(now.direction.distance(direction) < 1e-3, "{} for {direction}", now.direction);
    }
    // The blade cuts them at their moved positions.
    let level = map.transform_point3(2.0 * point).y;
    cut(&mut app, square(Vec3::Y * level, normal, 3.0));
    let vessels = published(app.world(), organ, VesselKind::Artery);
    let below = |node: usize| vessels.tree().positions()[node].y < level;
    let crossed: Vec<_> = vessels.tree().segments().filter(|&(node, parent)| below(node) != below(parent)).collect();
    assert!(!crossed.is_empty());
    let wounds = wounds(app.world(), organ, VesselKind::Artery);
    assert!(crossed.iter().all(|&(node, _)| wounds.is_severed(NodeId(node as u32))));
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
}

#[test]
fn tetrahedra_may_be_replaced_and_taken_away() {
    let mut app = timed_app(FRAME);
    let organ = solid(&mut app);
    let before = trees(app.world(), organ);
    move_tetrahedra(&mut app, organ, |at| at * f32::NAN);
    (0..2).for_each(|_| app.update());
    assert_eq!(before, trees(app.world(), organ), "an unstable soft body moves nothing");
    let finer = FollowsTetrahedra::new(solid_box(5, 1.0));
    app.world_mut().entity_mut(organ).insert(finer);
    app.update();
    assert_eq!(before, trees(app.world(), organ), "these are at rest");
    move_tetrahedra(&mut app, organ, |at| at * 2.0);
    app.update();
    assert_moved(&trees(app.world(), organ), &before, |at| at * 2.0);
    // The surface is drawn deformed, too. It is followed only once the tetrahedra are gone.
    app.world_mut().entity_mut(organ).insert(FollowsMesh);
    move_vertices(&mut app, organ, |at| at + Vec3::X);
    app.update();
    assert_moved(&trees(app.world(), organ), &before, |at| at * 2.0);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "a deformed mesh is no other mesh");
    app.world_mut().entity_mut(organ).remove::<FollowsTetrahedra>();
    (0..2).for_each(|_| app.update());
    assert_moved(&trees(app.world(), organ), &before, |at| at + Vec3::X);
    app.world_mut().entity_mut(organ).remove::<FollowsMesh>();
    assert_eq!(before, trees(app.world(), organ));
}
