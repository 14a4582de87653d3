//! CPU time of a frame in main and render world: an empty scene, and a million segments at rest and growing.
//!
//! `cargo bench --bench idle -- [SEGMENTS]` prints milliseconds, as medians of many frames, and the differences to an
//! empty scene, frame by frame. Two apps run in turn, and each measured frame follows one with vessels, so that both
//! meet the same machine, and caches that a software driver has emptied.
//!
//! Times are CPU times of all threads together, so other load on the machine and waiting for a graphics card don't
//! count. Any adapter will do. The driver's work on a frame's commands, once all are submitted, has its own column: a
//! software driver draws then, within the submitting call and on its own threads. On a graphics card that column is the
//! cost of submitting.
//!
//! There is one camera and one light with shadows in four cascades. The vessels are far away, so that a software driver
//! has little to draw, but all chunks are drawn in all views.

#[expect(dead_code, reason = "no pictures are written here")]
#[path = "../examples/common/headless.rs"]
mod headless;

use bevy::{
    camera::RenderTarget,
    log::LogPlugin,
    prelude::*,
    render::{
        RenderApp,
        render_resource::PollType,
        renderer::{RenderDevice, RenderGraph, RenderGraphSystems},
    },
};
use bevy_vessels::{
    VesselPlugin,
    plugin::{ChangeLog, VesselAppearance, Vessels, VesselsOf},
    render::SegmentChunk,
    synthesis::tree::{NO_PARENT, VesselKind, VesselTree},
};
use cpu_time::ProcessTime;
use headless::{HOW_TO_GET_PICTURES, OffscreenPlugin, OffscreenTarget, find_adapter, headless_plugins};
use std::time::Duration;

const FRAMES: usize = 100;
const WARM_UP: usize = 10;

fn main() {
    if find_adapter().is_none() {
        println!("{HOW_TO_GET_PICTURES}");
        return;
    }
    let segments = std::env::args().filter_map(|arg| arg.parse().ok()).next().unwrap_or(1_000_000);
    let (mut empty, mut full) = (scene(), scene());
    let vessels = spawn_vessels(&mut full, segments);
    let idle = measure([&mut empty, &mut full], |_| {});
    // the changes of a step in a large tree: a tenth of its segments, scattered
    let growing = measure([&mut empty, &mut full], |world| {
        let mut log = world.get_mut::<ChangeLog>(vessels).expect("required by vessels");
        log.mark((0..segments).step_by(10));
    });
    let world = full.world_mut();
    println!("{segments} segments in {} chunk entities", world.query::<&SegmentChunk>().iter(world).len());
    println!("{:24}{:>9}{:>9}{:>9}{:>9}{:>9}", "ms", "main", "extract", "render", "sum", "driver");
    report("empty", &idle[0]);
    report("at rest", &idle[1]);
    report("more than empty", &differences(&idle));
    report("a tenth of them changed", &growing[1]);
    report("more than empty", &differences(&growing));
}

/// A camera, a light with shadows, and an empty scene.
fn scene() -> App {
    let mut app = App::new();
    app.add_plugins((
        headless_plugins(true).disable::<LogPlugin>(),
        OffscreenPlugin { size: UVec2::splat(64) },
        VesselPlugin::default(),
    ));
    app.finish();
    app.cleanup();
    time_submission(&mut app);
    let target = app.world().resource::<OffscreenTarget>().0.clone();
    let place = Transform::from_xyz(0.0, 0.0, 40.0);
    app.world_mut().spawn((Camera3d::default(), RenderTarget::from(target), place));
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    app.world_mut().spawn((light, Transform::from_xyz(1.0, 2.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y)));
    app
}

/// One vessel that winds through a ball, so that every chunk spans the whole ball, as in an organ.
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
    let vessels = Vessels::from_tree(VesselKind::Artery, &tree, &[]);
    world.spawn((ChildOf(organ), VesselsOf(organ), vessels)).id()
}

/// Times of a frame in milliseconds, in the order of the columns.
type Times = [f64; 5];

/// Times of frames of an empty and a full app. `change` prepares each frame of the full one.
fn measure([empty, full]: [&mut App; 2], mut change: impl FnMut(&mut World)) -> [Vec<Times>; 2] {
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..WARM_UP + FRAMES {
        times[0].push(update(empty));
        change(full.world_mut());
        update(full);
        change(full.world_mut());
        times[1].push(update(full));
    }
    times.map(|mut times| times.split_off(WARM_UP))
}

/// [`App::update`], with a clock.
fn update(app: &mut App) -> Times {
    let apps = app.sub_apps_mut();
    let start = ProcessTime::now();
    apps.main.run_default_schedule();
    let [mut extract, mut render] = [Duration::ZERO; 2];
    let main = start.elapsed();
    for sub_app in apps.sub_apps.values_mut() {
        let start = ProcessTime::now();
        sub_app.extract(apps.main.world_mut());
        extract += start.elapsed();
        let start = ProcessTime::now();
        sub_app.update();
        render += start.elapsed();
    }
    apps.main.world_mut().clear_trackers();
    let submission = app.sub_app(RenderApp).world().resource::<Submission>().taken;
    let render = render - submission;
    [main, extract, render, main + extract + render, submission].map(|time| time.as_secs_f64() * 1000.0)
}

/// Time that the driver took for the last frame.
#[derive(Resource)]
struct Submission {
    begin: ProcessTime,
    taken: Duration,
}

/// Measures the time from submitting the frame's commands until all have been carried out. A software driver draws
/// within that call and on its own threads, and is idle in the rest of the frame.
fn time_submission(app: &mut App) {
    let begin = |mut submission: ResMut<Submission>| submission.begin = ProcessTime::now();
    let end = |mut submission: ResMut<Submission>, device: Res<RenderDevice>| {
        device.poll(PollType::wait_indefinitely()).expect("the device draws");
        submission.taken = submission.begin.elapsed();
    };
    app.sub_app_mut(RenderApp)
        .insert_resource(Submission { begin: ProcessTime::now(), taken: Duration::ZERO })
        .add_systems(
            RenderGraph,
            (
                begin.after(RenderGraphSystems::Render).before(RenderGraphSystems::Submit),
                end.after(RenderGraphSystems::Submit).before(RenderGraphSystems::Finish),
            ),
        );
}

/// Time by which each frame of the second app exceeds the corresponding frame of the first.
fn differences([empty, full]: &[Vec<Times>; 2]) -> Vec<Times> {
    let difference = |(empty, full): (&Times, &Times)| std::array::from_fn(|column| full[column] - empty[column]);
    empty.iter().zip(full).map(difference).collect()
}

/// Prints the median of each column.
fn report(what: &str, frames: &[Times]) {
    print!("{what:24}");
    for column in 0..5 {
        let mut times: Vec<f64> = frames.iter().map(|times| times[column]).collect();
        times.sort_unstable_by(f64::total_cmp);
        print!("{:9.3}", times[times.len() / 2]);
    }
    println!();
}
