//! Settings of the growth, and their defaults.
//!
//! Source: Rauch & Harders, "Interactive Synthesis of 3D Geometries of Blood Vessels" (2021), sections 3 and 4. Lengths
//! are in tissue lengths. The defaults are those of the paper's disc of diameter 1; [`ColonizationSettings::fit`] fits
//! them to a tissue of any size.

pub use super::validity::{SettingsError, SettingsWarning};

#[cfg(doc)]
use crate::synthesis::mesh::MAX_COORDINATE;
use crate::synthesis::roots::RootSpacing;
use crate::synthesis::tissue::{Extent, TissueGrowth};
use crate::synthesis::tree::{ByKind, VesselKind};

/// The measure of the drains' spread around a tip that decides on a bifurcation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum AngleSpread {
    /// The standard deviation, as in the paper's text.
    #[default]
    StandardDeviation,
    /// The root of the summed squares, not divided by their number, as in the paper's own program. More drains then
    /// reach the threshold sooner.
    RootSumOfSquares,
}

/// Settings of one system, arterial or venous.
///
/// All lengths are multiplied by λ_t = σ₀/σ_t as the tissue grows by [`tissue_growth`](Self::tissue_growth).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct SystemSettings {
    /// Weight ω of a vessel's present direction against the direction to its drains (Eq. 4).
    ///
    /// Higher values give straighter vessels; near 1 they no longer turn towards the tissue that they should supply.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_DIRECTION_WEIGHT`].
    pub direction_weight: f32,
    /// Least distance between a new drain and the other drains.
    ///
    /// Higher values give fewer drains and a coarser tree. Drains handed to the venous system are not tested again.
    ///
    /// Units: tissue lengths. Limits: 0 to [`MAX_COORDINATE`]. Default: [`Self::DEFAULT_DRAIN_BIRTH_DISTANCE`].
    pub drain_birth_distance: f32,
    /// Least distance between a new drain and the nodes of the tree: tissue closer than this is supplied.
    ///
    /// Higher values leave more room between vessels.
    ///
    /// Units: tissue lengths. Limits: 0 to [`MAX_COORDINATE`]. Default: [`Self::DEFAULT_NODE_BIRTH_DISTANCE`].
    pub node_birth_distance: f32,
    /// Distance δ within which a drain acts on its nearest node (Eq. 2 and 3).
    ///
    /// Higher values let vessels react to distant drains with fewer, smoother turns; lower values leave drains without
    /// effect.
    ///
    /// Units: tissue lengths. Limits: > 0, at most [`MAX_COORDINATE`]. Default: [`Self::DEFAULT_INFLUENCE_DISTANCE`].
    pub influence_distance: f32,
    /// Distance at which a drain that has acted counts as supplied and is removed.
    ///
    /// Lower values let terminals come closer to the tissue they feed, and take more steps.
    ///
    /// Units: tissue lengths. Limits: > 0, at most [`MAX_COORDINATE`]. Default: [`Self::DEFAULT_KILL_DISTANCE`].
    pub kill_distance: f32,
    /// Full opening angle γ of a node's perception volume (Eq. 2 and 3).
    ///
    /// Higher values let vessels react to drains beside them, and bend more sharply.
    ///
    /// Units: degrees. Limits: 0 to 360. Default: [`Self::DEFAULT_PERCEPTION_ANGLE`].
    pub perception_angle: f32,
    /// Radius of a terminal segment.
    ///
    /// All other radii follow from it by Murray's law, so it scales the thickness of the whole tree.
    ///
    /// Units: tissue lengths. Limits: > 0, at most [`MAX_COORDINATE`]. Default: [`Self::DEFAULT_TERMINAL_RADIUS`].
    pub terminal_radius: f32,
    /// Whether the terminal radius shrinks with λ_t like all other lengths, as in the paper's text. The paper's own
    /// program keeps it constant.
    ///
    /// Default: true.
    pub scale_terminal_radius: bool,
    /// Length d of a new segment.
    ///
    /// Lower values give smoother vessels and more nodes. Above the kill distance vessels overshoot their drains.
    ///
    /// Units: tissue lengths. Limits: > 0, at most [`MAX_COORDINATE`]. Default: [`Self::DEFAULT_STEP_LENGTH`].
    pub step_length: f32,
    /// Spread φ of the angles to its drains from which a tip bifurcates symmetrically.
    ///
    /// Higher values give fewer symmetric bifurcations, hence more lateral branches from a dominant vessel. Infinity (or
    /// anything above 180) turns them off.
    ///
    /// Units: degrees. Limits: ≥ 0. Default: [`Self::DEFAULT_BIFURCATION_THRESHOLD`].
    pub bifurcation_threshold: f32,
    /// The measure of the spread that is compared with the threshold.
    ///
    /// Default: the standard deviation.
    pub angle_spread: AngleSpread,
    /// Exponent κ of Murray's law, r_p^κ = r_l^κ + r_r^κ.
    ///
    /// Higher values make parents thinner relative to their children, and bifurcations wider.
    ///
    /// Limits: 2 to 4, both excluded. Default: [`Self::DEFAULT_BIFURCATION_EXPONENT`].
    pub bifurcation_exponent: f32,
    /// Law of tissue growth, by which lengths shrink.
    ///
    /// Default: linear, [`TissueGrowth::DEFAULT_LINEAR`] a step.
    pub tissue_growth: TissueGrowth,
    /// Whether vessels may sprout sideways between two nodes. If not, only tips grow and bifurcate, as in the paper's
    /// conjunctiva.
    ///
    /// Default: true.
    pub lateral_sprouts: bool,
    /// Most vessels that may leave a root.
    ///
    /// With 1, as in the paper, a root inside the tissue whose only vessel grows to a near edge can never reach the
    /// tissue behind it: on a disc about 2 % of random roots then supply next to nothing, with 2 none of 400. Narrow
    /// organs need more.
    ///
    /// Limits: ≥ 1. Default: [`Self::DEFAULT_ROOT_CHILDREN`].
    pub root_children: u32,
}

