//! Organs that are saved in a Bevy scene and loaded into a fresh app, and clones.

use super::*;
use bevy::{
    ecs::{entity::EntityHashMap, hierarchy::Children},
    world_serialization::{DynamicWorld, DynamicWorldBuilder, serde::WorldDeserializer},
};
use bevy_vessels::{
    plugin::{
        BloodLoss, CirculationState, Cuttable, CuttableVessels, GrowthControl, OpenEnd, OpenEndEntities, Patient,
        Perfusion, VesselOperation, VesselWounds, VesselsOf, WoundedGrowth,
    },
    synthesis::{
        haemodynamics::{BleedingSettings, BloodVolumeSettings, EndState},
        tree::{NO_PARENT, NodeId, Place},
        units::{Scale, Volume},
        wound::{Blade, EndId},
    },
};
use serde::de::DeserializeSeed;

/// An organ that never stops bleeding once it is cut.
fn organ_with_blood(app: &mut App, vasculature: Vasculature) -> Entity {
    let bleeding = BleedingSettings { clotting: None, ..default() };
    let perfusion = Perfusion { scale: Some(Scale::CENTIMETRES), bleeding, ..default() };
    let blood = BloodVolumeSettings { total: Volume::from_ml(321.0), ..default() };
    let patient = Patient::new(blood).expect("settings within their limits");
    let organ = spawn(app, vasculature);
    app.world_mut().entity_mut(organ).insert((Cuttable::default(), perfusion, patient));
    organ
}

/// Cuts an organ, and clamps, ties and seals some of its vessels.
fn operate(app: &mut App, organ: Entity) {
    let arteries = vessel_entity(app.world(), organ, VesselKind::Artery).expect("arteries");
    let mut door = app.world_mut().resource_mut::<CuttableVessels>();
    door.cut(Blade::rectangle(0.1 * Vec3::Y, Vec3::X, Vec3::Z).expect("a blade"));
    door.clamp_at(arteries, Place::new(NodeId(1), 0.5));
    door.ligate_at(arteries, Place::new(NodeId(2), 0.25));
    door.cauterise(Blade::ball(0.5 * Vec3::Z, 0.2).expect("a ball"), f32::INFINITY);
    app.update();
    app.world_mut().resource_mut::<CuttableVessels>().unclamp_near(Vec3::ZERO, f32::INFINITY);
    app.update();
    app.world_mut().resource_mut::<CuttableVessels>().clamp_at(arteries, Place::new(NodeId(4), 0.5));
    (0..20).for_each(|_| {
        app.update();
        thread::sleep(Duration::from_millis(2));
    });
}

/// All entities, as a scene's text.
fn save(world: &mut World) -> String {
    let entities: Vec<Entity> = world.query_filtered::<Entity, With<Transform>>().iter(world).collect();
    save_entities(world, entities)
}

fn save_entities(world: &World, entities: Vec<Entity>) -> String {
    let registry = world.resource::<AppTypeRegistry>().read();
    let scene = DynamicWorldBuilder::from_world(world, &registry).extract_entities(entities.into_iter()).build();
    scene.serialize(&registry).expect("a scene can be written")
}

/// Reads a scene into an app, gives every organ its mesh again, and returns the organs.
fn load(app: &mut App, scene: &str) -> Vec<Entity> {
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let mut server = app.world().resource::<AssetServer>().clone();
    let scene: DynamicWorld = {
        let registry = registry.read();
        let seed = WorldDeserializer { type_registry: &registry, load_from_path: &mut server };
        let mut deserializer = ron::Deserializer::from_str(scene).expect("RON");
        seed.deserialize(&mut deserializer).unwrap_or_else(|error| panic!("{error}"))
    };
    let mut entities = EntityHashMap::default();
    scene.write_to_world(app.world_mut(), &mut entities).expect("a scene of registered types");
    let mut organs: Vec<Entity> = entities.values().copied().collect();
    organs.retain(|&entity| app.world().get::<Perfusion>(entity).is_some());
    organs.sort_unstable();
    let mesh = add_mesh(app, sphere());
    for &organ in &organs {
        if app.world().get::<Vasculature>(organ).is_some() {
            app.world_mut().entity_mut(organ).insert(Mesh3d(mesh.clone()));
        }
    }
    organs
}

