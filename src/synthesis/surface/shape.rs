//! How many sides a vessel has, and how wide its cage must be for the surface to be as wide as the vessel.

use super::settings::SurfaceSettings;
use bevy_math::{Vec2, ops};
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

/// The radius of a cage's ring around which the subdivided ring has the area of a circle of radius 1.
///
/// In the limit, a ring is the cubic B-spline of its vertices. A level's vertices are points of that spline, and its faces
/// are chords.
fn swell(sides: u32, level: u32) -> f32 {
    let step = TAU / sides as f32;
    // The cage itself is as wide as that of a smooth surface.
    let parts = 1 << if level == 0 { SurfaceSettings::MOST_LEVEL } else { level };
    let point = |part: u32| {
        let t = part as f32 / parts as f32;
        let weights = [
            (1.0 - t).powi(3),
            3.0 * t.powi(3) - 6.0 * t * t + 4.0,
            1.0 + 3.0 * t + 3.0 * t * t - 3.0 * t.powi(3),
            t.powi(3),
        ];
        let sum = |coordinate: fn(f32) -> f32| {
            let terms = weights
                .iter()
                .enumerate()
                .map(|(place, weight)| weight / 6.0 * coordinate((place as f32 - 1.0) * step));
            terms.sum::<f32>()
        };
        Vec2::new(sum(ops::cos), sum(ops::sin))
    };
    let doubled_area: f32 = (0..parts).map(|part| point(part).perp_dot(point(part + 1))).sum();
    (TAU / (sides as f32 * doubled_area)).sqrt()
}
