//! Messages of the circulation: which ends bleed, and why blood can't flow.
//!
//! Each is a message, and an event on the organ, for observers. The event targets the organ, since that exists before
//! the cut and after the end closes; the fields name the open end.

use crate::plugin::{announcer::Announcer, job::JobPanic};
use crate::synthesis::haemodynamics::{EndSide, FlowError};
use crate::synthesis::wound::EndId;
use bevy::{
    ecs::{
        entity::Entity,
        event::EntityEvent,
        message::Message,
        reflect::{ReflectEvent, ReflectMessage},
        system::SystemParam,
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
    /// The end's identifier in the ledger.
    pub end: EndId,
    /// The end's side of the cut.
    pub side: EndSide,
    /// Its [`OpenEnd`](crate::plugin::OpenEnd) entity.
    pub entity: Entity,
}

/// An open end stops bleeding: it has clotted, has no pressure left, was closed, its vessels are gone, or its organ
/// lost its [`Perfusion`](crate::plugin::Perfusion). Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct BleedingStopped {
    /// The organ.
    #[event_target]
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// The end's identifier in the ledger.
    pub end: EndId,
    /// The end's side of the cut.
    pub side: EndSide,
    /// Its [`OpenEnd`](crate::plugin::OpenEnd) entity, `None` if it was closed or is gone.
    pub entity: Option<Entity>,
}

/// The blood of an organ can't flow. Other organs are not affected. Changing its
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

/// The reason why an organ's blood does not flow.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug, PartialEq)]
pub enum CirculationError {
    /// Its settings or its vessels allow no flow.
    #[error(transparent)]
    Flow(#[from] FlowError),
    /// The work on its network panicked.
    #[error(transparent)]
    Panicked(#[from] JobPanic),
}

/// The messages about bleeding.
#[derive(SystemParam)]
pub(crate) struct BleedingMessages<'w, 's> {
    pub(crate) started: Announcer<'w, 's, BleedingStarted>,
    pub(crate) stopped: Announcer<'w, 's, BleedingStopped>,
    pub(crate) failed: Announcer<'w, 's, CirculationFailed>,
}