/// The observable state of an organ's wounds and blood, without entity ids.
#[derive(Clone, Debug, PartialEq)]
struct Condition {
    trees: Vec<(VesselKind, VesselTree, Vec<u32>)>,
    /// Ends with their state, in the order of the ledger.
    ends: Vec<(EndId, Place, Vec3, bool)>,
    clamps: usize,
    injured: Vec<NodeId>,
}

fn condition(world: &World, organ: Entity) -> Condition {
    let mut condition = Condition { trees: Vec::new(), ends: Vec::new(), clamps: 0, injured: Vec::new() };
    for kind in VesselKind::ALL {
        let Some(entity) = vessel_entity(world, organ, kind) else { continue };
        let vessels = world.get::<Vessels>(entity).expect("vessels");
        condition.trees.push((kind, vessels.tree().clone(), vessels.birth_steps().to_vec()));
        let Some(wounds) = world.get::<VesselWounds>(entity) else { continue };
        condition.ends.extend(wounds.ends(vessels.tree()).map(|end| (end.id, end.place, end.position, end.is_open)));
        condition.clamps += wounds.clamps().count();
        condition.injured.extend(wounds.injured());
    }
    condition
}

/// Asserts that the organs have an entity for each open end and no others, and no surplus vessel entity.
#[track_caller]
fn assert_no_ghosts(world: &mut World, organs: &[Entity]) {
    let mut known = Vec::new();
    let mut vessel_entities = Vec::new();
    for &organ in organs {
        let entities = world.get::<OrganVessels>(organ).expect("an organ with vessels").entities().to_vec();
        for &entity in &entities {
            assert_eq!(world.get::<VesselsOf>(entity), Some(&VesselsOf(organ)));
            assert_eq!(world.get::<ChildOf>(entity).map(ChildOf::parent), Some(organ));
            assert!(world.get::<Children>(organ).is_some_and(|children| children.contains(&entity)));
            let ends = world.get::<OpenEndEntities>(entity).expect("a vessel entity that can be cut");
            let ends: Vec<_> = ends.iter().map(|(_, end)| end).collect();
            let children = world.get::<Children>(entity).map_or(0, |children| children.len());
            assert_eq!(children, ends.len(), "{entity} has its open ends for children, and no others");
            for &end in &ends {
                let open_end = world.get::<OpenEnd>(end).expect("an open end");
                assert_eq!((open_end.organ, open_end.vessels), (organ, entity));
            }
            known.extend(ends);
        }
        vessel_entities.extend(entities);
    }
    let mut all: Vec<Entity> = world.query_filtered::<Entity, With<OpenEnd>>().iter(world).collect();
    all.sort_unstable();
    known.sort_unstable();
    assert_eq!(all, known);
    let mut all: Vec<Entity> = world.query_filtered::<Entity, With<Vessels>>().iter(world).collect();
    all.sort_unstable();
    vessel_entities.sort_unstable();
    assert_eq!(all, vessel_entities);
}

#[track_caller]
fn wait_for_vessels(app: &mut App, organ: Entity, nodes: usize) {
    run_until(app, "the saved vessels", |world| {
        let vessels = vessel_entity(world, organ, VesselKind::Artery).and_then(|entity| world.get::<Vessels>(entity));
        vessels.is_some_and(|vessels| vessels.tree().len() == nodes)
    });
}

