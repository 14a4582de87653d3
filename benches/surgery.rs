//! Time of a frame, without drawing, in which vessels are cut, bleed, and follow a deforming organ.
//!
//! `cargo bench --bench surgery -- [SEGMENTS]` prints the wall time of all systems of a frame in milliseconds, least,
//! median and most, for a quarter, a half and all of the segments. This shows costs that grow faster than the organ.

use bevy::{
    asset::AssetPlugin,
    mesh::{MeshPlugin, VertexAttributeValues},
    prelude::*,
    time::TimeUpdateStrategy,
};
use bevy_vessels::{
    VesselPlugin,
    plugin::{
        BloodLoss, CirculationState, CuttableVessels, FollowsMesh, OpenEnd, OrganSupply, Perfusion, StrokeId,
        VesselIndex, Vessels, VesselsOf,
    },
    synthesis::{
        haemodynamics::{Pulse, RootPressure},
        tree::{NO_PARENT, VesselKind, VesselTree},
        units::Scale,
        wound::Blade,
    },
};
use std::{
    f32::consts::TAU,
    thread::sleep,
    time::{Duration, Instant},
};

const FRAME: Duration = Duration::from_millis(16);
const FRAMES: usize = 60;
/// Rows and columns of the organ's mesh.
const SECTORS: u32 = 170;

fn main() {
    let segments = std::env::args().filter_map(|arg| arg.parse().ok()).next().unwrap_or(100_000);
    for share in [4, 2, 1] {
        operate(segments / share);
    }
}

fn operate(segments: usize) {
    let (mut app, organ) = organ(segments);
    report(segments, "whole, at rest", &measure(&mut app, |_, _| {}));
    let stroke = StrokeId::begin();
    report(segments, "a sweep of 2 mm each frame", &measure(&mut app, |world, frame| sweep(world, stroke, frame)));
    report(segments, "bleeding", &measure(&mut app, |_, _| {}));
    report(segments, "bleeding, and breathing", &measure(&mut app, |world, frame| breathe(world, organ, frame)));
    let both = |world: &mut World, frame| {
        sweep(world, stroke, FRAMES + frame);
        breathe(world, organ, frame);
    };
    report(segments, "the same, and cut", &measure(&mut app, both));
    tell(&mut app);
    let slash = |app: &mut App, slashes: usize| {
        measure(app, |world, frame| {
            for number in 0..if frame == 0 { slashes } else { 0 } {
                let normal = Vec3::new(0.2, ops::cos(number as f32 * 0.1), ops::sin(number as f32 * 0.1));
                let disc = Blade::disc(Vec3::ZERO, normal, 1.0).expect("a disc has an area");
                world.resource_mut::<CuttableVessels>().cut(disc);
            }
        })
    };
    for (slashes, what) in [(1, "cut through the middle"), (30, "30 such cuts at once")] {
        report(segments, what, &slash(&mut app, slashes));
        tell(&mut app);
    }
    let undone = measure(&mut app, |world, frame| {
        if frame == 0 {
            world.resource_mut::<CuttableVessels>().undo_all();
        }
    });
    report(segments, "all undone", &undone);
}

/// An app without a window, and a ball of 0.2 m with vessels on it, with all jobs done.
fn organ(segments: usize) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin, VesselPlugin::default()));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
    app.finish();
    app.cleanup();
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Sphere::new(0.1).mesh().uv(SECTORS, SECTORS));
    let arterial_pressure = RootPressure::Pulsatile(Pulse::default());
    let blood = Perfusion { scale: Some(Scale::METRES), arterial_pressure, ..default() };
    let organ = (Mesh3d(mesh), Transform::default(), Visibility::default(), blood, FollowsMesh);
    let organ = app.world_mut().spawn(organ).id();
    let vessels = Vessels::from_tree(VesselKind::Artery, &tree(segments), &[]);
    let vessels = app.world_mut().spawn((ChildOf(organ), VesselsOf(organ), vessels)).id();
    let is_ready = |world: &World| {
        let (index, tree) = (world.get::<VesselIndex>(vessels), world.get::<Vessels>(vessels));
        let is_indexed = index.zip(tree).is_some_and(|(index, tree)| index.is_complete(tree));
        let flows = world.get::<CirculationState>(organ).is_some_and(CirculationState::flows);
        is_indexed && flows && world.get::<OrganSupply>(organ).is_some_and(|supply| !supply.vertices.is_empty())
    };
    while !is_ready(app.world()) {
        app.update();
        sleep(Duration::from_millis(5));
    }
    // jobs also bind vessels to the organ
    measure(&mut app, |world, frame| breathe(world, organ, frame));
    (app, organ)
}

