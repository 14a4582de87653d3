//! What the circulation tells: which ends bleed, and what keeps blood from flowing.

use crate::synthesis::haemodynamics::{EndSide, FlowError};
use crate::synthesis::wound::EndId;
use bevy::ecs::{entity::Entity, message::Message};

/// An open end begins to bleed.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct BleedingStarted {
    /// The organ.
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

/// An open end bleeds no more: it has clotted, has no pressure left, or was closed.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct BleedingStopped {
    /// The organ.
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

/// The blood of an organ can't flow. Other organs are not affected; a change of its [`Perfusion`] makes it try again.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct CirculationFailed {
    /// The organ.
    pub organ: Entity,
    /// What was wrong, with the value and the remedy.
    pub error: FlowError,
}
