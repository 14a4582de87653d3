//! An operation without a window: cut, clamp and cautery at fixed times, with pictures, and the blood loss as CSV.

use crate::{
    common::{
        light::KEY_LIGHT,
        photo::{MoreShots, Shot, Shots},
        studio::{StudioArgs, View},
    },
    figures::{Figures, Reading},
    instruments::{cauterise, draw_scalpel},
    surface::Surface,
};
use bevy::{ecs::system::SystemParam, prelude::*, time::TimeUpdateStrategy};
use bevy_vessels::{
    plugin::{CirculationState, CuttableVessels, OpenEnd, OrganSupply, StrokeId, VesselSystems},
    prelude::*,
    synthesis::{
        io::write_atomically,
        organ::Viewpoint,
        tree::{NodeId, Place, VesselTree},
        wound::EndSide,
    },
};
use clap::ValueEnum;
use std::{io::Write, time::Duration};

/// The operation without a window.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq)]
pub enum Script {
    /// A cut across the widest artery in view, a clamp on the artery of the end that bled most, then cautery along the
    /// cut.
    #[default]
    Demo,
}

/// Duration of a frame, so that the operation is the same on any machine.
const FRAME: Duration = Duration::from_millis(25);
/// Seconds between two lines of the table.
const INTERVAL: f64 = 0.1;
/// Times of the cut's begin and end, and its length in world units.
const CUT: [f64; 2] = [0.3, 0.8];
const CUT_LENGTH: f32 = 0.11;
/// Distance of the clamp above the end that bled most, and least distance of the root from the cut, in world units.
const CLAMP_ABOVE: f32 = 0.03;
const ROOT_ABOVE: f32 = 0.06;
/// Least cosine between the normal of the cut skin and the directions to the viewer and the light.
const FACING: f32 = 0.5;
const CLAMP: f64 = 5.0;
const CAUTERY: f64 = 8.0;
const END: f64 = 9.5;
/// Seconds before each step over which the bleeding is averaged: more than a heartbeat.
const TOLD_OVER: f64 = 1.0;
/// Times and names of the pictures.
const PICTURES: [(f64, &str); 4] =
    [(0.1, "cutting_before.png"), (0.875, "cutting_cut.png"), (4.9, "cutting.png"), (7.5, "cutting_clamped.png")];

/// Operates without a window.
pub struct OperationPlugin(pub Script);

impl Plugin for OperationPlugin {
    fn build(&self, app: &mut App) {
        if app.world().get_resource::<View>().is_none_or(|view| *view == View::Window) {
            return;
        }
        let Script::Demo = self.0;
        app.init_resource::<Operation>()
            .insert_resource(MoreShots { expected: true, ..default() })
            .add_systems(Update, operate.before(VesselSystems::Cut))
            .add_systems(PostUpdate, record);
    }
}

/// The progress of the operation.
#[derive(Resource, Default)]
struct Operation {
    site: Option<Site>,
    time: f64,
    pictures: usize,
    table: Vec<(f64, Reading)>,
    /// The scalpel's stroke, once it has begun.
    stroke: Option<StrokeId>,
    is_over: bool,
}

/// The site of the operation, in the world.
#[derive(Clone, Copy)]
struct Site {
    wound: Vec3,
    normal: Vec3,
    /// Across the vessel, along the skin.
    across: Vec3,
}

impl Site {
    /// The widest artery in view and lit, with some vessel between it and its root.
    fn find(vessels: &Vessels, place: &GlobalTransform, surface: &Surface) -> Option<Self> {
        let tree = vessels.tree();
        let at = |node: NodeId| place.transform_point(tree.positions()[node.index()]);
        let is_seen = |node: NodeId| surface.hit(surface.eye, at(node).lerp(surface.eye, 0.01)).is_none();
        let mut nodes: Vec<NodeId> = tree.segments().map(|(node, _)| NodeId(node as u32)).collect();
        nodes.sort_by(|a, b| tree.radii()[b.index()].total_cmp(&tree.radii()[a.index()]));
        let is_far = |node: NodeId| above(tree, node, |other| at(other).distance(at(node)) > ROOT_ABOVE).is_some();
        let faces = |normal: Vec3, other: Vec3| other.normalize_or_zero().dot(normal) > FACING;
        let is_lit = |at: Vec3| surface.hit(at + KEY_LIGHT, at + 0.01 * KEY_LIGHT).is_none();
        let shows =
            |&[at, normal]: &[Vec3; 2]| faces(normal, surface.eye - at) && faces(normal, KEY_LIGHT) && is_lit(at);
        let site = |node: NodeId| surface.nearest(at(node)).map(Into::into).filter(shows);
        let seen = nodes.into_iter().filter(|&node| is_far(node) && is_seen(node));
        let (node, [wound, normal]) = seen.filter_map(|node| Some((node, site(node)?))).next()?;
        let along = at(node) - at(tree.parent(node)?);
        Some(Self { wound, normal, across: along.cross(normal).normalize_or(Vec3::X) })
    }

