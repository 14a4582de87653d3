//! How far severed ends draw back.

use super::WoundError;

/// How far severed ends draw back along their vessel.
///
/// It goes on through nodes that only join two segments, so that it is the same however finely a vessel is divided. A
/// branching, a root or terminal, a clamp or tie, and the gap of another cut hold it: of the way to there an end draws
/// back by at most [`Self::MOST`], so that a piece between two of them never vanishes, and keeps its lumen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Retraction {
    /// How far an end draws back, as a multiple of the vessel's radius.
    ///
    /// Higher values open wider gaps, the wider the thicker the vessel.
    ///
    /// Limits: ≥ 0. Default: [`Self::DEFAULT_RADII`].
    pub radii: f32,
    /// How far it draws back beside that, whatever its radius.
    ///
    /// Higher values make gaps in the thinnest vessels visible, too.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: [`Self::DEFAULT_LENGTH`].
    pub length: f32,
}

impl Retraction {
    /// Half again the radius: a gap three radii wide, which is seen, and is no further than a vessel held by its tissue
    /// may go.
    pub const DEFAULT_RADII: f32 = 1.5;
    /// Nothing beside.
    pub const DEFAULT_LENGTH: f32 = 0.0;
    /// Most of the way to what holds an end that it draws back by. Below one half, so that two ends never meet.
    pub const MOST: f32 = 0.45;

    /// Passes settings within their limits.
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
