//! Settings of the growth, their limits, and the warnings for known artefacts.
//!
//! Source: Rauch & Harders, "Interactive Synthesis of 3D Geometries of Blood Vessels" (2021), sections 3 and 4. Lengths
//! are in tissue lengths. The defaults are those of the paper's disc of diameter 1; [`ColonizationSettings::fit`] makes
//! them fit a tissue of any size.

use crate::synthesis::tissue::{Extent, TissueGrowth};
use crate::synthesis::tree::System;
use std::fmt;

/// Which measure of the spread of drains around a tip decides on a bifurcation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum AngleSpread {
    /// The standard deviation, as the paper's text has it.
    #[default]
    StandardDeviation,
    /// The root of the summed squares, not divided by their number, as the paper's own program computes it. The
    /// threshold is then reached sooner the more drains there are.
    RootSumOfSquares,
}

/// Settings of one system, arterial or venous.
///
/// Every length is multiplied by λ_t = σ₀/σ_t as the tissue grows by [`tissue_growth`](Self::tissue_growth).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct SystemSettings {
    /// Weight ω of the direction a vessel already has against the direction to its drains (Eq. 4).
    ///
    /// Higher values give straighter vessels; near 1 they no longer turn towards what they should supply.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_DIRECTION_WEIGHT`].
    pub direction_weight: f32,
    /// Least distance between a new drain and the other drains.
    ///
    /// Higher values give fewer drains and a coarser tree. Drains handed to the venous system are not tested again.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: [`Self::DEFAULT_DRAIN_BIRTH_DISTANCE`].
    pub drain_birth_distance: f32,
    /// Least distance between a new drain and the nodes of the tree: tissue closer than this is supplied.
    ///
    /// Higher values leave more room between vessels.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: [`Self::DEFAULT_NODE_BIRTH_DISTANCE`].
    pub node_birth_distance: f32,
    /// Distance δ within which a drain acts on its nearest node (Eq. 2 and 3).
    ///
    /// Higher values let vessels feel drains from afar and take fewer, smoother turns; lower values leave drains unheard.
    ///
    /// Units: tissue lengths. Limits: > 0. Default: [`Self::DEFAULT_INFLUENCE_DISTANCE`].
    pub influence_distance: f32,
    /// Distance at which a drain that has acted counts as supplied and is removed.
    ///
    /// Lower values let terminals come closer to the tissue they feed, and take more steps.
    ///
    /// Units: tissue lengths. Limits: > 0. Default: [`Self::DEFAULT_KILL_DISTANCE`].
    pub kill_distance: f32,
    /// Full opening angle γ of a node's perception volume (Eq. 2 and 3).
    ///
    /// Higher values let vessels answer drains beside them, and bend more sharply.
    ///
    /// Units: degrees. Limits: 0 to 360. Default: [`Self::DEFAULT_PERCEPTION_ANGLE`].
    pub perception_angle: f32,
    /// Radius of a terminal segment.
    ///
    /// All other radii follow from it by Murray's law, so it scales the thickness of the whole tree.
    ///
    /// Units: tissue lengths. Limits: > 0. Default: [`Self::DEFAULT_TERMINAL_RADIUS`].
    pub terminal_radius: f32,
    /// Whether the terminal radius shrinks with λ_t like every other length, as the paper's text says. Its own program
    /// keeps it.
    ///
    /// Default: true.
    pub scale_terminal_radius: bool,
    /// Length d of a new segment.
    ///
    /// Lower values give smoother vessels and more nodes. Above the kill distance vessels overshoot what they grow to.
    ///
    /// Units: tissue lengths. Limits: > 0. Default: [`Self::DEFAULT_STEP_LENGTH`].
    pub step_length: f32,
    /// Spread φ of the angles to its drains from which on a tip bifurcates symmetrically.
    ///
    /// Higher values give fewer symmetric bifurcations, hence more lateral branches from a dominant vessel. Infinity (or
    /// anything above 180) turns them off.
    ///
    /// Units: degrees. Limits: ≥ 0. Default: [`Self::DEFAULT_BIFURCATION_THRESHOLD`].
    pub bifurcation_threshold: f32,
    /// How the spread that is compared with the threshold is measured.
    ///
    /// Default: the standard deviation.
    pub angle_spread: AngleSpread,
    /// Exponent κ of Murray's law, r_p^κ = r_l^κ + r_r^κ.
    ///
    /// Higher values make parents less thick than their children together need, and bifurcations wider.
    ///
    /// Limits: 2 to 4, both excluded. Default: [`Self::DEFAULT_BIFURCATION_EXPONENT`].
    pub bifurcation_exponent: f32,
    /// Law by which the tissue grows, and lengths shrink.
    ///
    /// Default: linear, [`TissueGrowth::DEFAULT_LINEAR`] a step.
    pub tissue_growth: TissueGrowth,
    /// Whether vessels may sprout sideways between two nodes. Without, only tips grow and bifurcate, as the paper's
    /// conjunctiva does.
    ///
    /// Default: true.
    pub lateral_sprouts: bool,
    /// How many vessels may leave a root.
    ///
    /// With 1, as in the paper, a root inside the tissue whose only vessel runs to a near edge can never reach what lies
    /// behind it: on a disc about 2 % of random roots then supply next to nothing, with 2 none of 400. Narrow organs need
    /// more.
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
    /// Vessels that may leave a root.
    pub const DEFAULT_ROOT_CHILDREN: u32 = 4;
    /// Venous influence distance, as a multiple of the arterial one, that keeps the venous tree from stalling.
    ///
    /// The drains handed over lie where the arteries were, which the veins reach only from further away. At 1 most venous
    /// trees stall on a disc, at 1.5 some of a hundred do, at 2 some on narrow organs.
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

