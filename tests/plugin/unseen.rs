//! Settings that change while the drawn vessels stay, as a slider or another seed asks for.

use super::*;
use bevy_vessels::plugin::{EntityCommandsExt, GrowthAction, GrowthCommand, GrowthControl, OrganPaint, RegrowsUnseen};
use bevy_vessels::synthesis::tissue::{TissueMode, TissuePaint};

/// An organ that has grown and changes unseen from now on.
fn grown(app: &mut App, wish: Vasculature) -> Entity {
    let organ = spawn(app, wish);
    app.world_mut().entity_mut(organ).insert(RegrowsUnseen);
    run_to_phase(app, organ, GrowthPhase::Finished);
    organ
}

fn tweak(app: &mut App, organ: Entity, change: impl FnOnce(&mut Vasculature)) {
    change(&mut app.world_mut().get_mut::<Vasculature>(organ).expect("an organ"));
}

fn weigh(wish: &mut Vasculature, weight: f32) {
    wish.generator.colonization_mut().expect("it colonizes").arterial.direction_weight = weight;
}

/// The vessels of an organ that was spawned so.
fn fresh(wish: Vasculature) -> [VesselTree; 2] {
    let mut app = headless(GrowthBudget::Steps(1000));
    let organ = spawn(&mut app, wish);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    trees(app.world(), organ)
}

#[test]
fn another_seed_shows_the_old_vessels_until_the_new_ones_are_there() {
    let mut app = headless(GrowthBudget::Steps(3));
    let organ = grown(&mut app, quick());
    let before = trees(app.world(), organ);
    tweak(&mut app, organ, |wish| wish.seed += 1);
    app.update();
    let mut frames = 0;
    run_until(&mut app, "other vessels", |world| {
        frames += 1;
        let now = trees(world, organ);
        assert!(now == before || progress(world, organ).phase != GrowthPhase::Regrowing, "nothing between");
        now != before
    });
    assert!(frames > 3, "they grew over some frames");
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), fresh(quick().with_seed(quick().seed + 1)), "as if spawned so");
    assert_published(app.world(), organ);
}

#[test]
fn a_slider_that_moves_all_the_time_shows_growth_after_growth_and_ends_at_its_last_value() {
    let mut app = headless(GrowthBudget::Steps(10));
    let organ = grown(&mut app, quick());
    let mut shown = vec![trees(app.world(), organ)];
    for frame in 0..60 {
        tweak(&mut app, organ, |wish| weigh(wish, 0.2 + 0.01 * frame as f32));
        app.update();
        let now = trees(app.world(), organ);
        assert!(now.iter().all(|tree| tree.len() > 10), "frame {frame}: something is drawn");
        if shown.last() != Some(&now) {
            shown.push(now);
        }
    }
    assert!(shown.len() > 3, "{} growths in 60 frames", shown.len());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let mut wish = quick();
    weigh(&mut wish, 0.2 + 0.01 * 59.0);
    assert_eq!(trees(app.world(), organ), fresh(wish));
}

#[test]
fn a_setting_that_is_put_back_gives_the_same_vessels() {
    let mut app = headless(GrowthBudget::Steps(10));
    let organ = grown(&mut app, quick());
    let before = trees(app.world(), organ);
    tweak(&mut app, organ, |wish| weigh(wish, 0.9));
    app.update();
    app.update();
    tweak(&mut app, organ, |wish| *wish = quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), before);
}

#[test]
fn a_stroke_taken_back_does_not_take_back_settings() {
    let mut app = headless(GrowthBudget::Steps(10));
    let organ = grown(&mut app, quick());
    let guess = TissuePaint { density: Some(vec![0.5; sphere().count_vertices()]), ..TissuePaint::default() };
    tweak(&mut app, organ, |wish| weigh(wish, 0.9));
    app.world_mut().entity_mut(organ).insert(OrganPaint(guess));
    app.update();
    app.world_mut().entity_mut(organ).remove::<OrganPaint>();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let mut wish = quick();
    weigh(&mut wish, 0.9);
    assert_eq!(trees(app.world(), organ), fresh(wish));
}

#[test]
fn a_restart_and_another_tissue_begin_in_view() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = grown(&mut app, quick());
    app.world_mut().write_message(GrowthCommand::new(organ, GrowthAction::Restart));
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Growing);
    assert!(progress(app.world(), organ).step <= 1);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    tweak(&mut app, organ, |wish| wish.tissue = TissueMode::Volume.into());
    app.update();
    run_until(&mut app, "the inside", |world| progress(world, organ).phase == GrowthPhase::Growing);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn what_is_asked_for_at_once_has_the_last_settings() {
    let mut app = headless(GrowthBudget::Steps(1));
    let organ = grown(&mut app, quick());
    for seed in [5, 6] {
        tweak(&mut app, organ, |wish| wish.seed = seed);
        app.update();
        app.update();
    }
    app.world_mut().commands().entity(organ).grow_now();
    app.update();
    assert_eq!(trees(app.world(), organ), fresh(quick().with_seed(6)));
    for seed in [7, 8] {
        tweak(&mut app, organ, |wish| wish.seed = seed);
        app.update();
        app.update();
    }
    app.world_mut().write_message(GrowthCommand::new(organ, GrowthAction::Finish));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), fresh(quick().with_seed(8)));
}

#[test]
fn a_paused_organ_keeps_its_vessels() {
    let mut app = headless(GrowthBudget::Steps(10));
    let organ = grown(&mut app, quick());
    let before = trees(app.world(), organ);
    app.world_mut().entity_mut(organ).insert(GrowthControl::Paused);
    tweak(&mut app, organ, |wish| wish.seed = 9);
    for _ in 0..20 {
        app.update();
        assert_eq!(trees(app.world(), organ), before);
    }
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Regrowing);
    app.world_mut().entity_mut(organ).insert(GrowthControl::Running);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), fresh(quick().with_seed(9)));
}
