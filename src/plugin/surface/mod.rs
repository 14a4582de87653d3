//! Closed surfaces: the vessels of an organ as meshes, shown in place of segments, and saved as files.

use crate::plugin::{
    order::{self, VesselSystems},
    vessels::{Vessels, VesselsPlugin},
};
use bevy::{
    app::{App, Plugin, Update},
    asset::Assets,
    ecs::{
        intern::Interned,
        query::{Changed, With, Without},
        schedule::{
            ApplyDeferred, IntoScheduleConfigs, ScheduleLabel,
            common_conditions::{any_match_filter, any_with_component, on_message, resource_exists},
        },
    },
    mesh::Mesh,
};

mod build;
mod commands;
mod follow;
mod make;
mod mesh;
mod messages;
mod save;
mod settings;
mod show;
mod vessel_mesh;

pub use commands::SurfaceCommandsExt;
pub use messages::{
    SurfaceAction, SurfaceCommand, SurfaceFailed, SurfaceNotSaved, SurfaceReady, SurfaceSaveError, SurfaceSaved,
    VesselSurfaceError,
};
pub use settings::{SurfaceDetail, SurfaceMoment, SurfaceShown, VesselSurface};
pub use vessel_mesh::{SurfaceLevel, VesselMesh};

use save::SurfaceSaves;

/// Gives closed meshes to the vessels of organs with a [`VesselSurface`], and saves them.
#[derive(Clone, Debug)]
pub struct SurfacePlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl SurfacePlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for SurfacePlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for SurfacePlugin {
    fn build(&self, app: &mut App) {
        VesselsPlugin::ensure(app, self.schedule);
        order::configure(app, self.schedule);
        app.init_resource::<SurfaceSaves>()
            .add_message::<SurfaceCommand>()
            .add_message::<SurfaceReady>()
            .add_message::<SurfaceFailed>()
            .add_message::<SurfaceSaved>()
            .add_message::<SurfaceNotSaved>()
            .add_observer(show::remove_surfaces)
            .add_observer(show::remove_surface)
            .add_observer(show::despawn_levels);
        let make = (
            (make::attach_meshes, ApplyDeferred)
                .chain_ignore_deferred()
                .run_if(any_with_component::<VesselSurface>)
                .run_if(any_match_filter::<(With<Vessels>, Without<VesselMesh>)>),
            save::read_commands.run_if(on_message::<SurfaceCommand>),
            make::make_surfaces.run_if(any_with_component::<VesselMesh>),
            (show::show_surfaces, ApplyDeferred)
                .chain_ignore_deferred()
                .run_if(any_match_filter::<Changed<VesselMesh>>),
            follow::follow_vessels.run_if(any_with_component::<VesselMesh>).run_if(resource_exists::<Assets<Mesh>>),
            save::save_surfaces.run_if(SurfaceSaves::any),
        );
        app.add_systems(self.schedule, make.chain_ignore_deferred().in_set(VesselSystems::Surface));
    }
}
