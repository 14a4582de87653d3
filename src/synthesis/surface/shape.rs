//! How many sides a vessel has, and how wide its cage must be for the surface to be as wide as the vessel.

use super::settings::SurfaceSettings;
use bevy_math::ops;
use std::f32::consts::{PI, TAU};

/// Number of different numbers of sides: 4, 8, 16, 32, 64.
const SIZES: usize = 5;

/// Numbers of sides by radius.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    least: u32,
    most: u32,
    widest: f32,
    swell: [f32; SIZES],
}

impl Shape {
    /// The shape of a network with this widest radius.
    pub fn new(settings: &SurfaceSettings, widest: f32) -> Self {
        let swell = std::array::from_fn(|size| swell(4 << size, settings.level));
        Self { least: settings.least_sides, most: settings.most_sides, widest, swell }
    }

    /// Sides of a vessel: the most for the widest ones, half as many for each halving of the radius.
    pub fn sides_of(&self, radius: f32) -> u32 {
        let mut sides = self.most;
        let mut least_radius = 0.5 * self.widest;
        while sides > self.least && radius < least_radius {
            sides /= 2;
            least_radius *= 0.5;
        }
        sides
    }

    /// The most sides.
    pub fn most(&self) -> u32 {
        self.most
    }

    /// Radius of a cage's ring for a vessel of radius 1.
    pub fn swell(&self, sides: u32) -> f32 {
        self.swell[(sides.trailing_zeros() as usize - 2).min(SIZES - 1)]
    }

    /// Distance from the axis of the middle of a cage's sides, for a vessel of radius 1.
    pub fn apothem(&self, sides: u32) -> f32 {
        self.swell(sides) * ops::cos(PI / sides as f32)
    }
}

/// A uniform ring of n vertices shrinks to (4 + 2 cos(2π/n)) / 6 of its radius in the limit, by the mask of cubic
/// B-splines. The faces of the last level are chords of the limit: they get the circle's area, not its radius.
fn swell(sides: u32, level: u32) -> f32 {
    let shrunk = (4.0 + 2.0 * ops::cos(TAU / sides as f32)) / 6.0;
    let chord = TAU / (sides << level) as f32;
    let equal_area = (chord / ops::sin(chord)).sqrt();
    if level == 0 { 1.0 / shrunk } else { equal_area / shrunk }
}
