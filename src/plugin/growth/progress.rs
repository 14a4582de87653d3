//! How far the growth of an organ is, and whether it goes on by itself.

use crate::synthesis::{growth::Growth, tree::ByKind};
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::time::Duration;

/// What the growth of an organ is at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone, PartialEq)]
pub enum GrowthPhase {
    /// The organ has no mesh yet, or its mesh is still being loaded.
    #[default]
    WaitingForMesh,
    /// The image that the tissue is read from is still being loaded.
    WaitingForImage,
    /// The mesh, or whatever the tissue is made of, is made into a tissue: for large organs beside the frames, as [`JobSettings`](crate::plugin::JobSettings) say.
    PreparingTissue,
    /// Steps are done, as the [budget](crate::plugin::GrowthBudget) allows. A paused growth is in this phase, too.
    Growing,
    /// The organ's [paint](crate::plugin::OrganPaint) has changed: other vessels grow unseen on what is painted now. Those
    /// that are drawn stay until these have done as many steps. What is told of steps and nodes is told of these.
    Regrowing,
    /// All steps are done.
    Finished,
    /// Something is wrong with the mesh, the image, the settings or the paint:
    /// [`GrowthState::error`](crate::plugin::GrowthState::error) says what. Changing the culprit starts the growth again.
    Failed,
}

/// How far the growth of an organ is. For reading: the plugin writes it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct GrowthProgress {
    /// What is going on.
    pub phase: GrowthPhase,
    /// Share of the tissue's preparation that is done, from 0 to 1.
    pub prepared: f32,
    /// Steps done.
    pub step: u32,
    /// Steps that there are.
    pub steps: u32,
    /// Nodes grown so far, of each kind.
    pub nodes: ByKind<usize>,
    /// Attraction points, or other places, that still wait for a vessel of each kind.
    pub waiting: ByKind<usize>,
    /// Time spent in the steps alone, on this machine.
    pub grow_time: Duration,
}

impl GrowthProgress {
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
}

/// Whether an organ's growth goes on by itself. Set it at will, or send a
/// [`GrowthCommand`](crate::plugin::GrowthCommand).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Component, Default, Clone, PartialEq)]
pub enum GrowthControl {
    /// Steps follow one another as the budget allows.
    #[default]
    Running,
    /// No step is done but those that are asked for, of vessels that grow unseen neither. The tissue is prepared all the
    /// same.
    Paused,
}

impl GrowthControl {
    /// Pauses what runs, and lets run what is paused.
    pub fn toggle(&mut self) {
        *self = match self {
            Self::Running => Self::Paused,
            Self::Paused => Self::Running,
        };
    }
}
