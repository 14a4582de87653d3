//! Arteries and veins grow over a procedural colon, and over the mucosa inside it.
//!
//! Every seed is another colon. Turn it with the left mouse button, move it with the right, zoom with the wheel.
//!
//! | key | |
//! |---|---|
//! | space | pause, go on |
//! | `.` | one step |
//! | `N` | the next seed |
//! | `A`, `V` | arteries, veins on and off |
//! | `C` | colour by system, radius, age, Strahler order |
//! | `I` | look from inside; then ↑ and ↓ travel along the lumen |
//!
//! `--mesh FILE.glb` takes an organ of your own, in any unit. `--headless` draws to files instead of a window, as it does
//! where there is no display: `cargo run --release --example colon -- --headless --out DIR`.

mod common;
#[path = "common/endoscopy.rs"]
mod endoscopy;
#[path = "common/organ_file.rs"]
mod organ_file;

use bevy::prelude::*;
use bevy_vessels::{
    prelude::*,
    synthesis::{
        organ::{ColonSettings, OrganMesh, RootSites},
        tree::System,
    },
};
use clap::{Parser, ValueEnum};
use common::{
    controls::{ControlsPlugin, HELP, Organ, OrganAssets, tell},
    photo::{Shot, Shots},
    studio::{StudioArgs, StudioPlugin, View, front_view, moved, to_unit_size},
};
use endoscopy::{Lumen, look_inside};
use organ_file::{OrganFile, OrganFiles};
use std::path::PathBuf;

/// Arteries and veins grow over a colon.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Grow on the organ in this glTF file instead of a procedural colon.
    #[arg(long)]
    mesh: Option<PathBuf>,
    /// Which colon, and which of the networks that the preset can give.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Name of a preset.
    #[arg(long, default_value = "colon")]
    preset: PresetName,
    /// Where vessels grow.
    #[arg(long, value_enum, default_value_t = Mode::Surface)]
    mode: Mode,
}

impl Args {
    /// The organ's tint: where vessels grow inside it, it is glass.
    fn tint(&self, color: Color) -> Color {
        if self.mode == Mode::Surface { color } else { color.with_alpha(0.25) }
    }
}

#[derive(ValueEnum, Clone, Copy, PartialEq)]
enum Mode {
    Surface,
    Volume,
    Staged,
}

fn main() -> AppExit {
    let args = Args::parse();
    App::new()
        .add_plugins(StudioPlugin {
            args: args.studio.clone(),
            title: "Vessels of the colon",
            help: HELP,
            more_help: "N  next seed\nI  inside, up and down travel",
        })
        .add_plugins((VesselPlugin::default(), ControlsPlugin))
        .insert_resource(args)
        .add_systems(Startup, spawn_organ)
        .add_systems(Update, spawn_file.run_if(resource_exists::<OrganFile>))
        .add_systems(Update, (next_seed, look_inside.after(tell)).run_if(resource_equals(View::Window)))
        .run()
}

fn spawn_organ(mut commands: Commands, args: Res<Args>, server: Res<AssetServer>) {
    match &args.mesh {
        Some(path) => commands.insert_resource(OrganFile::load(path, &server)),
        None => commands.run_system_cached(spawn_colon),
    }
}

/// `N`: the next seed's colon takes the place of this one.
fn next_seed(
    keys: Res<ButtonInput<KeyCode>>,
    mut commands: Commands,
    mut args: ResMut<Args>,
    organs: Query<Entity, With<Organ>>,
) {
    if keys.just_pressed(KeyCode::KeyN) {
        organs.iter().for_each(|organ| commands.entity(organ).despawn());
        args.seed += 1;
        commands.run_system_cached(spawn_organ);
    }
}

/// The vessels that the arguments ask for, with their radii multiplied.
fn vasculature(args: &Args, roots: Option<&RootSites>, radii: f32) -> Vasculature {
    let mut wish = Vasculature::new(args.preset).with_seed(args.seed);
    wish.tissue.mode = match args.mode {
        Mode::Surface => TissueMode::Surface,
        Mode::Volume => TissueMode::Volume,
        Mode::Staged => TissueMode::Staged { surface_steps: wish.settings.steps / 2 },
    };
    for system in System::ALL {
        wish.settings.system_mut(system).terminal_radius *= radii;
    }
    let Some(roots) = roots else { return wish };
    wish.with_roots(RootPlacement::Nearest(roots.arterial.clone()), RootPlacement::Nearest(roots.venous.clone()))
}

/// The colon of the seed. Its outer and its inner side are organs of their own, joined by a rim.
fn spawn_colon(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) -> Result {
    let colon = ColonSettings { seed: args.seed, triangles: 120_000, ..default() }.generate()?;
    let place = to_unit_size(colon.mesh.bounds());
    let mut spawn = |name: &'static str, mesh: OrganMesh, wish: Option<Vasculature>| {
        let mut organ = commands.spawn((Name::new(name), assets.organ(mesh.into(), args.tint(Color::WHITE), place)));
        wish.map(|wish| organ.insert(wish));
    };
    let outer = if args.mode != Mode::Surface { 0..colon.mesh.triangles.len() } else { colon.outer.clone() };
    spawn("colon", colon.mesh.part(outer), Some(vasculature(&args, Some(&colon.roots), 1.4)));
    if args.mode == Mode::Surface {
        spawn("rim", colon.mesh.part(colon.outer.end..colon.inner.start), None);
        let mucosa = vasculature(&args, Some(&colon.inner_roots), 0.4);
        spawn("mucosa", colon.mesh.part(colon.inner.clone()), Some(mucosa));
    }
    let lumen = moved(&colon.lumen, &place);
    let line = colon.centre_line.iter().map(|&point| place.transform_point(point)).collect();
    commands.insert_resource(Lumen::new(line, lumen.eye));
    shots.0 = vec![
        Shot { file: "colon.png", view: moved(&colon.front, &place), field_of_view: 37.0, endoscope: false },
        Shot { file: "colon_inside.png", view: lumen, field_of_view: 78.0, endoscope: true },
    ];
    Ok(())
}

/// The organ of a file, once it is there.
fn spawn_file(
    mut commands: Commands,
    args: Res<Args>,
    file: Res<OrganFile>,
    files: OrganFiles,
    mut assets: OrganAssets,
    mut shots: ResMut<Shots>,
    mut exit: MessageWriter<AppExit>,
) {
    let (mesh, place) = match files.mesh(&file, &assets.meshes) {
        Ok(Some(found)) => found,
        Ok(None) => return,
        Err(error) => {
            eprintln!("{error}");
            exit.write(AppExit::error());
            return;
        }
    };
    let organ = assets.organ(mesh, args.tint(Color::srgb(0.79, 0.47, 0.42)), place);
    commands.spawn((Name::new("organ"), organ, vasculature(&args, None, 1.4)));
    commands.remove_resource::<OrganFile>();
    shots.0 = vec![Shot { file: "colon.png", view: front_view(), field_of_view: 37.0, endoscope: false }];
}
