//! Settings of eyes.

use crate::synthesis::organ::{Laterality, OrganSettingsError, limits};

/// Settings of an eye. The same settings give the same meshes, bit for bit.
///
/// Lengths are those before variation. What has no setting is in proportion to the axial length: at 24 mm the eyeball is
/// 24.2 mm wide and 23.7 mm high (Bekerman, Gottlieb & Vaiman, "Variations in eyeball diameters of the healthy adults",
/// Journal of Ophthalmology, 2014).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct EyeSettings {
    /// Chooses an eye: sizes, iris, colours and the places of vessels vary with it.
    ///
    /// Default: 0.
    pub seed: u64,
    /// The side of the body. The optic nerve leaves towards the other side.
    ///
    /// Default: left.
    pub side: Laterality,
    /// From the apex of the cornea to the back of the eyeball.
    ///
    /// Units: metres. Limits: 0.001 to 1. Default: [`Self::DEFAULT_AXIAL_LENGTH`].
    pub axial_length: f32,
    /// Horizontal diameter of the cornea, from limbus to limbus.
    ///
    /// Units: metres. Limits: 0.3 to 0.6 of the axial length. Default: [`Self::DEFAULT_CORNEAL_DIAMETER`].
    pub corneal_diameter: f32,
    /// Radius of curvature of the cornea's front. Lower values make it bulge more.
    ///
    /// Units: metres. Limits: 0.56 to 1 of the corneal diameter. Default: [`Self::DEFAULT_CORNEAL_RADIUS`].
    pub corneal_radius: f32,
    /// Width of the limbus: the grey-blue ring in which the cornea becomes the sclera.
    ///
    /// Units: metres. Limits: 0.01 to 0.25 of the corneal diameter. Default: [`Self::DEFAULT_LIMBUS_WIDTH`].
    pub limbus_width: f32,
    /// Depth of the anterior chamber: from the back of the cornea to the pupil.
    ///
    /// Units: metres. Limits: 0.2 to 0.36 of the corneal diameter. Default: [`Self::DEFAULT_CHAMBER_DEPTH`].
    pub chamber_depth: f32,
    /// Diameter of the pupil: 2 mm in bright light, 8 mm in the dark. It does not vary by seed.
    ///
    /// Units: metres. Limits: 0.1 to 0.75 of the corneal diameter. Default: [`Self::DEFAULT_PUPIL_DIAMETER`].
    pub pupil_diameter: f32,
    /// Colour of the iris; `None` lets the seed choose.
    ///
    /// Default: none.
    pub iris: Option<IrisColor>,
    /// How far eyes of different seeds differ in size and shape: at 0 only colours, iris and vessels do.
    ///
    /// Limits: 0 to 1.5. Default: [`Self::DEFAULT_VARIATION`].
    pub variation: f32,
    /// Target number of triangles of all three meshes together; they are within a tenth of it.
    ///
    /// Limits: 4,000 to 4,000,000. Default: [`Self::DEFAULT_TRIANGLES`].
    pub triangles: u32,
}

/// The colour of an iris.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum IrisColor {
    /// Dark brown: much pigment before the fibres.
    Brown,
    /// Brown about the pupil, greenish outside.
    Hazel,
    /// Green: little pigment.
    Green,
    /// Blue: none, so that light fibres scatter over the dark layer behind them.
    Blue,
    /// Grey: none, and denser fibres.
    Grey,
}

impl IrisColor {
    /// All colours.
    pub const ALL: [Self; 5] = [Self::Brown, Self::Hazel, Self::Green, Self::Blue, Self::Grey];
}

impl EyeSettings {
    /// Within the 22 to 24.8 mm of Bekerman, Gottlieb & Vaiman (2014).
    pub const DEFAULT_AXIAL_LENGTH: f32 = 0.024;
    /// The mean of 11.71 ± 0.42 mm (Rüfer, Schröder & Erb, "White-to-white corneal diameter", Cornea 24, 2005).
    pub const DEFAULT_CORNEAL_DIAMETER: f32 = 0.0117;
    /// The 7.8 mm of schematic eyes: 43 dioptres.
    pub const DEFAULT_CORNEAL_RADIUS: f32 = 0.0078;
    /// Within the 1 to 1.5 mm of anatomy texts.
    pub const DEFAULT_LIMBUS_WIDTH: f32 = 0.0013;
    /// Within the 2.5 to 3.7 mm of ophthalmology texts.
    pub const DEFAULT_CHAMBER_DEPTH: f32 = 0.0031;
    /// The pupil in a lit room.
    pub const DEFAULT_PUPIL_DIAMETER: f32 = 0.004;
    /// The normal variation among adults' eyes.
    pub const DEFAULT_VARIATION: f32 = 1.0;
    /// Enough for a round outline, and for the fibres of the iris.
    pub const DEFAULT_TRIANGLES: u32 = 60_000;

    /// Checks every setting against its limits.
    ///
    /// # Errors
    /// The first value outside its limits.
    pub fn validate(&self) -> Result<(), OrganSettingsError> {
        let check = limits("eye");
        let (axial, corneal) = (self.axial_length, self.corneal_diameter);
        check("axial_length", axial, 0.001..=1.0, "0.001 to 1 m")?;
        check("corneal_diameter", corneal, 0.3 * axial..=0.6 * axial, "0.3 to 0.6 of the axial length")?;
        let of_cornea = |low: f32, high: f32| low * corneal..=high * corneal;
        check("corneal_radius", self.corneal_radius, of_cornea(0.56, 1.0), "0.56 to 1 of the corneal diameter")?;
        check("limbus_width", self.limbus_width, of_cornea(0.01, 0.25), "0.01 to 0.25 of the corneal diameter")?;
        check("chamber_depth", self.chamber_depth, of_cornea(0.2, 0.36), "0.2 to 0.36 of the corneal diameter")?;
        check("pupil_diameter", self.pupil_diameter, of_cornea(0.1, 0.75), "0.1 to 0.75 of the corneal diameter")?;
        check("variation", self.variation, 0.0..=1.5, "0 to 1.5")?;
        check("triangles", self.triangles as f32, 4_000.0..=4_000_000.0, "4,000 to 4,000,000")
    }
}

impl Default for EyeSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            side: Laterality::Left,
            axial_length: Self::DEFAULT_AXIAL_LENGTH,
            corneal_diameter: Self::DEFAULT_CORNEAL_DIAMETER,
            corneal_radius: Self::DEFAULT_CORNEAL_RADIUS,
            limbus_width: Self::DEFAULT_LIMBUS_WIDTH,
            chamber_depth: Self::DEFAULT_CHAMBER_DEPTH,
            pupil_diameter: Self::DEFAULT_PUPIL_DIAMETER,
            iris: None,
            variation: Self::DEFAULT_VARIATION,
            triangles: Self::DEFAULT_TRIANGLES,
        }
    }
}
