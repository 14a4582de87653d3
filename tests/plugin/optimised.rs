//! Vessels of least volume in a world: they grow within the budget, and bleed and are cut as others are.

use super::operating_field::*;
use super::*;
use bevy_vessels::{
    plugin::{BloodLoss, Cuttable, OrganSupply},
    synthesis::{cco::CcoSettings, units::Volume},
};

const TERMINALS: u32 = 80;

/// Arteries and veins of an optimised ball.
fn optimised() -> Vasculature {
    let roots = RootPlacements {
        artery: RootPlacement::Nearest(vec![Vec3::Y]),
        vein: RootPlacement::Nearest(vec![Vec3::new(0.2, 1.0, 0.0)]),
        ..default()
    };
    let settings = CcoSettings { terminals: TERMINALS, ..default() };
    Vasculature::new(PresetName::CcoBall).with_roots(roots).with_generator(settings)
}

#[test]
fn any_budget_gives_the_same_optimised_vessels() {
    let grown = |budget: GrowthBudget| {
        let mut app = headless(budget);
        let organ = spawn(&mut app, optimised());
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        trees(app.world(), organ)
    };
    let expected = grown(GrowthBudget::default());
    for tree in &expected {
        assert_eq!(tree.tips().len(), TERMINALS as usize);
    }
    for budget in [GrowthBudget::Steps(1), GrowthBudget::Steps(7), GrowthBudget::Time(Duration::ZERO)] {
        assert_eq!(grown(budget), expected, "{budget:?}");
    }
}

#[test]
fn blood_flows_through_optimised_vessels_until_they_are_cut() {
    let mut app = timed_app(Duration::from_millis(16));
    let organ = spawn(&mut app, optimised());
    app.world_mut().entity_mut(organ).insert((Cuttable::default(), blood()));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let ischaemic = |app: &App| app.world().get::<OrganSupply>(organ).map_or(1.0, |supply| supply.ischaemic_share);
    run_until(&mut app, "a supply", |world| {
        world.get::<OrganSupply>(organ).is_some_and(|supply| supply.ischaemic_share < 0.01)
    });
    cut(&mut app, square(Vec3::ZERO, Vec3::Y, 3.0));
    assert!(KINDS.iter().all(|&kind| !severed(app.world(), organ, kind).is_empty()));
    for _ in 0..10 {
        app.update();
    }
    // What lies below the cut gets no blood.
    assert!((0.2..0.9).contains(&ischaemic(&app)), "{}", ischaemic(&app));
    let loss = app.world().get::<BloodLoss>(organ).expect("a loss");
    assert!(loss.total > Volume::ZERO, "{loss:?}");
}
