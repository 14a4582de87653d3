//! Stems from L-systems as closed meshes: the four-sided cage, and what one and two subdivisions make of it.
//!
//! This is the method of Skjermo & Eidheim (2005) as in their Fig. 5. Turn the stems with the left mouse button, move
//! them with the right, zoom with the wheel.
//!
//! | key | |
//! |---|---|
//! | `1`, `2`, `3` | stem, binary tree, monopodial tree |
//! | ↑, ↓ | one generation more, fewer |
//! | `W` | edges of the cage |
//!
//! `--headless --out DIR` writes `lsystem_tree.png` instead, which is also the behaviour without a display.

#[path = "lsystem_tree/mod.rs"]
mod lsystem_tree;
#[path = "common/scene.rs"]
mod scene;
#[path = "common/vessel_mesh.rs"]
mod vessel_mesh;

use bevy::prelude::*;
use bevy_vessels::{
    VesselPlugin,
    synthesis::{
        surface::{Surface, SurfaceSettings},
        tree::VesselTree,
    },
};
use clap::Parser;
use lsystem_tree::{error::LSystemError, presets::PRESETS};
use scene::{
    photo::{Shot, Shots},
    studio::{StatusLine, StudioArgs, StudioPlugin, View, front_view, moved, to_unit_size},
};
use vessel_mesh::VesselMeshes;

const HELP: &str = "1 2 3  stem, binary, monopodial\nup down  generations";
const MORE_HELP: &str = "W  edges of the cage";
/// Most width and height of a stem, for the studio's view to hold three of them.
const MOST: Vec2 = Vec2::new(0.57, 1.1);
const BARK: Color = Color::srgb(0.62, 0.45, 0.32);

/// Stems from L-systems as closed meshes.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Number of the preset: 1 stem, 2 binary, 3 monopodial.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    preset: u8,
    /// Generations of rewriting. Default: the preset's.
    #[arg(long)]
    generations: Option<u32>,
}

/// What is shown.
#[derive(Resource, Clone, Copy)]
struct Chosen {
    preset: usize,
    generations: u32,
    edges: bool,
}

impl Chosen {
    fn tree(&self) -> Result<VesselTree, LSystemError> {
        PRESETS[self.preset].tree(self.generations)
    }
}

#[derive(Component)]
struct Stem;

fn main() -> AppExit {
    let args = Args::parse();
    let preset = usize::from(args.preset) - 1;
    let generations = args.generations.unwrap_or(PRESETS[preset].generations);
    let chosen = Chosen { preset, generations, edges: true };
    if let Err(error) = chosen.tree() {
        eprintln!("--generations {generations}: {error}");
        return AppExit::error();
    }
    App::new()
        .add_plugins(StudioPlugin { args: args.studio, title: "Stems", help: HELP, more_help: MORE_HELP })
        .add_plugins(VesselPlugin::default())
        .insert_resource(chosen)
        .add_systems(Startup, (show, request_picture))
        .add_systems(Update, (choose, show.run_if(resource_changed::<Chosen>)).chain().run_if(in_window))
        .run()
}

fn in_window(view: Res<View>) -> bool {
    *view == View::Window
}

fn request_picture(mut shots: ResMut<Shots>) {
    // From afar, so that all three are seen from the same side.
    let view = moved(&front_view(), &Transform::from_scale(Vec3::splat(1.75)));
    shots.0 = vec![Shot { file: "lsystem_tree.png", view, field_of_view: 28.0, endoscope: false }];
}

fn choose(keys: Res<ButtonInput<KeyCode>>, mut chosen: ResMut<Chosen>) {
    for (preset, key) in [KeyCode::Digit1, KeyCode::Digit2, KeyCode::Digit3].into_iter().enumerate() {
        if keys.just_pressed(key) {
            *chosen = Chosen { preset, generations: PRESETS[preset].generations, ..*chosen };
        }
    }
    let mut other = *chosen;
    other.edges ^= keys.just_pressed(KeyCode::KeyW);
    other.generations += u32::from(keys.just_pressed(KeyCode::ArrowUp));
    other.generations = other.generations.saturating_sub(u32::from(keys.just_pressed(KeyCode::ArrowDown)));
    let differs = (other.generations, other.edges) != (chosen.generations, chosen.edges);
    // Some hundred thousand segments take seconds.
    if differs && other.tree().is_ok_and(|tree| tree.len() < 20_000) {
        *chosen = other;
    }
}

/// Three levels of the chosen tree's surface, side by side.
fn show(
    mut commands: Commands,
    chosen: Res<Chosen>,
    mut meshes: VesselMeshes,
    mut status: ResMut<StatusLine>,
    before: Query<Entity, With<Stem>>,
) -> Result {
    before.iter().for_each(|stem| commands.entity(stem).despawn());
    let tree = chosen.tree()?;
    let points = tree.positions();
    let (low, high) = points.iter().fold((points[0], points[0]), |(a, b), &p| (a.min(p), b.max(p)));
    let fit = to_unit_size((low, high));
    let shrink = (MOST / (fit.scale * (high - low)).truncate()).min_element();
    for level in 0..3 {
        let settings = SurfaceSettings { level, most_sides: 4, least_sides: 4, ..default() };
        let mesh = Surface::new(&tree, &settings)?.mesh;
        let aside = Vec3::X * MOST.x * (level as f32 - 1.0);
        let place = Transform::from_translation(shrink * fit.translation + aside).with_scale(shrink * fit.scale);
        let mut faces = Mesh::from(&mesh);
        if level == 0 {
            faces = faces.with_duplicated_vertices().with_computed_flat_normals();
        }
        let mut stem = commands.spawn((Stem, place, meshes.tissue(faces, BARK)));
        if level == 0 && chosen.edges {
            stem.with_child(meshes.edges(&mesh));
        }
    }
    let name = PRESETS[chosen.preset].name;
    status.0 = format!("{name}, generation {}, {} segments: levels 0, 1, 2", chosen.generations, tree.len() - 1);
    Ok(())
}
