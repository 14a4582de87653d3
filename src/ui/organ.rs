//! The organ that the panel shows: its name, its seed, its tissue and where vessels enter.

use super::widgets::{choose_variant, is_same_variant};
use crate::synthesis::{
    random::VesselRng,
    roots::{RootPlacement, RootPlacements, Roots},
    tissue::{TissueMode, TissueSource},
    tree::VesselKind,
};
use bevy::ecs::entity::Entity;
use bevy_egui::egui::{ComboBox, DragValue, Grid, Ui};
use rand::{RngExt, SeedableRng};

/// Steps on the surface with which a growth in stages begins.
const SURFACE_STEPS: u32 = 40;

/// Shows the choice among organs.
pub(super) fn choose(ui: &mut Ui, organs: &[(Entity, String)], chosen: &mut Option<Entity>) {
    let name =
        |organ: Option<Entity>| organs.iter().find(|(own, _)| Some(*own) == organ).map(|(_, name)| name.as_str());
    ComboBox::from_id_salt("organ").selected_text(name(*chosen).unwrap_or("no organ")).show_ui(ui, |ui| {
        for (organ, name) in organs {
            ui.selectable_value(chosen, Some(*organ), name);
        }
    });
}

/// Shows the seed, with a dice.
pub(super) fn show_seed(ui: &mut Ui, seed: &mut u64) {
    ui.horizontal(|ui| {
        ui.label("seed").on_hover_text("Chooses one of the many networks that the same settings give.");
        ui.add(DragValue::new(seed).speed(0.05));
        if ui.button("⬅").on_hover_text("The seed before.").clicked() {
            *seed = seed.wrapping_sub(1);
        }
        if ui.button("➡").on_hover_text("The next seed.").clicked() {
            *seed = seed.wrapping_add(1);
        }
        if ui.button("🎲").on_hover_text("Any seed.").clicked() {
            *seed = rolled(*seed, ui.input(|input| input.time));
        }
    });
}

/// A seed of at most six digits, which can be told and typed.
fn rolled(seed: u64, time: f64) -> u64 {
    VesselRng::seed_from_u64(seed ^ time.to_bits()).random_range(0..1_000_000)
}

/// Shows where on a mesh vessels grow.
pub(super) fn show_tissue(ui: &mut Ui, tissue: &mut TissueSource) {
    let TissueSource::Mesh(mesh) = tissue else { return };
    ui.horizontal_wrapped(|ui| {
        ui.label("where").on_hover_text("On the organ's surface, on its lining, or through its inside.");
        let staged = TissueMode::Staged { surface_steps: SURFACE_STEPS };
        let choices = [
            ("surface", TissueMode::Surface),
            ("lining", TissueMode::Lining),
            ("inside", TissueMode::Volume),
            ("surface, then inside", staged),
        ];
        choose_variant(ui, &mut mesh.mode, choices);
        if let TissueMode::Staged { surface_steps } = &mut mesh.mode {
            ui.add(DragValue::new(surface_steps).range(1..=u32::MAX)).on_hover_text("steps on the surface");
        }
    });
}

/// Shows how the roots of each kind are placed.
pub(super) fn show_roots(ui: &mut Ui, roots: &mut RootPlacements) {
    Grid::new("roots").num_columns(2).show(ui, |ui| {
        for kind in VesselKind::ALL {
            ui.label(kind.plural());
            show_placement(ui, kind, &mut roots[kind]);
            ui.end_row();
        }
    });
}

fn show_placement(ui: &mut Ui, kind: VesselKind, placement: &mut RootPlacement) {
    ui.horizontal(|ui| {
        let choices = [
            ("none", RootPlacement::None),
            ("spread", RootPlacement::Spread(1)),
            ("within reach", RootPlacement::Within(Roots::DEFAULT_REACH)),
            ("at the hilum", RootPlacement::Hilum),
            ("beside", RootPlacement::Beside),
        ];
        let name = choices.iter().find(|(_, choice)| is_same_variant(placement, choice));
        let name = name.map_or("at points", |(name, _)| name);
        ComboBox::from_id_salt(("placement", kind.name()))
            .selected_text(name)
            .show_ui(ui, |ui| choose_variant(ui, placement, choices));
        match placement {
            RootPlacement::Spread(roots) => {
                ui.add(DragValue::new(roots).speed(0.05).range(1..=Roots::MAX_SPREAD)).on_hover_text("roots");
            }
            RootPlacement::Within(reach) => {
                ui.add(DragValue::new(reach).speed(0.005).range(Roots::LEAST_REACH..=f32::MAX).suffix(" d"))
                    .on_hover_text("All tissue is within so many diameters of a root.");
            }
            RootPlacement::Nearest(points) | RootPlacement::Exact(points) => {
                ui.weak(format!("{} points", points.len()));
            }
            _ => {}
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dice_shows_short_numbers_that_differ() {
        let seeds: Vec<u64> = (0..100).map(|roll| rolled(7, f64::from(roll) * 0.016)).collect();
        let different: std::collections::BTreeSet<_> = seeds.iter().collect();
        assert!(different.len() > 98 && seeds.iter().all(|&seed| seed < 1_000_000));
    }
}
