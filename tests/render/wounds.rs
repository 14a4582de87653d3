//! Gaps of severed vessels are visible, and disappear with undo.

use crate::{
    bar_of, comb,
    stage::{Picture, SIZE, Stage, on_stage},
};
use bevy::prelude::*;
use bevy_vessels::{
    plugin::{Cuttable, CuttableVessels},
    synthesis::{tree::VesselKind, wound::Blade},
};

/// Makes an organ cuttable, and draws it.
fn whole(stage: &mut Stage, organ: Entity) -> Picture {
    stage.app.world_mut().entity_mut(organ).insert(Cuttable::default());
    stage.picture()
}

fn operate(stage: &mut Stage, act: impl FnOnce(&mut CuttableVessels)) -> Picture {
    act(&mut stage.app.world_mut().resource_mut::<CuttableVessels>());
    stage.picture()
}

/// A scalpel that passes through the whole scene in a plane through a point.
fn slash(through: Vec3, along: Vec3) -> Blade {
    let [reach, depth] = [along * 200.0, Vec3::Z * 50.0];
    let edge = |at: Vec3| [at - depth, at + depth];
    Blade::sweep(edge(through - reach), edge(through + reach)).expect("a blade")
}

#[test]
fn a_severed_vessel_shows_its_gap_until_the_cut_is_undone() {
    on_stage("gap", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar_of(3.0, 50.0));
        let before = whole(stage, organ);
        assert!(before.is_vessel(64, 64));
        let cut = operate(stage, |vessels| vessels.cut(slash(Vec3::ZERO, Vec3::Y)));
        let gap = (0..SIZE).filter(|&x| x > 20 && x < 108 && cut.is_background(x, 64)).count();
        // Either end retracts by one and a half radii.
        assert!((7..=11).contains(&gap), "a gap of {gap} pixels");
        assert!(cut.is_background(64, 64) && cut.is_vessel(54, 64) && cut.is_vessel(74, 64));
        let undone = operate(stage, CuttableVessels::undo);
        assert_eq!(undone.differing(&before), 0, "undo leaves no trace");
    });
}

#[test]
fn many_pieces_have_room_and_boxes_of_their_own() {
    on_stage("pieces", |stage| {
        let organ = stage.spawn(VesselKind::Vein, &comb(16));
        let before = whole(stage, organ);
        let rows = [-18.0, 0.0, 18.0];
        let cut = operate(stage, |vessels| {
            rows.into_iter().for_each(|y| vessels.cut(slash(Vec3::Y * y, Vec3::X)));
        });
        for tooth in 0..16 {
            let x = (64.0 - 56.0 + 112.0 * tooth as f32 / 15.0) as usize;
            for y in rows {
                let row = (64.0 - y) as usize;
                assert!(cut.is_background(x, row), "tooth {tooth} has no gap at {y}");
            }
            for y in [-9.0, 9.0, -26.0, 26.0] {
                assert!(cut.is_vessel(x, (64.0 - y) as usize), "tooth {tooth} lacks its piece at {y}");
            }
        }
        let undone = operate(stage, CuttableVessels::undo_all);
        assert_eq!(undone.differing(&before), 0, "undo leaves no trace");
    });
}
