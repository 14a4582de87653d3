//! What a cut severed grows no further, and goes on once the cut is undone.

use super::operating_field::*;
use super::*;
use bevy_vessels::{
    plugin::{
        BloodLoss, Cuttable, CuttableVessels, EntityCommandsExt, SurfaceAction, SurfaceCommand, SurfaceMoment,
        VesselMesh, VesselSurface, WoundedGrowth,
    },
    synthesis::{
        cco::CcoSettings,
        tree::{NodeId, Place},
        wound::Blade,
    },
};

const FRAME: Duration = Duration::from_millis(16);

/// An app in which organs do one step a frame.
fn slow_app() -> App {
    let mut app = timed_app(FRAME);
    app.insert_resource(GrowthBudget::Steps(1));
    app
}

/// An organ that has grown half way.
fn half_grown(app: &mut App, wish: Vasculature, components: impl Bundle) -> Entity {
    let organ = spawn(app, wish);
    app.world_mut().entity_mut(organ).insert(components);
    run_until(app, "half of the steps", |world| progress(world, organ).fraction() >= 0.5);
    app.update();
    organ
}

/// A cut through the middle of the organ.
fn halve(app: &mut App) {
    cut(app, square(Vec3::Y * 0.1, Vec3::Y, 3.0));
}

/// Nodes after some frames.
fn nodes_after(app: &mut App, organ: Entity, frames: usize) -> [usize; 2] {
    (0..frames).for_each(|_| app.update());
    trees(app.world(), organ).map(|tree| tree.len())
}

fn whole() -> [VesselTree; 2] {
    let mut app = slow_app();
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    trees(app.world(), organ)
}

#[test]
fn a_cut_organ_grows_no_further_until_the_cut_is_undone() {
    let mut app = slow_app();
    let organ = half_grown(&mut app, quick(), Cuttable::default());
    halve(&mut app);
    assert!(!severed(app.world(), organ, VesselKind::Artery).is_empty());
    let before = nodes_after(&mut app, organ, 0);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Held);
    assert_eq!(nodes_after(&mut app, organ, 10), before);
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Growing);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), whole(), "as if it had never been cut");
}

#[test]
fn whoever_wants_growth_past_a_cut_says_so() {
    let mut app = slow_app();
    let goes_on = Cuttable { growth: WoundedGrowth::GoesOn, ..default() };
    let organ = half_grown(&mut app, quick(), goes_on);
    halve(&mut app);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), whole());
    assert!(!severed(app.world(), organ, VesselKind::Artery).is_empty(), "the wounds stay");
}

#[test]
fn the_switch_and_the_end_of_surgery_take_effect_at_once() {
    for released in [
        (|organ| _ = organ.insert(Cuttable { growth: WoundedGrowth::GoesOn, ..default() })) as fn(&mut EntityWorldMut),
        |organ| _ = organ.remove::<Cuttable>(),
    ] {
        let mut app = slow_app();
        let organ = half_grown(&mut app, quick(), Cuttable::default());
        halve(&mut app);
        let before = nodes_after(&mut app, organ, 3);
        released(&mut app.world_mut().entity_mut(organ));
        assert_ne!(nodes_after(&mut app, organ, 8), before);
    }
}

#[test]
fn seals_and_ties_hold_a_growth_and_clamps_do_not() {
    let mut app = slow_app();
    let organ = half_grown(&mut app, quick(), Cuttable::default());
    let arteries = vessel_entity(app.world(), organ, VesselKind::Artery).expect("arteries");
    let phase = |app: &App| progress(app.world(), organ).phase;
    operate(&mut app, |vessels| vessels.clamp_at(arteries, Place::new(NodeId(3), 0.5)));
    assert_eq!(phase(&app), GrowthPhase::Growing);
    operate(&mut app, |vessels| vessels.ligate_at(arteries, Place::new(NodeId(4), 0.5)));
    assert_eq!(phase(&app), GrowthPhase::Held);
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(phase(&app), GrowthPhase::Growing);
    let ball = Blade::ball(0.5 * Vec3::Y, 0.2).expect("a ball");
    operate(&mut app, |vessels| vessels.cauterise(ball, f32::INFINITY));
    assert_eq!(phase(&app), GrowthPhase::Held);
    operate(&mut app, CuttableVessels::undo_all);
    assert_eq!(phase(&app), GrowthPhase::Growing);
}

#[test]
fn whoever_asks_for_the_end_waits_for_the_wounds() {
    let mut app = slow_app();
    let organ = half_grown(&mut app, quick(), Cuttable::default());
    halve(&mut app);
    let before = nodes_after(&mut app, organ, 0);
    send(&mut app, organ, GrowthAction::Finish);
    app.world_mut().commands().entity(organ).grow_now();
    send(&mut app, organ, GrowthAction::Step(2));
    assert_eq!(nodes_after(&mut app, organ, 5), before);
    operate(&mut app, CuttableVessels::undo);
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), whole());
}

#[test]
fn a_restart_heals_and_grows() {
    let mut app = slow_app();
    let organ = half_grown(&mut app, quick(), Cuttable::default());
    halve(&mut app);
    send(&mut app, organ, GrowthAction::Restart);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), whole());
    assert!(severed(app.world(), organ, VesselKind::Artery).is_empty());
}

#[test]
fn optimised_vessels_keep_their_wounds_although_their_generator_replaces_trees() {
    let mut app = slow_app();
    let artery = RootPlacement::Nearest(vec![Vec3::Y]);
    let roots = RootPlacements { artery, vein: RootPlacement::None, ..default() };
    let settings = CcoSettings { terminals: 40, ..default() };
    let wish = Vasculature::new(PresetName::CcoBall).with_roots(roots).with_generator(settings);
    let organ = half_grown(&mut app, wish, Cuttable::default());
    cut(&mut app, square(Vec3::ZERO, Vec3::Y, 3.0));
    let before = severed(app.world(), organ, VesselKind::Artery);
    (0..10).for_each(|_| app.update());
    assert!(!before.is_empty());
    assert_eq!(severed(app.world(), organ, VesselKind::Artery), before);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Held);
}

#[test]
fn a_held_organ_bleeds_and_can_have_a_surface() {
    let mut app = slow_app();
    let surface = VesselSurface { when: SurfaceMoment::OnDemand, ..default() };
    let organ = half_grown(&mut app, quick(), (Cuttable::default(), blood(), surface));
    halve(&mut app);
    run_until(&mut app, "blood", |world| world.get::<BloodLoss>(organ).is_some_and(|loss| loss.bleeding_ends > 0));
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Held);
    let arteries = vessel_entity(app.world(), organ, VesselKind::Artery).expect("arteries");
    app.world_mut().write_message(SurfaceCommand { organ, action: SurfaceAction::Make });
    run_until(&mut app, "a surface", |world| world.get::<VesselMesh>(arteries).is_some_and(VesselMesh::is_shown));
}
