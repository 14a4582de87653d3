//! The settings of one system in the form used by a step: lengths multiplied by λ_t, angles in radians and cosines.

use super::settings::{AngleSpread, SystemSettings};
use crate::synthesis::space::point_grid::PointGrid;
use crate::synthesis::tissue::TissueGrowth;
use crate::synthesis::tree::murray;
use bevy_math::ops;
use std::f32::consts::PI;

/// One system's settings at the present size of the tissue.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lengths {
    pub drain_birth: f32,
    pub node_birth: f32,
    pub influence: f32,
    pub kill: f32,
    pub step: f32,
    pub terminal_radius: f32,
    pub direction_weight: f32,
    /// cos γ/2, or below −1 if everything is perceived.
    pub cos_half_perception: f32,
    /// sin γ/2.
    pub sin_half_perception: f32,
    pub bifurcation_threshold: f32,
    pub angle_spread: AngleSpread,
    /// Half the angle between the daughters of a symmetric bifurcation, in radians.
    pub half_bifurcation: f32,
    pub lateral_sprouts: bool,
    pub root_children: u32,
    /// Whether the angle of sprouts beside a vessel changes between steps even if the vessel does not.
    pub sprouts_turn: bool,
}

impl Lengths {
    /// The lengths at tissue size σ_t, relative to the start: λ_t = 1/σ_t.
    pub fn at_size(settings: &SystemSettings, size: f32) -> Self {
        let scale = size.recip();
        let half_perception = (0.5 * settings.perception_angle).to_radians();
        Self {
            drain_birth: settings.drain_birth_distance * scale,
            node_birth: settings.node_birth_distance * scale,
            influence: settings.influence_distance * scale,
            kill: settings.kill_distance * scale,
            step: settings.step_length * scale,
            terminal_radius: settings.terminal_radius * if settings.scale_terminal_radius { scale } else { 1.0 },
            direction_weight: settings.direction_weight,
            cos_half_perception: if half_perception >= PI { -2.0 } else { ops::cos(half_perception) },
            sin_half_perception: ops::sin(half_perception),
            bifurcation_threshold: settings.bifurcation_threshold.to_radians(),
            angle_spread: settings.angle_spread,
            half_bifurcation: murray::symmetric_half_angle(settings.bifurcation_exponent),
            lateral_sprouts: settings.lateral_sprouts,
            root_children: settings.root_children,
            sprouts_turn: settings.scale_terminal_radius && settings.tissue_growth != TissueGrowth::None,
        }
    }

    /// Largest distance at which a node matters to a drain, which acts on it or is supplied by it.
    pub fn reach(&self) -> f32 {
        self.influence.max(self.kill)
    }

    /// Distance from the tissue's surface within which a segment stays: half its radius, but not so little that a step
    /// would take many segments, nor so much that they wouldn't follow the surface.
    pub fn bend_tolerance(&self) -> f32 {
        (0.5 * self.terminal_radius).clamp(self.step / 256.0, self.step / 16.0)
    }

    /// Side of the cells of the indices over nodes and drains, which are asked together: a little more than twice the most
    /// frequent reach. Empty cells cost nothing, and a cell of this size has about one node.
    pub fn cell(&self) -> f32 {
        PointGrid::CELL * self.node_birth.max(self.drain_birth).max(self.kill).max(0.25 * self.influence)
    }
}
