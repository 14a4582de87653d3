//! Operating tools in the pointer's hand, and the patient's loss of blood.

use super::{
    pointer::Pointer,
    state::{PanelTool, VesselPanel},
    widgets::still_plot,
};
use crate::{
    plugin::{BloodLoss, CuttableVessels, Patient, StrokeId, VesselPicker, VesselPlace, Vessels},
    synthesis::wound::{Blade, BladeError},
};
use bevy::prelude::*;
use bevy_egui::egui::{Color32, Ui};
use egui_plot::{Line, PlotPoints};

/// Reach of tools, as a share of the size of the vessels' box.
const REACH: f32 = 0.02;
/// Length of the scalpel's edge on either side of what it touches, as a share of the same.
const EDGE: f32 = 0.05;
/// Widest vessel that the cautery seals, and the radius that it heats, as shares of the same.
const SEALED: f32 = 0.02;
/// Points of the curve of blood loss that are kept. When there are more, every second one is dropped.
const MOST_POINTS: usize = 1024;

/// A drag of a tool.
pub(super) struct Drag {
    stroke: StrokeId,
    /// The edge of the scalpel in the frame before.
    edge: Option<[Vec3; 2]>,
    /// Distance from the eye to the vessel that was touched last.
    depth: f32,
}

/// Works with the tool in hand, where the pointer is.
pub(super) fn operate(
    panel: Res<VesselPanel>,
    pointer: Pointer,
    all: Query<(&Vessels, &GlobalTransform)>,
    picker: VesselPicker,
    vessels: Option<ResMut<CuttableVessels>>,
    mut drag: Local<Option<Drag>>,
) -> Result {
    let works = panel.tool != PanelTool::Hand && !panel.tool.paints() && pointer.works();
    let (Some(mut vessels), true) = (vessels, works) else {
        *drag = None;
        return Ok(());
    };
    let Some(ray) = pointer.ray() else { return Ok(()) };
    let touched = picker.ray(ray, f32::INFINITY);
    let size = all.iter().map(|(vessels, place)| world_size(vessels, place)).fold(0.0, f32::max);
    let is_new = drag.is_none();
    let Some(now) = grasp(&mut drag, touched.as_ref()) else { return Ok(()) };
    let point = ray.get_point(now.depth);
    match panel.tool {
        PanelTool::Scalpel => {
            let edge = [-EDGE, EDGE].map(|along| point + along * size * *ray.direction);
            if let Some(before) = now.edge.replace(edge) {
                match Blade::sweep(before, edge) {
                    Ok(blade) => vessels.in_stroke(now.stroke).cut(blade),
                    Err(BladeError::NoArea { .. }) => {}
                    Err(error) => return Err(error.into()),
                }
            }
        }
        PanelTool::Cautery => {
            vessels.in_stroke(now.stroke).cauterise(Blade::ball(point, SEALED * size)?, SEALED * size);
        }
        PanelTool::Clamp if is_new => vessels.clamp(point, REACH * size),
        PanelTool::Unclamp if is_new => vessels.unclamp_near(point, REACH * size),
        PanelTool::Ligature if is_new => vessels.ligate(point, REACH * size),
        _ => {}
    }
    Ok(())
}

/// Size of vessels in the world: the diagonal of their box.
fn world_size(vessels: &Vessels, place: &GlobalTransform) -> f32 {
    2.0 * Vec3::from(vessels.aabb().half_extents).length() * place.compute_transform().scale.abs().max_element()
}

/// The drag that goes on, or begins at a vessel: between vessels the tool stays as deep as the last one was.
fn grasp<'a>(drag: &'a mut Option<Drag>, touched: Option<&VesselPlace>) -> Option<&'a mut Drag> {
    if let Some(touched) = touched {
        let depth = touched.distance;
        match drag {
            Some(drag) => drag.depth = depth,
            None => *drag = Some(Drag { stroke: StrokeId::begin(), edge: None, depth }),
        }
    }
    drag.as_mut()
}

/// The curve of an organ's blood loss.
#[derive(Debug, Default)]
pub(super) struct LossCurve {
    /// Seconds and millilitres.
    points: Vec<[f64; 2]>,
}

impl LossCurve {
    fn note(&mut self, time: f64, lost: f64) {
        let is_later = self.points.last().is_none_or(|&[last, _]| time > last + 0.05);
        if self.points.last().is_some_and(|&[_, last]| lost < last) {
            self.points.clear();
        }
        if is_later {
            self.points.push([time, lost]);
        }
        if self.points.len() > MOST_POINTS {
            let mut keep = false;
            self.points.retain(|_| {
                keep = !keep;
                keep
            });
        }
    }
}

/// Shows the tools, undo, and what the patient has lost.
pub(super) fn show(
    ui: &mut Ui,
    tool: &mut PanelTool,
    vessels: &mut CuttableVessels,
    loss: Option<&BloodLoss>,
    patient: Option<&Patient>,
    (curve, time): (&mut LossCurve, f64),
) {
    ui.horizontal_wrapped(|ui| {
        for choice in PanelTool::OPERATING {
            ui.selectable_value(tool, choice, choice.name());
        }
    });
    ui.horizontal(|ui| {
        if ui.button("undo").on_hover_text("Takes back the last stroke or action.").clicked() {
            vessels.undo();
        }
        if ui.button("heal all").clicked() {
            vessels.undo_all();
        }
    });
    let Some(loss) = loss else { return };
    curve.note(time, loss.total.ml());
    let rate = loss.rate.ml_per_min();
    ui.label(format!("{:.1} ml lost, {rate:.1} ml/min from {} open ends", loss.total.ml(), loss.bleeding_ends));
    if let Some(patient) = patient {
        ui.label(format!("{:.1} % of the patient's blood", 100.0 * patient.blood().lost_share()));
    }
    let line =
        Line::new("blood lost, ml", PlotPoints::from(curve.points.clone())).color(Color32::from_rgb(200, 60, 60));
    still_plot("blood lost").show(ui, |plot| plot.line(line));
}
