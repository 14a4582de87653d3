//! Draws small pictures of known vessels and checks their pixels.
//!
//! Without a graphics adapter every test is skipped with a message; with `BEVY_VESSELS_REQUIRE_GPU=1` it fails instead.
//! A software driver will do. With `BEVY_VESSELS_PICTURES=FOLDER` the pictures are kept.

#![cfg(feature = "render")]

#[path = "../../examples/common/headless.rs"]
mod headless;

mod detail;
mod flight;
mod stage;
mod surfaces;
mod taken_over;
mod wounds;

use bevy::{
    core_pipeline::prepass::{DeferredPrepass, DepthPrepass, MotionVectorPrepass, NormalPrepass},
    log::LogPlugin,
    pbr::DefaultOpaqueRendererMethod,
    prelude::*,
};
use bevy_vessels::{
    VesselPlugin,
    plugin::{ChangeLog, SegmentColoring, VesselAppearance, Vessels, VesselsOf},
    render::{SegmentBuffer, SegmentLimits, SegmentMaterial},
    synthesis::tree::{NO_PARENT, VesselKind, VesselTree},
};
use headless::headless_plugins;
use stage::{Picture, SIZE, on_stage};

/// Segments per chunk at the default roundness.
const CHUNK: usize = 4096;

/// A tree of the given nodes: position, parent, radius.
fn tree(nodes: &[([f32; 3], u32, f32)]) -> VesselTree {
    let positions = nodes.iter().map(|node| Vec3::from(node.0)).collect();
    let parents = nodes.iter().map(|node| node.1).collect();
    let radii = nodes.iter().map(|node| node.2).collect();
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

/// One horizontal segment through the middle of the picture, 40 pixels long with a radius of 8.
fn bar() -> VesselTree {
    bar_of(8.0, 20.0)
}

/// A horizontal segment with a radius through the middle of the picture, extending `half` to either side.
fn bar_of(radius: f32, half: f32) -> VesselTree {
    tree(&[([-half, 0.0, 0.0], NO_PARENT, radius), ([half, 0.0, 0.0], 0, radius)])
}

/// A comb of `count` short vertical vessels, each a tree of its own, from left to right.
fn comb(count: usize) -> VesselTree {
    let mut nodes = Vec::new();
    for tooth in 0..count {
        let x = -56.0 + 112.0 * tooth as f32 / (count - 1).max(1) as f32;
        nodes.push(([x, -30.0, 0.0], NO_PARENT, 2.0));
        nodes.push(([x, 30.0, 0.0], 2 * tooth as u32, 2.0));
    }
    tree(&nodes)
}

/// The same tree, moved.
fn moved(tree: &VesselTree, by: Vec3) -> VesselTree {
    let positions = tree.positions().iter().map(|&at| at + by).collect();
    VesselTree::from_arrays(positions, tree.parents().to_vec(), tree.radii().to_vec()).expect("a well-formed tree")
}

#[test]
fn a_segment_is_where_it_belongs_and_as_thick_as_it_says() {
    on_stage("segment", |stage| {
        stage.spawn(VesselKind::Artery, &bar());
        let picture = stage.picture();
        assert!(picture.is_red(64, 64), "{:?}", picture.at(64, 64));
        for (x, y) in [(64, 64 - 12), (64, 64 + 12), (64 - 34, 64), (64 + 34, 64), (2, 2)] {
            assert!(picture.is_background(x, y), "vessel at {x}, {y}");
        }
        assert_near(picture.height_at(64), 16, 2);
        // the end at the root has a shallow cap, the far end a round one
        let row = picture.width_at(64);
        assert!((44..=58).contains(&row), "{row} pixels long with both ends");
        assert!(picture.is_vessel(64 + 26, 64), "the far end is round and reaches a radius beyond the node");
        assert!(picture.is_background(64 + 26, 64 - 7), "round, not square");
    });
}

#[test]
fn radii_of_both_ends_are_respected() {
    on_stage("cone", |stage| {
        let cone = tree(&[([-40.0, 0.0, 0.0], NO_PARENT, 13.0), ([40.0, 0.0, 0.0], 0, 10.0)]);
        stage.spawn(VesselKind::Artery, &cone);
        let picture = stage.picture();
        assert_near(picture.height_at(64 - 38), 26, 2);
        assert_near(picture.height_at(64), 23, 2);
        assert_near(picture.height_at(64 + 38), 20, 2);
    });
}

#[test]
fn surfaces_face_outwards_and_are_lit_from_the_light() {
    on_stage("light", |stage| {
        stage.spawn(VesselKind::Artery, &bar());
        let picture = stage.picture();
        // the light comes from above and the camera's side
        let [top, middle, bottom] = [58, 64, 70].map(|y| picture.brightness(64, y));
        assert!(top > bottom * 1.3 && middle > bottom, "{top} {middle} {bottom}");
        assert!(bottom > 0.0, "ambient light reaches the far side");
    });
}

#[test]
fn mirrored_and_stretched_organs_are_drawn_right() {
    on_stage("mirror", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar());
        stage.set_transform(organ, Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
        let mirrored = stage.picture();
        assert_near(mirrored.height_at(64), 16, 2);
        let [top, bottom] = [58, 70].map(|y| mirrored.brightness(64, y));
        assert!(top > bottom * 1.3, "inside out: {top} {bottom}");
        stage.set_transform(organ, Transform::from_scale(Vec3::new(1.0, 2.0, 1.0)).with_translation(Vec3::X * 10.0));
        let stretched = stage.picture();
        assert_near(stretched.height_at(74), 32, 3);
        assert!(stretched.is_background(64 - 26, 64), "the whole hierarchy moved");
    });
}