/// Settings of a growth: both systems, and what they share.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ColonizationSettings {
    /// Number of growth steps.
    ///
    /// More steps fill the tissue further. Limits: ≥ 1. Default: [`Self::DEFAULT_STEPS`].
    pub steps: u32,
    /// Candidates for a drain drawn from the tissue in each step.
    ///
    /// More samples fill the tissue faster. Default: [`Self::DEFAULT_SAMPLES`].
    pub samples: u32,
    /// Growth ends before its last step when so many steps in a row, after the tissue has ceased to grow, brought neither a
    /// drain nor a segment: the tissue is full, or what is left of it is out of reach. A tissue that changes in stages is
    /// grown to the last step all the same.
    ///
    /// 0 turns this off. Default: [`Self::DEFAULT_IDLE_STEPS`].
    pub idle_steps: u32,
    /// Settings of the arteries.
    pub arterial: SystemSettings,
    /// Settings of the veins.
    pub venous: SystemSettings,
    /// Whether a node that leaves the tissue is brought back to the tissue's nearest point: onto a surface, or into a
    /// volume. The paper's own vessels leave it.
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
    /// Steps of the paper's examples.
    pub const DEFAULT_STEPS: u32 = 100;
    /// Samples a step of the paper's examples.
    pub const DEFAULT_SAMPLES: u32 = 1000;
    /// With the default samples 20,000 of them have then been refused in a row.
    pub const DEFAULT_IDLE_STEPS: u32 = 20;
    /// Most samples a step; more than this is surely a slip.
    pub const MAX_SAMPLES: u32 = 100_000_000;

    /// The settings of one system.
    pub fn system(&self, system: System) -> &SystemSettings {
        match system {
            System::Arterial => &self.arterial,
            System::Venous => &self.venous,
        }
    }

    /// The settings of one system, to change them.
    pub fn system_mut(&mut self, system: System) -> &mut SystemSettings {
        match system {
            System::Arterial => &mut self.arterial,
            System::Venous => &mut self.venous,
        }
    }

    /// Multiplies every length of both systems by `factor`.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        self.arterial.scale_lengths(factor);
        self.venous.scale_lengths(factor);
        self
    }

    /// Lengths in a volume as a multiple of those on a surface of the same equivalent diameter: the paper's ball against
    /// its disc. The same samples have more to fill there.
    pub const VOLUME_FACTOR: f32 = 1.5;

    /// Fits settings made for a surface of equivalent diameter 1, as all presets are, to a tissue of any size; in a volume
    /// lengths come out [`VOLUME_FACTOR`](Self::VOLUME_FACTOR) times as long.
    ///
    /// A 0.3 m organ and the same organ of 300 mm then grow the same vessels.
    #[must_use]
    pub fn fit(self, extent: Extent) -> Self {
        let factor = if let Extent::Volume(_) = extent { Self::VOLUME_FACTOR } else { 1.0 };
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

/// A setting that growth cannot start with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A value outside its limits.
    #[error("{system} {name} is {value}; it must be {limits}")]
    OutOfRange {
        /// The system whose setting it is.
        system: &'static str,
        /// Name of the field.
        name: &'static str,
        /// The value found.
        value: f32,
        /// What it may be.
        limits: &'static str,
    },
    /// A count outside its limits.
    #[error("{name} is {value}; it must be {limits}")]
    CountOutOfRange {
        /// Name of the field.
        name: &'static str,
        /// The value found.
        value: u32,
        /// What it may be.
        limits: &'static str,
    },
    /// A law of tissue growth that reaches a size of zero, or none.
    #[error(
        "{system} tissue_growth reaches a size of {size}; sizes must stay finite and above 0 for all {steps} steps"
    )]
    TissueGrowth {
        /// The system whose setting it is.
        system: &'static str,
        /// The size that was reached.
        size: f32,
        /// Steps of the growth.
        steps: u32,
    },
}

