//! The undo history has a limit, beyond which the oldest actions become permanent.

use super::operating_field::*;
use super::*;
use bevy_vessels::{
    plugin::{Cuttable, CuttableVessels, StrokeId, VesselAction, VesselCommand},
    synthesis::tree::NodeId,
};

const FRAME: Duration = Duration::from_millis(16);

/// An app with an organ for each number of segments, whose tubes lie along x, and a limit of the undo history.
fn operating_theatre(undo_limit: usize, organs: usize) -> (App, Vec<Entity>) {
    let mut app = timed_app(FRAME);
    let tree = tube(20.0, 0.1, 20);
    let organs = (0..organs).map(|_| organ_of(&mut app, &[(VesselKind::Artery, &tree)], Cuttable::default())).collect();
    app.world_mut().resource_mut::<CuttableVessels>().undo_limit = undo_limit;
    (app, organs)
}

/// A cut of the segment that ends in a node.
fn across(node: u32) -> VesselCommand {
    VesselCommand::new(VesselAction::Cut(square(Vec3::X * (node as f32 - 0.5), Vec3::X, 1.0)))
}

fn actions(app: &App) -> usize {
    app.world().resource::<CuttableVessels>().actions()
}

fn severed_nodes(app: &App, organ: Entity) -> Vec<u32> {
    severed(app.world(), organ, VesselKind::Artery).iter().map(|node: &NodeId| node.0).collect()
}

#[test]
fn the_oldest_actions_become_permanent() {
    let (mut app, organs) = operating_theatre(3, 1);
    for node in 1..=8 {
        operate(&mut app, |vessels| vessels.request(across(node)));
        assert_eq!(actions(&app), (node as usize).min(3));
    }
    let ledger = |app: &App| wounds(app.world(), organs[0], VesselKind::Artery).actions();
    assert_eq!(ledger(&app), 3, "the ledger forgets them, too");
    (0..9).for_each(|_| operate(&mut app, CuttableVessels::undo));
    assert_eq!((severed_nodes(&app, organs[0]), actions(&app)), (vec![1, 2, 3, 4, 5], 0));
    operate(&mut app, |vessels| vessels.request(across(9)));
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(severed_nodes(&app, organs[0]), [1, 2, 3, 4, 5], "undo works beyond the limit");
    operate(&mut app, CuttableVessels::undo_all);
    assert!(severed_nodes(&app, organs[0]).is_empty(), "all heals");
}

#[test]
fn a_stroke_counts_once_and_every_organ_forgets_its_own() {
    let (mut app, organs) = operating_theatre(2, 2);
    let stroke = StrokeId::begin();
    for node in 1..=4 {
        operate(&mut app, |vessels| vessels.request(across(node).in_stroke(stroke)));
    }
    operate(&mut app, |vessels| vessels.request(across(6).on(organs[0])));
    assert_eq!(actions(&app), 2);
    operate(&mut app, |vessels| vessels.request(across(7).on(organs[1])));
    assert_eq!(actions(&app), 2, "the stroke is permanent on both");
    (0..3).for_each(|_| operate(&mut app, CuttableVessels::undo));
    assert_eq!([0, 1].map(|organ| severed_nodes(&app, organs[organ])), [vec![1, 2, 3, 4], vec![1, 2, 3, 4]]);
}

#[test]
fn with_a_limit_of_zero_nothing_is_kept_and_a_lower_limit_takes_effect_at_the_next_action() {
    let (mut app, organs) = operating_theatre(9, 1);
    for node in 1..=4 {
        operate(&mut app, |vessels| vessels.request(across(node)));
    }
    app.world_mut().resource_mut::<CuttableVessels>().undo_limit = 0;
    operate(&mut app, |vessels| vessels.request(across(5)));
    assert_eq!(actions(&app), 0);
    operate(&mut app, CuttableVessels::undo);
    assert_eq!(severed_nodes(&app, organs[0]), [1, 2, 3, 4, 5]);
    assert_eq!(CuttableVessels::default().undo_limit, CuttableVessels::DEFAULT_UNDO_LIMIT);
}
