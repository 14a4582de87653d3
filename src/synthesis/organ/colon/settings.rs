//! Settings of colons.

use crate::synthesis::organ::{OrganSettingsError, limits};

/// Settings of a colon. The same settings give the same mesh, bit for bit.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ColonSettings {
    /// Chooses a colon: course, calibres, haustra and colours vary with it.
    ///
    /// Default: 0.
    pub seed: u64,
    /// Width across the abdomen, from the ascending to the descending colon's outer side, before variation.
    ///
    /// Course and appendix scale with it; calibre and haustra do not.
    ///
    /// Units: metres. Limits: 0.05 to 5. Default: [`Self::DEFAULT_WIDTH`].
    pub width: f32,
    /// Mean outer diameter. The caecum is about a quarter wider, the descending colon and sigmoid a fifth narrower.
    ///
    /// A calibre too large for the width is lowered where limbs would touch or bends would close.
    ///
    /// Units: metres. Limits: 0.04 to 0.25 of the width. Default: [`Self::DEFAULT_CALIBRE`].
    pub calibre: f32,
    /// Thickness of the wall between two folds.
    ///
    /// Units: metres. Limits: 0.01 to 0.15 of the calibre. Default: [`Self::DEFAULT_WALL_THICKNESS`].
    pub wall_thickness: f32,
    /// Mean length of a haustrum in a part of mean calibre.
    ///
    /// Higher values give fewer and longer haustra.
    ///
    /// Units: metres. Limits: 0.25 to 4 calibres. Default: [`Self::DEFAULT_HAUSTRUM_LENGTH`].
    pub haustrum_length: f32,
    /// How deep the haustra are: 0 is a smooth tube.
    ///
    /// Limits: 0 to 1.2. Default: [`Self::DEFAULT_HAUSTRA_DEPTH`].
    pub haustra_depth: f32,
    /// Width of a taenia coli.
    ///
    /// Units: metres. Limits: 0 to half a calibre. Default: [`Self::DEFAULT_TAENIA_WIDTH`].
    pub taenia_width: f32,
    /// How far colons of different seeds differ in course and calibre: at 0 only haustra and colours do.
    ///
    /// Limits: 0 to 1.5. Default: [`Self::DEFAULT_VARIATION`].
    pub variation: f32,
    /// Whether the caecum has an appendix: a thin solid stub, without a lumen of its own.
    ///
    /// Default: true.
    pub appendix: bool,
    /// Target number of triangles; the mesh is within a tenth of it.
    ///
    /// Limits: 2,000 to 4,000,000. Default: [`Self::DEFAULT_TRIANGLES`].
    pub triangles: u32,
}

impl ColonSettings {
    /// Within the 25 to 35 cm of an adult abdomen.
    pub const DEFAULT_WIDTH: f32 = 0.32;
    /// Within the 4 to 7 cm of radiology texts for a colon that is not distended.
    pub const DEFAULT_CALIBRE: f32 = 0.052;
    /// Within the 1 to 3 mm of a wall on computed tomography.
    pub const DEFAULT_WALL_THICKNESS: f32 = 0.0028;
    /// About half the calibre.
    pub const DEFAULT_HAUSTRUM_LENGTH: f32 = 0.027;
    /// The depth in drawings of anatomy texts.
    pub const DEFAULT_HAUSTRA_DEPTH: f32 = 1.0;
    /// Within the 6 to 12 mm of anatomy texts.
    pub const DEFAULT_TAENIA_WIDTH: f32 = 0.009;
    /// The normal variation among adults' colons.
    pub const DEFAULT_VARIATION: f32 = 1.0;
    /// Enough for round folds in a picture of the whole organ.
    pub const DEFAULT_TRIANGLES: u32 = 80_000;

    /// Checks every setting against its limits.
    ///
    /// # Errors
    /// The first value outside its limits.
    pub fn validate(&self) -> Result<(), OrganSettingsError> {
        let check = limits("colon");
        let calibre = self.calibre;
        check("width", self.width, 0.05..=5.0, "0.05 to 5 m")?;
        check("calibre", calibre, 0.04 * self.width..=0.25 * self.width, "0.04 to 0.25 of the width")?;
        let thickness = 0.01 * calibre..=0.15 * calibre;
        check("wall_thickness", self.wall_thickness, thickness, "0.01 to 0.15 of the calibre")?;
        let length = 0.25 * calibre..=4.0 * calibre;
        check("haustrum_length", self.haustrum_length, length, "0.25 to 4 calibres")?;
        check("haustra_depth", self.haustra_depth, 0.0..=1.2, "0 to 1.2")?;
        check("taenia_width", self.taenia_width, 0.0..=0.5 * calibre, "0 to half a calibre")?;
        check("variation", self.variation, 0.0..=1.5, "0 to 1.5")?;
        check("triangles", self.triangles as f32, 2_000.0..=4_000_000.0, "2,000 to 4,000,000")
    }
}

impl Default for ColonSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            width: Self::DEFAULT_WIDTH,
            calibre: Self::DEFAULT_CALIBRE,
            wall_thickness: Self::DEFAULT_WALL_THICKNESS,
            haustrum_length: Self::DEFAULT_HAUSTRUM_LENGTH,
            haustra_depth: Self::DEFAULT_HAUSTRA_DEPTH,
            taenia_width: Self::DEFAULT_TAENIA_WIDTH,
            variation: Self::DEFAULT_VARIATION,
            appendix: true,
            triangles: Self::DEFAULT_TRIANGLES,
        }
    }
}
