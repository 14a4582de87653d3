//! CPU time of a frame in main and render world: an empty scene, a million segments at rest, and as they grow.
//!
//! `cargo bench --bench idle -- [SEGMENTS]` prints milliseconds, the mean of many frames. On Linux that is the time that the
//! threads of the app have been at work, a software driver's own threads left out; elsewhere, time on the clock. Any adapter
//! will do: each frame begins when the last one has been drawn. One camera, one light with shadows in four cascades; the
//! vessels are far away, so that a software driver has little to draw, but all chunks are drawn in all views.

#[expect(dead_code, reason = "no pictures are written here")]
#[path = "../examples/common/headless.rs"]
mod headless;

use bevy::{
    camera::RenderTarget,
    log::LogPlugin,
    prelude::*,
    render::{RenderApp, render_resource::PollType, renderer::RenderDevice},
};
use bevy_vessels::{
    VesselPlugin,
    plugin::{SegmentChanges, VesselAppearance, VesselSystem, Vessels, VesselsOf},
    render::SegmentChunk,
    synthesis::tree::{NO_PARENT, System, VesselTree},
};
use headless::{HOW_TO_GET_PICTURES, OffscreenPlugin, OffscreenTarget, find_adapter, headless_plugins};
use std::time::{Duration, Instant};

const FRAMES: u32 = 60;
const WARM_UP: u32 = 10;

fn main() {
    if find_adapter().is_none() {
        println!("{HOW_TO_GET_PICTURES}");
        return;
    }
    let segments = std::env::args().filter_map(|arg| arg.parse().ok()).next().unwrap_or(1_000_000);
    let mut app = scene();
    report("empty", &measure(&mut app, |_| {}));
    let vessels = spawn_vessels(&mut app, segments);
    report(&format!("{segments} segments, idle"), &measure(&mut app, |_| {}));
    let world = app.world_mut();
    println!("{} chunk entities", world.query::<&SegmentChunk>().iter(world).len());
    // what a step changes in a large tree: a tenth of its segments, scattered
    let growing = measure(&mut app, |world| {
        let mut changes = world.get_mut::<SegmentChanges>(vessels).expect("required by the system");
        (0..segments).step_by(10).for_each(|node| changes.mark_node(node));
    });
    report("a tenth of them changed", &growing);
}

/// A camera, a light with shadows, and nothing to see.
fn scene() -> App {
    let mut app = App::new();
    app.add_plugins((
        headless_plugins(true).disable::<LogPlugin>(),
        OffscreenPlugin { size: UVec2::splat(64) },
        VesselPlugin::default(),
    ));
    app.finish();
    app.cleanup();
    let target = app.world().resource::<OffscreenTarget>().0.clone();
    let place = Transform::from_xyz(0.0, 0.0, 40.0);
    app.world_mut().spawn((Camera3d::default(), RenderTarget::from(target), place));
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    app.world_mut().spawn((light, Transform::from_xyz(1.0, 2.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y)));
    app
}

/// One vessel that winds through a ball, so that every chunk reaches everywhere, as in an organ.
fn spawn_vessels(app: &mut App, segments: usize) -> Entity {
    let place = |node: usize| {
        let turn = node as f32 * 2.399_963;
        let height = (node as f32 * 0.618_034).fract() * 2.0 - 1.0;
        Vec3::new(turn.cos(), height, turn.sin()) * 0.7
    };
    let positions = (0..=segments).map(|node| if node % 2 == 0 { place(node) } else { place(node - 1) * 0.99 });
    let parents = (0..=segments as u32).map(|node| node.checked_sub(1).unwrap_or(NO_PARENT)).collect();
    let tree = VesselTree::from_arrays(positions.collect(), parents, vec![1e-4; segments + 1]).expect("well-formed");
    let world = app.world_mut();
    let organ = world.spawn((Transform::default(), Visibility::default(), VesselAppearance::default())).id();
    let vessels = Vessels::from_tree(&tree, &[]);
    world.spawn((ChildOf(organ), VesselsOf(organ), VesselSystem(System::Arterial), vessels)).id()
}

/// Mean times of main world, extraction and render world.
type Times = [Duration; 3];

fn measure(app: &mut App, mut change: impl FnMut(&mut World)) -> Times {
    let mut times = Times::default();
    for frame in 0..WARM_UP + FRAMES {
        change(app.world_mut());
        let taken = update(app);
        if frame >= WARM_UP {
            times.iter_mut().zip(taken).for_each(|(time, taken)| *time += taken);
        }
    }
    times.map(|time| time / FRAMES)
}

/// [`App::update`], with a clock, and a wait for the driver at the end.
fn update(app: &mut App) -> Times {
    let clock = Instant::now();
    let now = || time_at_work().unwrap_or_else(|| clock.elapsed());
    let apps = app.sub_apps_mut();
    let start = now();
    apps.main.run_default_schedule();
    let mut taken = [now() - start, Duration::ZERO, Duration::ZERO];
    for sub_app in apps.sub_apps.values_mut() {
        let start = now();
        sub_app.extract(apps.main.world_mut());
        let extracted = now();
        sub_app.update();
        taken[1] += extracted - start;
        taken[2] += now() - extracted;
    }
    apps.main.world_mut().clear_trackers();
    let device = app.sub_app(RenderApp).world().resource::<RenderDevice>();
    device.poll(PollType::wait_indefinitely()).expect("the device draws");
    taken
}

/// Time that all threads but those of a software driver have been running, where the system tells.
fn time_at_work() -> Option<Duration> {
    let mut nanoseconds = 0;
    for thread in std::fs::read_dir("/proc/self/task").ok()? {
        let thread = thread.ok()?.path();
        let name = std::fs::read_to_string(thread.join("comm")).ok()?;
        if !["llvmpipe", "lvp", "vk"].iter().any(|driver| name.starts_with(driver)) {
            let times = std::fs::read_to_string(thread.join("schedstat")).ok()?;
            nanoseconds += times.split(' ').next()?.parse::<u64>().ok()?;
        }
    }
    Some(Duration::from_nanos(nanoseconds))
}

fn report(what: &str, times: &Times) {
    let [main, extract, render] = times.map(|time| time.as_secs_f64() * 1000.0);
    let sum = main + extract + render;
    println!("{what}: main {main:.3}, extract {extract:.3}, render {render:.3}, sum {sum:.3} ms");
}