/// Vessels over a ball that branch in two, each with half of its parent's piece of skin.
fn tree(segments: usize) -> VesselTree {
    let depth = |node: usize| (node + 1).ilog2();
    let radius = |node: usize| 0.0012 * ops::exp2(-(depth(node) as f32) / 3.0);
    // Longitude and latitude of each piece: from, to.
    let mut pieces = vec![[[0.0, TAU], [-1.2, 1.2]]];
    let place = |[longitude, latitude]: [[f32; 2]; 2]| {
        let [longitude, latitude] = [longitude, latitude].map(|[from, to]| 0.5 * (from + to));
        let (level, height) = (ops::cos(latitude), ops::sin(latitude));
        0.101 * Vec3::new(level * ops::cos(longitude), height, level * ops::sin(longitude))
    };
    let (mut positions, mut parents) = (vec![place(pieces[0])], vec![NO_PARENT]);
    for node in 1..=segments {
        let parent = (node - 1) / 2;
        let mut piece = pieces[parent];
        let [from, to] = piece[depth(parent) as usize % 2];
        let middle = 0.5 * (from + to);
        piece[depth(parent) as usize % 2] = if node % 2 == 0 { [from, middle] } else { [middle, to] };
        positions.push(place(piece));
        parents.push(parent as u32);
        pieces.push(piece);
    }
    let radii = (0..=segments).map(radius).collect();
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

/// Moves a scalpel around the ball.
fn sweep(world: &mut World, stroke: StrokeId, frame: usize) {
    let edge = |frame: usize| {
        let angle = 0.02 * frame as f32;
        let out = Vec3::new(ops::cos(angle), 0.3, ops::sin(angle)).normalize();
        [0.12 * out, 0.095 * out]
    };
    let blade = Blade::sweep(edge(frame), edge(frame + 1)).expect("the edge moves");
    world.resource_mut::<CuttableVessels>().in_stroke(stroke).cut(blade);
}

/// Moves all vertices of an organ's mesh.
fn breathe(world: &mut World, organ: Entity, frame: usize) {
    let id = world.get::<Mesh3d>(organ).expect("the organ has a mesh").id();
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let mut mesh = meshes.get_mut(id).expect("the mesh is there");
    if let Some(VertexAttributeValues::Float32x3(positions)) = mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION) {
        let push = 0.0001 * ops::cos(frame as f32 * 0.1);
        positions.iter_mut().for_each(|[x, y, _]| *y += push * (1.0 + *x));
    }
}

/// Time of all systems in each frame, in milliseconds.
fn measure(app: &mut App, mut change: impl FnMut(&mut World, usize)) -> Vec<f64> {
    let frame = |frame| {
        change(app.world_mut(), frame);
        let clock = Instant::now();
        app.update();
        clock.elapsed().as_secs_f64() * 1000.0
    };
    (0..FRAMES).map(frame).collect()
}

fn report(segments: usize, what: &str, times: &[f64]) {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (least, median, most) = (sorted[0], sorted[sorted.len() / 2], sorted[sorted.len() - 1]);
    println!(
        "{segments:>7} {what:<28} first {:8.3}, least {least:8.3}, median {median:8.3}, most {most:8.3} ms",
        times[0]
    );
}

/// Prints the number of open ends.
fn tell(app: &mut App) {
    let world = app.world_mut();
    let ends = world.query::<&OpenEnd>().iter(world).len();
    let bleeding: usize = world.query::<&BloodLoss>().iter(world).map(|loss| loss.bleeding_ends).sum();
    println!("{ends:>15} open ends, of which {bleeding} bleed");
}
