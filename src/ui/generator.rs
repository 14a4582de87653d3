//! The generator of an organ's vessels, with its settings.

use super::{colonization, knob::Rows, optimisation, widgets::show_error};
use crate::{
    plugin::Vasculature,
    synthesis::{
        cco::CcoSettings, colonization::ColonizationSettings, generator::Generator, preset::Preset,
        roots::RootPlacement,
    },
};
use bevy_egui::egui::Ui;

/// Shows the choice of a generator, its settings, and what is wrong with them. `base` has the values to go back to.
pub(super) fn show(ui: &mut Ui, wish: &mut Vasculature, base: &Preset, rows: &mut Rows, linked: &mut bool) {
    choose(ui, wish, base);
    let has_roots = |kind| wish.roots[kind] != RootPlacement::None;
    match &mut wish.generator {
        Generator::Colonization(settings) => {
            let base = base.generator.colonization().cloned().unwrap_or_default();
            colonization::show(ui, settings, &base, rows, linked);
        }
        Generator::Cco(settings) => {
            let base = base.generator.cco().cloned().unwrap_or_default();
            optimisation::show(ui, settings, &base, rows, has_roots);
        }
        Generator::Custom(_) => {
            ui.label("A generator of the app, without settings here.");
        }
    }
    if let Err(error) = wish.generator.validate() {
        show_error(ui, error);
    }
}

/// The choice between the generators. Another one starts with the preset's settings, if it is the preset's own.
fn choose(ui: &mut Ui, wish: &mut Vasculature, base: &Preset) {
    ui.horizontal(|ui| {
        let is_cco = wish.generator.cco().is_some();
        let is_colonization = wish.generator.colonization().is_some();
        let colonize = ui.selectable_label(is_colonization, "space colonization");
        if colonize.on_hover_text("Vessels grow towards tissue that has none.").clicked() && !is_colonization {
            let own = base.generator.colonization().cloned();
            wish.generator = own.unwrap_or_else(ColonizationSettings::default).into();
        }
        let optimise = ui.selectable_label(is_cco, "optimisation");
        if optimise.on_hover_text("Terminal by terminal, with the least volume of vessels.").clicked() && !is_cco {
            wish.generator = base.generator.cco().cloned().unwrap_or_else(CcoSettings::default).into();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        synthesis::colonization::SystemSettings,
        ui::knob::Knob,
        ui::sketch::{Sketched, grow},
    };

    /// Pictures of low and high values, and how many of them differ.
    fn differing<S: Sketched>(knobs: impl Iterator<Item = &'static Knob<S>>) -> (usize, usize) {
        let pictures = knobs.map(|knob| {
            let [low, high] = knob.low_and_high(&S::default()).map(|(_, settings)| grow(&settings));
            assert!(!low.is_empty() || !high.is_empty(), "{}: a picture", knob.name);
            usize::from(low != high)
        });
        let differ: Vec<usize> = pictures.collect();
        (differ.iter().sum(), differ.len())
    }

    #[test]
    fn every_setting_has_pictures_and_most_differ() {
        let (differ, all) = differing::<SystemSettings>(colonization::system_knobs());
        assert!(differ * 10 >= all * 8, "{differ} of {all}");
        let (differ, all) = differing::<CcoSettings>(optimisation::knobs());
        assert!(differ * 10 >= all * 6, "{differ} of {all}");
    }
}
