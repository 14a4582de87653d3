//! Physical units: the size of tissue lengths in metres, and conversions of pressures and flows.
//!
//! Vessels are made in tissue lengths, which have no physical size. Blood flow needs one: a [`Scale`] gives the metres
//! of a tissue length. In interfaces, quantities are newtypes with a constructor for each common unit; inside a
//! computation they are plain `f64` in SI units.

/// Pascals in a millimetre of mercury.
///
/// Source: the conventional millimetre of mercury, NIST Special Publication 811, appendix B.
pub const PASCALS_PER_MMHG: f64 = 133.322_387_415;

/// Density of whole blood, in kilograms per cubic metre.
///
/// Source: the usual textbook value, also used for orifices in the literature on bleeding.
pub const BLOOD_DENSITY: f64 = 1060.0;

/// Viscosity of whole blood in large vessels, in pascal seconds.
///
/// Source: the textbook value of 3.6 mPa·s.
pub const WHOLE_BLOOD_VISCOSITY: f64 = 3.6e-3;

/// Viscosity of plasma at 37 °C, in pascal seconds.
///
/// Source: the middle of the normal range of 1.1 to 1.3 mPa·s. Under the law of Pries with a haematocrit of 0.45 it
/// gives 3.8 mPa·s in large vessels.
pub const PLASMA_VISCOSITY: f64 = 1.2e-3;

/// Why a [`Scale`] could not be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a tissue length of {metres} m has no size; give the metres of one tissue length, finite and above 0, such as 0.001 for an organ in millimetres"
)]
pub struct ScaleError {
    /// Metres per tissue length, as given.
    pub metres: f64,
}

/// The size of a tissue length.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Scale {
    metres_per_length: f64,
}

impl Scale {
    /// An organ whose mesh is in micrometres, as traced vessels often are.
    pub const MICROMETRES: Self = Self { metres_per_length: 1e-6 };
    /// An organ whose mesh is in millimetres.
    pub const MILLIMETRES: Self = Self { metres_per_length: 1e-3 };
    /// An organ whose mesh is in centimetres.
    pub const CENTIMETRES: Self = Self { metres_per_length: 1e-2 };
    /// An organ whose mesh is in metres, as Bevy's worlds usually are.
    pub const METRES: Self = Self { metres_per_length: 1.0 };

    /// A scale with the metres of one tissue length.
    ///
    /// # Errors
    /// If the number is not finite or not above 0.
    pub fn from_metres(metres: f64) -> Result<Self, ScaleError> {
        let scale = Self { metres_per_length: metres };
        scale.validate()?;
        Ok(scale)
    }

    /// A scale with the millimetres of one tissue length.
    ///
    /// # Errors
    /// As [`from_metres`](Self::from_metres).
    pub fn from_millimetres(millimetres: f64) -> Result<Self, ScaleError> {
        Self::from_metres(millimetres * 1e-3)
    }

    /// Metres in one tissue length.
    pub const fn metres(self) -> f64 {
        self.metres_per_length
    }

    /// Converts a length from tissue lengths to metres.
    pub fn to_metres(self, length: f32) -> f64 {
        f64::from(length) * self.metres_per_length
    }

    /// Checks a scale that was read from a file.
    ///
    /// # Errors
    /// If it is not finite or not above 0.
    pub fn validate(self) -> Result<(), ScaleError> {
        if self.metres_per_length.is_finite() && self.metres_per_length > 0.0 {
            Ok(())
        } else {
            Err(ScaleError { metres: self.metres_per_length })
        }
    }
}

/// Defines a newtype over an `f64` in SI units, with a constructor and a getter for each unit.
macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident {
        $($(#[$from_doc:meta])* $from:ident, $(#[$to_doc:meta])* $to:ident = $factor:expr;)+
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
        #[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
        #[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
        pub struct $name(f64);

        impl $name {
            /// Zero.
            pub const ZERO: Self = Self(0.0);

            $(
                $(#[$from_doc])*
                pub const fn $from(value: f64) -> Self {
                    Self(value * $factor)
                }

                $(#[$to_doc])*
                pub const fn $to(self) -> f64 {
                    self.0 / $factor
                }
            )+
        }
    };
}

quantity! {
    /// A pressure relative to the atmosphere.
    Pressure {
        /// A pressure in pascals.
        from_pascals,
        /// In pascals.
        pascals = 1.0;
        /// A pressure in millimetres of mercury.
        from_mmhg,
        /// In millimetres of mercury.
        mmhg = PASCALS_PER_MMHG;
    }
}

quantity! {
    /// A volume per time.
    Flow {
        /// A flow in cubic metres per second.
        from_cubic_metres_per_second,
        /// In cubic metres per second.
        cubic_metres_per_second = 1.0;
        /// A flow in millilitres per minute.
        from_ml_per_min,
        /// In millilitres per minute.
        ml_per_min = 1e-6 / 60.0;
    }
}

quantity! {
    /// A volume of blood.
    Volume {
        /// A volume in cubic metres.
        from_cubic_metres,
        /// In cubic metres.
        cubic_metres = 1.0;
        /// A volume in millilitres.
        from_ml,
        /// In millilitres.
        ml = 1e-6;
    }
}

quantity! {
    /// A dynamic viscosity.
    Viscosity {
        /// A viscosity in pascal seconds.
        from_pascal_seconds,
        /// In pascal seconds.
        pascal_seconds = 1.0;
        /// A viscosity in centipoise, that is, in millipascal seconds.
        from_centipoise,
        /// In centipoise.
        centipoise = 1e-3;
    }
}

quantity! {
    /// The pressure per flow that drives it.
    Resistance {
        /// A resistance in pascal seconds per cubic metre.
        from_pascal_seconds_per_cubic_metre,
        /// In pascal seconds per cubic metre.
        pascal_seconds_per_cubic_metre = 1.0;
        /// A resistance in mmHg per mL/min, the peripheral resistance unit.
        from_mmhg_min_per_ml,
        /// In mmHg per mL/min.
        mmhg_min_per_ml = PASCALS_PER_MMHG / (1e-6 / 60.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_comes_out_as_it_went_in() {
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
        assert!(close(Pressure::from_mmhg(760.0).pascals(), 101_325.014_435_4));
        assert!(close(Pressure::from_mmhg(93.0).mmhg(), 93.0));
        assert!(close(Flow::from_ml_per_min(60.0).cubic_metres_per_second(), 1e-6));
        assert!(close(Flow::from_ml_per_min(7.0).ml_per_min(), 7.0));
        assert!(close(Viscosity::from_centipoise(3.6).pascal_seconds(), WHOLE_BLOOD_VISCOSITY));
        assert!(close(Volume::from_ml(5000.0).cubic_metres(), 5e-3));
        let drop = Resistance::from_mmhg_min_per_ml(2.0).pascal_seconds_per_cubic_metre()
            * Flow::from_ml_per_min(3.0).cubic_metres_per_second();
        assert!(close(Pressure::from_pascals(drop).mmhg(), 6.0));
    }

    #[test]
    fn a_scale_without_size_is_refused_by_its_number() {
        for metres in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = Scale::from_metres(metres).unwrap_err();
            assert!(error.to_string().contains(&metres.to_string()), "{error}");
        }
        assert_eq!(Scale::from_millimetres(10.0).unwrap(), Scale::CENTIMETRES);
        assert_eq!(Scale::MILLIMETRES.to_metres(2.5), 2.5e-3);
    }
}
