//! The blood that a patient has left, and the effect of its loss on the pressure.
//!
//! The pressure holds while the body compensates, then falls ever faster: with f the share of the blood lost, its share
//! is 1 up to f₀, 1 − ((f − f₀)/(f₁ − f₀))² up to f₁, and 0 beyond.
//!
//! Source: a loss below 15 % changes arterial pressure little, one of 15 to 40 % lowers it according to its amount,
//! more than 40 % is life-threatening (Klabunde, Cardiovascular Physiology Concepts, "Hemorrhagic Shock"); it falls to
//! zero when 35 to 45 % are lost fast (Guyton & Hall, Textbook of Medical Physiology, chapter on circulatory shock).
//! The parabola in between is our choice. Refilling from tissue takes hours and is not modelled.

use crate::synthesis::{haemodynamics::FlowError, units::Volume};

/// Settings of a patient's blood.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BloodVolumeSettings {
    /// The patient's blood volume before any loss.
    ///
    /// Lower values, as in a child, make the same wound more severe.
    ///
    /// Limits: finite, > 0. Default: [`Self::DEFAULT_TOTAL`].
    pub total: Volume,
    /// Whether a loss lowers the pressure. If not, the pressure holds at any loss.
    ///
    /// Default: true.
    pub lowers_pressure: bool,
    /// Share of the blood that can be lost without an effect on the pressure.
    ///
    /// Limits: 0 to [`exhausted`](Self::exhausted). Default: [`Self::DEFAULT_COMPENSATED`].
    pub compensated: f32,
    /// Share of the blood whose loss leaves no pressure.
    ///
    /// Limits: above [`compensated`](Self::compensated), at most 1. Default: [`Self::DEFAULT_EXHAUSTED`].
    pub exhausted: f32,
}

impl BloodVolumeSettings {
    /// Default of the blood volume, in millilitres: 70 mL for each of an adult's 70 kg.
    pub const DEFAULT_TOTAL: f64 = 4900.0;
    /// Default of the share that is compensated.
    pub const DEFAULT_COMPENSATED: f32 = 0.15;
    /// Default of the share that leaves no pressure.
    pub const DEFAULT_EXHAUSTED: f32 = 0.45;

    /// Share of the pressure that a loss leaves.
    pub fn pressure_share(&self, lost: Volume) -> f64 {
        if !self.lowers_pressure {
            return 1.0;
        }
        let (from, to) = (f64::from(self.compensated), f64::from(self.exhausted));
        let share = lost.cubic_metres() / self.total.cubic_metres();
        let x = ((share - from) / (to - from)).clamp(0.0, 1.0);
        1.0 - x * x
    }

    fn validate(&self) -> Result<(), FlowError> {
        FlowError::check_positive("the blood volume in mL", self.total.ml())?;
        let (from, to) = (f64::from(self.compensated), f64::from(self.exhausted));
        FlowError::check_share("the share of blood whose loss is compensated", from)?;
        FlowError::check_share("the share of blood whose loss leaves no pressure", to)?;
        FlowError::check_positive("the share without pressure, above that compensated,", to - from)
    }
}

impl Default for BloodVolumeSettings {
    fn default() -> Self {
        Self {
            total: Volume::from_ml(Self::DEFAULT_TOTAL),
            lowers_pressure: true,
            compensated: Self::DEFAULT_COMPENSATED,
            exhausted: Self::DEFAULT_EXHAUSTED,
        }
    }
}

/// The blood of one patient, shared by all bleeding organs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct BloodVolume {
    settings: BloodVolumeSettings,
    /// In m³.
    lost: f64,
}

impl BloodVolume {
    /// Largest share of the blood that flows in one part of a step.
    const LARGEST_SHARE: f64 = 1.0 / 64.0;

    /// The blood of a patient who has lost none.
    ///
    /// # Errors
    /// If a setting is outside its limits.
    pub fn new(settings: BloodVolumeSettings) -> Result<Self, FlowError> {
        settings.validate()?;
        Ok(Self { settings, lost: 0.0 })
    }

    /// The settings that it was made with.
    pub fn settings(&self) -> &BloodVolumeSettings {
        &self.settings
    }

