//! Figures and plots of an organ's vessels: what the paper measures.

use super::widgets::still_plot;
use crate::{
    plugin::{
        Vessels,
        job::{Job, Jobs},
    },
    synthesis::{
        pace::Pace,
        tree::{TreeStatistics, VesselKind, VesselTree},
    },
};
use bevy::{ecs::entity::Entity, platform::collections::HashMap};
use bevy_egui::egui::{Color32, Grid, Ui};
use egui_plot::{Bar, BarChart, Line, PlotPoints};

/// Bars in the histogram of angles.
const ANGLE_BARS: usize = 18;

/// What is known about a tree.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Figures {
    statistics: TreeStatistics,
    /// Bifurcations by their angle, in equal parts of 180 degrees.
    angles: [u32; ANGLE_BARS],
    /// Segments born in each step.
    born: Vec<u32>,
}

impl Figures {
    fn of(tree: &VesselTree, births: &[u32]) -> Self {
        let mut angles = [0; ANGLE_BARS];
        for angle in tree.bifurcation_angles() {
            let bar = (angle / 180.0 * ANGLE_BARS as f64) as usize;
            angles[bar.min(ANGLE_BARS - 1)] += 1;
        }
        let mut born = vec![0; births.iter().max().map_or(0, |&last| last as usize + 1)];
        births.iter().for_each(|&step| born[step as usize] += 1);
        Self { statistics: tree.statistics(), angles, born }
    }
}

/// The figures of all vessel entities that were asked for, made beside the frames.
#[derive(Debug, Default)]
pub(super) struct Statistics(HashMap<Entity, Known>);

/// Figures of a vessel entity, and those under way.
#[derive(Debug, Default)]
struct Known {
    /// Nodes and edits of the tree that the figures, or those under way, are of.
    of: (usize, u64),
    figures: Option<Figures>,
    job: Option<Job<Figures>>,
}

impl Statistics {
    /// Shows the figures of vessels, as they were when these last changed and there was time.
    pub(super) fn show(&mut self, ui: &mut Ui, entity: Entity, vessels: &Vessels, jobs: &Jobs) {
        let known = self.0.entry(entity).or_default();
        if let Some(Ok(figures)) = Job::poll(&mut known.job) {
            known.figures = Some(figures);
        }
        let now = (vessels.tree().len(), vessels.edits());
        if known.job.is_none() && known.of != now {
            known.of = now;
            let (tree, births) = (vessels.tree().clone(), vessels.birth_steps().to_vec());
            known.job = Some(jobs.start(tree.len(), async move |_: Pace| Figures::of(&tree, &births)));
        }
        match &known.figures {
            Some(figures) => figures.show(ui, vessels.kind()),
            None => drop(ui.spinner()),
        }
    }

    /// Forgets vessels that are gone.
    pub(super) fn retain(&mut self, lives: impl Fn(Entity) -> bool) {
        self.0.retain(|&entity, _| lives(entity));
    }
}

fn color(kind: VesselKind) -> Color32 {
    match kind {
        VesselKind::Artery => Color32::from_rgb(200, 70, 70),
        VesselKind::Vein => Color32::from_rgb(110, 100, 210),
        VesselKind::PortalVein => Color32::from_rgb(80, 120, 180),
        VesselKind::Duct => Color32::from_rgb(130, 170, 80),
    }
}

impl Figures {
    fn show(&self, ui: &mut Ui, kind: VesselKind) {
        let statistics = &self.statistics;
        Grid::new(("figures", kind.name())).num_columns(2).striped(true).show(ui, |ui| {
            let mut row = |name: &str, value: String| {
                ui.label(name);
                ui.label(value);
                ui.end_row();
            };
            row("nodes", statistics.nodes.to_string());
            row("tips", statistics.leaves.to_string());
            row("bifurcations", statistics.bifurcations.to_string());
            row("total length", format!("{:.4}", statistics.total_length));
            row("volume", format!("{:.3e}", statistics.volume));
            if let Some(radius) = statistics.root_radius {
                row("root radius", format!("{radius:.5}"));
            }
            if let Some(angle) = statistics.bifurcation_angle {
                let [mean, deviation] = [angle.mean, angle.standard_deviation];
                row("bifurcation angle", format!("{mean:.1}° ± {deviation:.1}°"));
            }
            if let Some(tortuosity) = statistics.tortuosity {
                row("tortuosity, median", format!("{:.2}", tortuosity.median));
            }
            let ratio = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.2}"));
            row("Horton ratios: number", ratio(statistics.branching_ratio));
            row("length", ratio(statistics.length_ratio));
            row("diameter", ratio(statistics.diameter_ratio));
        });
        let width = 180.0 / ANGLE_BARS as f64;
        let angles = (0..)
            .zip(self.angles)
            .map(|(bar, count)| Bar::new((f64::from(bar) + 0.5) * width, count.into()).width(width));
        bars(ui, "angles of bifurcations, degrees", kind, angles.collect());
        let orders = (1..).zip(&statistics.strahler);
        let streams =
            orders.map(|(order, found)| Bar::new(f64::from(order), (found.streams as f64).log10()).width(0.8));
        bars(ui, "streams of each Strahler order, log₁₀", kind, streams.collect());
        let levels = statistics.diameters_by_level.iter().enumerate();
        line(
            ui,
            "radius by generation",
            kind,
            levels.map(|(level, diameter)| [level as f64, 0.5 * diameter]).collect(),
        );
        let born = self.born.iter().enumerate().map(|(step, &count)| [step as f64, count.into()]);
        line(ui, "segments born in a step", kind, born.collect());
    }
}

fn bars(ui: &mut Ui, title: &str, kind: VesselKind, bars: Vec<Bar>) {
    let chart = BarChart::new(title, bars).color(color(kind));
    ui.weak(title);
    still_plot((title, kind.name())).show(ui, |plot| plot.bar_chart(chart));
}

fn line(ui: &mut Ui, title: &str, kind: VesselKind, points: Vec<[f64; 2]>) {
    let line = Line::new(title, PlotPoints::from(points)).color(color(kind));
    ui.weak(title);
    still_plot((title, kind.name())).show(ui, |plot| plot.line(line));
}
