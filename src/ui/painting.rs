//! Painting on organs: the pointer's strokes become changes of their paint and their roots.

use super::{
    brush::Brush,
    pointer::Pointer,
    state::{PanelTool, VesselPanel},
    stroke::{Canvas, PaintStroke},
};
use crate::{
    plugin::{GrowthState, OrganPaint, Vasculature},
    synthesis::tree::VesselKind,
};
use bevy::prelude::*;
use bevy_egui::egui::{Slider, Ui};

/// The stroke under way, and the organ that it is on.
#[derive(Resource, Default)]
pub(super) struct Painting(Option<(Entity, PaintStroke)>);

impl Painting {
    /// Whether a stroke is under way.
    pub(super) fn goes_on(&self) -> bool {
        self.0.is_some()
    }
}

/// An organ that can be painted.
type PaintedOrgan =
    (Entity, &'static GrowthState, &'static GlobalTransform, &'static mut Vasculature, Option<&'static mut OrganPaint>);

/// Paints where the pointer is, with the tool in hand.
pub(super) fn paint(
    mut commands: Commands,
    panel: Res<VesselPanel>,
    pointer: Pointer,
    mut organs: Query<PaintedOrgan>,
    mut painting: ResMut<Painting>,
) {
    if !panel.tool.paints() || !pointer.works() {
        if let Some((organ, stroke)) = painting.bypass_change_detection().0.take()
            && let Ok((.., Some(mut paint))) = organs.get_mut(organ)
        {
            stroke.end(&mut paint);
        }
        return;
    }
    let Some(ray) = pointer.ray() else { return };
    // A stroke stays on the organ where it began.
    let own = painting.0.as_ref().map(|(organ, _)| *organ);
    let touched = organs.iter().filter(|(organ, ..)| own.is_none_or(|own| own == *organ)).filter_map(|organ| {
        let (entity, state, place, ..) = organ;
        let point = touch(state, place, ray)?;
        Some((entity, point, place.transform_point(point).distance(ray.origin)))
    });
    let Some((entity, point, _)) = touched.min_by(|a, b| a.2.total_cmp(&b.2)) else { return };
    let Ok((_, state, _, mut wish, paint)) = organs.get_mut(entity) else { return };
    let Some(mesh) = state.canvas() else { return };
    let (_, stroke) = painting.0.get_or_insert_with(|| (entity, PaintStroke::begin()));
    // Drafts, so that only changes are changes.
    let mut draft = paint.as_deref().cloned().unwrap_or_default();
    let mut roots = wish.roots.clone();
    if !stroke.touch(panel.tool, &panel.brush, Canvas::new(mesh.mesh()), point, (&mut draft, &mut roots)) {
        return;
    }
    if wish.roots != roots {
        wish.roots = roots;
    }
    match paint {
        Some(mut paint) => drop(paint.set_if_neq(draft)),
        None if !draft.is_blank() => drop(commands.entity(entity).insert(draft)),
        None => {}
    }
}

/// The first point of an organ's mesh on a ray, in the organ's space.
fn touch(state: &GrowthState, place: &GlobalTransform, ray: Ray3d) -> Option<Vec3> {
    let mesh = state.canvas()?;
    let to_organ = place.affine().inverse();
    let from = to_organ.transform_point3(ray.origin);
    let along = to_organ.transform_vector3(*ray.direction).try_normalize()?;
    let canvas = Canvas::new(mesh.mesh());
    let far = from.distance(canvas.middle) + canvas.size;
    mesh.index().first_hit(from, from + far * along).map(|hit| hit.position)
}

/// Shows the painting tools and their brush.
pub(super) fn show(ui: &mut Ui, tool: &mut PanelTool, brush: &mut Brush, kinds: impl Fn(VesselKind) -> bool) {
    let is_there = |tool: &PanelTool| match tool {
        PanelTool::Root(kind) => kinds(*kind),
        _ => true,
    };
    ui.horizontal_wrapped(|ui| {
        for choice in [PanelTool::Hand].into_iter().chain(PanelTool::PAINTING).filter(is_there) {
            ui.selectable_value(tool, choice, choice.name()).on_hover_text(hint(choice));
        }
    });
    ui.add(Slider::new(&mut brush.radius, 0.002..=0.5).logarithmic(true).text("radius"))
        .on_hover_text("As a share of the organ's diagonal.");
    if *tool == PanelTool::Density {
        ui.add(Slider::new(&mut brush.strength, 0.0..=1.0).text("strength"))
            .on_hover_text("How far one touch goes towards the density.");
        ui.add(Slider::new(&mut brush.density, 0.0..=1.0).text("density"))
            .on_hover_text("0: no new vessels, 1: as without paint.");
    }
    ui.horizontal(|ui| {
        ui.checkbox(&mut brush.erases, "erase");
        ui.label("mirror");
        for (axis, mirror) in ["x", "y", "z"].into_iter().zip(&mut brush.mirror) {
            ui.toggle_value(mirror, axis).on_hover_text("Across the plane through the organ's middle.");
        }
    });
}

fn hint(tool: PanelTool) -> &'static str {
    match tool {
        PanelTool::Guide => "Draw a line for a large vessel, or drag one of its points.",
        PanelTool::Density => "Paint where fewer vessels grow.",
        PanelTool::NoGo => "Paint where no vessel may be.",
        PanelTool::Root(_) => "Click to place a root, or drag one.",
        _ => "The pointer turns the camera.",
    }
}
