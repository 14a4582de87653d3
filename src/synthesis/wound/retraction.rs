//! Retraction of severed ends.

use super::WoundError;

/// How far severed ends retract along their vessel.
///
/// Retraction passes nodes that only join two segments, so it doesn't depend on how finely a vessel is divided. A
/// branching, a root or terminal, a clamp or tie, and the gap of another cut hold an end: it retracts by at most
/// [`Self::MOST`] of the distance to them, so that a piece between two of them never vanishes, and keeps its lumen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Retraction {
    /// Retraction as a multiple of the vessel's radius.
    ///
    /// Higher values open wider gaps, most of all in thick vessels.
    ///
    /// Limits: ≥ 0. Default: [`Self::DEFAULT_RADII`].
    pub radii: f32,
    /// Retraction in addition, independent of the radius.
    ///
    /// Higher values make gaps in the thinnest vessels visible, too.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: [`Self::DEFAULT_LENGTH`].
    pub length: f32,
}

impl Retraction {
    /// One and a half radii: a gap three radii wide, which is visible, and not more than a vessel held by its tissue
    /// may retract.
    pub const DEFAULT_RADII: f32 = 1.5;
    /// None in addition.
    pub const DEFAULT_LENGTH: f32 = 0.0;
    /// Largest share of the distance to what holds an end that the end retracts. Below one half, so that two ends never
    /// meet.
    pub const MOST: f32 = 0.45;

    /// Checks the settings against their limits.
    ///
    /// # Errors
    /// The first value outside.
    pub fn validate(&self) -> Result<(), WoundError> {
        for (what, value) in [("radii", self.radii), ("length", self.length)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(WoundError::Retraction { what, value });
            }
        }
        Ok(())
    }
}

impl Default for Retraction {
    fn default() -> Self {
        Self { radii: Self::DEFAULT_RADII, length: Self::DEFAULT_LENGTH }
    }
}
