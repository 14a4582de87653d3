//! The organ and vessels that the command line asks for.

use crate::common::studio::StudioArgs;
use bevy::prelude::*;
use bevy_vessels::{
    prelude::*,
    synthesis::{organ::RootSites, units::Flow},
};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Arguments of examples with one organ.
#[derive(Args, Clone, Debug)]
pub struct OrganArgs {
    /// Arguments of the studio.
    #[command(flatten)]
    pub studio: StudioArgs,
    /// Use the organ in this GLB, glTF or OBJ file instead of a procedural colon.
    #[arg(long)]
    pub mesh: Option<PathBuf>,
    /// Seed of a procedural organ and of its network.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Name of a preset.
    #[arg(long, default_value = "colon")]
    pub preset: PresetName,
    /// Where vessels grow.
    #[arg(long, value_enum, default_value_t = Mode::Surface)]
    pub mode: Mode,
}

/// Where vessels grow.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq)]
pub enum Mode {
    /// Over the surface.
    Surface,
    /// Through the inside.
    Volume,
    /// Over the surface for half of the steps, then through the inside.
    Staged,
}

impl OrganArgs {
    /// Tint of organs that have no colours of their own.
    pub const FLESH: Color = Color::srgb(0.74, 0.42, 0.37);

    /// The vessels, with their radii multiplied so that they are visible from afar, or fine from near.
    pub fn vessels(&self, roots: Option<&RootSites>, radii: f32) -> Vasculature {
        let mut wish = Vasculature::new(self.preset).with_seed(self.seed);
        let mut steps = 0;
        if let Some(settings) = wish.generator.colonization_mut() {
            settings.arterial.terminal_radius *= radii;
            settings.venous.terminal_radius *= radii;
            steps = settings.steps;
        }
        if let Some(settings) = wish.generator.cco_mut() {
            // The fourth power of a radius is in proportion to the flow.
            let widened = |rate: Flow| rate.cubic_metres_per_second() * f64::from(radii).powi(4);
            for flow in settings.flow.values_mut() {
                flow.rate = Flow::from_cubic_metres_per_second(widened(flow.rate));
            }
        }
        let mode = match self.mode {
            Mode::Surface => TissueMode::Surface,
            Mode::Volume => TissueMode::Volume,
            Mode::Staged => TissueMode::Staged { surface_steps: steps / 2 },
        };
        wish.tissue = mode.into();
        if let Some(roots) = roots {
            wish.roots.artery = RootPlacement::Nearest(roots.arterial.clone());
            wish.roots.vein = RootPlacement::Nearest(roots.venous.clone());
        }
        wish
    }

    /// The tint of the organ: glass if vessels grow inside.
    pub fn tint(&self, color: Color) -> Color {
        if self.mode == Mode::Surface { color } else { color.with_alpha(0.16) }
    }
}
