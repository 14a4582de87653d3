//! The limits of the settings, and warnings about combinations with known artefacts.

use super::settings::{ColonizationSettings, SystemSettings};
use crate::synthesis::mesh::MAX_COORDINATE;
use crate::synthesis::tree::VesselKind;
use std::fmt;

/// A setting with which growth cannot start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A value outside its limits.
    #[error("{system} {name} is {value}; it must be {limits}")]
    OutOfRange {
        /// The system in question.
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
    /// A law of tissue growth that reaches a size of zero, or an invalid one.
    #[error(
        "{system} tissue_growth reaches a size of {size}; sizes must stay finite and above 0 for all {steps} steps"
    )]
    TissueGrowth {
        /// The system in question.
        system: &'static str,
        /// The size that was reached.
        size: f32,
        /// Steps of the growth.
        steps: u32,
    },
}

/// A valid combination of settings that gives an artefact (Fig. 6 of the paper).
#[derive(Clone, Debug, PartialEq)]
pub enum SettingsWarning {
    /// Vessels overshoot their drains and collide.
    StepExceedsKill {
        /// The system in question.
        system: VesselKind,
        /// Its step length.
        step: f32,
        /// Its kill distance.
        kill: f32,
    },
    /// Drains count as supplied beyond the distance at which they act.
    InfluenceBelowKill {
        /// The system in question.
        system: VesselKind,
        /// Its influence distance.
        influence: f32,
        /// Its kill distance.
        kill: f32,
    },
    /// Vessels bend back on themselves.
    WidePerception {
        /// The system in question.
        system: VesselKind,
        /// Its perception angle in degrees.
        degrees: f32,
    },
    /// Vessels grow straight past the tissue that they should supply.
    StrongDirection {
        /// The system in question.
        system: VesselKind,
        /// Its direction weight.
        weight: f32,
    },
    /// Drains are born within the distance at which they are removed.
    BirthBelowKill {
        /// The system in question.
        system: VesselKind,
        /// Its birth distance to nodes.
        birth: f32,
        /// Its kill distance.
        kill: f32,
    },
}

impl SettingsWarning {
    /// The system in question.
    pub fn system(&self) -> VesselKind {
        match *self {
            Self::StepExceedsKill { system, .. }
            | Self::InfluenceBelowKill { system, .. }
            | Self::WidePerception { system, .. }
            | Self::StrongDirection { system, .. }
            | Self::BirthBelowKill { system, .. } => system,
        }
    }

    /// Changes the settings of its system so that there is no cause for this warning any more: the value that it names
    /// goes to its nearest limit.
    pub fn mend(&self, settings: &mut SystemSettings) {
        match self {
            Self::StepExceedsKill { .. } => settings.step_length = settings.kill_distance,
            Self::InfluenceBelowKill { .. } => settings.influence_distance = settings.kill_distance,
            Self::WidePerception { .. } => settings.perception_angle = ColonizationSettings::WIDE_PERCEPTION,
            Self::StrongDirection { .. } => settings.direction_weight = ColonizationSettings::STRONG_DIRECTION,
            Self::BirthBelowKill { .. } => settings.node_birth_distance = settings.kill_distance,
        }
    }
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

    /// Checks every value against its limits, and returns warnings about combinations with known artefacts.
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
        for (kind, system) in self.systems() {
            system.check(kind, self.steps)?;
            system.warn(kind, &mut warnings);
        }
        Ok(warnings)
    }
}

impl SystemSettings {
    fn check(&self, system: VesselKind, steps: u32) -> Result<(), SettingsError> {
        let range = |name, value: f32, ok: bool, limits| {
            if ok { Ok(()) } else { Err(SettingsError::OutOfRange { system: system.name(), name, value, limits }) }
        };
        let positive = |name, value: f32| {
            range(name, value, value > 0.0 && value <= MAX_COORDINATE, "a length above 0, at most 1e9")
        };
        let not_negative =
            |name, value: f32| range(name, value, (0.0..=MAX_COORDINATE).contains(&value), "a length from 0 to 1e9");
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

    fn warn(&self, system: VesselKind, warnings: &mut Vec<SettingsWarning>) {
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
