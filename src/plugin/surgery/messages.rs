//! Messages that ask for actions on vessels, and those that report results.

use crate::synthesis::{
    tree::{Place, VesselKind},
    wound::{Blade, BladeError, ClampId, WoundError, WoundReport},
};
use bevy::{
    ecs::{
        entity::Entity,
        event::EntityEvent,
        message::Message,
        reflect::{ReflectEvent, ReflectMessage},
    },
    math::Vec3,
    reflect::Reflect,
};
use std::sync::atomic::{AtomicU64, Ordering};

/// Requests an action on vessels, as [`CuttableVessels`](crate::plugin::CuttableVessels) does, by a message. Carried
/// out in the same frame or the next.
///
/// ```
/// # use bevy_vessels::{plugin::{VesselAction, VesselCommand, VesselSite}};
/// # use bevy::prelude::{MessageWriter, Vec3};
/// fn clamp_here(mut commands: MessageWriter<VesselCommand>) {
///     let site = VesselSite::Near { point: Vec3::new(0.1, 0.2, 0.0), reach: 0.01 };
///     commands.write(VesselCommand::new(VesselAction::Clamp(site)));
/// }
/// # bevy::ecs::system::assert_is_system(clamp_here);
/// ```
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Clone, PartialEq)]
pub struct VesselCommand {
    /// The organ to act on; `None` for all that the action meets.
    pub organ: Option<Entity>,
    /// The stroke that it is part of; `None` for an action by itself.
    pub stroke: Option<StrokeId>,
    /// What is to be done.
    pub action: VesselAction,
}

impl VesselCommand {
    /// A command for all organs with a [`Cuttable`](crate::plugin::Cuttable).
    pub fn new(action: VesselAction) -> Self {
        Self { organ: None, stroke: None, action }
    }

    /// The same for one organ.
    #[must_use]
    pub fn on(self, organ: Entity) -> Self {
        Self { organ: Some(organ), ..self }
    }

    /// The same as part of a stroke.
    #[must_use]
    pub fn in_stroke(self, stroke: StrokeId) -> Self {
        Self { stroke: Some(stroke), ..self }
    }
}

/// One movement of an instrument, over any number of frames: one action for the user and for undo.
///
/// Begin one when the movement begins, and give it to each sweep that follows, with [`VesselCommand::in_stroke`] or
/// [`CuttableVessels::in_stroke`](crate::plugin::CuttableVessels::in_stroke). It ends when it is no longer used.
/// Several may go on at once, such as those of two hands.
///
/// Other actions on the same vessels between two actions of a stroke are undone together with it, since a ledger undoes
/// its actions in reverse order. After an undo the stroke may go on, as one that has just begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Clone, PartialEq)]
pub struct StrokeId(u64);

impl StrokeId {
    /// Begins a stroke without actions.
    pub fn begin() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// What can be done to vessels. Shapes, points and lengths are in world space.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Clone, PartialEq)]
pub enum VesselAction {
    /// Severs every vessel that the blade crosses; a ball or capsule also removes what lies within it.
    Cut(Blade),
    /// Seals by heat all vessels up to a calibre within a ball or capsule, for good.
    Cauterise {
        /// The ball or capsule.
        volume: Blade,
        /// Largest diameter that is sealed; infinity for any. Limits: > 0.
        ///
        /// Measured by the mean scale of the organ, the cube root of its determinant.
        max_calibre: f32,
    },
    /// Puts a clamp on: no blood passes until it is taken off.
    Clamp(VesselSite),
    /// Ties off: a clamp that only undo takes off.
    Ligate(VesselSite),
    /// Takes a clamp off.
    Unclamp {
        /// The vessel entity.
        vessels: Entity,
        /// The clamp, from the [`WoundReport`] of when it was put on.
        clamp: ClampId,
    },
    /// Takes off the clamp that is nearest to a point.
    UnclampNear {
        /// The point.
        point: Vec3,
        /// How far from it a clamp may be.
        reach: f32,
    },
    /// Undoes the last action or stroke that changed anything, on all vessels; for one organ, the last that changed it,
    /// only there.
    Undo,
    /// Undoes all actions.
    UndoAll,
}

/// The site on the vessels where an action takes place.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Clone, PartialEq)]
pub enum VesselSite {
    /// On the vessel that is nearest to a point, measured to its wall.
    Near {
        /// The point.
        point: Vec3,
        /// How far from it a vessel's wall may be.
        reach: f32,
    },
    /// At a place of a vessel entity.
    At {
        /// The vessel entity.
        vessels: Entity,
        /// The place.
        place: Place,
    },
}

/// The kind of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Clone, PartialEq)]
pub enum OperationKind {
    /// Vessels were severed.
    Cut,
    /// Vessels were sealed by heat.
    Cauterised,
    /// A clamp was put on.
    Clamped,
    /// A vessel was tied off.
    Ligated,
    /// A clamp was taken off.
    Unclamped,
    /// An action, a stroke or everything was undone.
    Undone,
}

/// Something was done to the vessels of one vessel entity. An action that changes several, in several organs or in
/// arteries and veins, sends one of these for each.
///
/// Also an event on the organ, for observers. Entities for the ends that it opened already exist: see
/// [`OpenEndEntities`](crate::plugin::OpenEndEntities).
#[derive(Message, EntityEvent, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct VesselOperation {
    /// The organ.
    #[event_target]
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// What kind of vessels these are.
    pub kind: VesselKind,
    /// What was done.
    pub operation: OperationKind,
    /// The stroke that it was part of. `None` for an undo.
    pub stroke: Option<StrokeId>,
    /// The changes, with positions in the space of the organ's mesh. Never empty.
    pub report: WoundReport,
}

/// An action could not be done, and changed nothing. A cut that meets no vessel is no failure.
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Clone, PartialEq)]
pub struct VesselOperationFailed {
    /// The command.
    pub command: VesselCommand,
    /// Why it could not be done.
    pub error: OperationError,
}

/// Why an action could not be done.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug, PartialEq)]
pub enum OperationError {
    /// The ledger refused it.
    #[error(transparent)]
    Wound(#[from] WoundError),
    /// The blade cannot be brought into an organ's space.
    #[error("{organ}: {error}")]
    Blade {
        /// The organ.
        organ: Entity,
        /// What is wrong.
        error: BladeError,
    },
    /// There is no vessel, or no clamp, at the point.
    #[error("there is no {what} within {reach} of {point}; aim nearer or give a longer reach")]
    NothingNear {
        /// What was looked for.
        what: &'static str,
        /// Where.
        point: Vec3,
        /// How far from there.
        reach: f32,
    },
    /// The entity is not an organ with vessels that can be cut.
    #[error("{organ} is not an organ that can be cut; give it a Cuttable, and wait until its vessels begin to grow")]
    NotCuttable {
        /// The entity.
        organ: Entity,
    },
    /// The entity carries no vessels that can be cut.
    #[error("{vessels} carries no vessels that can be cut; name a vessel entity of an organ with a Cuttable")]
    NoVessels {
        /// The entity.
        vessels: Entity,
    },
}
