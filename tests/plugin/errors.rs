//! An error of an organ is named, stops only that organ, and can be repaired.

use super::*;
use bevy::{
    asset::RenderAssetUsages,
    mesh::{Indices, PrimitiveTopology},
};
use bevy_vessels::plugin::{GrowthFailed, OrganGrowthError, OrganMeshError};

/// Runs until the organ fails, and returns the error.
#[track_caller]
pub fn failure(app: &mut App, organ: Entity) -> GrowthFailed {
    let mut cursor = MessageCursor::default();
    drain::<GrowthFailed>(app.world(), &mut cursor);
    let mut failures = Vec::new();
    run_until(app, "a failure", |world| {
        failures.extend(drain::<GrowthFailed>(world, &mut cursor));
        !failures.is_empty()
    });
    // Later frames with asset events must not make it fail a second time.
    for _ in 0..5 {
        app.update();
        failures.extend(drain::<GrowthFailed>(app.world(), &mut cursor));
    }
    assert_eq!(failures.len(), 1, "it fails once: {failures:?}");
    let failed = failures.remove(0);
    assert_eq!(failed.organ, organ);
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Failed);
    let state = app.world().get::<GrowthState>(organ).expect("an organ has a state");
    // As text, because an error that names a NaN is not equal to itself.
    assert_eq!(state.error().map(ToString::to_string), Some(failed.error.to_string()));
    failed
}

fn list(positions: Vec<[f32; 3]>) -> Mesh {
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
}

fn bad_meshes() -> Vec<(&'static str, Mesh)> {
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let with_nan = vec![[0.0, 0.0, 0.0], [1.0, f32::NAN, 0.0], [0.0, 1.0, 0.0]];
    let mut on_gpu = sphere();
    assert!(on_gpu.take_gpu_data().is_ok());
    vec![
        ("no positions", Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())),
        ("empty", list(vec![])),
        ("no triangle", list(corners[..2].to_vec())),
        ("NaN", list(with_nan)),
        ("no area", list(vec![[1.0; 3]; 3])),
        ("index out of range", list(corners.clone()).with_inserted_indices(Indices::U16(vec![0, 1, 9]))),
        (
            "lines",
            Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
                .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners),
        ),
        ("on the graphics card", on_gpu),
    ]
}

#[test]
fn bad_meshes_fail_their_organ_only_and_good_ones_repair_it() {
    for (what, mesh) in bad_meshes() {
        let mut app = headless(GrowthBudget::default());
        let healthy = spawn(&mut app, quick());
        let mesh = add_mesh(&mut app, mesh);
        let organ = app.world_mut().spawn((Mesh3d(mesh), quick())).id();
        let error = failure(&mut app, organ).error;
        assert!(matches!(error, OrganGrowthError::Mesh(_) | OrganGrowthError::Tissue(_)), "{what}: {error}");
        println!("{what}: {error}");
        let good = add_mesh(&mut app, sphere());
        app.world_mut().entity_mut(organ).insert(Mesh3d(good));
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        run_to_phase(&mut app, healthy, GrowthPhase::Finished);
        assert_eq!(trees(app.world(), organ), trees(app.world(), healthy), "{what}");
    }
}

#[test]
fn a_bad_mesh_takes_the_vessels_of_the_good_one_away() {
    let mut app = headless(GrowthBudget::default());
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let id = app.world().get::<Mesh3d>(organ).map(|mesh| mesh.id()).expect("the organ has a mesh");
    *app.world_mut().resource_mut::<Assets<Mesh>>().get_mut(id).expect("the mesh is there") = list(vec![]);
    failure(&mut app, organ);
    assert!(published(app.world(), organ, VesselKind::Artery).tree().is_empty());
}

#[test]
fn a_mesh_file_that_is_missing_is_named() {
    let mut app = headless(GrowthBudget::default());
    let mesh: Handle<Mesh> = app.world().resource::<AssetServer>().load("no-such-organ.glb#Mesh0/Primitive0");
    let organ = app.world_mut().spawn((Mesh3d(mesh), quick())).id();
    let error = failure(&mut app, organ).error;
    assert!(matches!(error, OrganGrowthError::Mesh(OrganMeshError::NotLoaded { .. })), "{error}");
    assert!(error.to_string().contains("no-such-organ.glb"), "{error}");
}

#[test]
fn roots_far_away_are_named() {
    let mut app = headless(GrowthBudget::default());
    let mut far = quick();
    far.roots.artery = RootPlacement::Exact(vec![Vec3::new(1234.5, 0.0, 0.0)]);
    let organ = spawn(&mut app, far);
    let error = failure(&mut app, organ).error;
    assert!(matches!(error, OrganGrowthError::Generator(_)), "{error}");
    assert!(error.to_string().contains("1234.5"), "{error}");
    let mut wish = app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes");
    *wish = quick();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn settings_out_of_range_are_named_and_mended_at_the_next_frame() {
    let mut app = headless(GrowthBudget::Steps(1));
    let mut wish = quick();
    settings_of(&mut wish).arterial.kill_distance = -1.0;
    let organ = spawn(&mut app, wish);
    let error = failure(&mut app, organ).error;
    assert!(error.to_string().contains("kill_distance"), "{error}");
    let mut wish = app.world_mut().get_mut::<Vasculature>(organ).expect("an organ has wishes");
    *wish = quick();
    app.update();
    assert_eq!(progress(app.world(), organ).step, 1, "the tissue was kept");
    send(&mut app, organ, GrowthAction::Finish);
    app.update();
    assert_published(app.world(), organ);
}

#[test]
fn a_restart_of_a_failed_organ_tries_again() {
    let mut app = headless(GrowthBudget::default());
    let mesh = add_mesh(&mut app, list(vec![]));
    let organ = app.world_mut().spawn((Mesh3d(mesh), quick())).id();
    let first = failure(&mut app, organ);
    send(&mut app, organ, GrowthAction::Restart);
    assert_eq!(failure(&mut app, organ), first);
}
