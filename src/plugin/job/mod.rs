//! Work that may take longer than a frame: done at once where it is little, beside the frames where there is a second
//! thread, and a slice in each frame where there is none.
//!
//! In: [paced](crate::synthesis::pace) work, and how many items it goes through. Out: its result, in the same frame or a
//! later one. Where the work is done never changes what comes out. Who lets go of a [`Job`] stops it. Work that panics
//! ends in a [`JobPanic`], so that nobody waits for it.

use crate::plugin::order::VesselSystems;
use crate::synthesis::pace::{Pace, at_once};
use bevy::{
    app::App,
    ecs::{
        change_detection::Res,
        intern::Interned,
        reflect::ReflectResource,
        resource::Resource,
        schedule::{IntoScheduleConfigs, ScheduleLabel},
        system::SystemParam,
    },
    reflect::{Reflect, std_traits::ReflectDefault},
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready, futures_lite::FutureExt},
};
use slices::{JobSlices, Place};
use std::{
    any::Any,
    fmt,
    panic::AssertUnwindSafe,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

mod slices;
#[cfg(test)]
mod tests;

/// Where work is done that takes longer than a frame: tissues, indices, networks and bindings of large organs.
///
/// Changes concern work that begins later; a new [`slice_time`](Self::slice_time) also what is under way.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub struct JobSettings {
    /// Who does large work.
    ///
    /// Default: [`JobMode::Auto`].
    pub mode: JobMode,
    /// Items, such as triangles or nodes, up to which work is done at once, in the frame in which it comes up.
    ///
    /// Higher values save small organs the frames of waiting, and let single frames take longer: some 3 ms for the default.
    ///
    /// Limits: none; 0 does nothing at once. Default: [`Self::DEFAULT_AT_ONCE`].
    pub at_once: usize,
    /// The time that all jobs together have in a frame, where they are done in slices.
    ///
    /// Higher values end them sooner and take more of each frame. Whatever it is, one job goes on a little in each frame, so
    /// that all come to their end.
    ///
    /// Units: time on this machine. Limits: none; 0 does one stretch of one job a frame. Default:
    /// [`Self::DEFAULT_SLICE_TIME`].
    pub slice_time: Duration,
}

impl JobSettings {
    /// Items up to which work is done at once.
    pub const DEFAULT_AT_ONCE: usize = 8192;
    /// An eighth of a frame at 60 frames a second.
    pub const DEFAULT_SLICE_TIME: Duration = Duration::from_millis(2);
}

impl Default for JobSettings {
    fn default() -> Self {
        Self { mode: JobMode::Auto, at_once: Self::DEFAULT_AT_ONCE, slice_time: Self::DEFAULT_SLICE_TIME }
    }
}

/// Who does work that is too large to be done at once.
///
/// What comes out is the same to the last bit; only the frame in which it comes differs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum JobMode {
    /// The task pool where it has threads of its own; in a browser, slices.
    #[default]
    Auto,
    /// The task pool. In a browser its tasks hold up the frames.
    TaskPool,
    /// A slice in each frame, on the thread that runs the schedule: of use to try out what a browser does.
    Slices,
}

impl JobMode {
    fn is_sliced(self) -> bool {
        match self {
            Self::Auto => cfg!(target_arch = "wasm32"),
            Self::TaskPool => false,
            Self::Slices => true,
        }
    }
}

/// The work that an organ was waiting for panicked. That organ fails; the app and all other organs go on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the work on it panicked ({message}), which is a fault of bevy_vessels; please report it with mesh and settings"
)]
pub struct JobPanic {
    /// What the panic said.
    pub message: String,
}

impl JobPanic {
    fn new(payload: &(dyn Any + Send)) -> Self {
        let text = payload.downcast_ref::<&str>().copied();
        let message = text.or(payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message").to_owned();
        Self { message }
    }
}

/// What comes out of a job.
type Outcome<T> = Result<T, JobPanic>;

/// Does work to its end, or to its panic: what it has made by then is dropped, so that nothing half done is left.
async fn guarded<T>(work: impl Future<Output = T>) -> Outcome<T> {
    AssertUnwindSafe(work).catch_unwind().await.map_err(|payload| JobPanic::new(&*payload))
}

/// Begins jobs.
#[derive(SystemParam)]
pub(crate) struct Jobs<'w> {
    settings: Res<'w, JobSettings>,
    slices: Res<'w, JobSlices>,
}

