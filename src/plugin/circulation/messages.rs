//! What the circulation tells: which ends bleed, and what keeps blood from flowing.
//!
//! Each is a message, and an event on the organ, for observers. An open end is named by the fields: the organ is there to
//! observe before it is cut, and after the end is closed.

use crate::plugin::job::JobPanic;
use crate::synthesis::haemodynamics::{EndSide, FlowError};
use crate::synthesis::wound::EndId;
use bevy::{
    ecs::{
        entity::Entity,
        event::EntityEvent,
        message::Message,
        reflect::{ReflectEvent, ReflectMessage},
    },
    reflect::Reflect,
};

/// An open end begins to bleed. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct BleedingStarted {
    /// The organ.
    #[event_target]
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// What the ledger knows the end by.
    pub end: EndId,
    /// Which side of the cut it is.
    pub side: EndSide,
    /// Its [`OpenEnd`](crate::plugin::OpenEnd) entity.
    pub entity: Entity,
}

/// An open end bleeds no more: it has clotted, has no pressure left, or was closed. Also an event on the
/// organ, for observers.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct BleedingStopped {
    /// The organ.
    #[event_target]
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// What the ledger knew the end by.
    pub end: EndId,
    /// Which side of the cut it was.
    pub side: EndSide,
    /// Its [`OpenEnd`](crate::plugin::OpenEnd) entity, `None` if it was closed.
    pub entity: Option<Entity>,
}

/// The blood of an organ can't flow. Other organs are not affected; a change of its
/// [`Perfusion`](crate::plugin::Perfusion) makes it try again. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct CirculationFailed {
    /// The organ.
    #[event_target]
    pub organ: Entity,
    /// What was wrong, with the value and the remedy.
    pub error: CirculationError,
}

/// Why the blood of an organ does not flow.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug, PartialEq)]
pub enum CirculationError {
    /// Its settings or its vessels leave no way to flow.
    #[error(transparent)]
    Flow(#[from] FlowError),
    /// The work on its network panicked.
    #[error(transparent)]
    Panicked(#[from] JobPanic),
}