/// Asserts that an organ can be cut and completely healed.
#[track_caller]
fn assert_can_be_cut(app: &mut App, organ: Entity) {
    let mut operations = MessageCursor::default();
    drain::<VesselOperation>(app.world(), &mut operations);
    app.world_mut()
        .resource_mut::<CuttableVessels>()
        .cut(Blade::rectangle(-0.2 * Vec3::Y, Vec3::X, Vec3::Z).expect("a blade"));
    app.update();
    let done: Vec<VesselOperation> = drain(app.world(), &mut operations);
    assert!(done.iter().any(|done| done.organ == organ && !done.report.opened.is_empty()));
    app.world_mut().resource_mut::<CuttableVessels>().undo_all();
    app.update();
    assert!(condition(app.world(), organ).injured.is_empty());
}

#[test]
fn an_organ_comes_back_with_its_vessels_wounds_and_blood() {
    let mut app = headless(GrowthBudget::default());
    let organ = organ_with_blood(&mut app, quick().with_seed(3));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    operate(&mut app, organ);
    let before = condition(app.world(), organ);
    assert!(before.ends.iter().any(|end| end.3) && before.clamps == 1, "{:?}", before.ends);
    let lost = app.world().get::<BloodLoss>(organ).expect("a loss").total;
    let patient = *app.world().get::<Patient>(organ).expect("a patient");
    assert!(lost.ml() > 0.0 && (patient.blood().lost().ml() / lost.ml() - 1.0).abs() < 1e-9);
    let scene = save(app.world_mut());
    assert!(!scene.contains("birth_steps"), "what grows again is not written");

    let mut fresh = headless(GrowthBudget::default());
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    fresh.world_mut().get_mut::<Perfusion>(loaded).expect("a perfusion").paused = true;
    wait_for_vessels(&mut fresh, loaded, before.trees[0].1.len());
    assert_eq!(condition(fresh.world(), loaded), before, "in the frame in which the vessels are there");
    assert!(progress(fresh.world(), loaded).is_finished());
    assert_no_ghosts(fresh.world_mut(), &[loaded]);
    assert_eq!(fresh.world().get::<Patient>(loaded), Some(&patient));
    assert_eq!(fresh.world().get::<BloodLoss>(loaded).expect("a loss").total, lost);

    fresh.world_mut().get_mut::<Perfusion>(loaded).expect("a perfusion").paused = false;
    run_until(&mut fresh, "more blood lost", |world| world.get::<BloodLoss>(loaded).expect("a loss").total > lost);
    assert!(fresh.world().get::<Patient>(loaded).expect("a patient").blood().lost() > lost);
    assert_can_be_cut(&mut fresh, loaded);
    assert_no_ghosts(fresh.world_mut(), &[loaded]);
}

#[test]
fn a_scene_loaded_twice_gives_two_organs() {
    let mut app = headless(GrowthBudget::default());
    let organ = organ_with_blood(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    operate(&mut app, organ);
    let before = condition(app.world(), organ);
    let scene = save(app.world_mut());
    let mut fresh = headless(GrowthBudget::default());
    let organs = [load(&mut fresh, &scene), load(&mut fresh, &scene)].concat();
    let &[first, second] = &organs[..] else { panic!("two organs") };
    for organ in [first, second] {
        wait_for_vessels(&mut fresh, organ, before.trees[0].1.len());
        assert_eq!(condition(fresh.world(), organ), before);
    }
    assert_no_ghosts(fresh.world_mut(), &organs);
    fresh.world_mut().despawn(first);
    fresh.update();
    assert_no_ghosts(fresh.world_mut(), &[second]);
    assert_eq!(condition(fresh.world(), second), before);
}

#[test]
fn a_growth_that_was_paused_is_as_far_as_it_was() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = organ_with_blood(&mut app, quick());
    run_until(&mut app, "some steps", |world| progress(world, organ).step == 12);
    send(&mut app, organ, GrowthAction::Pause);
    app.world_mut().entity_mut(organ).insert(Cuttable { growth: WoundedGrowth::GoesOn, ..default() });
    app.update();
    operate(&mut app, organ);
    let (before, step) = (condition(app.world(), organ), progress(app.world(), organ).step);
    let scene = save(app.world_mut());
    let mut fresh = headless(GrowthBudget::Steps(1));
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    wait_for_vessels(&mut fresh, loaded, before.trees[0].1.len());
    assert_eq!(condition(fresh.world(), loaded), before);
    assert_eq!(progress(fresh.world(), loaded).step, step);
    assert_eq!(fresh.world().get::<GrowthControl>(loaded), Some(&GrowthControl::Paused));
    send(&mut fresh, loaded, GrowthAction::Finish);
    run_to_phase(&mut fresh, loaded, GrowthPhase::Finished);
    assert!(!condition(fresh.world(), loaded).injured.is_empty(), "wounds stay while the growth goes on");
}