#[test]
fn slots_without_a_segment_are_invisible() {
    on_stage("empty", |stage| {
        // a root and a child on the same spot; a chunk has 254 more slots, all empty, at the origin
        let nothing = tree(&[([0.0, 0.0, 0.0], NO_PARENT, 9.0), ([30.0, 0.0, 0.0], NO_PARENT, 9.0)]);
        let organ = stage.spawn(VesselKind::Artery, &nothing);
        let picture = stage.picture();
        assert_eq!(picture.vessel_pixels(), 0);
        assert_eq!(stage.chunks(organ).len(), 1);
    });
}

#[test]
fn growth_appears_through_range_writes_and_larger_buffers() {
    on_stage("growth", |stage| {
        let full = comb(CHUNK);
        let organ = stage.spawn(VesselKind::Artery, &comb(2));
        let before = stage.picture();
        // half of the comb is one chunk, the whole comb two: the second picture needs a larger buffer and a new chunk
        stage.change(organ, &full, 4..full.len());
        let after = stage.picture();
        assert_eq!(stage.chunks(organ).len(), 2);
        let [few, many] = [&before, &after].map(Picture::vessel_pixels);
        assert!(few > 0 && many > 10 * few, "{few} {many}");
        for x in [64 - 50, 64 - 1, 64 + 1, 64 + 50] {
            assert!(after.is_vessel(x, 64), "a tooth at {x}: the first chunk kept its segments");
        }
    });
}

#[test]
fn only_marked_ranges_are_written_again() {
    on_stage("ranges", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &comb(CHUNK));
        let before = stage.picture();
        // everything moved out of view, but only the second half was marked as changed
        stage.change(organ, &moved(&comb(CHUNK), 500.0 * Vec3::X), CHUNK..2 * CHUNK);
        let after = stage.picture();
        assert!(before.is_vessel(64 - 40, 64) && before.is_vessel(64 + 40, 64));
        assert!(after.is_vessel(64 - 40, 64), "the first half is as it was");
        assert!(after.is_background(64 + 40, 64), "the second one is gone");
    });
}

#[test]
fn scattered_changes_reach_their_slots_and_no_others() {
    on_stage("scattered", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &comb(28));
        let before = stage.picture();
        // all teeth moved out of view, and every third was marked as changed
        let changed = (0..28).filter(|tooth| tooth % 3 == 1).flat_map(|t| [2 * t, 2 * t + 1]);
        stage.change(organ, &moved(&comb(28), 500.0 * Vec3::X), changed);
        let after = stage.picture();
        for tooth in 0..28 {
            let x = (64.0 - 56.0 + 112.0 * tooth as f32 / 27.0) as usize;
            assert!(before.is_vessel(x, 64), "tooth {tooth}");
            assert_eq!(after.is_background(x, 64), tooth % 3 == 1, "tooth {tooth}");
        }
    });
}

#[test]
fn a_restart_clears_what_was_there() {
    on_stage("restart", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &comb(CHUNK));
        stage.picture();
        stage.replace(organ, &bar());
        let picture = stage.picture();
        assert!(picture.is_vessel(64, 64));
        assert!(picture.is_background(64, 64 - 20) && picture.is_background(64 + 40, 64), "stale segments");
        assert_eq!(stage.chunks(organ).len(), 1);
        stage.replace(organ, &VesselTree::new());
        assert_eq!(stage.picture().vessel_pixels(), 0);
        assert!(stage.chunks(organ).is_empty());
    });
}

