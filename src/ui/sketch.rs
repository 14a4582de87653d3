//! Small pictures of what a setting does: the paper's disc, grown with a low and with a high value of it.

use crate::synthesis::{
    cco::CcoSettings,
    colonization::{ColonizationSettings, SystemSettings},
    generator::Generator,
    roots::{RootPlacement, RootPlacements},
    tissue::Disc,
    tree::{VesselKind, VesselTree},
};
use bevy::{math::Vec3, platform::collections::HashMap};
use bevy_egui::egui::{self, Color32, Pos2, Sense, Stroke, Ui};
use std::sync::Arc;

/// Width and height of a picture, in points.
const SIZE: f32 = 120.0;
/// Least width of a line, in points.
const LEAST_LINE: f32 = 0.5;

/// Settings of which there are pictures.
pub(super) trait Sketched: Clone + Default + 'static {
    /// A generator with these settings, for a small growth.
    fn generator(&self) -> Generator;
}

impl Sketched for ColonizationSettings {
    fn generator(&self) -> Generator {
        Self { steps: self.steps.min(100), samples: self.samples.min(1000), ..self.clone() }.into()
    }
}

impl Sketched for SystemSettings {
    fn generator(&self) -> Generator {
        let settings = ColonizationSettings { arterial: self.clone(), steps: 70, samples: 400, ..Default::default() };
        settings.generator()
    }
}

impl Sketched for CcoSettings {
    fn generator(&self) -> Generator {
        Self { terminals: self.terminals.min(400), ..self.clone() }.into()
    }
}

/// A line of a picture: two points, from 0 to 1, and a width.
type Line = ([[f32; 2]; 2], f32);

/// The pictures that have been asked for.
#[derive(Debug, Default)]
pub(super) struct Sketches(HashMap<(&'static str, bool), Arc<[Line]>>);

impl Sketches {
    /// Shows the pictures of a setting's low and high value beside each other. One that is missing is made, at most one in a
    /// frame.
    pub(super) fn show_low_and_high<S: Sketched>(
        &mut self,
        ui: &mut Ui,
        name: &'static str,
        low_and_high: [(String, S); 2],
    ) {
        let mut may_make = true;
        ui.horizontal(|ui| {
            for (high, (value, settings)) in low_and_high.into_iter().enumerate() {
                let key = (name, high == 1);
                if may_make && !self.0.contains_key(&key) {
                    self.0.insert(key, grow(&settings).into());
                    may_make = false;
                }
                ui.vertical(|ui| {
                    match self.0.get(&key) {
                        Some(lines) => draw(ui, lines),
                        None => ui.ctx().request_repaint(),
                    }
                    ui.weak(value);
                });
            }
        });
    }
}

/// The lines of the arteries that grow on a disc. None if they can't.
pub(super) fn grow(settings: &impl Sketched) -> Vec<Line> {
    let placed = RootPlacements {
        artery: RootPlacement::Nearest(vec![Vec3::new(0.0, -0.45, 0.0)]),
        vein: RootPlacement::None,
        ..RootPlacements::default()
    };
    let Ok(disc) = Disc::flat(0.5) else { return Vec::new() };
    let Ok(mut growth) = settings.generator().start(Arc::new(disc), &placed.into(), 1) else { return Vec::new() };
    growth.run();
    growth.trees()[VesselKind::Artery].as_ref().map_or_else(Vec::new, |grown| lines(grown.tree))
}

fn lines(tree: &VesselTree) -> Vec<Line> {
    let point = |node: usize| [tree.positions()[node].x + 0.5, 0.5 - tree.positions()[node].y];
    tree.segments().map(|(node, parent)| ([point(parent), point(node)], 2.0 * tree.radii()[node])).collect()
}

fn draw(ui: &mut Ui, lines: &[Line]) {
    let (rect, _) = ui.allocate_exact_size(egui::Vec2::splat(SIZE), Sense::hover());
    let painter = ui.painter_at(rect);
    painter.circle_filled(rect.center(), 0.5 * SIZE, Color32::from_rgb(226, 206, 192));
    let place = |[x, y]: [f32; 2]| Pos2::new(rect.left() + x * SIZE, rect.top() + y * SIZE);
    for &(ends, width) in lines {
        let stroke = Stroke::new((width * SIZE).max(LEAST_LINE), Color32::from_rgb(150, 30, 32));
        painter.line_segment(ends.map(place), stroke);
    }
}
