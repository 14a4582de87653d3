//! An operation without a window: cut, clamp and cautery at fixed times, with pictures, and the blood loss as CSV.

use crate::{
    common::{
        photo::{MoreShots, Shot, Shots},
        studio::{StudioArgs, View},
    },
    figures::{Figures, Reading},
    instruments::{cauterise, clamp, draw_scalpel},
    surface::Surface,
};
use bevy::{prelude::*, time::TimeUpdateStrategy};
use bevy_vessels::{
    plugin::{CirculationState, CuttableVessels, OrganSupply, StrokeId, VesselSystems},
    prelude::*,
    synthesis::{
        io::write_atomically,
        organ::Viewpoint,
        tree::{NodeId, System},
    },
};
use clap::ValueEnum;
use std::{io::Write, time::Duration};

/// What is done where there is no window.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq)]
pub enum Script {
    /// A cut across the widest artery in view, a clamp above it, then cautery along the cut.
    #[default]
    Demo,
}

/// Seconds of a frame. All that happens is the same on any machine.
const FRAME: Duration = Duration::from_millis(25);
/// Seconds between two lines of the table.
const INTERVAL: f64 = 0.1;
/// When the cut begins and ends, and how long it is in world units.
const CUT: [f64; 2] = [0.3, 0.8];
const CUT_LENGTH: f32 = 0.11;
/// Least length of the segment that is cut, in radii.
const SLENDER: f32 = 6.0;
/// How far above the cut the clamp goes on, in world units.
const CLAMP_ABOVE: f32 = 0.03;
const CLAMP: f64 = 5.0;
const CAUTERY: f64 = 8.0;
const END: f64 = 9.5;
/// When which picture is taken.
const PICTURES: [(f64, &str); 4] =
    [(0.1, "cutting_before.png"), (0.875, "cutting_cut.png"), (4.9, "cutting.png"), (7.5, "cutting_clamped.png")];

/// Operates where there is no window.
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

/// How far the operation is.
#[derive(Resource, Default)]
struct Operation {
    site: Option<Site>,
    time: f64,
    pictures: usize,
    table: Vec<(f64, Reading)>,
    /// The scalpel's, once it is on.
    stroke: Option<StrokeId>,
    is_over: bool,
}

/// Where it is done, in the world.
#[derive(Clone, Copy)]
struct Site {
    wound: Vec3,
    normal: Vec3,
    /// Across the vessel, along the skin.
    across: Vec3,
    /// On the vessel, towards its root.
    upstream: Vec3,
}

impl Site {
    /// The widest slender artery in view, with some vessel between it and its root.
    fn find(vessels: &Vessels, place: &GlobalTransform, surface: &Surface) -> Option<Self> {
        let tree = vessels.tree();
        let at = |node: NodeId| place.transform_point(tree.positions()[node.index()]);
        let is_seen = |node: NodeId| surface.hit(surface.eye, at(node).lerp(surface.eye, 0.01)).is_none();
        let above = |node: NodeId, far: f32| {
            let mut path = std::iter::successors(Some(node), |&node| tree.parent(node));
            path.find(|&other| at(other).distance(at(node)) > far)
        };
        // an end stays on its segment: in a stout one, the joints' round ends would hide the gap
        let is_slender = |node: usize| tree.segment_vector(node).length() > SLENDER * tree.radii()[node];
        let slender = tree.segments().filter(|&(node, _)| is_slender(node));
        let mut nodes: Vec<NodeId> = slender.map(|(node, _)| NodeId(node as u32)).collect();
        nodes.sort_by(|a, b| tree.radii()[b.index()].total_cmp(&tree.radii()[a.index()]));
        let node = nodes.into_iter().find(|&node| above(node, 2.0 * CLAMP_ABOVE).is_some() && is_seen(node))?;
        let (wound, normal) = surface.nearest(at(node))?;
        let along = at(node) - at(tree.parent(node)?);
        let upstream = at(above(node, CLAMP_ABOVE)?);
        Some(Self { wound, normal, across: along.cross(normal).normalize_or(Vec3::X), upstream })
    }

    /// Where the scalpel is at a share of its way, and in which direction its edge points.
    fn scalpel(&self, share: f32, surface: &Surface) -> [Vec3; 2] {
        let over = self.wound + self.across * CUT_LENGTH * (share - 0.5);
        let touch = surface.hit(over + 0.05 * self.normal, over - 0.1 * self.normal);
        [touch.map_or(over, |(touch, _)| touch), -self.normal]
    }

    /// From nearby, on the line along which it is seen from the front: nothing is in the way there.
    fn view(&self, surface: &Surface) -> Viewpoint {
        let eye = self.wound + 0.25 * (surface.eye - self.wound).normalize_or(Vec3::Z);
        Viewpoint { eye, target: self.wound, up: Vec3::Y }
    }
}

/// Goes on by a frame, unless a picture is being taken.
fn operate(
    time: Res<Time>,
    mut operation: ResMut<Operation>,
    mut step: ResMut<TimeUpdateStrategy>,
    (mut shots, mut more): (ResMut<Shots>, ResMut<MoreShots>),
    mut vessels: ResMut<CuttableVessels>,
    mut looks: Query<&mut VesselAppearance>,
    patient: (Query<(&CirculationState, &OrganSupply)>, Query<(&VesselSystem, &Vessels, &GlobalTransform)>),
    surface: Option<Res<Surface>>,
    mut exit: MessageWriter<AppExit>,
) -> Result {
    *step = TimeUpdateStrategy::ManualDuration(Duration::ZERO);
    let Some(surface) = surface else { return Ok(()) };
    let Some(site) = operation.site else {
        if let Some(error) = patient.0.iter().find_map(|(state, _)| state.error()) {
            eprintln!("{error}");
            exit.write(AppExit::error());
        }
        // the blood flows and its supply is known: from here on, all is the same whatever the machine
        if patient.0.iter().any(|(state, supply)| state.flows() && !supply.vertices.is_empty()) {
            let arteries = patient.1.iter().filter(|(system, ..)| system.0 == System::Arterial);
            operation.site = arteries.filter_map(|(_, vessels, place)| Site::find(vessels, place, &surface)).next();
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
        clamp(&mut vessels, site.upstream);
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

/// Keeps the figures, and writes them at the end.
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
    }
    Ok(())
}

fn write_table(out: &mut dyn Write, table: &[(f64, Reading)]) -> std::io::Result<()> {
    writeln!(out, "time_s,rate_ml_per_min,loss_ml,open_ends,ischaemic_share,root_pressure_mmhg")?;
    for (time, Reading { open_ends, rate, loss, ischaemic_share, root_pressure }) in table {
        writeln!(out, "{time:.3},{rate:.4},{loss:.5},{open_ends},{ischaemic_share:.5},{root_pressure:.3}")?;
    }
    Ok(())
}
