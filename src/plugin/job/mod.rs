//! Work that may take longer than a frame: done at once if it is small, in the task pool if there is a second thread,
//! and a slice in each frame if there is none.
//!
//! In: [paced](crate::synthesis::pace) work, and its number of items. Out: its result, in the same frame or a later
//! one. The result never depends on where the work is done. Dropping a [`Job`] stops it. Work that panics ends in a
//! [`JobPanic`].

use crate::plugin::order::VesselSystems;
use crate::synthesis::pace::{Pace, at_once};
use bevy::{
    app::App,
    ecs::{
        change_detection::Res,
        intern::Interned,
        schedule::{IntoScheduleConfigs, ScheduleLabel},
        system::SystemParam,
    },
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready, futures_lite::FutureExt},
};
use slices::{JobSlices, Place};
use std::{
    any::Any,
    fmt,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

mod settings;
mod slices;
#[cfg(test)]
mod tests;

pub use settings::{JobMode, JobSettings};

/// The work on an organ panicked, in a job or in a step of its growth. That organ fails; the app and all other organs
/// go on, unless the app is built to abort on panics.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the work on it panicked ({message}), which is a fault of its custom generator, if it has one, or else of \
     bevy_vessels; please report that with mesh and settings"
)]
pub struct JobPanic {
    /// The message of the panic.
    pub message: String,
}

impl JobPanic {
    fn new(payload: &(dyn Any + Send)) -> Self {
        let text = payload.downcast_ref::<&str>().copied();
        let message = text.or(payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message").to_owned();
        Self { message }
    }
}

/// The result of a job.
pub(crate) type Outcome<T> = Result<T, JobPanic>;

/// Does work now. After a panic, whatever it has changed must be dropped.
pub(crate) fn catch_panic<T>(work: impl FnOnce() -> T) -> Outcome<T> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| JobPanic::new(&*payload))
}

/// The outcome of work that may fail, as one result.
pub(crate) fn as_one<T, E: From<JobPanic>>(outcome: Outcome<Result<T, E>>) -> Result<T, E> {
    outcome.unwrap_or_else(|panic| Err(panic.into()))
}

/// Does work until it ends or panics. A panic drops everything that the work has made.
async fn guarded<T>(work: impl Future<Output = T>) -> Outcome<T> {
    AssertUnwindSafe(work).catch_unwind().await.map_err(|payload| JobPanic::new(&*payload))
}

/// Starts jobs.
#[derive(SystemParam)]
pub(crate) struct Jobs<'w> {
    settings: Res<'w, JobSettings>,
    slices: Res<'w, JobSlices>,
}

impl Jobs<'_> {
    /// Largest number of items for which work is done at once.
    pub(crate) fn at_once(&self) -> usize {
        self.settings.at_once
    }

    /// Whether work on so many items is done at once.
    pub(crate) fn is_small(&self, items: usize) -> bool {
        items <= self.at_once() && self.at_once() > 0
    }

    /// Starts work on about so many items. If they are few, it is done when this returns.
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

/// Work that was started, and its result once it is ready. Dropping it stops the work.
pub(crate) struct Job<T> {
    work: Work<Outcome<T>>,
    pace: Pace,
    /// Tells the work that its job was dropped.
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
        // A dropped task runs no farther than to its next pause.
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

    /// Whether the result is ready.
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

    /// Takes the result out of a job that is done, and drops the job.
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

/// Registers what jobs need, with their system in a schedule.
pub(crate) fn register(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.init_resource::<JobSettings>().init_resource::<JobSlices>().register_type::<JobSettings>();
    app.add_systems(schedule, slices::advance_slices.before(VesselSystems::Source).run_if(slices::has_slices));
}
