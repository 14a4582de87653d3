//! One tree twice: as it is drawn while it grows, round cones in each other, and as a closed mesh.
//!
//! `--swc FILE` takes a tree of your own, in any unit; without it one grows in a ball. Turn with the left mouse button,
//! move with the right, zoom with the wheel.
//!
//! | key | |
//! |---|---|
//! | `W` | edges of the mesh |
//!
//! `--headless --out DIR` writes pictures instead, which is also the behaviour without a display: `surface.png` with
//! both, `surface_joint.png` with the edges around the widest joint, and `surface_worst.png` of the joint where the mesh
//! is farthest from the vessels.

#[path = "surface/places.rs"]
mod places;
#[path = "common/scene.rs"]
mod scene;
#[path = "common/vessel_mesh.rs"]
mod vessel_mesh;

use bevy::prelude::*;
use bevy_vessels::{
    plugin::VesselsOf,
    prelude::*,
    synthesis::{
        colonization::Colonization,
        io::{SwcReadOptions, load_swc},
        organ::Viewpoint,
        surface::{Surface, SurfaceMesh, SurfaceSettings},
        tissue::Ball,
        tree::VesselTree,
    },
};
use clap::Parser;
use places::{Sight, widest_joint, worst_lateral};
use scene::{
    photo::{Shot, Shots},
    studio::{StudioArgs, StudioPlugin, View, front_view, moved, to_unit_size},
};
use std::{error::Error, path::PathBuf, sync::Arc};
use vessel_mesh::VesselMeshes;

/// Size of each tree, for two of them to fit into the view.
const SIZE: f32 = 0.9;
const BLOOD: Color = Color::srgb(0.62, 0.05, 0.06);

/// A tree as round cones and as a closed mesh.
#[derive(Parser, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// A tree from an SWC file.
    #[arg(long, value_name = "FILE")]
    swc: Option<PathBuf>,
    /// Subdivisions of the mesh.
    #[arg(long, default_value_t = SurfaceSettings::DEFAULT_LEVEL)]
    level: u32,
    /// Sides of the mesh around the widest vessels, before subdivision.
    #[arg(long, default_value_t = SurfaceSettings::DEFAULT_MOST_SIDES)]
    sides: u32,
}

#[derive(Resource)]
struct Scene {
    tree: VesselTree,
    mesh: SurfaceMesh,
}

/// The edges on the whole mesh.
#[derive(Component)]
struct Edges;

impl Scene {
    fn new(args: &Args) -> Result<Self, Box<dyn Error>> {
        let tree = match &args.swc {
            Some(path) => load_swc(path, &SwcReadOptions::default())?,
            None => grown()?,
        };
        let settings = SurfaceSettings { level: args.level, most_sides: args.sides, ..default() };
        let surface = Surface::new(&tree, &settings)?;
        println!("{} nodes, {} triangles, {:?}", tree.len(), surface.mesh.triangle_count(), surface.report);
        Ok(Self { tree, mesh: surface.mesh })
    }
}

/// Arteries in a ball, fewer and stouter than the preset's so that they are visible from afar.
fn grown() -> Result<VesselTree, Box<dyn Error>> {
    let mut settings = ColonizationSettings { steps: 60, ..default() }.scaled(3.75);
    settings.arterial.terminal_radius *= 4.0;
    let artery = RootPlacement::Nearest(vec![0.5 * Vec3::NEG_Y]);
    let roots = RootPlacements { artery, vein: RootPlacement::None, ..default() };
    let mut growth = Colonization::new(Arc::new(Ball::new(Vec3::ZERO, 0.5)?), settings, &roots.into(), 3)?;
    growth.run();
    Ok(growth.tree(VesselKind::Artery).clone())
}

fn main() -> AppExit {
    let args = Args::parse();
    let Ok(scene) = Scene::new(&args).inspect_err(|error| eprintln!("{error}")) else {
        return AppExit::error();
    };
    App::new()
        .add_plugins(StudioPlugin { args: args.studio, title: "Surface", help: "W  edges", more_help: "" })
        .add_plugins(VesselPlugin::default())
        .insert_resource(scene)
        .add_systems(Startup, (spawn_both, spawn_close_ups).chain())
        .add_systems(Update, toggle_edges.run_if(resource_equals(View::Window)))
        .run()
}

fn spawn_both(mut commands: Commands, scene: Res<Scene>, mut meshes: VesselMeshes, mut shots: ResMut<Shots>) {
    let points = scene.tree.positions();
    let corners = points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)));
    let fit = to_unit_size(corners);
    let place = |x| Transform::from_translation(SIZE * fit.translation + x * Vec3::X).with_scale(SIZE * fit.scale);
    let organ = commands.spawn((place(-0.5), Visibility::default(), VesselAppearance::default())).id();
    let vessels = Vessels::from_tree(VesselKind::Artery, &scene.tree, &[]);
    commands.spawn((ChildOf(organ), VesselsOf(organ), vessels));
    let edges = (meshes.edges(&scene.mesh), Edges, Visibility::Hidden);
    commands.spawn((place(0.5), meshes.tissue(Mesh::from(&scene.mesh), BLOOD))).with_child(edges);
    // From afar, so that both are seen from the same side.
    let view = moved(&front_view(), &Transform::from_scale(Vec3::splat(1.75)));
    shots.0.push(Shot { file: "surface.png", view, field_of_view: 28.0, endoscope: false });
}

/// Large copies of the mesh far to the right, each with a sight in its middle.
fn spawn_close_ups(mut commands: Commands, scene: Res<Scene>, mut meshes: VesselMeshes, mut shots: ResMut<Shots>) {
    let worst = worst_lateral(&scene.tree, &scene.mesh);
    if let Some((_, distance)) = worst {
        println!("at joints the mesh is at most {:.0} % of a radius away from the vessels", 100.0 * distance);
    }
    let sights = [("surface_joint.png", widest_joint(&scene.tree)), ("surface_worst.png", worst.map(|worst| worst.0))];
    for (at, (file, sight)) in (1..).zip(sights) {
        let Some(Sight { center, radius, from }) = sight else { continue };
        let (target, scale) = (1e3 * at as f32 * Vec3::X, 1.0 / (Sight::DISTANCE * radius));
        let place = Transform::from_translation(target - scale * center).with_scale(Vec3::splat(scale));
        commands.spawn((place, meshes.tissue(Mesh::from(&scene.mesh), BLOOD))).with_child(meshes.edges(&scene.mesh));
        let view = Viewpoint { eye: target + from, target, up: from.any_orthonormal_vector() };
        shots.0.push(Shot { file, view, field_of_view: 45.0, endoscope: false });
    }
}

fn toggle_edges(keys: Res<ButtonInput<KeyCode>>, mut edges: Single<&mut Visibility, With<Edges>>) {
    if keys.just_pressed(KeyCode::KeyW) {
        edges.toggle_inherited_hidden();
    }
}
