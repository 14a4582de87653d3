//! Events of an organ reach observers of that organ, global observers, and readers of messages.

use super::*;
use bevy_vessels::{
    plugin::{
        BleedingStarted, BleedingStopped, CirculationFailed, Cuttable, CuttableVessels, EntityCommandsExt,
        GrowthFailed, GrowthFinished, GrowthStarted, OpenEnd, OpenEndEntities, Perfusion, VesselOperation,
    },
    synthesis::{haemodynamics::BleedingSettings, roots::RootPlacements, units::Scale, wound::Blade},
};

/// Number of times that each listener received an event.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
struct Heard<E: Send + Sync + 'static> {
    on_organ: u32,
    anywhere: u32,
    event: std::marker::PhantomData<E>,
}

impl<E: Send + Sync + 'static> Default for Heard<E> {
    fn default() -> Self {
        Self { on_organ: 0, anywhere: 0, event: std::marker::PhantomData }
    }
}

/// Counts an event on one organ, and on all.
fn listen<E: EntityEvent>(app: &mut App, organ: Entity) {
    app.init_resource::<Heard<E>>();
    app.add_observer(|_: On<E>, mut heard: ResMut<Heard<E>>| heard.anywhere += 1);
    let on_organ = |_: On<E>, mut heard: ResMut<Heard<E>>| heard.on_organ += 1;
    app.world_mut().entity_mut(organ).observe(on_organ);
}

#[track_caller]
fn assert_heard<E: EntityEvent + Message>(app: &App, times: u32) {
    let heard = app.world().resource::<Heard<E>>();
    let name = std::any::type_name::<E>();
    assert_eq!((heard.on_organ, heard.anywhere), (times, times), "{name}");
}

#[test]
fn growth_is_heard_once_by_observers_of_the_organ_and_of_all() {
    let mut app = headless(GrowthBudget::Steps(7));
    let organ = spawn(&mut app, quick());
    listen::<GrowthStarted>(&mut app, organ);
    listen::<GrowthFinished>(&mut app, organ);
    listen::<GrowthFailed>(&mut app, organ);
    let published = |finished: On<GrowthFinished>, organs: Query<&OrganVessels>, vessels: Query<&Vessels>| {
        let entities = organs.get(finished.organ).expect("an organ with vessels").entities();
        let longest = vessels.iter_many(entities).map(|vessels| vessels.birth_steps().iter().max().copied()).max();
        assert!(longest.flatten() >= Some(STEPS - 7), "the last steps are published: {longest:?}");
    };
    app.world_mut().entity_mut(organ).observe(published);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.update();
    assert_heard::<GrowthStarted>(&app, 1);
    assert_heard::<GrowthFinished>(&app, 1);
    assert_heard::<GrowthFailed>(&app, 0);
    send(&mut app, organ, GrowthAction::Restart);
    send(&mut app, organ, GrowthAction::Finish);
    app.update();
    assert_heard::<GrowthStarted>(&app, 2);
    assert_heard::<GrowthFinished>(&app, 2);
    app.world_mut().commands().entity(organ).grow_now();
    app.world_mut().get_mut::<Vasculature>(organ).expect("a vasculature").seed = 9;
    app.world_mut().commands().entity(organ).grow_now();
    app.world_mut().flush();
    assert_heard::<GrowthFinished>(&app, 3);
}

#[test]
fn a_failure_is_heard_on_its_organ_only() {
    let mut app = headless(GrowthBudget::default());
    let good = spawn(&mut app, quick());
    let bad = spawn(
        &mut app,
        quick().with_roots(RootPlacements { artery: RootPlacement::Exact(vec![Vec3::splat(99.0)]), ..default() }),
    );
    listen::<GrowthFailed>(&mut app, good);
    run_to_phase(&mut app, bad, GrowthPhase::Failed);
    app.update();
    let heard = app.world().resource::<Heard<GrowthFailed>>();
    assert_eq!((heard.on_organ, heard.anywhere), (0, 1));
}

#[test]
fn cuts_and_bleeding_are_heard_with_their_open_ends_in_place() {
    let mut app = headless(GrowthBudget::default());
    let bleeding = BleedingSettings { clotting: None, ..default() };
    let perfusion = Perfusion { scale: Some(Scale::CENTIMETRES), bleeding, ..default() };
    let organ = spawn(&mut app, quick());
    app.world_mut().entity_mut(organ).insert((Cuttable::default(), perfusion));
    listen::<VesselOperation>(&mut app, organ);
    listen::<BleedingStarted>(&mut app, organ);
    listen::<BleedingStopped>(&mut app, organ);
    listen::<CirculationFailed>(&mut app, organ);
    let in_place = |operation: On<VesselOperation>, entities: Query<&OpenEndEntities>, ends: Query<&OpenEnd>| {
        let entities = entities.get(operation.vessels).expect("a vessel entity has open ends");
        for opened in &operation.report.opened {
            let end = entities.get(opened.id).and_then(|entity| ends.get(entity).ok());
            assert_eq!(end.map(|end| end.id), Some(opened.id), "the end's entity is there when the cut is told");
        }
    };
    app.world_mut().entity_mut(organ).observe(in_place);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.update();
    let half = Blade::rectangle(Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Z).expect("a blade");
    app.world_mut().resource_mut::<CuttableVessels>().cut(half);
    let mut operations = MessageCursor::default();
    let mut started = MessageCursor::default();
    drain::<VesselOperation>(app.world(), &mut operations);
    drain::<BleedingStarted>(app.world(), &mut started);
    app.update();
    let operations = drain(app.world(), &mut operations).len() as u32;
    let started = drain(app.world(), &mut started).len() as u32;
    assert!(operations > 0 && started > 0, "{operations} operations, {started} ends bleed");
    assert_heard::<VesselOperation>(&app, operations);
    assert_heard::<BleedingStarted>(&app, started);
    app.world_mut().get_mut::<Perfusion>(organ).expect("a perfusion").discharge_coefficient = -1.0;
    app.update();
    app.update();
    assert_heard::<CirculationFailed>(&app, 1);
    app.world_mut().resource_mut::<CuttableVessels>().undo_all();
    app.update();
    assert_heard::<VesselOperation>(&app, 2 * operations);
}
