//! Textures: the vessels of an organ painted into maps of its surface.

use crate::plugin::{
    order::{self, VesselSystems},
    vessels::VesselsPlugin,
};
use bevy::{
    app::{App, Plugin, Update},
    ecs::{
        intern::Interned,
        schedule::{IntoScheduleConfigs, ScheduleLabel, common_conditions::any_with_component},
    },
};

mod bake;
mod make;
mod maps;
mod messages;
mod settings;
mod show;

pub use bake::texture_image;
pub use maps::VesselMaps;
pub use messages::{TextureFailed, TextureReady, VesselTextureError};
pub use settings::{TextureBase, TextureShown, VesselTexture};

/// Paints the vessels of organs with a [`VesselTexture`] into maps.
#[derive(Clone, Debug)]
pub struct TexturePlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl TexturePlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for TexturePlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for TexturePlugin {
    fn build(&self, app: &mut App) {
        VesselsPlugin::ensure(app, self.schedule);
        order::configure(app, self.schedule);
        app.register_required_components::<VesselTexture, VesselMaps>();
        app.add_message::<TextureReady>()
            .add_message::<TextureFailed>()
            .add_observer(show::remove_maps)
            .add_observer(show::show_vessels);
        let make = (make::make_textures, show::hide_vessels).chain_ignore_deferred();
        app.add_systems(self.schedule, make.run_if(any_with_component::<VesselTexture>).in_set(VesselSystems::Texture));
    }
}
