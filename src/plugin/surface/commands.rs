//! Surfaces in one call.

use crate::plugin::surface::messages::{SurfaceAction, SurfaceCommand};
use crate::synthesis::io::SurfaceOptions;
use bevy::ecs::{system::EntityCommands, world::EntityWorldMut};
use std::path::PathBuf;

/// Commands for organs with a [`VesselSurface`](crate::plugin::VesselSurface).
pub trait SurfaceCommandsExt {
    /// Makes the surfaces of the organ's vessels: see [`SurfaceAction::Make`].
    fn make_surface(&mut self) -> &mut Self;

    /// Saves the surfaces of the organ's vessels in the background: see [`SurfaceAction::Save`]. A
    /// [`SurfaceSaved`](crate::plugin::SurfaceSaved) or [`SurfaceNotSaved`](crate::plugin::SurfaceNotSaved) tells how it
    /// ended.
    ///
    /// ```
    /// # use bevy_vessels::plugin::{SurfaceCommandsExt, VesselSurface};
    /// # use bevy::prelude::{Commands, Entity, Single, With};
    /// fn save(organ: Single<Entity, With<VesselSurface>>, mut commands: Commands) {
    ///     commands.entity(*organ).save_surface("liver.stl");
    /// }
    /// # bevy::ecs::system::assert_is_system(save);
    /// ```
    fn save_surface(&mut self, path: impl Into<PathBuf>) -> &mut Self;

    /// The same, with a unit, comments or triangles in the file.
    fn save_surface_with(&mut self, path: impl Into<PathBuf>, options: SurfaceOptions) -> &mut Self;
}

impl SurfaceCommandsExt for EntityCommands<'_> {
    fn make_surface(&mut self) -> &mut Self {
        send(self, SurfaceAction::Make)
    }

    fn save_surface(&mut self, path: impl Into<PathBuf>) -> &mut Self {
        self.save_surface_with(path, SurfaceOptions::default())
    }

    fn save_surface_with(&mut self, path: impl Into<PathBuf>, options: SurfaceOptions) -> &mut Self {
        send(self, SurfaceAction::Save { path: path.into(), options })
    }
}

fn send<'a, 'b>(commands: &'a mut EntityCommands<'b>, action: SurfaceAction) -> &'a mut EntityCommands<'b> {
    commands.queue(move |organ: EntityWorldMut| {
        let organ_id = organ.id();
        organ.into_world_mut().write_message(SurfaceCommand { organ: organ_id, action });
    })
}
