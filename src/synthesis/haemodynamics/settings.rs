//! Boundary conditions of a network of vessels: pressure at its roots, bed at its terminals, outside pressure at its
//! wounds.
//!
//! Arteries are driven by a root pressure above that of the bed. Veins are the same in reverse: their root pressure
//! lies below that of the bed, and every flow is negative, from the terminals to the root.

use super::{FlowError, ViscosityLaw};
use crate::synthesis::units::{Pressure, Resistance, Scale};
use bevy_math::ops;

/// Everything that flow depends on besides the tree.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct FlowSettings {
    /// Size of a tissue length. Resistance falls with its cube, so a wrong scale is easily seen.
    ///
    /// Default: [`Scale::MILLIMETRES`].
    pub scale: Scale,
    /// How viscosity depends on vessel diameter.
    ///
    /// Default: [`ViscosityLaw::IN_VIVO`].
    pub viscosity: ViscosityLaw,
    /// Pressure at every root. Below the bed's pressure blood flows towards the root, as in veins.
    ///
    /// Default: constant, [`Self::DEFAULT_ARTERIAL_PRESSURE`].
    pub root: RootPressure,
    /// The bed into which terminals drain.
    pub bed: BedSettings,
    /// Pressure outside the vessels, against which an open end bleeds: that of the air, of the gas in a closed abdomen,
    /// or of a compress.
    ///
    /// Higher values make wounds bleed less. Limits: finite. Default: atmospheric, 0.
    pub ambient: Pressure,
    /// Discharge coefficient of an open end: the share of an ideal orifice's flow that passes.
    ///
    /// Higher values make wide vessels bleed more; narrow ones are limited by their own resistance.
    ///
    /// Limits: > 0, at most 1. Default: [`Self::DEFAULT_DISCHARGE_COEFFICIENT`].
    pub discharge_coefficient: f32,
}

impl FlowSettings {
    /// Default of the discharge coefficient: with it a sheep's carotid with a hole of 2.5 mm at 90 mmHg bleeds the
    /// measured 400 mL/min (PMID 22166236).
    pub const DEFAULT_DISCHARGE_COEFFICIENT: f32 = 0.29;
    /// Default of the root pressure of arteries, in mmHg: the textbook's mean of a large artery is 95 to 100.
    pub const DEFAULT_ARTERIAL_PRESSURE: f64 = 95.0;
    /// Default of the root pressure of veins, in mmHg: the textbook has 0 to 4 in the vena cava.
    pub const DEFAULT_VENOUS_PRESSURE: f64 = 4.0;
    /// Default pressure at the root of portal veins, in mmHg: the textbook has 5 to 10.
    pub const DEFAULT_PORTAL_PRESSURE: f64 = 8.0;
    /// Default pressure of the bed behind portal veins, the liver's sinusoids, in mmHg: the textbook has 3 to 5.
    pub const DEFAULT_SINUSOID_PRESSURE: f64 = 4.0;

    /// Defaults for arteries.
    pub fn arterial() -> Self {
        Self {
            scale: Scale::MILLIMETRES,
            viscosity: ViscosityLaw::default(),
            root: RootPressure::Constant(Pressure::from_mmhg(Self::DEFAULT_ARTERIAL_PRESSURE)),
            bed: BedSettings::default(),
            ambient: Pressure::ZERO,
            discharge_coefficient: Self::DEFAULT_DISCHARGE_COEFFICIENT,
        }
    }

    /// Defaults for veins.
    pub fn venous() -> Self {
        let root = RootPressure::Constant(Pressure::from_mmhg(Self::DEFAULT_VENOUS_PRESSURE));
        Self { root, ..Self::arterial() }
    }