    /// The scalpel's point at a share of its path, and the direction of its edge.
    fn scalpel(&self, share: f32, surface: &Surface) -> [Vec3; 2] {
        let over = self.wound + self.across * CUT_LENGTH * (share - 0.5);
        let touch = surface.hit(over + 0.05 * self.normal, over - 0.1 * self.normal);
        [touch.map_or(over, |(touch, _)| touch), -self.normal]
    }

    /// A near view, on the line of sight from the front, where nothing is in the way.
    fn view(&self, surface: &Surface) -> Viewpoint {
        let eye = self.wound + 0.25 * (surface.eye - self.wound).normalize_or(Vec3::Z);
        Viewpoint { eye, target: self.wound, up: Vec3::Y }
    }
}

/// The first node that passes a test, from a node towards the root.
fn above(tree: &VesselTree, node: NodeId, passes: impl Fn(NodeId) -> bool) -> Option<NodeId> {
    std::iter::successors(Some(node), |&node| tree.parent(node)).find(|&node| passes(node))
}

/// The patient's open ends and vessels.
#[derive(SystemParam)]
struct Patient<'w, 's> {
    ends: Query<'w, 's, (&'static OpenEnd, &'static GlobalTransform)>,
    vessels: Query<'w, 's, (&'static Vessels, &'static GlobalTransform)>,
    blood: Query<'w, 's, (&'static CirculationState, &'static OrganSupply)>,
}

impl Patient<'_, '_> {
    /// The site to operate on.
    fn site(&self, surface: &Surface) -> Option<Site> {
        let arteries = self.vessels.iter().filter(|(vessels, _)| vessels.kind() == VesselKind::Artery);
        arteries.filter_map(|(vessels, place)| Site::find(vessels, place, surface)).next()
    }

    /// The clamp's place on the artery that has lost most: a little before its end.
    fn feeds_most(&self) -> Option<(Entity, Place)> {
        let fed = self.ends.iter().filter(|(end, _)| (end.kind, end.side) == (VesselKind::Artery, EndSide::Proximal));
        let (end, tip) = fed.max_by(|(a, _), (b, _)| a.lost.ml().total_cmp(&b.lost.ml()))?;
        let (vessels, to_world) = self.vessels.get(end.vessels).ok()?;
        let tree = vessels.tree();
        let is_above = |node: NodeId| {
            let at = to_world.transform_point(tree.positions()[node.index()]);
            // the segment at a root is the last that can be clamped
            let is_last = tree.parent(node).is_none_or(|parent| tree.parent(parent).is_none());
            is_last || at.distance(tip.translation()) > CLAMP_ABOVE
        };
        Some((end.vessels, Place::new(above(tree, end.place.node, is_above)?, 0.5)))
    }
}

