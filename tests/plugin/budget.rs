//! The budget decides only how many steps a frame does.

use super::*;
use bevy_vessels::plugin::{EntityCommandsExt, GrowthFrame, GrowthStarted};

fn grown_with(budget: GrowthBudget) -> [VesselTree; 2] {
    let mut app = headless(budget);
    let organ = spawn(&mut app, quick().with_seed(3));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
    trees(app.world(), organ)
}

#[test]
fn any_budget_gives_the_vessels_of_grow_now() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick().with_seed(3));
    app.world_mut().commands().entity(organ).grow_now();
    app.world_mut().flush();
    let expected = trees(app.world(), organ);
    for budget in [
        GrowthBudget::Steps(1),
        GrowthBudget::Steps(7),
        GrowthBudget::Time(Duration::ZERO),
        GrowthBudget::Time(Duration::from_micros(300)),
        GrowthBudget::Time(Duration::from_secs(9)),
    ] {
        assert_eq!(grown_with(budget), expected, "{budget:?}");
    }
}

#[test]
fn organs_share_the_budget_and_none_starves() {
    let mut app = headless(GrowthBudget::Steps(3));
    let mut short = quick();
    settings_of(&mut short).steps = 5;
    let organs = [spawn(&mut app, quick()), spawn(&mut app, short), spawn(&mut app, quick().with_seed(2))];
    for organ in organs {
        send(&mut app, organ, GrowthAction::Pause);
    }
    run_until(&mut app, "all tissues", |world| {
        organs.iter().all(|&organ| progress(world, organ).phase == GrowthPhase::Growing)
    });
    app.insert_resource(GrowthBudget::Steps(2));
    for organ in organs {
        send(&mut app, organ, GrowthAction::Resume);
    }
    for frame in 1..=15 {
        app.update();
        assert_eq!(app.world().resource::<GrowthFrame>().steps, 2);
        let [first, short, second] = organs.map(|organ| progress(app.world(), organ).step);
        assert_eq!(first + short + second, 2 * frame);
        assert!(first.abs_diff(second) <= 1, "frame {frame}: {first} {short} {second}");
        assert!(short == 5 || first.abs_diff(short) <= 1, "frame {frame}: {first} {short} {second}");
    }
}

#[test]
fn a_time_budget_below_a_step_still_does_one_step_a_frame() {
    let mut app = headless(GrowthBudget::Time(Duration::ZERO));
    let organs = [spawn(&mut app, quick()), spawn(&mut app, quick())];
    run_until(&mut app, "both growing", |world| organs.iter().all(|&organ| progress(world, organ).step > 0));
    let before: u32 = organs.iter().map(|&organ| progress(app.world(), organ).step).sum();
    (0..6).for_each(|_| app.update());
    let after: u32 = organs.iter().map(|&organ| progress(app.world(), organ).step).sum();
    assert_eq!(after - before, 6);
}

#[test]
fn many_growths_start_one_by_one_where_there_is_no_time_and_all_start() {
    let mut app = headless(GrowthBudget::Time(Duration::ZERO));
    let organs: Vec<Entity> = (0..6).map(|seed| spawn(&mut app, quick().with_seed(seed))).collect();
    let mut started = 0;
    run_until(&mut app, "all started", |world| {
        let started_phases = [GrowthPhase::Growing, GrowthPhase::Finished];
        let now = organs.iter().filter(|&&organ| started_phases.contains(&progress(world, organ).phase)).count();
        assert!(now <= started + 1, "{now} growths after {started}");
        started = now;
        now == organs.len()
    });
    // all need a restart at once: each frame starts the next one
    for &organ in &organs {
        app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes").seed += 100;
    }
    let mut cursor = app.world().resource::<Messages<GrowthStarted>>().get_cursor_current();
    let mut restarted = Vec::new();
    for _ in 0..organs.len() {
        // an organ that changes every frame doesn't take the others' turns
        app.world_mut().get_mut::<Vasculature>(organs[0]).expect("an organ has wishes").seed += 1;
        app.update();
        let frame: Vec<_> = drain(app.world(), &mut cursor).iter().map(|start| start.organ).collect();
        assert_eq!(frame.len(), 1);
        restarted.extend(frame);
    }
    restarted.sort_unstable();
    restarted.dedup();
    assert_eq!(restarted.len(), organs.len(), "each of them once");
}

#[test]
fn the_account_of_a_frame_holds_what_was_done() {
    let mut app = headless(GrowthBudget::Steps(3));
    let organ = spawn(&mut app, quick());
    run_until(&mut app, "a step", |world| progress(world, organ).step > 0);
    app.update();
    let frame = *app.world().resource::<GrowthFrame>();
    assert_eq!(frame.steps, 3);
    assert!(frame.step_time > Duration::ZERO && frame.publish_time > Duration::ZERO, "{frame:?}");
    assert_eq!(frame.time(), frame.start_time + frame.step_time + frame.publish_time);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.update();
    let rest = *app.world().resource::<GrowthFrame>();
    assert_eq!((rest.steps, rest.start_time, rest.publish_time), (0, Duration::ZERO, Duration::ZERO));
}