    /// Defaults for portal veins, which lead from the bed of the gut to that of the liver.
    pub fn portal() -> Self {
        let root = RootPressure::Constant(Pressure::from_mmhg(Self::DEFAULT_PORTAL_PRESSURE));
        let pressure = Pressure::from_mmhg(Self::DEFAULT_SINUSOID_PRESSURE);
        Self { root, bed: BedSettings { pressure, ..BedSettings::default() }, ..Self::arterial() }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first one outside its limits, with the value and the remedy.
    pub fn validate(&self) -> Result<(), FlowError> {
        self.scale.validate()?;
        self.viscosity.validate()?;
        self.root.validate()?;
        self.bed.validate()?;
        FlowError::check_finite("the ambient pressure in mmHg", self.ambient.mmhg())?;
        let coefficient = f64::from(self.discharge_coefficient);
        FlowError::check_positive("the discharge coefficient", coefficient)?;
        FlowError::check_share("the discharge coefficient", coefficient)
    }
}

impl Default for FlowSettings {
    fn default() -> Self {
        Self::arterial()
    }
}

/// The capillary bed behind the terminals.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BedSettings {
    /// Pressure of the bed's common pool.
    ///
    /// Higher values reduce arterial flow, raise venous flow and make the far end of a cut vessel bleed back.
    ///
    /// Limits: finite. Default: [`Self::DEFAULT_PRESSURE`].
    pub pressure: Pressure,
    /// Resistance between each terminal and the pool, or between the two ends of a link. `None` holds every terminal at
    /// the pool's pressure; then the vessels alone limit the flow.
    ///
    /// Limits: finite, > 0. Default: `None`.
    pub resistance: Option<Resistance>,
}

impl BedSettings {
    /// Default of the bed's pressure, in mmHg: the textbook has 35 to 10 along a capillary.
    pub const DEFAULT_PRESSURE: f64 = 22.5;
    /// Largest conductance of a bed, in m³/(s·Pa). Its products with the resistance of any vessel are finite.
    const OPEN: f64 = 1e100;

    /// Conductance of a terminal's or a link's bed, in m³/(s·Pa), if it resists.
    pub(super) fn conductance(&self) -> Option<f64> {
        let conductance = |resistance: Resistance| 1.0 / resistance.pascal_seconds_per_cubic_metre();
        self.resistance.map(|resistance| conductance(resistance).clamp(1.0 / Self::OPEN, Self::OPEN))
    }

    fn validate(&self) -> Result<(), FlowError> {
        FlowError::check_finite("the bed's pressure in mmHg", self.pressure.mmhg())?;
        self.resistance.map_or(Ok(()), |resistance| {
            let value = resistance.pascal_seconds_per_cubic_metre();
            FlowError::check_positive("the bed's resistance in Pa·s/m³", value)
        })
    }
}

impl Default for BedSettings {
    fn default() -> Self {
        Self { pressure: Pressure::from_mmhg(Self::DEFAULT_PRESSURE), resistance: None }
    }
}

/// Pressure at the roots over time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum RootPressure {
    /// The same at all times.
    Constant(Pressure),
    /// Pulsatile, as of a beating heart.
    Pulsatile(Pulse),
}

impl RootPressure {
    /// The pressure at a time.
    ///
    /// `seconds` is the time since the lowest pressure of a beat.
    pub fn at(&self, seconds: f64) -> Pressure {
        match self {
            Self::Constant(pressure) => *pressure,
            Self::Pulsatile(pulse) => pulse.at(seconds),
        }
    }

    /// The mean pressure over time.
    pub fn mean(&self) -> Pressure {
        match self {
            Self::Constant(pressure) => *pressure,
            Self::Pulsatile(pulse) => pulse.mean(),
        }
    }

    fn validate(&self) -> Result<(), FlowError> {
        match self {
            Self::Constant(pressure) => FlowError::check_finite("the root pressure in mmHg", pressure.mmhg()),
            Self::Pulsatile(pulse) => pulse.validate(),
        }
    }
}

/// A pulsatile arterial pressure.
///
/// Over a beat the pressure is the diastolic one plus (u² + 2u³)/3 of the difference to the systolic one, with u = (1 −
/// cos 2πφ)/2: smooth, lowest at the phase φ = 0, highest at ½, and narrower at the top than at the bottom. Its mean is
/// exactly that of the clinical rule: the diastolic pressure plus a third of the difference.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Pulse {
    /// Heart rate.
    ///
    /// Units: per minute. Limits: finite, > 0. Default: [`Self::DEFAULT_HEART_RATE`].
    pub heart_rate: f32,
    /// Highest pressure of a beat.
    ///
    /// Limits: at least the diastolic pressure. Default: [`Self::DEFAULT_SYSTOLIC`].
    pub systolic: Pressure,
    /// Lowest pressure of a beat.
    ///
    /// Limits: finite. Default: [`Self::DEFAULT_DIASTOLIC`].
    pub diastolic: Pressure,
}