/// No frame may grow on before the wounds are back.
#[test]
fn a_growth_that_was_held_by_wounds_is_held_again() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = organ_with_blood(&mut app, quick());
    run_until(&mut app, "some steps", |world| progress(world, organ).step == 12);
    operate(&mut app, organ);
    let before = condition(app.world(), organ);
    let scene = save(app.world_mut());
    let mut fresh = headless(GrowthBudget::Steps(100));
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    wait_for_vessels(&mut fresh, loaded, before.trees[0].1.len());
    (0..5).for_each(|_| fresh.update());
    assert_eq!(condition(fresh.world(), loaded), before);
    assert_eq!(progress(fresh.world(), loaded).phase, GrowthPhase::Held);
}

#[test]
fn wounds_of_other_vessels_are_dropped() {
    let mut app = headless(GrowthBudget::default());
    let organ = organ_with_blood(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    operate(&mut app, organ);
    let scene = save(app.world_mut());
    let mut fresh = headless(GrowthBudget::default());
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    fresh.world_mut().get_mut::<Vasculature>(loaded).expect("a vasculature").seed = 99;
    run_until(&mut fresh, "other vessels", |world| !condition(world, loaded).trees[0].1.is_empty());
    run_to_phase(&mut fresh, loaded, GrowthPhase::Finished);
    assert!(condition(fresh.world(), loaded).injured.is_empty());
    assert_no_ghosts(fresh.world_mut(), &[loaded]);
    assert_can_be_cut(&mut fresh, loaded);
}

#[test]
fn an_organ_saved_without_its_vessels_grows_new_ones() {
    let mut app = headless(GrowthBudget::default());
    let organ = organ_with_blood(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    operate(&mut app, organ);
    let trees = condition(app.world(), organ).trees;
    let scene = save_entities(app.world(), vec![organ]);
    let mut fresh = headless(GrowthBudget::default());
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    wait_for_vessels(&mut fresh, loaded, trees[0].1.len());
    let now = condition(fresh.world(), loaded);
    assert_eq!(now.trees, trees);
    assert!(now.injured.is_empty());
    assert_can_be_cut(&mut fresh, loaded);
}

/// An organ without a mesh, whose arteries are a given tree.
fn given_organ(app: &mut App) -> (Entity, Entity) {
    let positions = vec![Vec3::ZERO, 0.3 * Vec3::Y, Vec3::new(0.2, 0.6, 0.0), Vec3::new(-0.2, 0.6, 0.0)];
    let tree = VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 1], vec![0.05, 0.05, 0.04, 0.04]);
    let vessels = Vessels::from_tree(VesselKind::Artery, &tree.expect("a tree"), &[0, 1, 2, 2]);
    let perfusion = Perfusion { scale: Some(Scale::CENTIMETRES), ..default() };
    let organ = app.world_mut().spawn((Transform::default(), Visibility::default(), perfusion)).id();
    let entity = app.world_mut().spawn((vessels, VesselsOf(organ), ChildOf(organ))).id();
    (organ, entity)
}

