//! Vessels follow an organ that is deformed, and are cut where they are then.

use crate::theatre::*;
use crate::*;
use bevy_vessels::{
    plugin::{Cuttable, FollowsMesh, SegmentChanges},
    synthesis::tree::NodeId,
};

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

/// A shear that leaves lengths across the surface nearly as they are.
fn shear(at: Vec3) -> Vec3 {
    at + Vec3::new(2.0 + 0.3 * at.y, -1.0, 0.5)
}

#[test]
fn vessels_follow_in_the_same_frame_and_nothing_grows_again() {
    let mut app = theatre(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    move_vertices(&mut app, organ, shear);
    app.update();
    for (system, before) in System::ALL.into_iter().zip(&before) {
        let vessels = published(app.world(), organ, system);
        assert_eq!((vessels.tree().parents(), vessels.tree().radii()), (before.parents(), before.radii()));
        let (min, max) = (vessels.aabb().min(), vessels.aabb().max());
        for (now, before) in vessels.tree().positions().iter().zip(before.positions()) {
            // Nodes stand off the surface by their radius, and that along its normal, which a shear turns.
            assert!(now.distance(shear(*before)) < 0.02, "{now} for {}", shear(*before));
            assert!(Vec3A::from(*now).cmpge(min).all() && Vec3A::from(*now).cmple(max).all());
        }
        let entity = vessel_entity(app.world(), organ, system).unwrap();
        assert!(!app.world().get::<SegmentChanges>(entity).unwrap().is_empty(), "they are drawn anew");
    }
    (0..5).for_each(|_| app.update());
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "a deformed mesh is no other mesh");
}

#[test]
fn what_is_cut_is_where_the_organ_has_it() {
    let mut app = theatre(FRAME);
    let organ = following(&mut app);
    let (point, normal) = (Vec3::Y * 0.2, Vec3::Y);
    cut(&mut app, square(point, normal, 3.0));
    let severed_before = System::ALL.map(|system| severed(app.world(), organ, system));
    move_vertices(&mut app, organ, |at| at + 10.0 * Vec3::X);
    app.update();
    for end in open_ends(&mut app) {
        let vessels = published(app.world(), organ, end.system);
        assert_eq!(end.position, vessels.tree().position_at(end.place));
        assert!(end.position.x > 9.0, "the end is at {}", end.position);
    }
    assert_eq!(severed_before, System::ALL.map(|system| severed(app.world(), organ, system)), "the bond survives");
    cut(&mut app, square(-point, normal, 3.0));
    assert_eq!(severed_before, System::ALL.map(|system| severed(app.world(), organ, system)), "nothing is there");
    cut(&mut app, square(-point + 10.0 * Vec3::X, normal, 3.0));
    for system in System::ALL {
        let vessels = published(app.world(), organ, system);
        let below = |node: usize| vessels.tree().positions()[node].y < -point.y;
        let crossed = vessels.tree().segments().filter(|&(node, parent)| below(node) != below(parent));
        let crossed: Vec<NodeId> = crossed.map(|(node, _)| NodeId(node as u32)).collect();
        assert!(!crossed.is_empty());
        assert!(crossed.iter().all(|&node| wounds(app.world(), organ, system).is_severed(node)));
        assert_eq!(severed(app.world(), organ, system).len(), severed_before[system.index()].len() + crossed.len());
    }
}

#[test]
fn an_organ_that_comes_to_rest_has_its_vessels_exactly_as_they_grew() {
    let mut app = theatre(FRAME);
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
    let mut app = theatre(FRAME);
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
    let mut app = theatre(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    edit_mesh(&mut app, organ, |mesh| *mesh = Sphere::new(0.5).mesh().uv(40, 20));
    run_until(&mut app, "a restart", |world| progress(world, organ).phase != GrowthPhase::Finished);
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
    let mut app = theatre(FRAME);
    let organ = following(&mut app);
    let before = trees(app.world(), organ);
    move_vertices(&mut app, organ, |at| at * f32::NAN);
    (0..2).for_each(|_| app.update());
    assert_eq!(before, trees(app.world(), organ));
}
