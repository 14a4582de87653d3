//! The white of an eye with its vessels, as the paper makes it: many small trees of three sizes, each in its own band,
//! grown apart, blurred by their depth, and baked into one texture, under iris and cornea.
//!
//! Turn it with the left mouse button, move it with the right, zoom with the wheel. `N` shows the next seed's eye.
//!
//! `--headless` draws to files instead, which is also the behaviour without a display.

#[path = "common/scene.rs"]
mod common;

use bevy::{
    light::NotShadowCaster,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, futures::check_ready},
};
use bevy_vessels::{
    VesselPlugin,
    plugin::texture_image,
    synthesis::{
        organ::{Eye, EyeSettings},
        recipe::conjunctiva,
        texture::{Bake, BakeSettings, Canvas, Layer, MapKind},
        tissue::MeshSurface,
        tree::{VesselKind, VesselTree},
    },
};
use clap::Parser;
use common::{
    light::moist_tissue,
    photo::{Shot, Shots},
    studio::{StatusLine, StudioArgs, StudioPlugin, View, moved, to_unit_size},
};
use std::sync::Arc;

/// Vessels in the white of an eye.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Seed of the eye and its vessels.
    #[arg(long, default_value_t = 3)]
    seed: u64,
    /// Width and height of the texture, in texels.
    #[arg(long, default_value_t = 4096)]
    texels: u32,
}

fn main() -> AppExit {
    let args = Args::parse();
    let studio = args.studio.clone();
    App::new()
        .add_plugins(StudioPlugin { args: studio, title: "Conjunctiva", help: "N  next seed", more_help: "" })
        .add_plugins(VesselPlugin::default())
        .insert_resource(args)
        .add_systems(Startup, begin)
        .add_systems(
            Update,
            (show.run_if(resource_exists::<Painting>), next_seed.run_if(resource_equals(View::Window))),
        )
        .run()
}

/// An eye whose texture is being made.
#[derive(Resource)]
struct Painting(Task<std::result::Result<(Eye, Bake), String>>);

/// A part of the eye that is shown.
#[derive(Component)]
struct Part;

fn begin(mut commands: Commands, args: Res<Args>, mut status: ResMut<StatusLine>) {
    let Args { seed, texels, .. } = *args;
    status.0 = format!("seed {seed}, its vessels grow");
    let work = async move { paint(seed, texels).map_err(|error| error.to_string()) };
    commands.insert_resource(Painting(AsyncComputeTaskPool::get().spawn(work)));
}

/// `N`: the next seed's eye replaces this one, when it is ready.
fn next_seed(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands, mut args: ResMut<Args>) {
    if keys.just_pressed(KeyCode::KeyN) {
        args.seed += 1;
        commands.run_system_cached(begin);
    }
}

/// Makes an eye, grows the layers of its conjunctiva apart from each other, and bakes them together.
fn paint(seed: u64, texels: u32) -> std::result::Result<(Eye, Bake), Box<dyn std::error::Error>> {
    let eye = EyeSettings { seed, ..default() }.generate()?;
    let surface = Arc::new(MeshSurface::new(eye.globe.part(eye.conjunctiva.clone()).triangle_mesh()?)?);
    let mut grown: Vec<(VesselTree, _)> = Vec::new();
    for layer in conjunctiva(&eye, seed) {
        let tissue = layer.tissue(&surface)?;
        let mut growth = layer.preset.generator.start(tissue, &layer.preset.roots(), layer.seed)?;
        growth.run();
        let trees = growth.trees();
        let tree = VesselKind::ALL.into_iter().find_map(|kind| trees[kind].as_ref().map(|grown| grown.tree.clone()));
        grown.extend(tree.map(|tree| (tree, layer.look)));
    }
    let layers: Vec<Layer<'_>> = grown.iter().map(|(tree, look)| Layer { tree, look: look.clone() }).collect();
    // The colours of the eye's vertices are drawn, too.
    let settings = BakeSettings { size: texels, base_color: [1.0; 3], ..default() };
    let bake = Bake::new(&Canvas::of_shaded(&eye.globe)?, &layers, None, &settings)?;
    Ok((eye, bake))
}

fn show(
    mut commands: Commands,
    mut painting: ResMut<Painting>,
    args: Res<Args>,
    parts: Query<Entity, With<Part>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut images: ResMut<Assets<Image>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
    (mut shots, mut status): (ResMut<Shots>, ResMut<StatusLine>),
    mut exit: MessageWriter<AppExit>,
) {
    let Some(painted) = check_ready(&mut painting.0) else { return };
    commands.remove_resource::<Painting>();
    let (eye, bake) = match painted {
        Ok(painted) => painted,
        Err(error) => {
            eprintln!("{error}");
            exit.write(AppExit::error());
            return;
        }
    };
    parts.iter().for_each(|part| commands.entity(part).despawn());
    let place = to_unit_size(eye.globe.bounds());
    let mut texture = |kind| bake.map(kind).map(|map| images.add(texture_image(map.clone(), bake.report.repeats)));
    let sclera = StandardMaterial {
        base_color_texture: texture(MapKind::Albedo),
        normal_map_texture: texture(MapKind::Normal),
        clearcoat: 0.8,
        clearcoat_perceptual_roughness: 0.08,
        ..moist_tissue(Color::WHITE)
    };
    let iris = StandardMaterial { perceptual_roughness: 0.7, ..default() };
    let cornea = StandardMaterial {
        base_color: Color::srgba(1.0, 1.0, 1.0, 0.06),
        alpha_mode: AlphaMode::Blend,
        perceptual_roughness: 0.04,
        reflectance: 0.6,
        ..default()
    };
    if let Some(mut materials) = materials {
        for (name, mesh, material) in [
            ("sclera", eye.globe.clone(), sclera),
            ("iris", eye.iris.clone(), iris),
            ("cornea", eye.cornea.clone(), cornea),
        ] {
            let drawn = (Mesh3d(meshes.add(Mesh::from(mesh))), MeshMaterial3d(materials.add(material)), place);
            let mut part = commands.spawn((Part, Name::new(name), drawn));
            if name == "cornea" {
                part.insert(NotShadowCaster);
            }
        }
    }
    let shot = |file, view| Shot { file, view: moved(view, &place), field_of_view: 44.0, endoscope: false };
    shots.0 = vec![
        shot("conjunctiva.png", &eye.three_quarter),
        shot("conjunctiva_front.png", &eye.front),
        shot("conjunctiva_side.png", &eye.lateral),
    ];
    status.0 = format!("seed {}, {} texels near vessels", args.seed, bake.report.texels);
}
