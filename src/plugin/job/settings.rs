//! Settings of jobs.

use bevy::{
    ecs::{reflect::ReflectResource, resource::Resource},
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::time::Duration;

/// How work that takes longer than a frame is done: tissues, starts of growths, indices, networks and bindings of large
/// organs.
///
/// Changes apply to work that begins later; a new [`slice_time`](Self::slice_time) also to work under way.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct JobSettings {
    /// Where large work is done.
    ///
    /// Default: [`JobMode::Auto`].
    pub mode: JobMode,
    /// Largest number of items, such as triangles or nodes, for which work is done at once, in the frame that asks for
    /// it.
    ///
    /// Higher values spare larger organs the wait, and let single frames take longer: some 3 ms for the default.
    ///
    /// Limits: none; with 0 no work is done at once. Default: [`Self::DEFAULT_AT_ONCE`].
    pub at_once: usize,
    /// The time in a frame for all jobs together, if they are done in slices.
    ///
    /// Higher values finish them sooner and take more of each frame. One job always advances a little in each frame, so
    /// all jobs finish.
    ///
    /// Units: time on this machine. Limits: none; 0 does one stretch of one job a frame. Default:
    /// [`Self::DEFAULT_SLICE_TIME`].
    pub slice_time: Duration,
}

impl JobSettings {
    /// Default of [`at_once`](Self::at_once), in items.
    pub const DEFAULT_AT_ONCE: usize = 8192;
    /// Default of [`slice_time`](Self::slice_time): an eighth of a frame at 60 frames a second.
    pub const DEFAULT_SLICE_TIME: Duration = Duration::from_millis(2);
}

impl Default for JobSettings {
    fn default() -> Self {
        Self { mode: JobMode::Auto, at_once: Self::DEFAULT_AT_ONCE, slice_time: Self::DEFAULT_SLICE_TIME }
    }
}

/// Where work is done that is too large to be done at once. The result is the same to the last bit; only its frame
/// differs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum JobMode {
    /// In the task pool if that has threads of its own; in a browser, in slices.
    #[default]
    Auto,
    /// In the task pool. In a browser its tasks block the frames.
    TaskPool,
    /// A slice in each frame, on the thread that runs the schedule, as in a browser.
    Slices,
}

impl JobMode {
    pub(super) fn is_sliced(self) -> bool {
        match self {
            Self::Auto => cfg!(target_arch = "wasm32"),
            Self::TaskPool => false,
            Self::Slices => true,
        }
    }
}
