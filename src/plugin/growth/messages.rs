//! Commands to a growth, and the messages that it sends.

use crate::plugin::{
    job::JobPanic,
    organ::{image::OrganImageError, mesh::OrganMeshError},
};
use crate::synthesis::{generator::GeneratorError, tissue::TissueError};
use bevy::{
    ecs::{
        entity::Entity,
        event::EntityEvent,
        message::Message,
        reflect::{ReflectEvent, ReflectMessage},
    },
    reflect::Reflect,
};

/// Tells an organ's growth what to do. Carried out in the same frame or the next; unknown organs are ignored.
///
/// ```
/// # use bevy_vessels::plugin::{GrowthAction, GrowthCommand, Vasculature};
/// # use bevy::prelude::{Entity, MessageWriter, Query, With};
/// fn step_once(organs: Query<Entity, With<Vasculature>>, mut commands: MessageWriter<GrowthCommand>) {
///     commands.write_batch(organs.iter().map(|organ| GrowthCommand::new(organ, GrowthAction::Step(1))));
/// }
/// # bevy::ecs::system::assert_is_system(step_once);
/// ```
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Clone, PartialEq)]
pub struct GrowthCommand {
    /// The entity with the [`Vasculature`](crate::plugin::Vasculature).
    pub organ: Entity,
    /// What the growth is to do.
    pub action: GrowthAction,
}

impl GrowthCommand {
    /// A command for one organ.
    pub fn new(organ: Entity, action: GrowthAction) -> Self {
        Self { organ, action }
    }
}

/// Actions of a growth command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Clone, PartialEq)]
pub enum GrowthAction {
    /// Do no more steps until resumed or told to.
    Pause,
    /// Continue growing.
    Resume,
    /// Pause, but first do this many steps, added to those already asked for, as the budget allows.
    Step(u32),
    /// Start again from the roots. A failed growth tries again. A paused one starts over and stays paused.
    Restart,
    /// Do all remaining steps in one frame, however long it takes, even if paused. If the mesh or the tissue isn't
    /// ready, this happens in the first frame in which both are.
    Finish,
}

/// An organ's growth starts from its roots, for the first time or again, unseen where
/// [paint](crate::plugin::OrganPaint) has changed. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct GrowthStarted {
    /// The entity with the [`Vasculature`](crate::plugin::Vasculature).
    #[event_target]
    pub organ: Entity,
}

/// An organ's vessels have done all their steps, and its vessel entities are up to date.
///
/// It is a message, and an event on the organ, for observers of it or of all organs:
///
/// ```
/// # use bevy_vessels::{plugin::{GrowthFinished, Vasculature}, synthesis::preset::PresetName};
/// # use bevy::prelude::{Commands, On};
/// fn spawn_organ(mut commands: Commands) {
///     commands.spawn(Vasculature::new(PresetName::Liver)).observe(|finished: On<GrowthFinished>| {
///         println!("{} has its vessels", finished.organ);
///     });
/// }
/// # bevy::ecs::system::assert_is_system(spawn_organ);
/// ```
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct GrowthFinished {
    /// The entity with the [`Vasculature`](crate::plugin::Vasculature).
    #[event_target]
    pub organ: Entity,
}

/// An organ's growth could not start. Other organs are not affected. Changing the faulty input starts it again. Also an
/// event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct GrowthFailed {
    /// The entity with the [`Vasculature`](crate::plugin::Vasculature).
    #[event_target]
    pub organ: Entity,
    /// What was wrong, with the value and the remedy.
    pub error: OrganGrowthError,
}

/// Why an organ's vessels do not grow.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug, PartialEq)]
pub enum OrganGrowthError {
    /// Vessels cannot grow on its mesh.
    #[error(transparent)]
    Mesh(#[from] OrganMeshError),
    /// No tissue can be read from its image.
    #[error(transparent)]
    Image(#[from] OrganImageError),
    /// The organ gives no tissue of the requested kind, or not with the paint on it.
    #[error(transparent)]
    Tissue(#[from] TissueError),
    /// Its preset could not be loaded.
    #[error("the preset cannot be loaded: {reason}")]
    Preset {
        /// What is wrong, with the file.
        reason: String,
    },
    /// Its settings or roots are not valid.
    #[error(transparent)]
    Generator(#[from] GeneratorError),
    /// The work on its tissue panicked.
    #[error(transparent)]
    Panicked(#[from] JobPanic),
}
