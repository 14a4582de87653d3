//! An organ grows, and follows commands.

use super::*;
use bevy_vessels::plugin::{EntityCommandsExt, GrowthControl, GrowthFinished, GrowthFrame, GrowthStarted, diagnostics};

#[test]
fn an_organ_grows_over_frames_and_finishes() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    let (mut started, mut finished) = (MessageCursor::default(), MessageCursor::default());
    let (mut starts, mut ends, mut steps) = (vec![], vec![], vec![]);
    run_until(&mut app, "the end", |world| {
        starts.extend(drain::<GrowthStarted>(world, &mut started));
        ends.extend(drain::<GrowthFinished>(world, &mut finished));
        if progress(world, organ).step > 0 {
            steps.push(progress(world, organ).step);
            assert_published(world, organ);
        }
        !ends.is_empty()
    });
    assert_eq!(starts, [GrowthStarted { organ }]);
    assert_eq!(ends, [GrowthFinished { organ }]);
    assert_eq!(steps, (1..=STEPS).collect::<Vec<_>>(), "one step a frame");
    let progress = progress(app.world(), organ);
    assert_eq!((progress.phase, progress.fraction()), (GrowthPhase::Finished, 1.0));
    assert!(progress.grow_time > Duration::ZERO);
    for kind in KINDS {
        assert_eq!(progress.nodes[kind], published(app.world(), organ, kind).tree().len());
        assert!(progress.nodes[kind] > 50, "{kind:?}: {progress:?}");
    }
}

#[test]
fn mesh_assets_without_the_mesh_plugin_are_enough() {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), AssetPlugin::default(), VesselPlugin::default()));
    app.insert_resource(jobs());
    app.init_asset::<Mesh>();
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn an_app_without_mesh_assets_lives() {
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), VesselPlugin::default()));
    app.finish();
    app.cleanup();
    let organ = app.world_mut().spawn(quick()).id();
    app.world_mut().commands().entity(organ).grow_now();
    (0..3).for_each(|_| app.update());
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::WaitingForMesh);
}

#[test]
fn grow_now_finishes_in_one_call() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    app.world_mut().commands().entity(organ).grow_now();
    app.world_mut().flush();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
    assert_published(app.world(), organ);
    let mut finished = MessageCursor::default();
    assert_eq!(drain::<GrowthFinished>(app.world(), &mut finished), [GrowthFinished { organ }]);
    let before = trees(app.world(), organ);
    (0..5).for_each(|_| app.update());
    assert_eq!(before, trees(app.world(), organ), "it stays finished");
    app.world_mut().commands().entity(organ).grow_now();
    send(&mut app, organ, GrowthAction::Finish);
    (0..2).for_each(|_| app.update());
    assert_eq!(before, trees(app.world(), organ), "there is nothing left to do");
    assert_eq!(drain::<GrowthFinished>(app.world(), &mut finished), []);
}

#[test]
fn grow_now_takes_over_a_growth_under_way() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    let preparing = spawn(&mut app, quick());
    run_until(&mut app, "step 3", |world| progress(world, organ).step == 3);
    let late = spawn(&mut app, quick());
    app.update();
    for organ in [organ, preparing, late] {
        app.world_mut().commands().entity(organ).grow_now();
        app.world_mut().flush();
        assert_published(app.world(), organ);
        assert_eq!(progress(app.world(), organ).step, STEPS);
    }
    assert_eq!(trees(app.world(), organ), trees(app.world(), late));
    let vessels = app.world_mut().query::<&Vessels>().iter(app.world()).count();
    assert_eq!(vessels, 6, "no vessel entity is spawned twice");
}

#[test]
fn grow_now_waits_for_a_late_mesh() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = app.world_mut().spawn(quick()).id();
    app.world_mut().commands().entity(organ).grow_now();
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::WaitingForMesh);
    let mesh = add_mesh(&mut app, sphere());
    app.world_mut().entity_mut(organ).insert(Mesh3d(mesh));
    run_until(&mut app, "a start", |world| progress(world, organ).step > 0);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
}

#[test]
fn pause_step_resume_and_finish() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert(GrowthControl::Paused);
    run_to_phase(&mut app, organ, GrowthPhase::Growing);
    let step_after = |app: &mut App, frames: usize| {
        (0..frames).for_each(|_| app.update());
        progress(app.world(), organ).step
    };
    assert_eq!(step_after(&mut app, 5), 0, "the paused growth is prepared, but does not step");
    send(&mut app, organ, GrowthAction::Step(1));
    send(&mut app, organ, GrowthAction::Step(2));
    assert_eq!(step_after(&mut app, 1), 1, "granted steps keep to the budget");
    assert_eq!(step_after(&mut app, 9), 3);
    send(&mut app, organ, GrowthAction::Resume);
    assert_eq!(step_after(&mut app, 4), 7);
    send(&mut app, organ, GrowthAction::Pause);
    assert_eq!(step_after(&mut app, 4), 7);
    send(&mut app, organ, GrowthAction::Finish);
    assert_eq!(step_after(&mut app, 1), STEPS);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
    assert_eq!(app.world().get::<GrowthControl>(organ), Some(&GrowthControl::Paused));
    assert_published(app.world(), organ);
}

#[test]
fn a_restart_grows_the_same_vessels_on_the_same_entities() {
    let mut app = headless(GrowthBudget::Steps(9));
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let before = trees(app.world(), organ);
    let entity = vessel_entity(app.world(), organ, VesselKind::Artery);
    send(&mut app, organ, GrowthAction::Restart);
    app.update();
    assert_eq!(progress(app.world(), organ).step, 9, "it restarts in the next frame, on the tissue at hand");
    assert_published(app.world(), organ);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(before, trees(app.world(), organ));
    assert_eq!(entity, vessel_entity(app.world(), organ, VesselKind::Artery));
}

#[test]
fn diagnostics_are_measured() {
    use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
    let mut app = headless(GrowthBudget::Steps(2));
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "steps", |world| progress(world, organ).step > 5);
    let measured = |path: &DiagnosticPath| {
        app.world().resource::<DiagnosticsStore>().get_measurement(path).map(|found| found.value)
    };
    assert_eq!(measured(&diagnostics::STEPS), Some(2.0));
    assert_eq!(app.world().resource::<GrowthFrame>().steps, 2);
    let nodes = progress(app.world(), organ).nodes.values().sum::<usize>();
    assert_eq!(measured(&diagnostics::NODES), Some(nodes as f64));
    assert!(measured(&diagnostics::WAITING).is_some_and(|waiting| waiting > 0.0));
    assert!(measured(&diagnostics::STEP_TIME).is_some_and(|time| time > 0.0));
}