#[test]
fn despawning_the_organ_removes_chunks_and_buffers() {
    on_stage("despawn", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar());
        stage.picture();
        let before = stage.assets();
        assert_eq!(before, [1, 1], "a buffer and a material");
        stage.app.world_mut().despawn(organ);
        assert_eq!(stage.picture().vessel_pixels(), 0);
        assert_eq!(stage.assets(), [0, 0]);
        assert_eq!(stage.chunk_count(), 0);
    });
}

#[test]
fn losing_the_vessels_alone_removes_the_drawing() {
    on_stage("detach", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar());
        stage.picture();
        let vessels = stage.vessels(organ);
        stage.app.world_mut().entity_mut(vessels).remove::<Vessels>();
        assert_eq!(stage.picture().vessel_pixels(), 0);
        assert_eq!((stage.assets(), stage.chunk_count()), ([0, 0], 0));
    });
}

#[test]
fn kinds_have_their_colours_and_can_be_hidden() {
    on_stage("kinds", |stage| {
        let organ = stage.spawn(VesselKind::Vein, &bar());
        let vein = stage.picture();
        assert!(vein.is_blue(64, 64), "{:?}", vein.at(64, 64));
        stage.appearance(organ, |look| look.colors.vein = Color::srgb(0.1, 0.6, 0.1));
        let [r, g, b] = stage.picture().at(64, 64);
        assert!(g > r && g > b, "the new colour is there at the next frame");
        stage.appearance(organ, |look| look.shown.vein = false);
        assert_eq!(stage.picture().vessel_pixels(), 0);
        stage.appearance(organ, |look| look.shown.vein = true);
        assert!(stage.picture().is_vessel(64, 64));
    });
}

#[test]
fn colours_tell_radius_age_and_order() {
    on_stage("colours", |stage| {
        // a trunk that splits in two, and a thin old branch below
        let nodes = [
            ([-50.0, 20.0, 0.0], NO_PARENT, 12.0),
            ([0.0, 20.0, 0.0], 0, 12.0),
            ([50.0, 30.0, 0.0], 1, 6.0),
            ([50.0, 10.0, 0.0], 1, 6.0),
            ([-50.0, -30.0, 0.0], NO_PARENT, 3.0),
            ([50.0, -30.0, 0.0], 4, 3.0),
        ];
        let organ = stage.spawn_born(VesselKind::Artery, &tree(&nodes), &[0, 40, 80, 80, 0, 1]);
        let (trunk, thin) = ((40, 64 - 20), (64, 64 + 30));
        let mut seen = Vec::new();
        for coloring in [SegmentColoring::Radius, SegmentColoring::Age, SegmentColoring::StrahlerOrder] {
            stage.appearance(organ, |look| look.coloring = coloring);
            let picture = stage.picture();
            let [trunk, thin] = [trunk, thin].map(|(x, y)| picture.at(x, y));
            assert!(distance(trunk, thin) > 40, "{coloring:?}: {trunk:?} and {thin:?} look alike");
            assert!(!seen.contains(&trunk), "{coloring:?} looks like another");
            seen.push(trunk);
        }
        stage.appearance(organ, |look| look.coloring = SegmentColoring::Kind);
        let picture = stage.picture();
        assert!(picture.is_red(trunk.0, trunk.1) && picture.is_red(thin.0, thin.1));
    });
}

#[test]
fn vessels_cast_shadows_and_receive_them() {
    on_stage("shadow", |stage| {
        stage.spawn_wall();
        let lit = stage.picture();
        stage.spawn(VesselKind::Artery, &bar());
        let shaded = stage.picture();
        // the light comes from above: the shadow on the wall behind lies below the vessel
        let darkest = (64 + 10..64 + 40).map(|y| shaded.brightness(64, y) / lit.brightness(64, y)).fold(1.0, f32::min);
        assert!(darkest < 0.7, "the wall has {darkest} of its light below the vessel");
        let above = shaded.brightness(64, 64 - 40) / lit.brightness(64, 64 - 40);
        assert!(above > 0.95, "and {above} above it");
    });
}

#[test]
fn prepasses_see_the_same_surface() {
    on_stage("prepass", |stage| {
        stage.spawn(VesselKind::Artery, &bar());
        let forward = stage.picture();
        stage.with_on_camera((DepthPrepass, NormalPrepass, MotionVectorPrepass), |stage| {
            assert_looks_like(&stage.picture(), &forward);
        });
    });
}

