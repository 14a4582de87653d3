//! Placeholder until the tissue room lands.
/// Where on an organ mesh vessels grow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueMode {
    /// surface
    #[default]
    Surface,
    /// volume
    Volume,
}
/// What to make of an organ mesh.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct TissueSettings {
    /// mode
    pub mode: TissueMode,
}
