//! Procedural blood vessels for Bevy.

pub mod synthesis;

#[cfg(feature = "plugin")]
pub mod plugin;
#[cfg(feature = "render")]
pub mod render;