#[test]
fn given_vessels_come_back_with_their_wounds() {
    let mut app = headless(GrowthBudget::default());
    let (organ, arteries) = given_organ(&mut app);
    app.update();
    app.world_mut()
        .resource_mut::<CuttableVessels>()
        .cut(Blade::rectangle(0.45 * Vec3::Y, Vec3::X, Vec3::Z).expect("a blade"));
    app.world_mut().resource_mut::<CuttableVessels>().clamp_at(arteries, Place::new(NodeId(1), 0.5));
    app.update();
    let before = condition(app.world(), organ);
    assert_eq!((before.ends.len(), before.clamps), (4, 1));
    let scene = save(app.world_mut());
    let mut fresh = headless(GrowthBudget::default());
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    fresh.update();
    assert_eq!(condition(fresh.world(), loaded), before);
    assert_no_ghosts(fresh.world_mut(), &[loaded]);
    // A tree that was changed in the file is another tree.
    let changed = scene.replace("0.05", "0.06");
    assert_ne!(changed, scene);
    let [other] = load(&mut fresh, &changed)[..] else { panic!("one organ") };
    fresh.update();
    assert!(condition(fresh.world(), other).injured.is_empty(), "the wounds are of another tree");
}

#[test]
fn ends_that_have_clotted_stay_so() {
    let mut app = headless(GrowthBudget::default());
    let (organ, _) = given_organ(&mut app);
    app.update();
    app.world_mut()
        .resource_mut::<CuttableVessels>()
        .cut(Blade::rectangle(0.45 * Vec3::Y, Vec3::X, Vec3::Z).expect("a blade"));
    run_until(&mut app, "bleeding", |world| {
        world.get::<CirculationState>(organ).expect("a state").bleeding(VesselKind::Artery).rate().ml_per_min() > 0.0
    });
    let ages = |world: &World, organ| -> Vec<f64> {
        let state = world.get::<CirculationState>(organ).expect("a state");
        state.bleeding(VesselKind::Artery).ends().iter().map(|end| end.age).collect()
    };
    (0..50).for_each(|_| {
        app.update();
        thread::sleep(Duration::from_millis(2));
    });
    let before = ages(app.world(), organ);
    let scene = save(app.world_mut());
    let mut fresh = headless(GrowthBudget::default());
    let [loaded] = load(&mut fresh, &scene)[..] else { panic!("one organ") };
    run_until(&mut fresh, "bleeding", |world| {
        world.query::<&OpenEnd>().iter(world).any(|end| end.state == EndState::Bleeding)
    });
    let after = ages(fresh.world(), loaded);
    assert_eq!(after.len(), before.len());
    assert!(before.iter().zip(&after).all(|(before, after)| before <= after), "{before:?} {after:?}");
}

#[test]
fn clones_are_organs_of_their_own() {
    let mut app = headless(GrowthBudget::default());
    let organ = organ_with_blood(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    operate(&mut app, organ);
    app.world_mut().get_mut::<Perfusion>(organ).expect("a perfusion").paused = true;
    app.update();
    let before = condition(app.world(), organ);
    let alone = app.world_mut().entity_mut(organ).clone_and_spawn();
    let whole = app.world_mut().entity_mut(organ).clone_and_spawn_with_opt_out(|builder| {
        builder.linked_cloning(true);
    });
    for clone in [alone, whole] {
        wait_for_vessels(&mut app, clone, before.trees[0].1.len());
        run_to_phase(&mut app, clone, GrowthPhase::Finished);
    }
    app.update();
    assert_eq!(condition(app.world(), whole), before, "with its vessel entities, an organ is cloned with its wounds");
    let grown = condition(app.world(), alone);
    assert_eq!((&grown.trees, grown.injured.len()), (&before.trees, 0), "without, its vessels are whole");
    assert_no_ghosts(app.world_mut(), &[organ, alone, whole]);
    app.world_mut().despawn(organ);
    app.update();
    assert_eq!(condition(app.world(), whole), before);
    assert_no_ghosts(app.world_mut(), &[alone, whole]);
}
