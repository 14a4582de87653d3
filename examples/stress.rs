//! Many organs grow at once within one time budget per frame; the costs are printed at the end.
//!
//! You see discs on which arteries and veins spread, all at the same pace. Turn them with the left mouse button, move them
//! with the right, zoom with the wheel.
//!
//! | key | |
//! |---|---|
//! | space | pause, resume |
//! | `.` | one step |
//! | `N` | the next seeds |
//! | `A`, `V`, `C` | arteries, veins, colours |
//!
//! `--headless` grows them without window and renderer, and then exits:
//! `cargo run --release --example stress -- --headless --organs 100 --budget 2`.

#[expect(dead_code, reason = "other examples share more")]
mod common;

use bevy::prelude::*;
use bevy_vessels::{
    plugin::{GrowthFrame, GrowthPlugin},
    prelude::*,
};
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, OrganAssets, tell},
    headless::headless_plugins,
    studio::{StatusLine, StudioArgs, StudioPlugin, View, has_display},
};
use std::time::Duration;

/// Many organs grow at once.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Number of organs.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    organs: u32,
    /// Milliseconds that the growth of all organs may take in each frame.
    #[arg(long, default_value_t = 2.0)]
    budget: f32,
    /// Factor for the lengths of the paper's settings: smaller values give more nodes. The default gives about 6,000.
    #[arg(long, default_value_t = 0.75)]
    lengths: f32,
}

/// Times of frames in which something grew.
#[derive(Resource, Default)]
struct Record {
    growth: Vec<Duration>,
    frames: Vec<Duration>,
    /// Steps of the slowest organ when the first one had finished.
    slowest: Option<u32>,
    told: bool,
}

fn main() -> AppExit {
    let args = Args::parse();
    let budget = GrowthBudget::Time(Duration::from_secs_f32(args.budget.clamp(0.0, 1e3) / 1e3));
    let growth = GrowthPlugin::default().with_budget(budget);
    let mut app = App::new();
    if args.studio.headless || !has_display() {
        app.add_plugins(headless_plugins(false)).insert_resource(View::Nothing);
    } else {
        let (studio, title) = (args.studio.clone(), "Many organs");
        app.add_plugins(StudioPlugin { args: studio, title, help: HELP, more_help: "N  next seeds" });
        app.add_plugins(ControlsPlugin).add_systems(Update, (next_seeds, tell_times.after(tell)));
    }
    app.add_plugins(VesselPlugin { growth, ..default() })
        .init_resource::<Record>()
        .insert_resource(args)
        .add_systems(Startup, spawn_organs)
        .add_systems(Last, (record, finish).chain())
        .run()
}

/// Discs in rows, within one unit.
fn spawn_organs(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets) {
    let in_row = (args.organs as f32).sqrt().ceil();
    for organ in 0..args.organs {
        let (column, row) = (organ as f32 % in_row, (organ as f32 / in_row).floor());
        let place = Vec3::new(column + 0.5 - 0.5 * in_row, 0.5 * in_row - row - 0.5, 0.0) / in_row;
        let place = Transform::from_translation(place).with_scale(Vec3::splat(0.9 / in_row));
        let disc = Circle::new(0.5).mesh().resolution(64).build();
        let mut vessels = Vasculature::new(PresetName::Paper).with_seed(u64::from(organ));
        vessels.roots.artery = RootPlacement::Nearest(vec![Vec3::new(-0.5, 0.0, 0.0)]);
        vessels.generator = vessels.generator.scaled(args.lengths.clamp(0.1, 4.0));
        assets.spawn(&mut commands, disc, Color::srgb(0.8, 0.7, 0.66), place).insert(vessels);
    }
}

/// `N`: all organs grow again, from other seeds.
fn next_seeds(keys: Res<ButtonInput<KeyCode>>, mut organs: Query<&mut Vasculature>, mut record: ResMut<Record>) {
    if keys.just_pressed(KeyCode::KeyN) {
        let count = organs.iter().len() as u64;
        organs.iter_mut().for_each(|mut vasculature| vasculature.seed += count);
        *record = Record::default();
    }
}

fn record(frame: Res<GrowthFrame>, time: Res<Time<Real>>, organs: Query<&GrowthProgress>, mut record: ResMut<Record>) {
    if *frame != GrowthFrame::default() {
        record.growth.push(frame.time());
        record.frames.push(time.delta());
    }
    if record.slowest.is_none() && organs.iter().any(GrowthProgress::is_finished) {
        record.slowest = organs.iter().map(|progress| progress.step).min();
    }
}

/// Prints the figures once all have grown.
fn finish(
    args: Res<Args>,
    view: Res<View>,
    organs: Query<&GrowthProgress>,
    mut record: ResMut<Record>,
    mut exit: MessageWriter<AppExit>,
) {
    if record.told || !organs.iter().all(GrowthProgress::is_finished) {
        return;
    }
    record.told = true;
    let nodes: usize = organs.iter().flat_map(|progress| progress.nodes.values()).sum();
    println!("{} organs, {} nodes each, budget {} ms", args.organs, nodes / organs.iter().len(), args.budget);
    println!("growth systems: {}", percentiles(&record.growth));
    println!("whole frames:   {}", percentiles(&record.frames));
    println!("when the first was done, the slowest was at step {}", record.slowest.unwrap_or_default());
    if *view == View::Nothing {
        exit.write(AppExit::Success);
    }
}

fn tell_times(record: Res<Record>, mut status: ResMut<StatusLine>) {
    status.0.push_str(&format!(", growth {}", percentiles(&record.growth)));
}

fn percentiles(times: &[Duration]) -> String {
    let mut times = times.to_vec();
    times.sort_unstable();
    let Some(last) = times.len().checked_sub(1) else { return "no frames".to_owned() };
    let at = |share: usize| times[last * share / 100].as_secs_f64() * 1000.0;
    format!("{} frames, p50 {:.2} ms, p99 {:.2} ms, max {:.2} ms", last + 1, at(50), at(99), at(100))
}
