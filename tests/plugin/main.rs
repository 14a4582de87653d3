//! The plugin in headless apps: no window, no renderer, no graphics card.
//!
//! These tests are built twice. In the target `plugin` small work is done at once and large work in the task pool, as
//! on a desktop. In `plugin_in_slices` all work is done in slices, as in a browser. The results must be the same, so no
//! test may rely on a job being done in the frame in which it begins.

mod budget;
mod changes;
mod circulation;
mod cutting;
mod deformation;
mod desktop;
mod entities;
mod errors;
mod generators;
mod growth;
mod held;
mod observers;
mod operating_field;
mod optimised;
mod paint;
mod picking;
mod presets;
mod registry;
mod scene;
mod scene_organs;
#[path = "../common/shared.rs"]
mod shared;
mod sharing;
mod sources;
mod splitting;
mod starting;
mod surface;
mod texture;
mod undo_limit;
mod units;
mod unseen;
mod warnings;

use bevy::{asset::AssetPlugin, ecs::message::MessageCursor, mesh::MeshPlugin, prelude::*};
use bevy_vessels::{
    VesselPlugin,
    plugin::{
        GrowthAction, GrowthBudget, GrowthCommand, GrowthPhase, GrowthPlugin, GrowthProgress, GrowthState, JobMode,
        JobSettings, OrganVessels, Vasculature, Vessels,
    },
    synthesis::{
        colonization::{Colonization, ColonizationSettings},
        preset::PresetName,
        roots::{RootPlacement, RootPlacements},
        tree::{VesselKind, VesselTree},
    },
};
use std::{
    thread,
    time::{Duration, Instant},
};

/// Steps of the growths in these tests.
const STEPS: u32 = 30;
/// The kinds of vessels that they have.
const KINDS: [VesselKind; 2] = Colonization::KINDS;

/// Whether all jobs of these apps are done in slices.
const IN_SLICES: bool = matches!(env!("CARGO_CRATE_NAME").as_bytes(), b"plugin_in_slices");

/// The settings of jobs in this target.
fn jobs() -> JobSettings {
    if IN_SLICES { JobSettings { mode: JobMode::Slices, at_once: 0, ..default() } } else { default() }
}

/// The smallest app that can grow vessels.
fn headless(budget: GrowthBudget) -> App {
    headless_with_assets(budget, AssetPlugin::default())
}

/// The same, with assets from elsewhere.
fn headless_with_assets(budget: GrowthBudget, assets: AssetPlugin) -> App {
    let mut app = App::new();
    let growth = GrowthPlugin::default().with_budget(budget);
    app.add_plugins((MinimalPlugins, assets, MeshPlugin, TransformPlugin, VesselPlugin { growth, ..default() }));
    app.insert_resource(jobs());
    app.finish();
    app.cleanup();
    app
}

/// Vessels that grow quickly.
fn quick() -> Vasculature {
    let artery = RootPlacement::Nearest(vec![Vec3::Y]);
    let mut vasculature =
        Vasculature::new(PresetName::Paper).with_roots(RootPlacements { artery, ..RootPlacements::default() });
    let settings = settings_of(&mut vasculature);
    settings.steps = STEPS;
    settings.samples = 500;
    vasculature
}

/// The settings of space colonization.
fn settings_of(vasculature: &mut Vasculature) -> &mut ColonizationSettings {
    vasculature.generator.colonization_mut().expect("it colonizes")
}

fn sphere() -> Mesh {
    Sphere::new(0.5).mesh().uv(32, 18)
}

fn add_mesh(app: &mut App, mesh: impl Into<Mesh>) -> Handle<Mesh> {
    app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh)
}

/// Spawns an organ with a sphere's mesh.
fn spawn(app: &mut App, vasculature: Vasculature) -> Entity {
    let mesh = add_mesh(app, sphere());
    app.world_mut().spawn((Mesh3d(mesh), vasculature)).id()
}

/// Runs frames until something holds.
#[track_caller]
fn run_until(app: &mut App, what: &str, mut holds: impl FnMut(&mut World) -> bool) {
    let start = Instant::now();
    while !holds(app.world_mut()) {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain: {what}");
        app.update();
        thread::sleep(Duration::from_millis(1));
    }
}

#[track_caller]
fn run_to_phase(app: &mut App, organ: Entity, phase: GrowthPhase) {
    run_until(app, &format!("{phase:?}"), |world| progress(world, organ).phase == phase);
}

fn progress(world: &World, organ: Entity) -> &GrowthProgress {
    world.get::<GrowthProgress>(organ).expect("an organ has progress")
}

fn send(app: &mut App, organ: Entity, action: GrowthAction) {
    app.world_mut().write_message(GrowthCommand::new(organ, action));
}

/// Collects messages over frames.
fn drain<M: Message + Clone>(world: &World, cursor: &mut MessageCursor<M>) -> Vec<M> {
    cursor.read(world.resource::<Messages<M>>()).cloned().collect()
}

/// The vessel entity of a kind of an organ.
fn vessel_entity(world: &World, organ: Entity, kind: VesselKind) -> Option<Entity> {
    let vessels = world.get::<OrganVessels>(organ)?;
    let is_of_kind = |entity| world.get::<Vessels>(entity).is_some_and(|vessels| vessels.kind() == kind);
    vessels.entities().iter().copied().find(|&entity| is_of_kind(entity))
}

/// A copy of the published vessels of a kind.
fn published(world: &World, organ: Entity, kind: VesselKind) -> Vessels {
    let entity = vessel_entity(world, organ, kind).expect("the kind has vessels");
    world.get::<Vessels>(entity).expect("a vessel entity has vessels").clone()
}

fn trees(world: &World, organ: Entity) -> [VesselTree; 2] {
    KINDS.map(|kind| published(world, organ, kind).tree().clone())
}

/// A tree with changed positions and radii, and more nodes.
fn edited(tree: &VesselTree, edit: impl FnOnce(&mut Vec<Vec3>, &mut Vec<u32>, &mut Vec<f32>)) -> VesselTree {
    let (mut positions, mut parents, mut radii) =
        (tree.positions().to_vec(), tree.parents().to_vec(), tree.radii().to_vec());
    edit(&mut positions, &mut parents, &mut radii);
    VesselTree::from_arrays(positions, parents, radii).expect("parents come first")
}

/// Asserts that the published vessels equal those of the growth, node by node.
#[track_caller]
fn assert_published(world: &World, organ: Entity) {
    let state = world.get::<GrowthState>(organ).expect("an organ has a state");
    let growth = state.growth().expect("the growth has started");
    for kind in KINDS {
        let (vessels, grown) = (published(world, organ, kind), growth.trees()[kind].expect("the kind grows"));
        assert_eq!(vessels.tree(), &grown.vessels(), "{}", kind.name());
        assert_eq!(vessels.birth_steps(), grown.birth_steps);
        let (min, max) = (vessels.aabb().min(), vessels.aabb().max());
        for (position, radius) in vessels.tree().positions().iter().zip(vessels.tree().radii()) {
            let position = Vec3A::from(*position);
            assert!((position - *radius).cmpge(min - 1e-5).all() && (position + *radius).cmple(max + 1e-5).all());
        }
    }
}
