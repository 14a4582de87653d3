//! Clotting of open ends.
//!
//! The open area of an end falls as e^(−t/τ) after the cut, and closes at once when a small share is left. τ grows with
//! a power of the diameter, and is based on two references:
//!
//! - A sheep's carotid with a hole of 2.5 mm bleeds 400 mL/min at first, under 100 after 5 min, and stops near 17 min
//!   (PMID 22166236). With τ = 213 s the area is 24 % after 5 min and 1 % after 16.3 min.
//! - The bleeding time of small vessels is 1 to 9 min (Ivy's test). With the exponent 0.45 vessels of 6 µm close after
//!   1.1 min, of 0.1 mm after 3.8, of 0.5 mm after 7.9.

use crate::synthesis::haemodynamics::FlowError;
use bevy_math::ops;

/// Settings of the clotting.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Clotting {
    /// Time constant τ of a hole with [`Self::REFERENCE_DIAMETER`].
    ///
    /// Higher values let wounds bleed longer, as with anticoagulants.
    ///
    /// Units: seconds. Limits: finite, > 0. Default: [`Self::DEFAULT_TIME_CONSTANT`].
    pub time_constant: f32,
    /// Power of the diameter with which τ grows.
    ///
    /// Higher values make small vessels close sooner and large ones later; 0 closes all alike.
    ///
    /// Limits: 0 to 4. Default: [`Self::DEFAULT_CALIBRE_EXPONENT`].
    pub calibre_exponent: f32,
    /// Share of the area at which the rest closes at once.
    ///
    /// Lower values let an end trickle longer.
    ///
    /// Limits: > 0, below 1. Default: [`Self::DEFAULT_SEALED_SHARE`].
    pub sealed_share: f32,
}

impl Clotting {
    /// Default of the time constant, in seconds.
    pub const DEFAULT_TIME_CONSTANT: f32 = 213.0;
    /// Default of the power of the diameter.
    pub const DEFAULT_CALIBRE_EXPONENT: f32 = 0.45;
    /// Default of the share at which an end is sealed.
    pub const DEFAULT_SEALED_SHARE: f32 = 0.01;
    /// Diameter of the hole whose time constant is given, in metres: that of the experiment.
    pub const REFERENCE_DIAMETER: f64 = 2.5e-3;

    /// Time constant τ of a hole, in seconds. Its diameter is in metres.
    pub fn time_constant_of(&self, diameter: f64) -> f64 {
        let calibre = (diameter / Self::REFERENCE_DIAMETER) as f32;
        f64::from(self.time_constant * ops::powf(calibre, self.calibre_exponent))
    }

    /// Share of a hole's area that is open at an age in seconds; 0 once it is sealed.
    pub fn opening(&self, diameter: f64, age: f64) -> f64 {
        let share = ops::exp(-(age / self.time_constant_of(diameter)) as f32);
        if share > self.sealed_share { f64::from(share) } else { 0.0 }
    }

    /// Age in seconds at which a hole is sealed. Its diameter is in metres.
    pub fn sealed_after(&self, diameter: f64) -> f64 {
        -self.time_constant_of(diameter) * f64::from(ops::ln(self.sealed_share))
    }

    pub(crate) fn validate(&self) -> Result<(), FlowError> {
        FlowError::check_positive("the time constant of clotting in s", f64::from(self.time_constant))?;
        FlowError::check_share(
            "a quarter of the calibre exponent of clotting",
            f64::from(self.calibre_exponent) / 4.0,
        )?;
        let sealed = f64::from(self.sealed_share);
        FlowError::check_positive("the share at which an end is sealed", sealed)?;
        FlowError::check_share("the share at which an end is sealed", sealed)
    }
}

impl Default for Clotting {
    fn default() -> Self {
        Self {
            time_constant: Self::DEFAULT_TIME_CONSTANT,
            calibre_exponent: Self::DEFAULT_CALIBRE_EXPONENT,
            sealed_share: Self::DEFAULT_SEALED_SHARE,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::haemodynamics::clotting::*;

    #[test]
    fn ends_close_within_the_published_times() {
        let clotting = Clotting::default();
        let minutes = |diameter: f64| clotting.sealed_after(diameter) / 60.0;
        assert!((minutes(2.5e-3) / 17.0 - 1.0).abs() < 0.15, "{}", minutes(2.5e-3));
        assert!(clotting.opening(2.5e-3, 300.0) < 0.25);
        for micrometres in [6.0, 20.0, 100.0, 500.0] {
            let minutes = minutes(micrometres * 1e-6);
            assert!((1.0..9.0).contains(&minutes), "{micrometres} µm: {minutes} min");
        }
    }

    #[test]
    fn an_opening_starts_whole_and_ends_sealed() {
        let clotting = Clotting::default();
        assert_eq!(clotting.opening(1e-3, 0.0), 1.0);
        let sealed = clotting.sealed_after(1e-3);
        assert!(clotting.opening(1e-3, 0.999 * sealed) > 0.0);
        assert_eq!(clotting.opening(1e-3, 1.001 * sealed), 0.0);
        assert_eq!(clotting.opening(1e-3, 1e12), 0.0);
    }

    #[test]
    fn settings_outside_their_limits_are_refused() {
        let default = Clotting::default();
        for bad in [
            Clotting { time_constant: 0.0, ..default },
            Clotting { time_constant: f32::NAN, ..default },
            Clotting { calibre_exponent: -1.0, ..default },
            Clotting { sealed_share: 0.0, ..default },
            Clotting { sealed_share: 1.5, ..default },
        ] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
        assert_eq!(default.validate(), Ok(()));
    }
}