/// A combination of settings that grows, but with an artefact (Fig. 6 of the paper).
#[derive(Clone, Debug, PartialEq)]
pub enum SettingsWarning {
    /// Vessels overshoot the drains they grow to and collide.
    StepExceedsKill {
        /// The system in question.
        system: System,
        /// Its step length.
        step: f32,
        /// Its kill distance.
        kill: f32,
    },
    /// Drains count as supplied further away than they are heard.
    InfluenceBelowKill {
        /// The system in question.
        system: System,
        /// Its influence distance.
        influence: f32,
        /// Its kill distance.
        kill: f32,
    },
    /// Vessels bend back on themselves.
    WidePerception {
        /// The system in question.
        system: System,
        /// Its perception angle in degrees.
        degrees: f32,
    },
    /// Vessels grow straight past what they should supply.
    StrongDirection {
        /// The system in question.
        system: System,
        /// Its direction weight.
        weight: f32,
    },
    /// Drains are born within the distance at which they are removed.
    BirthBelowKill {
        /// The system in question.
        system: System,
        /// Its birth distance to nodes.
        birth: f32,
        /// Its kill distance.
        kill: f32,
    },
}

impl fmt::Display for SettingsWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StepExceedsKill { system, step, kill } => write!(
                f,
                "{}: the step length {step} is above the kill distance {kill}, so vessels overshoot and collide; lower the step length",
                system.name()
            ),
            Self::InfluenceBelowKill { system, influence, kill } => write!(
                f,
                "{}: the influence distance {influence} is below the kill distance {kill}, so few drains act; raise the influence distance",
                system.name()
            ),
            Self::WidePerception { system, degrees } => write!(
                f,
                "{}: the perception angle of {degrees}° lets vessels turn back; stay at or below 180°",
                system.name()
            ),
            Self::StrongDirection { system, weight } => write!(
                f,
                "{}: the direction weight {weight} makes vessels miss their drains; stay at or below 0.95",
                system.name()
            ),
            Self::BirthBelowKill { system, birth, kill } => write!(
                f,
                "{}: drains are born {birth} from a node, within the kill distance {kill}; raise node_birth_distance",
                system.name()
            ),
        }
    }
}

