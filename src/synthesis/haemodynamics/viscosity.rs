//! Viscosity of blood: the same everywhere, or lower in small vessels by the Fåhræus–Lindqvist effect.
//!
//! In: the diameter of a vessel in metres. Out: the apparent viscosity for Poiseuille's law. Source: Pries, Secomb,
//! Gessner, Sperandio, Gross and Gaehtgens, "Resistance to blood flow in microvessels in vivo", Circulation Research 75
//! (1994), the relation in vivo.

use super::FlowError;
use crate::synthesis::{
    exponential::{exp, exp_m1, ln},
    units::{PLASMA_VISCOSITY, Viscosity, WHOLE_BLOOD_VISCOSITY},
};

/// How viscosity depends on a vessel's diameter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum ViscosityLaw {
    /// The same in every vessel.
    ///
    /// Limits: finite, > 0. Default: [`WHOLE_BLOOD_VISCOSITY`].
    Constant(Viscosity),
    /// The relation of Pries et al. (1994) in vivo: viscosity falls with the diameter down to about 40 µm and rises
    /// steeply in capillaries.
    Pries {
        /// Viscosity of the plasma, which multiplies the relation.
        ///
        /// Limits: finite, > 0. Default: [`PLASMA_VISCOSITY`].
        plasma: Viscosity,
        /// Share of red cells in the discharged volume.
        ///
        /// Higher values make blood more viscous, most of all in small vessels.
        ///
        /// Limits: 0 to 0.95. Default: [`Self::DEFAULT_HAEMATOCRIT`].
        haematocrit: f32,
    },
}

impl ViscosityLaw {
    /// Default of the haematocrit: that of the published relation.
    pub const DEFAULT_HAEMATOCRIT: f32 = 0.45;
    /// Diameter below which the relation is held constant, in micrometres: it diverges at 1.1.
    pub const LEAST_DIAMETER: f64 = 3.0;
    const MOST_HAEMATOCRIT: f32 = 0.95;

    /// The same viscosity everywhere: that of whole blood in large vessels.
    pub const WHOLE_BLOOD: Self = Self::Constant(Viscosity::from_pascal_seconds(WHOLE_BLOOD_VISCOSITY));
    /// The relation of Pries with its published haematocrit.
    pub const IN_VIVO: Self = Self::Pries {
        plasma: Viscosity::from_pascal_seconds(PLASMA_VISCOSITY),
        haematocrit: Self::DEFAULT_HAEMATOCRIT,
    };

    /// Apparent viscosity in a vessel of this diameter, in pascal seconds. The diameter is in metres.
    pub fn in_vessel(&self, diameter: f64) -> f64 {
        match *self {
            Self::Constant(viscosity) => viscosity.pascal_seconds(),
            Self::Pries { plasma, haematocrit } => {
                plasma.pascal_seconds() * relative_viscosity(diameter * 1e6, f64::from(haematocrit))
            }
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// The first one outside its limits.
    pub fn validate(&self) -> Result<(), FlowError> {
        let (Self::Constant(viscosity) | Self::Pries { plasma: viscosity, .. }) = *self;
        FlowError::check_positive("the viscosity in Pa·s", viscosity.pascal_seconds())?;
        match *self {
            Self::Pries { haematocrit, .. } if !(0.0..=Self::MOST_HAEMATOCRIT).contains(&haematocrit) => {
                Err(FlowError::Haematocrit { haematocrit })
            }
            _ => Ok(()),
        }
    }
}

impl Default for ViscosityLaw {
    fn default() -> Self {
        Self::IN_VIVO
    }
}

/// Viscosity over that of plasma, by the relation of Pries et al. (1994) in vivo.
///
/// `diameter` is in micrometres; below [`ViscosityLaw::LEAST_DIAMETER`] it counts as that.
pub fn relative_viscosity(diameter: f64, haematocrit: f64) -> f64 {
    // A metre is a safe upper limit: the relation is constant far below it.
    let d = diameter.clamp(ViscosityLaw::LEAST_DIAMETER, 1e6);
    let at_45 = 6.0 * exp(-0.085 * d) + 3.2 - 2.44 * exp(-0.06 * exp(0.645 * ln(d)));
    let d3 = d * d * d;
    let t = 1.0 / (1.0 + 1e-11 * (d3 * d3) * (d3 * d3));
    let shape = (0.8 + exp(-0.075 * d)) * (t - 1.0) + t;
    let wall = (d / (d - 1.1)) * (d / (d - 1.1));
    (1.0 + (at_45 - 1.0) * share_of_cells(shape, haematocrit) * wall) * wall
}

/// ((1 − H)^C − 1) / (0.55^C − 1): share of the effect at H = 0.45 that remains at another haematocrit.
fn share_of_cells(shape: f64, haematocrit: f64) -> f64 {
    let (here, at_45) = (ln(1.0 - haematocrit), ln(0.55));
    // The exponent passes through 0 near 11 µm, where both differences vanish but their ratio does not.
    if shape.abs() < 1e-12 { here / at_45 } else { exp_m1(shape * here) / exp_m1(shape * at_45) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIAMETERS: [f64; 9] = [5.0, 8.0, 10.0, 20.0, 40.0, 50.0, 100.0, 300.0, 1000.0];
    const AT_45: [f64; 9] = [12.620, 7.307, 5.872, 3.231, 2.314, 2.282, 2.532, 3.010, 3.198];
    const AT_20: [f64; 9] = [6.517, 3.588, 2.651, 1.762, 1.454, 1.437, 1.503, 1.646, 1.702];

    #[test]
    fn the_published_table_comes_out_to_three_decimals() {
        for (haematocrit, table) in [(0.45, AT_45), (0.2, AT_20)] {
            for (diameter, expected) in DIAMETERS.into_iter().zip(table) {
                let viscosity = relative_viscosity(diameter, haematocrit);
                assert!((viscosity - expected).abs() <= 5.0e-4, "{diameter} µm, H {haematocrit}: {viscosity}");
            }
        }
    }

    #[test]
    fn the_relation_is_smooth_finite_and_that_of_plasma_without_cells() {
        let mut before = relative_viscosity(0.0, 0.3);
        for step in 1..200_000 {
            let diameter = f64::from(step) * 1e-3;
            let viscosity = relative_viscosity(diameter, 0.3);
            assert!(viscosity.is_finite() && (viscosity / before - 1.0).abs() < 1e-2, "{diameter} µm: {viscosity}");
            before = viscosity;
        }
        assert!((relative_viscosity(1e300, 0.45) - 3.2).abs() < 1e-4);
        let wall: f64 = 10.0 / 8.9;
        assert!((relative_viscosity(10.0, 0.0) - wall * wall).abs() < 1e-12);
    }

    #[test]
    fn numbers_outside_their_limits_are_refused() {
        let law =
            |viscosity, haematocrit| ViscosityLaw::Pries { plasma: Viscosity::from_centipoise(viscosity), haematocrit };
        for bad in [law(0.0, 0.4), law(f64::NAN, 0.4), law(1.2, -0.1), law(1.2, 1.0), law(1.2, f32::NAN)] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
        assert!(ViscosityLaw::Constant(Viscosity::ZERO).validate().is_err());
        assert_eq!(law(1.2, 0.0).validate(), Ok(()));
        assert_eq!(ViscosityLaw::default().validate(), Ok(()));
    }
}
