//! Vessels that are visible from afar.

use bevy_vessels::prelude::*;

/// Vessels with their radii multiplied.
pub fn stouter(mut wish: Vasculature, radii: f32) -> Vasculature {
    let settings = wish.generator.colonization_mut().expect("presets colonize");
    settings.arterial.terminal_radius *= radii;
    settings.venous.terminal_radius *= radii;
    wish
}