impl Jobs<'_> {
    /// Items up to which work is done at once.
    pub(crate) fn at_once(&self) -> usize {
        self.settings.at_once
    }

    /// Whether work on so many items is done at once.
    pub(crate) fn is_small(&self, items: usize) -> bool {
        items <= self.at_once() && self.at_once() > 0
    }

    /// Begins work on about so many items. If they are few, it is done when this returns.
    pub(crate) fn start<T, W>(&self, items: usize, work: impl FnOnce(Pace) -> W) -> Job<T>
    where
        T: Send + 'static,
        W: Future<Output = T> + Send + 'static,
    {
        if self.is_small(items) {
            Job::at_once(work)
        } else if self.settings.mode.is_sliced() {
            Job::in_slices(&self.slices, work)
        } else {
            Job::in_task_pool(work)
        }
    }
}

/// Work that was begun, and its result once it is there. To let go of it stops it.
pub(crate) struct Job<T> {
    work: Work<Outcome<T>>,
    pace: Pace,
    /// Tells the work that nobody waits for it any more.
    is_dropped: Arc<AtomicBool>,
}

enum Work<T> {
    Done(Option<T>),
    Task(Task<T>),
    Slices(Place<T>),
}

impl<T: Send + 'static> Job<T> {
    fn at_once<W: Future<Output = T>>(work: impl FnOnce(Pace) -> W) -> Self {
        let pace = Pace::default();
        let result = at_once(guarded(work(pace.clone())));
        Self { work: Work::Done(Some(result)), pace, is_dropped: Arc::default() }
    }

    fn in_task_pool<W: Future<Output = T> + Send + 'static>(work: impl FnOnce(Pace) -> W) -> Self {
        let is_dropped = Arc::<AtomicBool>::default();
        // A task that was dropped goes no farther than to its next pause.
        let pace = Pace::new({
            let is_dropped = Arc::clone(&is_dropped);
            move || is_dropped.load(Ordering::Relaxed)
        });
        let task = AsyncComputeTaskPool::get_or_init(TaskPool::new).spawn(guarded(work(pace.clone())));
        Self { work: Work::Task(task), pace, is_dropped }
    }

    fn in_slices<W: Future<Output = T> + Send + 'static>(slices: &JobSlices, work: impl FnOnce(Pace) -> W) -> Self {
        let (pace, is_dropped) = (slices.pace(), Arc::<AtomicBool>::default());
        let place = slices.add(guarded(work(pace.clone())), Arc::clone(&is_dropped));
        Self { work: Work::Slices(place), pace, is_dropped }
    }

    /// Whether the result is there.
    pub(crate) fn is_done(&self) -> bool {
        match &self.work {
            Work::Done(_) => true,
            Work::Task(task) => task.is_finished(),
            Work::Slices(place) => place.is_filled(),
        }
    }

    /// Share of the work that is done, from 0 to 1. It never falls.
    pub(crate) fn progress(&self) -> f32 {
        if self.is_done() { 1.0 } else { self.pace.progress() }
    }

    /// Takes the result out of a job that is done, and lets go of the job.
    pub(crate) fn poll(job: &mut Option<Self>) -> Option<Outcome<T>> {
        let result = match &mut job.as_mut()?.work {
            Work::Done(result) => result.take(),
            Work::Task(task) => check_ready(task),
            Work::Slices(place) => place.take(),
        };
        if result.is_some() {
            *job = None;
        }
        result
    }
}

impl<T> Drop for Job<T> {
    fn drop(&mut self) {
        self.is_dropped.store(true, Ordering::Relaxed);
    }
}

impl<T> fmt::Debug for Job<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Job").field("pace", &self.pace).finish_non_exhaustive()
    }
}

/// Registers what jobs need, with the systems of a schedule.
pub(crate) fn register(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.init_resource::<JobSettings>().init_resource::<JobSlices>().register_type::<JobSettings>();
    app.add_systems(schedule, slices::advance_slices.before(VesselSystems::Source));
}
