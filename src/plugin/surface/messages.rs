//! Commands to surfaces, and the messages that they send.

use crate::plugin::job::JobPanic;
use crate::synthesis::{
    binding::BindingError,
    io::{SurfaceOptions, WriteError},
    surface::SurfaceError,
    tree::VesselKind,
};
use bevy::{
    ecs::{
        entity::Entity,
        event::EntityEvent,
        message::Message,
        reflect::{ReflectEvent, ReflectMessage},
    },
    reflect::Reflect,
};
use std::{path::PathBuf, sync::Arc};

/// Asks for the surface of an organ's vessels, or saves it. Carried out in the same frame or the next; the organ must
/// have a [`VesselSurface`](crate::plugin::VesselSurface).
///
/// ```
/// # use bevy_vessels::plugin::{SurfaceCommand, Vasculature};
/// # use bevy::prelude::{Entity, MessageWriter, Single, With};
/// fn save(organ: Single<Entity, With<Vasculature>>, mut commands: MessageWriter<SurfaceCommand>) {
///     commands.write(SurfaceCommand::save(*organ, "vessels.ply"));
/// }
/// # bevy::ecs::system::assert_is_system(save);
/// ```
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque, Message, Clone, Debug, PartialEq)]
pub struct SurfaceCommand {
    /// The entity with the [`VesselSurface`](crate::plugin::VesselSurface).
    pub organ: Entity,
    /// What is to be done.
    pub action: SurfaceAction,
}

impl SurfaceCommand {
    /// Makes the surfaces of the vessels that an organ has now.
    pub fn make(organ: Entity) -> Self {
        Self { organ, action: SurfaceAction::Make }
    }

    /// Saves the surfaces of all vessels of an organ to a file.
    pub fn save(organ: Entity, path: impl Into<PathBuf>) -> Self {
        Self { organ, action: SurfaceAction::Save { path: path.into(), options: SurfaceOptions::default() } }
    }
}

/// Actions of a surface command.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceAction {
    /// Make the surfaces of the vessels that the organ has now. While these grow, this waits; pause the growth to have
    /// the surface of what has grown.
    Make,
    /// Save the surfaces of all vessels to a file, in the background: at rest, with what was cut away left out. They are
    /// made first if they aren't ready.
    Save {
        /// The file. Its extension says the format, such as `.glb`, `.stl`, `.ply`, `.obj` or `.off`; an old file is
        /// replaced as a whole, or stays as it is.
        path: PathBuf,
        /// What the file says besides.
        options: SurfaceOptions,
    },
}

/// The surface of a vessel entity is ready. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct SurfaceReady {
    /// The entity with the [`VesselSurface`](crate::plugin::VesselSurface).
    #[event_target]
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// Its kind of vessels.
    pub kind: VesselKind,
}

/// The surface of a vessel entity could not be made; its segments stay. Other vessels are not affected. Changing the
/// settings or the vessels tries again. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct SurfaceFailed {
    /// The entity with the [`VesselSurface`](crate::plugin::VesselSurface).
    #[event_target]
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// What was wrong, with the value and the remedy.
    pub error: VesselSurfaceError,
}

/// The surfaces of an organ were saved. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct SurfaceSaved {
    /// The entity with the [`VesselSurface`](crate::plugin::VesselSurface).
    #[event_target]
    pub organ: Entity,
    /// The file.
    pub path: PathBuf,
}

/// The surfaces of an organ were not saved. An old file at the path is unchanged. Also an event on the organ, for
/// observers.
#[derive(Message, EntityEvent, Clone, Debug, Reflect)]
#[reflect(Message, Event, Clone)]
pub struct SurfaceNotSaved {
    /// The entity that the command named.
    #[event_target]
    pub organ: Entity,
    /// The file.
    pub path: PathBuf,
    /// What was wrong.
    pub error: SurfaceSaveError,
}

/// Why vessels have no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug, PartialEq)]
pub enum VesselSurfaceError {
    /// The settings are out of their limits, or the surface would be too large.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The surface doesn't fit its tree.
    #[error(transparent)]
    Binding(#[from] BindingError),
    /// The work on it panicked.
    #[error(transparent)]
    Panicked(#[from] JobPanic),
}

/// Why surfaces were not saved.
#[derive(Clone, Debug, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug)]
pub enum SurfaceSaveError {
    /// The organ doesn't ask for surfaces, or is gone.
    #[error("the organ has no surfaces; give it a VesselSurface")]
    NoSurface,
    /// There is nothing to save.
    #[error("the organ has no vessels; save it when they have grown")]
    NoVessels,
    /// The surface of some vessels could not be made.
    #[error(transparent)]
    Surface(#[from] VesselSurfaceError),
    /// The file could not be written.
    #[error(transparent)]
    Write(Arc<WriteError>),
    /// The work on it panicked.
    #[error(transparent)]
    Panicked(#[from] JobPanic),
}
