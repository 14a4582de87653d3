//! The budget decides how many steps a frame does, and nothing else.

use crate::*;
use bevy_vessels::plugin::{EntityCommandsExt, GrowthFrame};

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
    short.settings.steps = 5;
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
