//! Vessel entities belong to their organ: they are spawned, moved, hidden and despawned with it.

use super::*;
use bevy_vessels::plugin::{Cuttable, Perfusion, VesselAppearance, VesselSystems, VesselsOf};

fn vessel_count(app: &mut App) -> usize {
    app.world_mut().query::<&Vessels>().iter(app.world()).count()
}

#[test]
fn each_kind_with_roots_gets_one_entity() {
    let mut app = headless(GrowthBudget::default());
    let mut arteries = quick();
    arteries.roots.vein = RootPlacement::None;
    let organ = spawn(&mut app, arteries);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert!(vessel_entity(app.world(), organ, VesselKind::Artery).is_some());
    assert_eq!(vessel_count(&mut app), 1);

    *app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes") = quick();
    run_until(&mut app, "veins", |world| vessel_entity(world, organ, VesselKind::Vein).is_some());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
    assert_eq!(vessel_count(&mut app), 2);

    app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes").roots.vein = RootPlacement::None;
    run_until(&mut app, "no veins", |world| vessel_entity(world, organ, VesselKind::Vein).is_none());
    assert_eq!(vessel_count(&mut app), 1);
}

#[test]
fn vessels_are_named_children_of_their_organ() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    for (kind, name) in [(VesselKind::Artery, "Arteries"), (VesselKind::Vein, "Veins")] {
        let entity = vessel_entity(app.world(), organ, kind).expect("the kind has vessels");
        assert_eq!(app.world().get::<ChildOf>(entity), Some(&ChildOf(organ)));
        assert_eq!(app.world().get::<VesselsOf>(entity), Some(&VesselsOf(organ)));
        assert_eq!(app.world().get::<Name>(entity).map(Name::as_str), Some(name));
    }
}

#[test]
fn vessels_follow_the_organ() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let before = trees(app.world(), organ);
    let transform = Transform::from_xyz(3.0, -2.0, 1.0).with_scale(Vec3::splat(2.0));
    app.world_mut().entity_mut(organ).insert(transform);
    (0..3).for_each(|_| app.update());
    let entity = vessel_entity(app.world(), organ, VesselKind::Vein).expect("the kind has vessels");
    let global = app.world().get::<GlobalTransform>(entity).map(GlobalTransform::compute_transform);
    assert_eq!(global, Some(transform));
    assert_eq!(before, trees(app.world(), organ), "moving an organ does not grow it again");
}

#[test]
fn despawning_an_organ_removes_all_of_it_in_any_phase() {
    for frames in [0, 1, 2, 30] {
        let mut app = headless(GrowthBudget::Steps(1));
        let other = spawn(&mut app, quick());
        let organ = spawn(&mut app, quick());
        (0..frames).for_each(|_| {
            app.update();
            thread::sleep(Duration::from_millis(2));
        });
        app.world_mut().entity_mut(organ).despawn();
        run_to_phase(&mut app, other, GrowthPhase::Finished);
        assert_eq!(vessel_count(&mut app), 2, "after {frames} frames only the other organ's are left");
        let orphans = app.world_mut().query::<&VesselsOf>().iter(app.world()).filter(|of| of.0 == organ).count();
        assert_eq!(orphans, 0);
    }
}

/// A command despawns the organ in the same frame in which another spawns its vessels.
#[test]
fn despawning_an_organ_while_its_vessels_are_spawned_leaves_none() {
    let mut app = headless(GrowthBudget::default());
    app.add_systems(Update, |started: Query<(Entity, &GrowthProgress)>, mut commands: Commands| {
        for (organ, _) in started.iter().filter(|(_, progress)| progress.phase != GrowthPhase::WaitingForMesh) {
            commands.entity(organ).try_despawn();
        }
    });
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "the end of the organ", |world| world.get_entity(organ).is_err());
    (0..3).for_each(|_| app.update());
    assert_eq!(vessel_count(&mut app), 0);
}

/// The commands of the plugin don't fail, and spawn nothing, wherever in a frame another command was before them.
#[test]
fn an_organ_or_its_vasculature_may_be_removed_in_any_set() {
    use VesselSystems::{Circulate, Cut, Follow, Grow, Publish, Source};

    fn despawn(organs: Query<(Entity, &GrowthProgress)>, mut commands: Commands) {
        for (organ, _) in organs.iter().filter(|(_, progress)| progress.phase != GrowthPhase::WaitingForMesh) {
            commands.entity(organ).try_despawn();
        }
    }

    fn remove(organs: Query<(Entity, &GrowthProgress)>, mut commands: Commands) {
        for (organ, _) in organs.iter().filter(|(_, progress)| progress.phase != GrowthPhase::WaitingForMesh) {
            commands.entity(organ).try_remove::<Vasculature>();
        }
    }

    for set in [Source, Grow, Publish, Follow, Cut, Circulate] {
        for is_despawned in [true, false] {
            let mut app = headless(GrowthBudget::default());
            if is_despawned {
                app.add_systems(Update, despawn.in_set(set));
            } else {
                app.add_systems(Update, remove.in_set(set));
            }
            let organ = spawn(&mut app, quick());
            app.world_mut().entity_mut(organ).insert((Cuttable::default(), Perfusion::default()));
            run_until(&mut app, "the end", |world| world.get::<Vasculature>(organ).is_none());
            (0..3).for_each(|_| app.update());
            assert_eq!(vessel_count(&mut app), 0, "{set:?}");
        }
    }
}

#[test]
fn removing_the_vasculature_removes_the_vessels_and_adding_it_grows_them_again() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let before = trees(app.world(), organ);
    app.world_mut().entity_mut(organ).remove::<Vasculature>();
    app.update();
    assert_eq!(vessel_count(&mut app), 0);
    assert!(app.world().get::<OrganVessels>(organ).is_none());
    app.world_mut().entity_mut(organ).insert(quick());
    app.update();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(before, trees(app.world(), organ));
}

#[test]
fn appearance_hides_and_shows_kinds() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick());
    app.world_mut().get_mut::<VesselAppearance>(organ).expect("an organ has a look").shown.vein = false;
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let visibility = |app: &App, kind| {
        vessel_entity(app.world(), organ, kind).and_then(|entity| app.world().get::<Visibility>(entity).copied())
    };
    assert_eq!(visibility(&app, VesselKind::Artery), Some(Visibility::Inherited));
    assert_eq!(visibility(&app, VesselKind::Vein), Some(Visibility::Hidden));
    let mut look = app.world_mut().get_mut::<VesselAppearance>(organ).expect("an organ has a look");
    (look.shown.artery, look.shown.vein) = (false, true);
    app.update();
    assert_eq!(visibility(&app, VesselKind::Artery), Some(Visibility::Hidden));
    assert_eq!(visibility(&app, VesselKind::Vein), Some(Visibility::Inherited));
}