impl SystemSettings {
    /// ω of the paper.
    pub const DEFAULT_DIRECTION_WEIGHT: f32 = 0.5;
    /// Birth distance between drains of the paper.
    pub const DEFAULT_DRAIN_BIRTH_DISTANCE: f32 = 0.03;
    /// Birth distance between drain and node of the paper.
    pub const DEFAULT_NODE_BIRTH_DISTANCE: f32 = 0.04;
    /// δ of the paper.
    pub const DEFAULT_INFLUENCE_DISTANCE: f32 = 0.065;
    /// Kill distance of the paper.
    pub const DEFAULT_KILL_DISTANCE: f32 = 0.03;
    /// γ of the paper, in degrees.
    pub const DEFAULT_PERCEPTION_ANGLE: f32 = 90.0;
    /// Terminal radius of the paper.
    pub const DEFAULT_TERMINAL_RADIUS: f32 = 0.0005;
    /// d of the paper.
    pub const DEFAULT_STEP_LENGTH: f32 = 0.03;
    /// φ of the paper, in degrees.
    pub const DEFAULT_BIFURCATION_THRESHOLD: f32 = 15.0;
    /// κ of the paper.
    pub const DEFAULT_BIFURCATION_EXPONENT: f32 = 2.55;
    /// Default of [`root_children`](Self::root_children).
    pub const DEFAULT_ROOT_CHILDREN: u32 = 4;
    /// Venous influence distance, as a multiple of the arterial one, that keeps the venous tree from stalling.
    ///
    /// The drains handed over are near the arteries, and the veins reach them only from further away. At 1 most venous
    /// trees stall on a disc, at 1.5 some of a hundred, at 2 some on narrow organs.
    pub const DEFAULT_VENOUS_INFLUENCE_FACTOR: f32 = 2.5;

    /// Multiplies every length by `factor`. Angles, weights and exponents stay.
    pub fn scale_lengths(&mut self, factor: f32) {
        for length in [
            &mut self.drain_birth_distance,
            &mut self.node_birth_distance,
            &mut self.influence_distance,
            &mut self.kill_distance,
            &mut self.terminal_radius,
            &mut self.step_length,
        ] {
            *length *= factor;
        }
    }
}

impl Default for SystemSettings {
    fn default() -> Self {
        Self {
            direction_weight: Self::DEFAULT_DIRECTION_WEIGHT,
            drain_birth_distance: Self::DEFAULT_DRAIN_BIRTH_DISTANCE,
            node_birth_distance: Self::DEFAULT_NODE_BIRTH_DISTANCE,
            influence_distance: Self::DEFAULT_INFLUENCE_DISTANCE,
            kill_distance: Self::DEFAULT_KILL_DISTANCE,
            perception_angle: Self::DEFAULT_PERCEPTION_ANGLE,
            terminal_radius: Self::DEFAULT_TERMINAL_RADIUS,
            scale_terminal_radius: true,
            step_length: Self::DEFAULT_STEP_LENGTH,
            bifurcation_threshold: Self::DEFAULT_BIFURCATION_THRESHOLD,
            angle_spread: AngleSpread::default(),
            bifurcation_exponent: Self::DEFAULT_BIFURCATION_EXPONENT,
            tissue_growth: TissueGrowth::default(),
            lateral_sprouts: true,
            root_children: Self::DEFAULT_ROOT_CHILDREN,
        }
    }
}

