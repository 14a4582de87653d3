//! Closed meshes are drawn in place of segments, look like them from afar, and need no storage buffers.

use crate::{
    stage::{Picture, SIZE, Stage, on_stage},
    tree,
};
use bevy::{camera::visibility::VisibilityRange, prelude::*};
use bevy_vessels::{
    plugin::{Cuttable, CuttableVessels, SurfaceShown, VesselMesh, VesselSurface},
    render::{SegmentLimits, SegmentMaterial},
    synthesis::{
        tree::{NO_PARENT, VesselKind, VesselTree},
        wound::Blade,
    },
};

/// A crooked vessel with branches, some 100 pixels wide.
fn shrub() -> VesselTree {
    tree(&[
        ([-50.0, -10.0, 0.0], NO_PARENT, 6.0),
        ([-25.0, 0.0, 0.0], 0, 6.0),
        ([0.0, 5.0, 4.0], 1, 5.0),
        ([25.0, 0.0, 6.0], 2, 4.5),
        ([50.0, 5.0, 0.0], 3, 4.0),
        ([10.0, 30.0, 0.0], 2, 3.0),
        ([15.0, 50.0, 0.0], 5, 2.5),
        ([-10.0, -30.0, 5.0], 1, 3.0),
        ([35.0, -30.0, 0.0], 3, 2.5),
    ])
}

fn frames(stage: &mut Stage, count: usize) {
    (0..count).for_each(|_| stage.app.update());
}