#[test]
fn deferred_rendering_draws_the_same() {
    on_stage("deferred", |stage| {
        stage.spawn(VesselKind::Artery, &bar());
        let forward = stage.picture();
        stage.with_on_camera((DepthPrepass, DeferredPrepass), |stage| {
            stage.app.insert_resource(DefaultOpaqueRendererMethod::deferred());
            let deferred = stage.picture();
            stage.app.insert_resource(DefaultOpaqueRendererMethod::forward());
            assert_looks_like(&deferred, &forward);
        });
    });
}

#[test]
fn boxes_follow_growth_so_that_nothing_in_view_is_culled() {
    on_stage("culling", |stage| {
        // the chunk begins far out of view; the last segments, which grow into view, must be drawn
        let far = [([900.0, 0.0, 0.0], NO_PARENT, 1.0), ([910.0, 0.0, 0.0], 0, 1.0)];
        let organ = stage.spawn(VesselKind::Artery, &tree(&far));
        assert_eq!(stage.picture().vessel_pixels(), 0);
        assert_eq!(stage.visible_chunks(), 0, "what is out of view is culled");
        let mut grown = far.to_vec();
        grown.extend([([-10.0, 0.0, 0.0], NO_PARENT, 8.0), ([10.0, 0.0, 0.0], 2, 8.0)]);
        stage.change(organ, &tree(&grown), 2..4);
        assert!(stage.picture().is_vessel(64, 64));
        // a segment whose axis is out of view, but whose side is in view
        let beside = [([-30.0, 74.0, 0.0], NO_PARENT, 20.0), ([30.0, 74.0, 0.0], 0, 20.0)];
        stage.replace(organ, &tree(&beside));
        assert!(stage.picture().is_vessel(64, 3), "a vessel's side at the edge of the picture");
    });
}

#[test]
fn nothing_is_done_when_nothing_changed() {
    on_stage("idle", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar());
        stage.picture();
        let vessels = stage.vessels(organ);
        let world = stage.app.world();
        let changed = world.entity(vessels).get_ref::<SegmentBuffer>().expect("drawn").last_changed();
        let seen = world.entity(vessels).get::<ChangeLog>().expect("required").now();
        stage.app.update();
        let world = stage.app.world();
        assert!(seen.is_current(world.entity(vessels).get::<ChangeLog>().expect("required")), "nothing is marked");
        let buffer = world.entity(vessels).get_ref::<SegmentBuffer>().expect("drawn");
        assert_eq!(buffer.last_changed().get(), changed.get(), "an idle frame touches the buffer");
    });
}

#[test]
fn users_can_change_the_material() {
    on_stage("material", |stage| {
        let organ = stage.spawn(VesselKind::Artery, &bar());
        let plain = stage.picture();
        let vessels = stage.vessels(organ);
        let material = stage.app.world().get::<SegmentBuffer>(vessels).expect("drawn").material().clone();
        let mut materials = stage.app.world_mut().resource_mut::<Assets<SegmentMaterial>>();
        materials.get_mut(&material).expect("alive").base.base_color = Color::srgb(0.2, 0.2, 0.2);
        let dimmed = stage.picture();
        assert!(dimmed.brightness(64, 64) < 0.5 * plain.brightness(64, 64));
        assert!(dimmed.is_red(64, 64), "the base colour multiplies that of the segment");
    });
}

#[test]
fn without_a_renderer_vessels_are_kept_and_nothing_is_drawn() {
    let mut app = App::new();
    app.add_plugins((headless_plugins(false).disable::<LogPlugin>(), VesselPlugin::default()));
    app.finish();
    app.cleanup();
    let organ = app.world_mut().spawn((Transform::default(), Visibility::default(), VesselAppearance::default())).id();
    let vessels = Vessels::from_tree(VesselKind::Artery, &bar(), &[]);
    let vessels = app.world_mut().spawn((ChildOf(organ), VesselsOf(organ), vessels)).id();
    app.update();
    app.update();
    assert!(app.world().get::<SegmentBuffer>(vessels).is_none());
    assert!(!app.world().contains_resource::<SegmentLimits>());
}

/// The same outline, and about the same colours: lighting differs a little between render methods.
#[track_caller]
fn assert_looks_like(picture: &Picture, expected: &Picture) {
    for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
        assert_eq!(picture.is_vessel(x, y), expected.is_vessel(x, y), "outline at {x}, {y}");
        let [now, then] = [picture, expected].map(|picture| picture.at(x, y));
        assert!(distance(now, then) < 120, "{now:?}, not {then:?} at {x}, {y}");
    }
}

fn distance(a: [u8; 3], b: [u8; 3]) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).sum()
}

#[track_caller]
fn assert_near(value: usize, expected: usize, tolerance: usize) {
    assert!(value.abs_diff(expected) <= tolerance, "{value}, not {expected} ± {tolerance} pixels");
}
