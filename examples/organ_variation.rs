//! Sixteen different organs with their vessels: colons, livers, kidneys and eyes, each from its seed.
//!
//! Turn them with the left mouse button, move them with the right, zoom with the wheel.
//!
//! | key | |
//! |---|---|
//! | `N` | sixteen others |
//! | space, `.` | pause and resume, one step |
//! | `A`, `V`, `C` | arteries, veins, colours |
//!
//! `--headless` draws to a file instead, which is also the behaviour without a display.

mod common;
#[path = "common/stouter.rs"]
mod stouter;

use bevy::prelude::*;
use bevy_vessels::{
    prelude::*,
    synthesis::{
        mesh::ShadedMesh,
        organ::{ColonSettings, EyeSettings, KidneySettings, LiverSettings, RootSites, Viewpoint},
        tissue::NoGoRegion,
    },
};
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, Organ, OrganAssets},
    photo::{Shot, Shots},
    studio::{StudioArgs, StudioPlugin, View, moved, to_unit_size, transform_of},
};
use stouter::stouter;

/// Organs along each side of the picture.
const ACROSS: u64 = 4;
/// Distance between two organs. Each is one unit large.
const SPACING: f32 = 1.12;

/// Organs that differ by their seeds.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Seed of the first organ of each kind.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> AppExit {
    let args = Args::parse();
    let studio = args.studio.clone();
    App::new()
        .add_plugins(StudioPlugin { args: studio, title: "Organs by their seeds", help: HELP, more_help: "N  others" })
        .add_plugins((VesselPlugin::default(), ControlsPlugin))
        .insert_resource(args)
        .add_systems(Startup, spawn_organs)
        .add_systems(Update, other_seeds.run_if(resource_equals(View::Window)))
        .run()
}

/// `N`: the next sixteen take the place of these.
fn other_seeds(
    keys: Res<ButtonInput<KeyCode>>,
    mut commands: Commands,
    mut args: ResMut<Args>,
    organs: Query<Entity, With<Organ>>,
) {
    if keys.just_pressed(KeyCode::KeyN) {
        organs.iter().for_each(|organ| commands.entity(organ).despawn());
        args.seed += ACROSS;
        commands.run_system_cached(spawn_organs);
    }
}

/// A column for each kind of organ, a row for each seed.
fn spawn_organs(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) -> Result {
    for row in 0..ACROSS {
        let seed = args.seed + row;
        let colon = ColonSettings { seed, triangles: 40_000, ..default() }.generate()?;
        let liver = LiverSettings { seed, ..default() }.generate()?;
        let kidney = KidneySettings { seed, ..default() }.generate()?;
        let eye = EyeSettings { seed, ..default() }.generate()?;
        // The pupil and what lies before it have no vessels.
        let pupil = NoGoRegion::Ball { center: eye.limbus.0, radius: 1.05 * eye.limbus.1 };
        let iris = eye.iris;
        let organs = [
            ("colon", colon.mesh, colon.roots, colon.front, PresetName::Colon, 2.5),
            ("liver", liver.mesh, liver.roots, liver.front, PresetName::Paper, 4.5),
            ("kidney", kidney.mesh, kidney.roots, kidney.front, PresetName::Paper, 4.5),
            ("eye", eye.globe, eye.roots, eye.front, PresetName::Conjunctiva, 2.0),
        ];
        for (column, (name, mesh, roots, view, preset, radii)) in (0..).zip(organs) {
            let place = in_the_grid(&mesh, &view, column, row);
            let vessels = stouter(Vasculature::new(preset), radii).with_seed(seed).with_tissue(TissueMode::Surface);
            let vessels = vessels.with_roots(entries(&roots));
            let mut organ = assets.spawn(&mut commands, mesh.into(), Color::WHITE, place);
            organ.insert((Name::new(format!("{name}_{seed}")), vessels));
            if name == "eye" {
                let mut paint = OrganPaint::default();
                paint.no_go.regions.push(pupil);
                organ.insert(paint);
                assets.spawn(&mut commands, iris.clone().into(), Color::WHITE, place);
            }
        }
    }
    let view = Viewpoint { eye: Vec3::new(0.0, 0.0, 5.9), target: Vec3::ZERO, up: Vec3::Y };
    shots.0 = vec![Shot { file: "organ_variation.png", view, field_of_view: 42.0, endoscope: false }];
    Ok(())
}

/// Arteries and veins from where they enter the organ.
fn entries(roots: &RootSites) -> RootPlacements {
    RootPlacements {
        artery: RootPlacement::Nearest(roots.arterial.clone()),
        vein: RootPlacement::Nearest(roots.venous.clone()),
        ..RootPlacements::default()
    }
}

/// The transform that makes an organ one unit large, shows its front, and puts it in its cell.
fn in_the_grid(mesh: &ShadedMesh, view: &Viewpoint, column: u64, row: u64) -> Transform {
    let sized = to_unit_size(mesh.bounds());
    let turn = transform_of(&moved(view, &sized)).rotation.inverse();
    let cell = |index: u64| (index as f32 - 0.5 * (ACROSS - 1) as f32) * SPACING;
    Transform::from_translation(Vec3::new(cell(column), -cell(row), 0.0)) * Transform::from_rotation(turn) * sized
}