impl ColonizationSettings {
    /// Perception angle above which vessels turn back, in degrees.
    const WIDE_PERCEPTION: f32 = 180.0;
    /// Direction weight above which vessels miss their drains.
    const STRONG_DIRECTION: f32 = 0.95;

    /// Checks every value against its limits, and names the combinations that give known artefacts.
    ///
    /// # Errors
    /// The first value outside its limits. Settings that pass cannot make a growth step fail.
    pub fn validate(&self) -> Result<Vec<SettingsWarning>, SettingsError> {
        let count = |name, value, limits| Err(SettingsError::CountOutOfRange { name, value, limits });
        if self.steps == 0 {
            return count("steps", 0, "at least 1");
        }
        if self.samples > Self::MAX_SAMPLES {
            return count("samples", self.samples, "at most 100000000");
        }
        let mut warnings = Vec::new();
        for system in System::ALL {
            self.system(system).check(system, self.steps)?;
            self.system(system).warn(system, &mut warnings);
        }
        Ok(warnings)
    }
}

impl SystemSettings {
    fn check(&self, system: System, steps: u32) -> Result<(), SettingsError> {
        let range = |name, value: f32, ok: bool, limits| {
            if ok { Ok(()) } else { Err(SettingsError::OutOfRange { system: system.name(), name, value, limits }) }
        };
        let positive =
            |name, value: f32| range(name, value, value.is_finite() && value > 0.0, "a finite length above 0");
        let not_negative =
            |name, value: f32| range(name, value, value.is_finite() && value >= 0.0, "a finite length of at least 0");
        let weight = self.direction_weight;
        range("direction_weight", weight, (0.0..=1.0).contains(&weight), "between 0 and 1")?;
        not_negative("drain_birth_distance", self.drain_birth_distance)?;
        not_negative("node_birth_distance", self.node_birth_distance)?;
        positive("influence_distance", self.influence_distance)?;
        positive("kill_distance", self.kill_distance)?;
        positive("terminal_radius", self.terminal_radius)?;
        positive("step_length", self.step_length)?;
        let angle = self.perception_angle;
        range("perception_angle", angle, (0.0..=360.0).contains(&angle), "between 0 and 360 degrees")?;
        let threshold = self.bifurcation_threshold;
        range("bifurcation_threshold", threshold, threshold >= 0.0, "at least 0 degrees, infinity included")?;
        let exponent = self.bifurcation_exponent;
        range("bifurcation_exponent", exponent, exponent > 2.0 && exponent < 4.0, "above 2 and below 4")?;
        if self.root_children == 0 {
            return Err(SettingsError::CountOutOfRange { name: "root_children", value: 0, limits: "at least 1" });
        }
        self.tissue_growth.check(steps).map_err(|size| SettingsError::TissueGrowth {
            system: system.name(),
            size,
            steps,
        })
    }

    fn warn(&self, system: System, warnings: &mut Vec<SettingsWarning>) {
        let kill = self.kill_distance;
        if self.step_length > kill {
            warnings.push(SettingsWarning::StepExceedsKill { system, step: self.step_length, kill });
        }
        if self.influence_distance < kill {
            warnings.push(SettingsWarning::InfluenceBelowKill { system, influence: self.influence_distance, kill });
        }
        if self.perception_angle > ColonizationSettings::WIDE_PERCEPTION {
            warnings.push(SettingsWarning::WidePerception { system, degrees: self.perception_angle });
        }
        if self.direction_weight > ColonizationSettings::STRONG_DIRECTION {
            warnings.push(SettingsWarning::StrongDirection { system, weight: self.direction_weight });
        }
        if self.node_birth_distance < kill {
            warnings.push(SettingsWarning::BirthBelowKill { system, birth: self.node_birth_distance, kill });
        }
    }
}
