//! Both generators in the same procedural liver: on the left arteries and veins by space colonization, on the right its
//! four trees of least volume by constrained constructive optimisation, which never touch.
//!
//! Keys as on the screen. `--headless --out DIR` writes `cco.png` with both livers and `cco_liver.png` of the right
//! one.

mod common;

use bevy::prelude::*;
use bevy_vessels::{
    prelude::*,
    synthesis::organ::{LiverSettings, Viewpoint},
};
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, OrganAssets},
    photo::{Shot, Shots},
    studio::{StudioArgs, StudioPlugin, moved, to_unit_size},
};

/// Both generators side by side.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Seed of the organ and of its networks.
    #[arg(long, default_value_t = 3)]
    seed: u64,
    /// Terminals of each of the four trees.
    #[arg(long, default_value_t = 1500)]
    terminals: u32,
}

/// Distance of each liver from the middle.
const BESIDE: Vec3 = Vec3::new(0.58, 0.0, 0.0);

fn main() -> AppExit {
    let args = Args::parse();
    App::new()
        .add_plugins(StudioPlugin { args: args.studio.clone(), title: "Least volume", help: HELP, more_help: "" })
        .add_plugins((VesselPlugin::default(), ControlsPlugin))
        .insert_resource(args)
        .add_systems(Startup, spawn_livers)
        .run()
}

fn spawn_livers(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) -> Result {
    let liver = LiverSettings { seed: args.seed, ..default() }.generate()?;
    let fit = to_unit_size(liver.mesh.bounds());
    let place = |middle| fit.with_translation(fit.translation + middle);
    let glass = Color::srgba(1.0, 0.9, 0.85, 0.16);
    let roots = RootPlacements {
        artery: RootPlacement::Nearest(liver.roots.arterial.clone()),
        vein: RootPlacement::Nearest(liver.roots.venous.clone()),
        ..default()
    };
    let mut colonized = Vasculature::new(PresetName::Liver).with_seed(args.seed).with_roots(roots.clone());
    if let Some(settings) = colonized.generator.colonization_mut() {
        // Visible from afar.
        settings.arterial.terminal_radius *= 2.0;
        settings.venous.terminal_radius *= 2.0;
    }
    let beside = RootPlacement::Beside;
    let all_roots = RootPlacements { portal_vein: beside.clone(), duct: beside, ..roots };
    let mut optimised = Vasculature::new(PresetName::CcoLiver).with_seed(args.seed).with_roots(all_roots);
    if let Some(settings) = optimised.generator.cco_mut() {
        settings.terminals = args.terminals;
    }
    for (name, middle, wish) in [("colonized", -BESIDE, colonized), ("optimised", BESIDE, optimised)] {
        assets.spawn(&mut commands, liver.mesh.clone().into(), glass, place(middle)).insert((
            Name::new(name),
            wish,
            VesselAppearance::default(),
        ));
    }
    let view = moved(&liver.front, &place(BESIDE));
    let both = Viewpoint { eye: Vec3::new(0.0, 0.3, 2.6), target: Vec3::ZERO, up: Vec3::Y };
    shots.0.push(Shot { file: "cco.png", view: both, field_of_view: 40.0, endoscope: false });
    shots.0.push(Shot { file: "cco_liver.png", view, field_of_view: 36.0, endoscope: false });
    Ok(())
}
