//! Procedural blood vessels for Bevy.

pub mod synthesis;

#[cfg(feature = "plugin")]
pub mod plugin;
#[cfg(feature = "render")]
pub mod render;

#[cfg(feature = "plugin")]
use bevy::app::{App, Plugin};

/// Everything that an app with vessels needs: growth, and drawing where the app draws.
///
/// Add it after `DefaultPlugins`. In an app without a renderer vessels grow all the same.
#[cfg(feature = "plugin")]
#[derive(Clone, Debug, Default)]
pub struct VesselPlugin {
    /// How vessels grow in this app: schedule and budget.
    pub growth: plugin::GrowthPlugin,
}

#[cfg(feature = "plugin")]
impl Plugin for VesselPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(self.growth.clone());
    }
}