/// Waits until the organ's mesh is shown, and its segments no longer are.
fn wait_for_mesh(stage: &mut Stage, organ: Entity) {
    for _ in 0..500 {
        stage.app.update();
        let mesh = stage.app.world().get::<VesselMesh>(stage.vessels(organ));
        if mesh.is_some_and(VesselMesh::is_shown) {
            frames(stage, 15);
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("the mesh is never shown");
}

fn ask(stage: &mut Stage, organ: Entity, surface: VesselSurface) {
    stage.app.world_mut().entity_mut(organ).insert(surface);
}

/// Pixels that belong to a vessel in one picture alone.
fn outline_change(a: &Picture, b: &Picture) -> usize {
    let pixels = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
    pixels.filter(|&(x, y)| a.is_vessel(x, y) != b.is_vessel(x, y)).count()
}

#[test]
fn a_mesh_takes_the_place_of_segments_without_a_jump() {
    on_stage("surface", |stage| {
        stage.set_shadows(false);
        let organ = stage.spawn(VesselKind::Artery, &shrub());
        let segments = stage.picture();
        ask(stage, organ, VesselSurface::default());
        wait_for_mesh(stage, organ);
        let mesh = stage.picture();
        assert_eq!(stage.visible_chunks(), 0, "segments are hidden");
        let (change, of) = (outline_change(&segments, &mesh), segments.vessel_pixels());
        assert!(change * 10 < of, "{change} of {of} pixels change");
        let brighter = mesh.mean_brightness() / segments.mean_brightness();
        assert!((brighter - 1.0).abs() < 0.02, "brighter by {brighter}");
        assert!(mesh.is_red(64, 60), "{:?}", mesh.at(64, 60));
        ask(stage, organ, VesselSurface { shows: SurfaceShown::Preview, ..default() });
        assert_eq!(stage.picture().differing(&segments), 0, "the segments are as they were");
        ask(stage, organ, VesselSurface::default());
        wait_for_mesh(stage, organ);
        stage.app.world_mut().entity_mut(organ).remove::<VesselSurface>();
        assert_eq!(stage.picture().differing(&segments), 0, "and without the component");
    });
}

#[test]
fn colours_follow_the_appearance_while_segments_are_hidden() {
    on_stage("surface colours", |stage| {
        stage.set_shadows(false);
        let organ = stage.spawn(VesselKind::Artery, &shrub());
        ask(stage, organ, VesselSurface::default());
        wait_for_mesh(stage, organ);
        stage.appearance(organ, |look| look.colors.artery = Color::srgb(0.1, 0.1, 0.8));
        assert!(stage.picture().is_blue(64, 60));
        stage.app.world_mut().entity_mut(organ).remove::<VesselSurface>();
        assert!(stage.picture().is_blue(64, 60), "segments have heard of it");
    });
}

#[test]
fn nothing_pops_on_the_way_through_all_levels() {
    on_stage("surface levels", |stage| {
        stage.set_shadows(false);
        let organ = stage.spawn(VesselKind::Vein, &shrub());
        ask(stage, organ, VesselSurface::default());
        wait_for_mesh(stage, organ);
        let (vessels, mut seen, mut before) = (stage.vessels(organ), [false; 3], None::<Picture>);
        let mesh = stage.app.world().get::<VesselMesh>(vessels).expect("a mesh");
        let (size, entities) = (mesh.size(), mesh.entities().to_vec());
        // The camera has no perspective: pictures at all distances are the same, but for the levels.
        for distance in [1.0, 1.9, 2.1, 2.3, 2.45, 3.5, 5.5, 6.2, 6.8, 7.4, 7.6] {
            // Half as large and half as far: the camera sees no farther than 1000 units.
            stage.set_transform(
                organ,
                Transform::from_xyz(0.0, 0.0, 200.0 - 0.5 * distance * size).with_scale(Vec3::splat(0.5)),
            );
            let picture = stage.picture();
            for (seen, &entity) in seen.iter_mut().zip(&entities) {
                let range = stage.app.world().get::<VisibilityRange>(entity).expect("a range of distances");
                *seen |= range.is_visible_at_all(0.5 * distance * size);
            }
            if let Some(before) = before {
                let (change, of) = (outline_change(&before, &picture), before.vessel_pixels());
                assert!(change * 20 < of, "{change} of {of} pixels change at {distance}");
                let brighter = picture.mean_brightness() / before.mean_brightness();
                assert!((brighter - 1.0).abs() < 0.01, "brighter by {brighter} at {distance}");
            }
            before = Some(picture);
        }
        assert_eq!(seen, [true; 3]);
    });
}

#[test]
fn a_cut_opens_the_mesh_and_closes_it_with_stumps() {
    on_stage("surface cut", |stage| {
        stage.set_shadows(false);
        let bar = tree(&[([-50.0, 0.0, 0.0], NO_PARENT, 3.0), ([50.0, 0.0, 0.0], 0, 3.0)]);
        let organ = stage.spawn(VesselKind::Artery, &bar);
        stage.app.world_mut().entity_mut(organ).insert(Cuttable::default());
        ask(stage, organ, VesselSurface::default());
        wait_for_mesh(stage, organ);
        assert!(stage.picture().is_vessel(64, 64));
        let edge = |y: f32| [Vec3::new(0.0, y, -50.0), Vec3::new(0.0, y, 50.0)];
        let blade = Blade::sweep(edge(-200.0), edge(200.0)).expect("a blade");
        stage.app.world_mut().resource_mut::<CuttableVessels>().cut(blade);
        stage.app.update();
        wait_for_mesh(stage, organ);
        let cut = stage.picture();
        assert_eq!(stage.visible_chunks(), 0);
        let gap = (0..SIZE).filter(|&x| x > 20 && x < 108 && cut.is_background(x, 64)).count();
        assert!((7..=11).contains(&gap), "a gap of {gap} pixels, as with segments");
    });
}

#[test]
fn meshes_are_drawn_without_storage_buffers() {
    on_stage("surface without buffers", |stage| {
        stage.set_shadows(false);
        let limits = stage.app.world_mut().remove_resource::<SegmentLimits>().expect("this GPU draws segments");
        let organ = stage.spawn(VesselKind::Artery, &shrub());
        ask(stage, organ, VesselSurface::default());
        wait_for_mesh(stage, organ);
        let (picture, chunks) = (stage.picture(), stage.chunk_count());
        let materials = stage.app.world().resource::<Assets<SegmentMaterial>>().len();
        stage.app.insert_resource(limits);
        assert_eq!((chunks, materials), (0, 0));
        assert!(picture.is_red(64, 60) && picture.vessel_pixels() > 500, "{}", picture.vessel_pixels());
    });
}
