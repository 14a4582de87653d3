//! Scenes: presets as assets, organs in the scenes of glTF files, and organs that are saved.

use crate::plugin::{
    growth::GrowthPlugin,
    order::{self, VesselSystems},
};
use bevy::{
    app::{App, Plugin, Update},
    asset::{AssetApp, AssetServer, Assets},
    ecs::{
        intern::Interned,
        schedule::{ApplyDeferred, IntoScheduleConfigs, ScheduleLabel, common_conditions::any_with_component},
    },
    log::warn,
};

pub(crate) mod organ_preset;
pub(crate) mod preset_asset;
mod scene_organs;

pub use organ_preset::VesselPreset;
pub use preset_asset::{PresetAsset, PresetLoadError, PresetLoader};
pub use scene_organs::{SceneMeshes, VasculatureOfScene};

/// Loads presets as assets, and gives organs with a [`VesselPreset`] and the meshes of scenes with a
/// [`VasculatureOfScene`] their vessels. Adds the [`GrowthPlugin`].
///
/// Add it after `AssetPlugin`, which `DefaultPlugins` contain. Otherwise no presets are loaded, with a warning.
///
/// # Presets
///
/// [`PresetAsset`] is a [`Preset`](crate::synthesis::preset::Preset) from a file that ends in `.vessels.ron`. An organ
/// with a [`VesselPreset`] gets its [`Vasculature`](crate::plugin::Vasculature) from it, and again whenever the file
/// changes.
///
/// # Saved organs
///
/// An organ that Bevy saves in a scene, or clones, keeps everything that cannot be made again. Save its vessel entities
/// with it: those in its [`OrganVessels`](crate::plugin::OrganVessels). Extract these entities with Bevy's
/// `DynamicWorldBuilder`; nothing else is needed.
///
/// | component | what is kept |
/// |---|---|
/// | settings, such as [`Vasculature`](crate::plugin::Vasculature), [`OrganPaint`](crate::plugin::OrganPaint), [`Perfusion`](crate::plugin::Perfusion) and [`VesselSurface`](crate::plugin::VesselSurface) | everything |
/// | [`GrowthProgress`](crate::plugin::GrowthProgress) | the number of steps, which are done at once after loading |
/// | [`Vessels`](crate::plugin::Vessels) that grew | their kind, and a hash: they grow again from mesh, settings and seed |
/// | [`Vessels`](crate::plugin::Vessels) of a [given tree](crate::plugin::Vessels::from_tree) | everything, at rest |
/// | [`VesselWounds`](crate::plugin::VesselWounds) | everything but the undo history; undoing all still heals them |
/// | [`CirculationState`](crate::plugin::CirculationState) | how far open ends have clotted |
/// | [`Patient`](crate::plugin::Patient), [`BloodLoss`](crate::plugin::BloodLoss) | everything |
/// | [`OpenEnd`](crate::plugin::OpenEnd) entities | nothing: the wounds spawn them again |
/// | [`VesselMesh`](crate::plugin::VesselMesh) | nothing: it is made again |
///
/// Wounds belong to their tree. If another tree grew because the mesh or the settings changed, they are dropped with a
/// warning. A scene has no mesh and no image that was not loaded from a file: give the organ its `Mesh3d` or
/// [`OrganImage`](crate::plugin::OrganImage) again.
///
/// A [custom generator](crate::synthesis::generator::Generator::Custom) cannot be written. Leave the `Vasculature` of
/// such an organ out of the scene, and insert it after loading.
#[derive(Clone, Debug)]
pub struct ScenePlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl ScenePlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for ScenePlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<GrowthPlugin>() {
            app.add_plugins(GrowthPlugin::default().in_schedule(self.schedule));
        }
        order::configure(app, self.schedule);
        app.add_systems(
            self.schedule,
            (scene_organs::follow_scenes, ApplyDeferred)
                .chain_ignore_deferred()
                .before_ignore_deferred(VesselSystems::Source)
                .run_if(any_with_component::<VasculatureOfScene>),
        );
        if !app.world().contains_resource::<AssetServer>() {
            return;
        }
        app.init_asset::<PresetAsset>().register_asset_reflect::<PresetAsset>().register_asset_loader(PresetLoader);
        app.add_systems(
            self.schedule,
            (organ_preset::follow_presets, ApplyDeferred)
                .chain_ignore_deferred()
                .before_ignore_deferred(VesselSystems::Source)
                .run_if(any_with_component::<VesselPreset>),
        );
    }

    fn finish(&self, app: &mut App) {
        let world = app.world();
        if world.contains_resource::<AssetServer>() && !world.contains_resource::<Assets<PresetAsset>>() {
            warn!("no presets are loaded from files: add the vessel plugin after DefaultPlugins");
        }
    }
}
