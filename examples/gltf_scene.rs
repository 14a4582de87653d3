//! Organs in the scene of a glTF file: meshes with a name get vessels, wherever in the scene they are.
//!
//! `--glb FILE --name NAME` takes a file of your own, about one metre large; without it, the example writes one with a
//! liver and its cast. Keys as on the screen. `--headless --out DIR` writes `gltf_scene.png`, which is also the
//! behaviour without a display.

mod common;

use bevy::{prelude::*, world_serialization::WorldAssetRoot};
use bevy_vessels::{
    plugin::VasculatureOfScene,
    prelude::*,
    synthesis::{mesh::ShadedMesh, organ::LiverSettings},
};
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, OrganAssets},
    photo::{Shot, Shots},
    studio::{StudioArgs, StudioPlugin, front_view, moved, to_unit_size},
};
use serde_json::json;
use std::{fs, path::PathBuf};

/// Organs in the scene of a glTF file.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// A GLB or glTF file.
    #[arg(long)]
    glb: Option<PathBuf>,
    /// Name of the nodes or meshes that get vessels.
    #[arg(long, default_value = "liver")]
    name: String,
    /// Seed of the networks.
    #[arg(long, default_value_t = 3)]
    seed: u64,
}

fn main() -> AppExit {
    let args = Args::parse();
    App::new()
        .add_plugins(StudioPlugin { args: args.studio.clone(), title: "glTF scene", help: HELP, more_help: "" })
        .add_plugins((VesselPlugin::default(), ControlsPlugin))
        .insert_resource(args)
        .add_systems(Startup, spawn_scene)
        .add_observer(request_picture)
        .run()
}

fn spawn_scene(mut commands: Commands, args: Res<Args>, server: Res<AssetServer>, mut assets: OrganAssets) -> Result {
    let path = match &args.glb {
        Some(path) => path.clone(),
        None => write_scene()?,
    };
    let vessels = Vasculature::new(PresetName::Colon).with_seed(args.seed);
    commands.spawn((
        WorldAssetRoot(server.load(format!("{}#Scene0", path.display()))),
        VasculatureOfScene::new(vessels).named([args.name.clone()]),
    ));
    // What is no part of the scene has no vessels.
    let below = Transform::from_xyz(0.0, -0.5, 0.0);
    assets.spawn(&mut commands, Sphere::new(0.06).into(), Color::srgb(0.8, 0.78, 0.74), below);
    Ok(())
}

/// The scene has been spawned, and an organ in it grows.
fn request_picture(_: On<Add, Vasculature>, mut shots: ResMut<Shots>) {
    if shots.0.is_empty() {
        let view = moved(&front_view(), &Transform::from_scale(Vec3::splat(1.3)));
        shots.0.push(Shot { file: "gltf_scene.png", view, field_of_view: 40.0, endoscope: false });
    }
}

/// Writes a scene with two nodes that share the mesh of a liver, and returns its file.
fn write_scene() -> Result<PathBuf> {
    let liver = LiverSettings::default().generate()?.mesh;
    let fit = to_unit_size(liver.bounds());
    let place = |x: f32| (fit.translation + x * Vec3::X).to_array();
    let node =
        |name, mesh, x| json!({ "name": name, "mesh": mesh, "translation": place(x), "scale": fit.scale.to_array() });
    let path = std::env::temp_dir().join(format!("bevy_vessels_scene_{}.glb", std::process::id()));
    fs::write(&path, glb(&liver, json!([node("liver", 0, -0.55), node("cast", 1, 0.55)])))?;
    Ok(path)
}

/// A binary glTF file with some nodes, and one mesh of flesh and another one of plaster.
fn glb(mesh: &ShadedMesh, nodes: serde_json::Value) -> Vec<u8> {
    let floats =
        |values: &[Vec3]| values.iter().flat_map(|value| value.to_array()).flat_map(f32::to_le_bytes).collect();
    let indices = mesh.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
    let parts: [Vec<u8>; 3] = [floats(&mesh.positions), floats(&mesh.normals), indices];
    let starts = [0, parts[0].len(), parts[0].len() + parts[1].len()];
    let views: Vec<_> =
        (0..3).map(|i| json!({ "buffer": 0, "byteOffset": starts[i], "byteLength": parts[i].len() })).collect();
    let (low, high) = mesh.bounds();
    let vertices = mesh.positions.len();
    let primitive =
        |material| json!({ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2, "material": material });
    let look = |color: [f32; 4]| json!({ "baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": 0.45 });
    let material = |color| json!({ "pbrMetallicRoughness": look(color) });
    let document = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": nodes,
        "meshes": [{ "primitives": [primitive(0)] }, { "primitives": [primitive(1)] }],
        "materials": [material([0.45, 0.12, 0.09, 1.0]), material([0.8, 0.78, 0.74, 1.0])],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
              "min": low.to_array(), "max": high.to_array() },
            { "bufferView": 1, "componentType": 5126, "count": vertices, "type": "VEC3" },
            { "bufferView": 2, "componentType": 5125, "count": 3 * mesh.triangles.len(), "type": "SCALAR" },
        ],
        "bufferViews": views,
        "buffers": [{ "byteLength": parts.concat().len() }],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let data = parts.concat();
    let chunk = |kind: &[u8; 4], content: &[u8]| [&(content.len() as u32).to_le_bytes(), &kind[..], content].concat();
    let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", &data)].concat();
    [b"glTF", &2u32.to_le_bytes()[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
}
