//! The plugin with all of Bevy's default plugins, without a graphics card, and organs from files.

use super::*;
use bevy::{
    asset::UnapprovedPathMode,
    log::LogPlugin,
    render::{RenderPlugin, settings::WgpuSettings},
    window::ExitCondition,
    winit::WinitPlugin,
};
use std::path::PathBuf;

/// `DefaultPlugins` as on a machine without a display or a graphics driver.
fn desktop() -> App {
    let mut app = App::new();
    let settings = WgpuSettings { backends: None, ..default() };
    app.add_plugins((
        DefaultPlugins
            .build()
            .disable::<WinitPlugin>()
            .disable::<LogPlugin>()
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(RenderPlugin { render_creation: settings.into(), ..default() })
            .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() }),
        VesselPlugin::default(),
    ));
    app.insert_resource(jobs());
    app.finish();
    app.cleanup();
    app
}

fn organ_file(name: &str) -> Option<PathBuf> {
    shared::folder(&format!("data/organs/{name}"))
}

#[test]
fn all_that_a_user_writes() {
    let mut app = desktop();
    let organ = add_mesh(&mut app, sphere());
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    let vasculature = Vasculature::new(PresetName::Colon).with_seed(7);
    let organ = app.world_mut().spawn((Mesh3d(organ), MeshMaterial3d(material), vasculature)).id();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
}

#[test]
fn an_organ_from_a_file_grows_once_it_is_loaded() {
    let Some(path) = organ_file("colon_vhf.glb") else { return };
    let mut app = desktop();
    let label = format!("{}#Mesh0/Primitive0", path.display());
    let mesh: Handle<Mesh> = app.world().resource::<AssetServer>().load(label);
    let mut wish = Vasculature::new(PresetName::Colon);
    settings_of(&mut wish).steps = 40;
    let organ = app.world_mut().spawn((Mesh3d(mesh), wish)).id();
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::WaitingForMesh);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_published(app.world(), organ);
    assert!(progress(app.world(), organ).nodes.artery > 100);
}