impl Pulse {
    /// Default of the heart rate, per minute.
    pub const DEFAULT_HEART_RATE: f32 = 70.0;
    /// Default of the systolic pressure, in mmHg: a healthy adult's.
    pub const DEFAULT_SYSTOLIC: f64 = 120.0;
    /// Default of the diastolic pressure, in mmHg: a healthy adult's.
    pub const DEFAULT_DIASTOLIC: f64 = 80.0;

    /// Duration of a beat, in seconds.
    pub fn period(&self) -> f64 {
        60.0 / f64::from(self.heart_rate)
    }

    /// The pressure at a time in seconds since the lowest pressure of a beat.
    pub fn at(&self, seconds: f64) -> Pressure {
        let beats = seconds / self.period();
        let phase = (beats - beats.floor()) as f32;
        let u = 0.5 - 0.5 * f64::from(ops::cos(std::f32::consts::TAU * phase));
        self.between(u * u * (1.0 + 2.0 * u) / 3.0)
    }

    /// Mean over a beat: the diastolic pressure plus a third of the difference to the systolic one.
    pub fn mean(&self) -> Pressure {
        self.between(1.0 / 3.0)
    }

    fn between(&self, share: f64) -> Pressure {
        let (low, high) = (self.diastolic.pascals(), self.systolic.pascals());
        Pressure::from_pascals(low + (high - low) * share)
    }

    fn validate(&self) -> Result<(), FlowError> {
        FlowError::check_positive("the heart rate per minute", f64::from(self.heart_rate))?;
        let (systolic, diastolic) = (self.systolic.mmhg(), self.diastolic.mmhg());
        FlowError::check_finite("the systolic pressure in mmHg", systolic)?;
        FlowError::check_finite("the diastolic pressure in mmHg", diastolic)?;
        if systolic < diastolic {
            return Err(FlowError::SystolicBelowDiastolic { systolic, diastolic });
        }
        Ok(())
    }
}

impl Default for Pulse {
    fn default() -> Self {
        Self {
            heart_rate: Self::DEFAULT_HEART_RATE,
            systolic: Pressure::from_mmhg(Self::DEFAULT_SYSTOLIC),
            diastolic: Pressure::from_mmhg(Self::DEFAULT_DIASTOLIC),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beat_has_its_extremes_and_its_mean() {
        let pulse = Pulse { heart_rate: 90.0, ..Pulse::default() };
        let samples: Vec<f64> =
            (0..1000).map(|i| pulse.at(7.0 * pulse.period() * f64::from(i) / 1000.0).mmhg()).collect();
        let mean = samples.iter().sum::<f64>() / 1000.0;
        assert!((mean - (80.0 + 40.0 / 3.0)).abs() < 1e-4, "{mean}");
        assert!((mean - pulse.mean().mmhg()).abs() < 1e-4);
        assert!(samples.iter().all(|p| (80.0..=120.0 + 1e-9).contains(p)));
        assert!((pulse.at(0.0).mmhg() - 80.0).abs() < 1e-9);
        assert!((pulse.at(pulse.period() * 1000.5).mmhg() - 120.0).abs() < 1e-4);
    }

    #[test]
    fn settings_outside_their_limits_name_the_value() {
        let refuses = |change: fn(&mut FlowSettings), word: &str| {
            let mut settings = FlowSettings::default();
            change(&mut settings);
            let message = settings.validate().expect_err(word).to_string();
            assert!(message.contains(word), "{message}");
        };
        refuses(|s| s.root = RootPressure::Constant(Pressure::from_mmhg(f64::NAN)), "NaN");
        refuses(|s| s.ambient = Pressure::from_mmhg(f64::INFINITY), "inf");
        refuses(|s| s.bed.resistance = Some(Resistance::ZERO), "0");
        refuses(|s| s.bed.pressure = Pressure::from_mmhg(f64::NAN), "NaN");
        refuses(|s| s.discharge_coefficient = 1.5, "1.5");
        let pulse = |pulse: Pulse| FlowSettings { root: RootPressure::Pulsatile(pulse), ..FlowSettings::default() };
        assert!(pulse(Pulse { heart_rate: 0.0, ..Pulse::default() }).validate().is_err());
        let upside_down = Pulse { systolic: Pressure::from_mmhg(60.0), ..Pulse::default() };
        let message = pulse(upside_down).validate().unwrap_err().to_string();
        assert!(message.contains("60") && message.contains("80"), "{message}");
        assert_eq!(FlowSettings::default().validate(), Ok(()));
        assert_eq!(FlowSettings::venous().validate(), Ok(()));
    }
}