    /// Total loss of all wounds.
    pub fn lost(&self) -> Volume {
        Volume::from_cubic_metres(self.lost)
    }

    /// Share of the blood that is lost, from 0 to 1.
    pub fn lost_share(&self) -> f64 {
        self.lost / self.settings.total.cubic_metres()
    }

    /// Share of the pressure that is left.
    pub fn pressure_share(&self) -> f64 {
        self.settings.pressure_share(self.lost())
    }

    /// Share of the pressure that is left after losing a further volume in m³.
    pub(super) fn pressure_share_after(&self, more: f64) -> f64 {
        self.settings.pressure_share(Volume::from_cubic_metres(self.lost + more))
    }

    /// The time in seconds in which a loss of `rate` m³/s takes the largest share of the blood that one part of a step may
    /// take; `None` if that is no less than `seconds`, or no blood is left.
    pub(super) fn shorter(&self, rate: f64, seconds: f64) -> Option<f64> {
        let most = Self::LARGEST_SHARE * self.settings.total.cubic_metres();
        (self.left() > 0.0 && rate * seconds > 2.0 * most).then(|| most / rate)
    }

    /// The share of a loss of `rate` m³/s over a time in seconds that is there to be lost.
    pub(super) fn share_there(&self, rate: f64, seconds: f64) -> f64 {
        let loss = rate * seconds;
        // A rate over no time needs no blood but some that could flow.
        if loss > self.left() || self.left() == 0.0 { self.left() / loss.max(f64::MIN_POSITIVE) } else { 1.0 }
    }

    /// What is left, in m³.
    fn left(&self) -> f64 {
        (self.settings.total.cubic_metres() - self.lost).max(0.0)
    }

    /// Takes blood away, at most what is left.
    pub fn lose(&mut self, volume: Volume) {
        self.lost = (self.lost + volume.cubic_metres()).min(self.settings.total.cubic_metres());
    }

    /// Gives blood back, at most the lost volume.
    pub fn transfuse(&mut self, volume: Volume) {
        self.lost = (self.lost - volume.cubic_metres()).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::haemodynamics::blood_volume::*;

    #[test]
    fn the_pressure_holds_then_falls_to_nothing() {
        let settings = BloodVolumeSettings::default();
        let share = |f: f64| settings.pressure_share(Volume::from_ml(4900.0 * f));
        assert_eq!(share(0.0), 1.0);
        assert_eq!(share(0.15), 1.0);
        assert!((share(0.30) - 0.75).abs() < 1e-6);
        assert!((0.2..0.4).contains(&share(0.40)));
        assert_eq!(share(0.46), 0.0);
        let falling: Vec<f64> = (0..100).map(|i| share(f64::from(i) * 0.01)).collect();
        assert!(falling.windows(2).all(|pair| pair[1] <= pair[0]));
        let constant = BloodVolumeSettings { lowers_pressure: false, ..settings };
        assert_eq!(constant.pressure_share(Volume::from_ml(1e6)), 1.0);
    }

    #[test]
    fn transfusion_restores_the_pressure() {
        let mut blood = BloodVolume::new(BloodVolumeSettings::default()).unwrap();
        blood.lose(Volume::from_ml(1960.0));
        assert!((blood.lost_share() - 0.4).abs() < 1e-12 && blood.pressure_share() < 0.4);
        blood.transfuse(Volume::from_ml(1960.0));
        assert_eq!(blood.pressure_share(), 1.0);
        blood.transfuse(Volume::from_ml(5.0));
        assert_eq!(blood.lost(), Volume::ZERO);
    }

    #[test]
    fn settings_outside_their_limits_are_refused() {
        let default = BloodVolumeSettings::default();
        for bad in [
            BloodVolumeSettings { total: Volume::ZERO, ..default },
            BloodVolumeSettings { compensated: 0.5, ..default },
            BloodVolumeSettings { compensated: -0.1, ..default },
            BloodVolumeSettings { exhausted: 1.5, ..default },
            BloodVolumeSettings { exhausted: f32::NAN, ..default },
        ] {
            assert!(BloodVolume::new(bad).is_err(), "{bad:?}");
        }
    }
}
