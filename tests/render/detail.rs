//! Levels of detail: the picture doesn't change when a chunk changes its mesh, and vessels keep their covered area.

use crate::{stage::*, tree};
use bevy::prelude::*;
use bevy_vessels::{
    render::SegmentChunk,
    synthesis::tree::{NO_PARENT, VesselKind, VesselTree},
};

/// Vertical segments of one radius from left to right, each with a root of its own, `length` long.
fn fence(count: usize, radius: f32, length: f32) -> VesselTree {
    let mut nodes = Vec::new();
    for post in 0..count {
        let x = -50.0 + 100.0 * (post as f32 + 0.5) / count as f32;
        nodes.push(([x, -0.5 * length, 0.0], NO_PARENT, radius));
        nodes.push(([x, 0.5 * length, 0.0], 2 * post as u32, radius));
    }
    tree(&nodes)
}

/// The last level of detail of an organ's only chunk.
fn level(stage: &Stage, organ: Entity) -> usize {
    let chunks = stage.chunks(organ);
    assert_eq!(chunks.len(), 1);
    stage.app.world().get::<SegmentChunk>(chunks[0]).expect("a chunk").level()
}

fn scaled(stage: &mut Stage, organ: Entity, scale: f32) -> Picture {
    stage.set_transform(organ, Transform::from_scale(Vec3::splat(scale)).with_rotation(Quat::from_rotation_z(0.3)));
    stage.picture()
}

/// Draws vessels at sizes from near to far, with both levels of detail where a chunk may have either, and returns both
/// pictures for each change of level.
fn changes_of_level(stage: &mut Stage) -> Vec<[Picture; 2]> {
    // a unit is a pixel; chunks get coarser a little below a limit and finer at it, so both levels occur in between
    let organ = stage.spawn(VesselKind::Artery, &fence(40, 0.1, 4.0));
    let mut changes = Vec::new();
    let mut scale = 80.0;
    while scale > 0.3 {
        scale *= 0.95;
        let before = scaled(stage, organ, scale);
        let fine = level(stage, organ);
        scaled(stage, organ, 0.8 * scale);
        let after = scaled(stage, organ, scale);
        if level(stage, organ) > fine {
            changes.push([before, after]);
        }
    }
    stage.app.world_mut().despawn(organ);
    assert!(changes.len() >= 4, "only {} changes of level", changes.len());
    changes
}

#[test]
fn a_change_of_level_is_not_to_be_seen() {
    on_stage("levels", |stage| {
        stage.set_shadows(false);
        let differing: Vec<_> = changes_of_level(stage).iter().map(|[before, after]| before.differing(after)).collect();
        assert!(differing.iter().all(|&pixels| pixels == 0), "{differing:?} pixels differ");
    });
}

#[test]
fn a_change_of_level_is_hardly_seen_in_shadows() {
    on_stage("levels in shadow", |stage| {
        // a shadow map may be finer than the picture: shapes that are equal here differ there by parts of a pixel
        for [before, after] in changes_of_level(stage) {
            let outlines = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
            let moved = outlines.filter(|&(x, y)| before.is_vessel(x, y) != after.is_vessel(x, y)).count();
            assert_eq!(moved, 0, "pixels of the outline");
            let change = after.mean_brightness() / before.mean_brightness();
            assert!((change - 1.0).abs() < 0.005, "brighter by {change}");
        }
    });
}

#[test]
fn near_vessels_have_all_their_corners_and_far_ones_few() {
    on_stage("near and far", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &fence(3, 6.0, 60.0));
        scaled(stage, organ, 1.0);
        assert_eq!(level(stage, organ), 0);
        scaled(stage, organ, 0.08);
        let far = level(stage, organ);
        assert!(far >= 2, "level {far}");
        scaled(stage, organ, 1.0);
        assert_eq!(level(stage, organ), 0, "and back");
    });
}

#[test]
fn vessels_thinner_than_a_pixel_cover_what_they_should() {
    on_stage("coverage", |stage| {
        // a thousand segments, whose total width is the expected covered share of the picture
        for radius in [0.02, 0.01, 0.005, 0.002] {
            let organ = stage.spawn(VesselKind::Artery, &fence(1000, radius, 60.0));
            let covered = scaled(stage, organ, 1.0).vessel_pixels() as f32;
            let expected = 1000.0 * 2.0 * radius * 60.0;
            assert!((covered / expected - 1.0).abs() < 0.15, "radius {radius}: {covered} pixels, not {expected}");
            stage.app.world_mut().despawn(organ);
        }
    });
}
