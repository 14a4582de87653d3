//! Cut, bleed, clamp: an operation on the vessels of a colon that breathes.
//!
//! Let the vessels grow, then drag with the right mouse button: a scalpel cuts along the cursor's path, and severed
//! vessels bleed at a rate given by pressure and radius. Turn with the left button, move with the middle one, zoom with
//! the wheel.
//!
//! | key | |
//! |---|---|
//! | right drag | scalpel |
//! | `K`, `U` | a clamp on the vessel under the cursor, and off again |
//! | `B` | cautery under the cursor, while it is held |
//! | `Z` | undo |
//! | space | pause growth and bleeding |
//! | `A`, `V`, `C` | arteries, veins, meaning of the colours: the last pales vessels without blood |
//!
//! `--mesh FILE` takes your own organ (GLB, glTF, OBJ), in metres. `--headless --script demo --out DIR` makes the same
//! cut, clamp and cautery on any machine and writes pictures and `blood_loss.csv`. This is also the behaviour without a
//! display.

#[path = "common/blood.rs"]
mod blood;
#[path = "common/breathing.rs"]
mod breathing;
mod common;
#[path = "common/figures.rs"]
mod figures;
#[path = "common/film.rs"]
mod film;
#[path = "common/film_picture.rs"]
mod film_picture;
#[path = "common/instruments.rs"]
mod instruments;
#[path = "common/jets.rs"]
mod jets;
#[path = "common/operation.rs"]
mod operation;
#[path = "common/organ_file.rs"]
mod organ_file;
#[path = "common/skin.rs"]
mod skin;
#[path = "common/surface.rs"]
mod surface;
#[path = "common/wish.rs"]
mod wish;

use bevy::prelude::*;
use bevy_vessels::{
    plugin::{FollowsMesh, Perfusion},
    prelude::*,
    synthesis::{
        haemodynamics::{Pulse, RootPressure},
        organ::ColonSettings,
        units::Scale,
    },
};
use blood::BloodPlugin;
use breathing::BreathingPlugin;
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, OrganAssets},
    studio::{StudioPlugin, front_view, moved, to_unit_size},
};
use figures::FiguresPlugin;
use instruments::{INSTRUMENTS_HELP, InstrumentsPlugin};
use operation::{OperationPlugin, Script};
use organ_file::{OrganFile, OrganFilePlugin, OrganLoaded};
use surface::Surface;
use wish::OrganArgs;

/// Cut, bleed, clamp.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    organ: OrganArgs,
    /// The operation without a window.
    #[arg(long, value_enum, default_value_t)]
    script: Script,
}

fn main() -> AppExit {
    let args = Args::parse();
    let title = "Cut, bleed, clamp";
    App::new()
        .add_plugins(StudioPlugin { args: args.organ.studio.clone(), title, help: HELP, more_help: INSTRUMENTS_HELP })
        .add_plugins((VesselPlugin::default(), ControlsPlugin, OrganFilePlugin))
        .add_plugins((InstrumentsPlugin, BloodPlugin, BreathingPlugin, FiguresPlugin, OperationPlugin(args.script)))
        .insert_resource(args)
        .add_observer(spawn_loaded)
        .add_systems(Startup, spawn_organ)
        .run()
}

/// Blood under pulsatile pressure.
fn perfusion() -> impl Bundle {
    let arterial_pressure = RootPressure::Pulsatile(Pulse::default());
    (Perfusion { scale: Some(Scale::METRES), arterial_pressure, ..default() }, FollowsMesh)
}

fn spawn_organ(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets) -> Result {
    if let Some(path) = &args.organ.mesh {
        commands.insert_resource(OrganFile::new(path.clone()));
        return Ok(());
    }
    let colon = ColonSettings { seed: args.organ.seed, triangles: 60_000, ..default() }.generate()?;
    let place = to_unit_size(colon.mesh.bounds());
    commands.insert_resource(Surface::new(&Mesh::from(colon.mesh.clone()), &place, moved(&colon.front, &place).eye)?);
    let tint = args.organ.tint(Color::WHITE);
    let outside = colon.mesh.part(colon.outer.clone()).into();
    let vessels = args.organ.vessels(Some(&colon.roots), 0.7);
    assets.spawn(&mut commands, outside, tint, place).insert((Name::new("colon"), vessels, perfusion()));
    let inside = colon.mesh.part(colon.outer.end..colon.inner.end).into();
    assets.spawn(&mut commands, inside, tint, place).insert(Name::new("inside"));
    Ok(())
}

/// The organ from a file.
fn spawn_loaded(loaded: On<OrganLoaded>, mut commands: Commands, args: Res<Args>, mut assets: OrganAssets) -> Result {
    commands.insert_resource(Surface::new(&loaded.mesh, &loaded.place, front_view().eye)?);
    let tint = args.organ.tint(OrganArgs::FLESH);
    let vessels = args.organ.vessels(None, 0.7);
    let organ = (Name::new("organ"), vessels, perfusion());
    assets.spawn(&mut commands, loaded.mesh.clone(), tint, loaded.place).insert(organ);
    Ok(())
}