/// Settings of a growth: both systems, and common settings.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ColonizationSettings {
    /// Number of growth steps.
    ///
    /// More steps fill the tissue further. Limits: ≥ 1. Default: [`Self::DEFAULT_STEPS`].
    pub steps: u32,
    /// Candidates for drains that are drawn from the tissue in each step.
    ///
    /// More samples fill the tissue faster. Default: [`Self::DEFAULT_SAMPLES`].
    pub samples: u32,
    /// Growth ends early if this many steps in a row, after the tissue has stopped growing, gave neither a drain nor a
    /// segment: the tissue is full, or the rest is out of reach. On a staged tissue, growth always goes on to the last
    /// step.
    ///
    /// 0 turns this off. Default: [`Self::DEFAULT_IDLE_STEPS`].
    pub idle_steps: u32,
    /// Settings of the arteries.
    pub arterial: SystemSettings,
    /// Settings of the veins.
    pub venous: SystemSettings,
    /// Whether vessels keep to the tissue. On a mesh's surface they run straight along it and bend where it does, with a
    /// node at each bend, so that no segment leads more than half a terminal radius away from it (but at least 1/256 and at
    /// most 1/16 of a step); they are drawn to tissue on their own side of it, in the directions along it. In other
    /// tissues, a node that leaves the tissue is brought back to its nearest point. The paper's own vessels leave it.
    ///
    /// Default: true.
    pub confine: bool,
    /// Whether vessels on a surface are lifted off it by their radius, so that they lie on it instead of half in it.
    /// Applies to what is drawn and written; without effect in a volume.
    ///
    /// Default: true.
    pub stand_off: bool,
}

impl ColonizationSettings {
    /// Number of steps in the paper's examples.
    pub const DEFAULT_STEPS: u32 = 100;
    /// Samples per step in the paper's examples.
    pub const DEFAULT_SAMPLES: u32 = 1000;
    /// With the default number of samples, 20,000 in a row have then been refused.
    pub const DEFAULT_IDLE_STEPS: u32 = 20;
    /// Most samples per step; more is surely a mistake.
    pub const MAX_SAMPLES: u32 = 100_000_000;

    /// The settings of both systems, arteries first.
    pub fn systems(&self) -> [(VesselKind, &SystemSettings); 2] {
        [(VesselKind::Artery, &self.arterial), (VesselKind::Vein, &self.venous)]
    }

    /// The settings of the system of a kind; `None` for kinds that colonization doesn't grow.
    pub fn system(&self, kind: VesselKind) -> Option<&SystemSettings> {
        self.systems().into_iter().find(|&(own, _)| own == kind).map(|(_, settings)| settings)
    }

    /// The spacing of roots.
    pub fn root_spacing(&self) -> ByKind<Option<RootSpacing>> {
        ByKind::from_fn(|kind| {
            self.system(kind).map(|system| RootSpacing { step: system.step_length, reach: system.influence_distance })
        })
    }

    /// Multiplies every length of both systems by `factor`.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        self.arterial.scale_lengths(factor);
        self.venous.scale_lengths(factor);
        self
    }

    /// Ratio of lengths in a volume to those on a surface of the same equivalent diameter, as in the paper's ball and
    /// disc. There the same samples have more to fill.
    pub const VOLUME_FACTOR: f32 = 1.5;

    /// Fits settings made for a surface of equivalent diameter 1, as in all presets, to a tissue of any size; in a
    /// volume lengths become [`VOLUME_FACTOR`](Self::VOLUME_FACTOR) times as long.
    ///
    /// An organ of 0.3 m and the same organ of 300 mm then grow alike, except for rounding.
    #[must_use]
    pub fn fit(self, extent: Extent) -> Self {
        let factor = if extent.is_solid() { Self::VOLUME_FACTOR } else { 1.0 };
        self.scaled(extent.equivalent_diameter() * factor)
    }
}

impl Default for ColonizationSettings {
    fn default() -> Self {
        let arterial = SystemSettings::default();
        let venous = SystemSettings {
            influence_distance: arterial.influence_distance * SystemSettings::DEFAULT_VENOUS_INFLUENCE_FACTOR,
            ..SystemSettings::default()
        };
        Self {
            steps: Self::DEFAULT_STEPS,
            samples: Self::DEFAULT_SAMPLES,
            idle_steps: Self::DEFAULT_IDLE_STEPS,
            arterial,
            venous,
            confine: true,
            stand_off: true,
        }
    }
}
