//! The progress of an organ's growth, and whether it runs or is paused.

use crate::synthesis::{growth::Growth, tree::ByKind};
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::time::Duration;

/// The phase of an organ's growth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, PartialEq)]
pub enum GrowthPhase {
    /// The organ has no mesh yet, or its mesh is still being loaded.
    #[default]
    WaitingForMesh,
    /// The image that the tissue is read from is still being loaded.
    WaitingForImage,
    /// The tissue is being made from the mesh or another source, or roots are placed on it. Large organs do this in a
    /// job, as [`JobSettings`](crate::plugin::JobSettings) say. Vessels that start again, with another seed say, stay
    /// until then.
    PreparingTissue,
    /// Steps are being done, as the [budget](crate::plugin::GrowthBudget) allows. A paused growth is in this phase,
    /// too.
    Growing,
    /// No steps are done until severed vessels are whole again, as
    /// [`Cuttable::growth`](crate::plugin::Cuttable::growth) says.
    Held,
    /// The organ's [paint](crate::plugin::OrganPaint) has changed, or its settings where it has [`RegrowsUnseen`], and new
    /// vessels grow unseen. The drawn vessels stay until the new ones have done as many steps. Numbers of steps and nodes are those of the new
    /// vessels.
    Regrowing,
    /// All steps are done.
    Finished,
    /// Something is wrong with the mesh, the image, the settings or the paint:
    /// [`GrowthState::error`](crate::plugin::GrowthState::error) says what. Changing it starts the growth again.
    Failed,
}

/// The progress of an organ's growth. Read-only: the plugin writes it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct GrowthProgress {
    /// The phase of the growth.
    pub phase: GrowthPhase,
    /// Share of the tissue's preparation that is done, from 0 to 1.
    pub prepared: f32,
    /// Steps done.
    pub step: u32,
    /// Steps in total.
    pub steps: u32,
    /// Nodes grown so far, of each kind.
    pub nodes: ByKind<usize>,
    /// Attraction points, or other places, that still need a vessel of each kind.
    pub waiting: ByKind<usize>,
    /// Time spent in the steps alone, on this machine.
    pub grow_time: Duration,
}

impl GrowthProgress {
    /// Whether the vessels are there to stay: what is made of them is worth its time.
    pub(crate) fn is_grown(&self) -> bool {
        matches!(self.phase, GrowthPhase::Finished | GrowthPhase::Regrowing | GrowthPhase::Failed)
    }

    /// The progress of a growth in a phase.
    pub(crate) fn of(phase: GrowthPhase, growth: Option<&dyn Growth>, grow_time: Duration) -> Self {
        let Some(growth) = growth else { return Self { phase, grow_time, ..Self::default() } };
        let (count, trees) = (growth.progress(), growth.trees());
        Self {
            phase,
            prepared: 1.0,
            step: count.done,
            steps: count.all,
            nodes: trees.map(|_, grown| grown.map_or(0, |grown| grown.tree.len())),
            waiting: trees.map(|_, grown| grown.map_or(0, |grown| grown.waiting)),
            grow_time,
        }
    }

    /// Share of the steps that are done, from 0 to 1.
    pub fn fraction(&self) -> f32 {
        if self.steps == 0 { 0.0 } else { self.step as f32 / self.steps as f32 }
    }

    /// Whether all steps are done.
    pub fn is_finished(&self) -> bool {
        self.phase == GrowthPhase::Finished
    }

    /// Whether the vessels have grown as far as they do for now: all steps are done, or wait for wounds to heal.
    pub(crate) fn is_settled(&self) -> bool {
        matches!(self.phase, GrowthPhase::Finished | GrowthPhase::Held)
    }
}

/// Whether an organ's growth runs or is paused. Set it at any time, or send a
/// [`GrowthCommand`](crate::plugin::GrowthCommand).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Component, Default, Clone, PartialEq)]
pub enum GrowthControl {
    /// Steps follow one another as the budget allows.
    #[default]
    Running,
    /// Only steps that are asked for are done. This holds for vessels that grow unseen, too. The tissue is still
    /// prepared.
    Paused,
}

/// Lets vessels with changed settings or another seed grow unseen: the drawn vessels stay until the new ones have done as
/// many steps. Put it beside the [`Vasculature`](crate::plugin::Vasculature) of an organ whose settings are tweaked.
///
/// Changes that come before the new vessels are drawn wait for that, and only the last of them counts: a slider that moves
/// all the time shows one growth after the other, and there is always something to see. Without this component, vessels
/// start from their roots in view, at every change. [`GrowthAction::Restart`](crate::plugin::GrowthAction::Restart) does so
/// in either case.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct RegrowsUnseen;

impl GrowthControl {
    /// Pauses a running growth, or resumes a paused one.
    pub fn toggle(&mut self) {
        *self = match self {
            Self::Running => Self::Paused,
            Self::Paused => Self::Running,
        };
    }
}
