//! Small parts that several groups of the panel share.

use bevy_egui::egui::{Color32, Ui, Vec2};
use egui_plot::Plot;
use std::mem::discriminant;

/// Height of a plot, in points.
const PLOT_HEIGHT: f32 = 90.0;

/// Shows the choice among variants of an enum, of which some have values: those of the present one stay.
pub(super) fn choose_variant<T>(ui: &mut Ui, value: &mut T, choices: impl IntoIterator<Item = (&'static str, T)>) {
    for (name, choice) in choices {
        let is_chosen = is_same_variant(value, &choice);
        if ui.selectable_label(is_chosen, name).clicked() && !is_chosen {
            *value = choice;
        }
    }
}

/// Whether two values are of the same variant.
pub(super) fn is_same_variant<T>(first: &T, second: &T) -> bool {
    discriminant(first) == discriminant(second)
}

/// Shows what is wrong.
pub(super) fn show_error(ui: &mut Ui, error: impl ToString) {
    ui.colored_label(Color32::from_rgb(230, 90, 80), error.to_string());
}

/// A plot that is only looked at.
pub(super) fn still_plot<'a>(id: impl std::hash::Hash) -> Plot<'a> {
    Plot::new(id)
        .height(PLOT_HEIGHT)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show_background(false)
        .set_margin_fraction(Vec2::new(0.02, 0.1))
}