/// Advances by a frame, unless a picture is being taken.
fn operate(
    time: Res<Time>,
    mut operation: ResMut<Operation>,
    mut step: ResMut<TimeUpdateStrategy>,
    (mut shots, mut more): (ResMut<Shots>, ResMut<MoreShots>),
    mut vessels: ResMut<CuttableVessels>,
    mut looks: Query<&mut VesselAppearance>,
    patient: Patient,
    surface: Option<Res<Surface>>,
    mut exit: MessageWriter<AppExit>,
) -> Result {
    *step = TimeUpdateStrategy::ManualDuration(Duration::ZERO);
    let Some(surface) = surface else { return Ok(()) };
    let Some(site) = operation.site else {
        if let Some(error) = patient.blood.iter().find_map(|(state, _)| state.error()) {
            eprintln!("{error}");
            exit.write(AppExit::error());
        }
        // the blood flows and its supply is known: from here on, everything is the same on any machine
        if patient.blood.iter().any(|(state, supply)| state.flows() && !supply.vertices.is_empty()) {
            operation.site = patient.site(&surface);
            more.expected = operation.site.is_some();
        }
        return Ok(());
    };
    let before = operation.time;
    operation.time += time.delta_secs_f64();
    let now = operation.time;
    let is_due = |at: f64| before < at && at <= now;
    let share = |at: f64| ((at - CUT[0]) / (CUT[1] - CUT[0])).clamp(0.0, 1.0) as f32;
    if share(before) < share(now) {
        let stroke = *operation.stroke.get_or_insert_with(StrokeId::begin);
        draw_scalpel(vessels.in_stroke(stroke), [before, now].map(|at| site.scalpel(share(at), &surface)))?;
    }
    if is_due(CLAMP) {
        if let Some((artery, place)) = patient.feeds_most() {
            vessels.clamp_at(artery, place);
        }
        looks.iter_mut().for_each(|mut look| look.coloring = SegmentColoring::Supply);
    }
    if is_due(CAUTERY) {
        let stroke = StrokeId::begin();
        for step in 0..=8 {
            cauterise(vessels.in_stroke(stroke), site.scalpel(step as f32 / 8.0, &surface)[0])?;
        }
    }
    if let Some(&(_, file)) = PICTURES.get(operation.pictures).filter(|(at, _)| *at <= now) {
        operation.pictures += 1;
        shots.0.push(Shot { file, view: site.view(&surface), field_of_view: 36.0, endoscope: false });
    }
    operation.is_over = now >= END;
    if operation.is_over {
        more.expected = false;
    } else if more.taken >= shots.0.len() {
        *step = TimeUpdateStrategy::ManualDuration(FRAME);
    }
    Ok(())
}

/// Records the figures, and writes them at the end.
fn record(
    mut operation: ResMut<Operation>,
    figures: Figures,
    args: Res<StudioArgs>,
    mut written: Local<bool>,
) -> Result {
    let due = operation.table.len() as f64 * INTERVAL;
    if operation.site.is_some() && operation.time >= due - 1e-9 && !*written {
        let now = operation.time;
        operation.table.push((now, figures.read()));
    }
    if operation.is_over && !std::mem::replace(&mut *written, true) {
        std::fs::create_dir_all(&args.out)?;
        let path = args.out.join("blood_loss.csv");
        write_atomically(&path, |out| write_table(out, &operation.table))?;
        println!("{}", path.display());
        let [cut, clamped, sealed] = [CLAMP, CAUTERY, END].map(|end| mean_rate(&operation.table, end));
        println!("bleeding: {cut:.1} mL/min from the cut, {clamped:.1} with the clamp, {sealed:.1} after cautery");
    }
    Ok(())
}

/// Mean rate of loss before a time, in mL/min.
fn mean_rate(table: &[(f64, Reading)], end: f64) -> f64 {
    let lost =
        |at: f64| table.iter().rfind(|(time, _)| *time <= at).map_or((0.0, 0.0), |(time, now)| (*time, now.loss));
    let ((from, before), (to, after)) = (lost(end - TOLD_OVER), lost(end));
    60.0 * (after - before) / (to - from)
}

/// The last step before a time.
fn last_step(time: f64) -> &'static str {
    let steps = [(CAUTERY, "cautery"), (CLAMP, "clamp"), (CUT[0], "cut")];
    steps.into_iter().find(|(at, _)| *at < time).map_or("none", |(_, step)| step)
}

fn write_table(out: &mut dyn Write, table: &[(f64, Reading)]) -> std::io::Result<()> {
    writeln!(out, "time_s,last_step,rate_ml_per_min,loss_ml,open_ends,ischaemic_share,root_pressure_mmhg")?;
    for (time, Reading { open_ends, rate, loss, ischaemic_share, root_pressure }) in table {
        let step = last_step(*time);
        writeln!(out, "{time:.3},{step},{rate:.4},{loss:.5},{open_ends},{ischaemic_share:.5},{root_pressure:.3}")?;
    }
    Ok(())
}
