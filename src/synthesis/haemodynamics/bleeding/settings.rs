//! Settings of the bleeding.

use crate::synthesis::haemodynamics::{Clotting, FlowError};

/// Settings of the bleeding.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BleedingSettings {
    /// How open ends clot. With `None` they never do.
    pub clotting: Option<Clotting>,
    /// Longest step that is not divided. A pulsatile pressure is always sampled at least [`Self::SAMPLES_PER_BEAT`]
    /// times per beat.
    ///
    /// Lower values follow a pulse more closely and cost more.
    ///
    /// Units: seconds. Limits: finite, > 0. Default: [`Self::DEFAULT_LONGEST_STEP`].
    pub longest_step: f32,
}

impl BleedingSettings {
    /// Default of the longest step: that of a game at 20 frames a second.
    pub const DEFAULT_LONGEST_STEP: f32 = 0.05;
    /// Least number of steps in a beat of the heart.
    pub const SAMPLES_PER_BEAT: f64 = 16.0;

    pub(super) fn validate(&self) -> Result<(), FlowError> {
        FlowError::check_positive("the longest step of the bleeding in s", f64::from(self.longest_step))?;
        self.clotting.map_or(Ok(()), |clotting| clotting.validate())
    }
}

impl Default for BleedingSettings {
    fn default() -> Self {
        Self { clotting: Some(Clotting::default()), longest_step: Self::DEFAULT_LONGEST_STEP }
    }
}
