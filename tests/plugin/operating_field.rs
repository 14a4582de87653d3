//! Organs and instruments for the tests of cutting, bleeding and deformation.

use super::*;
use bevy::time::TimeUpdateStrategy;
use bevy_vessels::{
    plugin::{Cuttable, CuttableVessels, OpenEnd, Perfusion, VesselWounds, VesselsOf},
    synthesis::{
        tree::{NO_PARENT, NodeId, Place},
        units::Scale,
        wound::Blade,
    },
};

/// An app with a fixed duration of frames.
pub fn timed_app(frame: Duration) -> App {
    let mut app = headless(GrowthBudget::Steps(1000));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(frame));
    app
}

/// An organ with given trees, each of a kind, without a mesh.
pub fn organ_of(app: &mut App, trees: &[(VesselKind, &VesselTree)], components: impl Bundle) -> Entity {
    let organ = app.world_mut().spawn((Transform::default(), Visibility::default(), components)).id();
    for &(kind, tree) in trees {
        app.world_mut().spawn((ChildOf(organ), VesselsOf(organ), Vessels::from_tree(kind, tree, &[])));
    }
    app.update();
    organ
}

/// A straight vessel along x from 0 to `length`, in `segments`.
pub fn tube(length: f32, radius: f32, segments: usize) -> VesselTree {
    let positions = (0..=segments).map(|i| Vec3::X * (length * i as f32 / segments as f32)).collect();
    let parents = (0..=segments).map(|i| if i == 0 { NO_PARENT } else { i as u32 - 1 }).collect();
    VesselTree::from_arrays(positions, parents, vec![radius; segments + 1]).expect("a tube is a tree")
}

/// A stem along x from 0 to 1 that forks there into two branches of length 1 along ±y.
pub fn fork(radius: f32) -> VesselTree {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.0)];
    let radii = vec![radius, radius, 0.8 * radius, 0.8 * radius];
    VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 1], radii).expect("a fork is a tree")
}

/// Blood in an organ whose unit is a millimetre.
pub fn blood() -> Perfusion {
    Perfusion { scale: Some(Scale::MILLIMETRES), ..Perfusion::default() }
}

/// A square blade with an edge length, perpendicular to a direction.
pub fn square(center: Vec3, normal: Vec3, size: f32) -> Blade {
    let normal = normal.normalize();
    let half = 0.5 * size * normal.any_orthonormal_vector();
    Blade::rectangle(center, half, normal.cross(half)).expect("a square has an area")
}

/// Clamps all segments that leave a root.
pub fn clamp_roots(app: &mut App, organ: Entity, kind: VesselKind) {
    let entity = vessel_entity(app.world(), organ, kind).expect("the kind has vessels");
    let tree = published(app.world(), organ, kind).tree().clone();
    let first = tree.segments().filter(|&(_, parent)| tree.parents()[parent] == NO_PARENT);
    let first: Vec<NodeId> = first.map(|(node, _)| NodeId(node as u32)).collect();
    operate(app, |vessels| first.iter().for_each(|&node| vessels.clamp_at(entity, Place::new(node, 0.5))));
}

pub fn operate(app: &mut App, operation: impl FnOnce(&mut CuttableVessels)) {
    operation(&mut app.world_mut().resource_mut::<CuttableVessels>());
    app.update();
}

pub fn cut(app: &mut App, blade: Blade) {
    operate(app, |vessels| vessels.cut(blade));
}

pub fn wounds(world: &World, organ: Entity, kind: VesselKind) -> &VesselWounds {
    let vessels = vessel_entity(world, organ, kind).expect("the kind has vessels");
    world.get::<VesselWounds>(vessels).expect("the vessels can be cut")
}

pub fn severed(world: &World, organ: Entity, kind: VesselKind) -> Vec<NodeId> {
    wounds(world, organ, kind).severed_segments().collect()
}

/// All open ends, in the order of kinds and ids.
pub fn open_ends(app: &mut App) -> Vec<OpenEnd> {
    let mut ends: Vec<OpenEnd> = app.world_mut().query::<&OpenEnd>().iter(app.world()).copied().collect();
    ends.sort_by_key(|end| (end.organ, end.kind, end.id));
    ends
}

/// A quick growth that can be cut, grown to completion.
pub fn grown(app: &mut App, components: impl Bundle) -> Entity {
    let organ = spawn(app, quick());
    app.world_mut().entity_mut(organ).insert((Cuttable::default(), components));
    run_to_phase(app, organ, GrowthPhase::Finished);
    (0..2).for_each(|_| app.update());
    organ
}
