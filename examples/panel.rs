//! Vessels to tweak: a panel with every setting, presets, statistics, products and operating tools beside an organ.
//!
//! Drop a GLB, glTF or OBJ file on the window, or name one with `--mesh`; otherwise there is a procedural colon. Turn the
//! organ with the left mouse button, move it with the right, zoom with the wheel. The panel has the pointer while it is
//! used.
//!
//! | key | |
//! |---|---|
//! | space, `.` | pause and resume, one step |
//! | `A`, `V`, `C`, `M` | arteries, veins, colours, mesh |
//! | F1 | the panel on and off |
//! | F12 | a picture of the window, `panel-N.png` |
//! | Ctrl Z, Ctrl Shift Z | undo, redo of settings, paint and roots |
//!
//! `--headless` draws to a file instead, which is also the behaviour without a display.

mod common;
#[path = "common/organ_file.rs"]
mod organ_file;
#[path = "common/wish.rs"]
mod wish;

use bevy::{
    prelude::*,
    render::view::screenshot::{Screenshot, save_to_disk},
    window::FileDragAndDrop,
};
use bevy_egui::EguiContexts;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_vessels::{
    plugin::{Patient, Perfusion},
    prelude::*,
    synthesis::organ::ColonSettings,
    ui::{PanelFocus, VesselPanel, VesselPanelPlugin},
};
use clap::Parser;
use common::{
    controls::{ControlKeys, ControlsPlugin, HELP, Organ, OrganAssets},
    photo::{OVERSAMPLING, Shot, Shots},
    studio::{StudioPlugin, View, front_view, moved, to_unit_size},
};
use organ_file::{OrganFile, OrganFilePlugin, OrganLoaded};
use wish::OrganArgs;

const MORE_HELP: &str = "F1  panel\nF12  picture\nctrl Z  undo";

/// A panel to tweak the vessels of an organ.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    organ: OrganArgs,
}

fn main() -> AppExit {
    let args = Args::parse();
    let studio = args.organ.studio.clone();
    App::new()
        .add_plugins(StudioPlugin { args: studio, title: "Vessels to tweak", help: HELP, more_help: MORE_HELP })
        .add_plugins((VesselPlugin::default(), ControlsPlugin, OrganFilePlugin, VesselPanelPlugin))
        .configure_sets(Update, ControlKeys.run_if(not(types_into_panel)))
        .insert_resource(args)
        .add_observer(spawn_loaded)
        .add_systems(Startup, spawn_organ)
        .add_systems(PreUpdate, enlarge.run_if(resource_equals(View::Pictures)))
        .add_systems(Update, (hold_camera, press_keys, take_dropped).run_if(resource_equals(View::Window)))
        .run()
}

fn types_into_panel(focus: Res<PanelFocus>) -> bool {
    focus.has_keys()
}

/// Pictures are drawn larger than they are.
fn enlarge(mut contexts: EguiContexts) {
    if let Ok(context) = contexts.ctx_mut() {
        context.set_zoom_factor(OVERSAMPLING as f32);
    }
}

/// The camera rests while the panel has the pointer.
fn hold_camera(focus: Res<PanelFocus>, mut cameras: Query<&mut PanOrbitCamera>) {
    for mut camera in &mut cameras {
        if camera.enabled == focus.has_pointer() {
            camera.enabled = !focus.has_pointer();
        }
    }
}

fn press_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut panel: ResMut<VesselPanel>,
    mut commands: Commands,
    mut pictures: Local<u32>,
) {
    if keys.just_pressed(KeyCode::F1) {
        panel.open = !panel.open;
    }
    if keys.just_pressed(KeyCode::F12) {
        *pictures += 1;
        let path = format!("panel-{}.png", *pictures);
        commands.spawn(Screenshot::primary_window()).observe(save_to_disk(path));
    }
}

/// A file that is dropped on the window is the next organ.
fn take_dropped(mut drops: MessageReader<FileDragAndDrop>, mut commands: Commands) {
    for drop in drops.read() {
        if let FileDragAndDrop::DroppedFile { path_buf, .. } = drop {
            commands.insert_resource(OrganFile::new(path_buf.clone()));
        }
    }
}

fn spawn_organ(mut commands: Commands, args: Res<Args>) {
    match &args.organ.mesh {
        Some(path) => commands.insert_resource(OrganFile::new(path.clone())),
        None => commands.run_system_cached(spawn_colon),
    }
}

fn spawn_colon(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) -> Result {
    let colon = ColonSettings { seed: args.organ.seed, ..default() }.generate()?;
    let place = to_unit_size(colon.mesh.bounds());
    let vessels = args.organ.vessels(Some(&colon.roots), 1.4);
    let mut organ = assets.spawn(&mut commands, colon.mesh.into(), args.organ.tint(Color::WHITE), place);
    organ.insert((Name::new("colon"), vessels, operable()));
    let view = moved(&colon.front, &place);
    shots.0 = vec![Shot { file: "panel.png", view, field_of_view: 42.0, endoscope: false }];
    Ok(())
}

/// What lets vessels be cut, and bleed.
fn operable() -> impl Bundle {
    (Cuttable::default(), Perfusion::default(), Patient::default())
}

/// The organ from a file takes the place of what is there.
fn spawn_loaded(
    loaded: On<OrganLoaded>,
    mut commands: Commands,
    args: Res<Args>,
    organs: Query<Entity, With<Organ>>,
    mut assets: OrganAssets,
    mut shots: ResMut<Shots>,
) {
    organs.iter().for_each(|organ| commands.entity(organ).despawn());
    let tint = args.organ.tint(OrganArgs::FLESH);
    let mut organ = assets.spawn(&mut commands, loaded.mesh.clone(), tint, loaded.place);
    organ.insert((Name::new("organ"), args.organ.vessels(None, 1.4), operable()));
    shots.0 = vec![Shot { file: "panel.png", view: front_view(), field_of_view: 42.0, endoscope: false }];
}
