//! Arteries and veins grow over a procedural colon, and over the mucosa inside it. Once grown, they become closed meshes
//! outside, and lie in the texture of the mucosa inside.
//!
//! Every seed gives another colon. Turn it with the left mouse button, move it with the right, zoom with the wheel.
//!
//! | key | |
//! |---|---|
//! | space | pause, resume |
//! | `.` | one step |
//! | `N` | the next seed |
//! | `A`, `V` | arteries, veins on and off |
//! | `C` | colour by kind, radius, age, Strahler order |
//! | `M` | closed meshes, segments as while they grow, or vessels in the mucosa's texture |
//! | `I` | view from inside; then ↑ and ↓ travel along the lumen |
//!
//! `--mesh FILE` takes your own organ (GLB, glTF, OBJ), in any unit. `--headless` draws to files instead of a window,
//! which is also the behaviour without a display: `cargo run --release --example colon -- --headless --out DIR`.

mod common;
#[path = "common/endoscopy.rs"]
mod endoscopy;
#[path = "common/organ_file.rs"]
mod organ_file;
#[path = "common/wish.rs"]
mod wish;

use bevy::prelude::*;
use bevy_vessels::{
    plugin::{VesselSurface, VesselTexture},
    prelude::*,
    synthesis::{
        mesh::ShadedMesh,
        organ::ColonSettings,
        texture::{BakeSettings, VesselLook},
    },
};
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, Organ, OrganAssets, tell},
    photo::{Shot, Shots},
    studio::{StudioPlugin, View, front_view, moved, to_unit_size},
};
use endoscopy::{Lumen, look_inside};
use organ_file::{OrganFile, OrganFilePlugin, OrganLoaded};
use wish::{Mode, OrganArgs};

const MORE_HELP: &str = "N  next seed\nI  inside, up and down travel";

/// Arteries and veins grow over a colon.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    organ: OrganArgs,
}

fn main() -> AppExit {
    let args = Args::parse();
    let title = "Vessels of the colon";
    App::new()
        .add_plugins(StudioPlugin { args: args.organ.studio.clone(), title, help: HELP, more_help: MORE_HELP })
        .add_plugins((VesselPlugin::default(), ControlsPlugin, OrganFilePlugin))
        .insert_resource(args)
        .add_observer(spawn_loaded)
        .add_systems(Startup, spawn_organ)
        .add_systems(Update, (next_seed, look_inside.after(tell)).run_if(resource_equals(View::Window)))
        .run()
}

fn spawn_organ(mut commands: Commands, args: Res<Args>) {
    match &args.organ.mesh {
        Some(path) => commands.insert_resource(OrganFile::new(path.clone())),
        None => commands.run_system_cached(spawn_colon),
    }
}

/// `N`: the next seed's organ replaces this one.
fn next_seed(
    keys: Res<ButtonInput<KeyCode>>,
    mut commands: Commands,
    mut args: ResMut<Args>,
    organs: Query<Entity, With<Organ>>,
) {
    if keys.just_pressed(KeyCode::KeyN) {
        organs.iter().for_each(|organ| commands.entity(organ).despawn());
        args.organ.seed += 1;
        commands.run_system_cached(spawn_organ);
    }
}

/// The colon of the seed. Its outer and inner sides are separate organs, joined by a rim.
fn spawn_colon(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) -> Result {
    let colon = ColonSettings { seed: args.organ.seed, triangles: 120_000, ..default() }.generate()?;
    let place = to_unit_size(colon.mesh.bounds());
    let mut spawn = |name: &'static str, mesh: ShadedMesh, vessels: Option<Vasculature>| {
        let mut organ = assets.spawn(&mut commands, mesh.into(), args.organ.tint(Color::WHITE), place);
        organ.insert(Name::new(name));
        vessels.map(|vessels| organ.insert((vessels, VesselSurface::default())));
        organ.id()
    };
    let outside = args.organ.vessels(Some(&colon.roots), 1.4);
    if args.organ.mode == Mode::Surface {
        spawn("colon", colon.mesh.part(colon.outer.clone()), Some(outside));
        spawn("rim", colon.mesh.part(colon.outer.end..colon.inner.start), None);
        let inside = args.organ.vessels(Some(&colon.inner_roots), 0.4).with_tissue(TissueMode::Lining);
        let mucosa = spawn("mucosa", colon.mesh.part(colon.inner.clone()), Some(inside));
        commands.entity(mucosa).insert(mucosa_texture());
    } else {
        spawn("colon", colon.mesh.clone(), Some(outside));
    }
    let lumen = moved(&colon.lumen, &place);
    let line = colon.centre_line.iter().map(|&point| place.transform_point(point)).collect();
    commands.insert_resource(Lumen::new(line, lumen.eye));
    shots.0 = vec![
        Shot { file: "colon.png", view: moved(&colon.front, &place), field_of_view: 42.0, endoscope: false },
        Shot { file: "colon_inside.png", view: lumen, field_of_view: 78.0, endoscope: true },
    ];
    Ok(())
}

/// The texture of a mucosa: fine enough for its thin vessels along the whole colon.
fn mucosa_texture() -> VesselTexture {
    let looks =
        [VesselKind::Artery, VesselKind::Vein].map(|kind| (kind, VesselLook { strength: 1.0, ..VesselLook::of(kind) }));
    VesselTexture { settings: BakeSettings { size: 4096, ..default() }, looks: looks.into(), ..default() }
}

/// The organ from a file.
fn spawn_loaded(
    loaded: On<OrganLoaded>,
    mut commands: Commands,
    args: Res<Args>,
    mut assets: OrganAssets,
    mut shots: ResMut<Shots>,
) {
    let tint = args.organ.tint(OrganArgs::FLESH);
    assets.spawn(&mut commands, loaded.mesh.clone(), tint, loaded.place).insert((
        Name::new("organ"),
        args.organ.vessels(None, 1.4),
        VesselSurface::default(),
    ));
    shots.0 = vec![Shot { file: "colon.png", view: front_view(), field_of_view: 42.0, endoscope: false }];
}
