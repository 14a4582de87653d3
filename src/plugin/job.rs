//! Work that may take longer than a frame: done at once if it is small, in the task pool if there is a second thread,
//! and a slice in each frame if there is none.
//!
//! In: [paced](crate::synthesis::pace) work, and its number of items. Out: its result, in the same frame or a later
//! one. The result never depends on where the work is done. Dropping a [`Job`] stops it.

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
    platform::time::Instant,
    reflect::{Reflect, std_traits::ReflectDefault},
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready},
};
use std::{
    collections::VecDeque,
    fmt,
    pin::Pin,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    task::{Context, Waker},
    time::Duration,
};

/// How work that takes longer than a frame is done: tissues, indices, networks and bindings of large organs.
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
    /// Units: time on this machine. Limits: none. Default: [`Self::DEFAULT_SLICE_TIME`].
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

/// Where work is done that is too large to be done at once.
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
    fn is_sliced(self) -> bool {
        match self {
            Self::Auto => cfg!(target_arch = "wasm32"),
            Self::TaskPool => false,
            Self::Slices => true,
        }
    }
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
        items <= self.at_once()
    }

    /// Starts work on about so many items. If they are few, it is done when this returns.
    pub(crate) fn start<T, W>(&self, items: usize, work: impl FnOnce(Pace) -> W) -> Job<T>
    where
        T: Send + 'static,
        W: Future<Output = T> + Send + 'static,
    {
        if self.is_small(items) {
            Job::done(at_once(work(Pace::default())))
        } else if self.settings.mode.is_sliced() {
            self.slices.start(work)
        } else {
            Job::in_task_pool(work)
        }
    }
}

/// Work that was started, and its result once it is ready. Dropping it stops the work.
pub(crate) struct Job<T> {
    work: Work<T>,
    pace: Pace,
    is_dropped: Arc<AtomicBool>,
}

enum Work<T> {
    Done(Option<T>),
    Task(Task<T>),
    Slices(Arc<Mutex<Option<T>>>),
}

impl<T: Send + 'static> Job<T> {
    fn done(result: T) -> Self {
        Self { work: Work::Done(Some(result)), pace: Pace::default(), is_dropped: Arc::default() }
    }

    fn in_task_pool<W: Future<Output = T> + Send + 'static>(work: impl FnOnce(Pace) -> W) -> Self {
        let is_dropped = Arc::<AtomicBool>::default();
        // A dropped task runs no farther than to its next pause.
        let pace = Pace::new({
            let is_dropped = Arc::clone(&is_dropped);
            move || is_dropped.load(Ordering::Relaxed)
        });
        let task = AsyncComputeTaskPool::get_or_init(TaskPool::new).spawn(work(pace.clone()));
        Self { work: Work::Task(task), pace, is_dropped }
    }

    /// Whether the result is ready.
    pub(crate) fn is_done(&self) -> bool {
        match &self.work {
            Work::Done(_) => true,
            Work::Task(task) => task.is_finished(),
            Work::Slices(result) => lock(result).is_some(),
        }
    }

    /// Share of the work that is done, from 0 to 1. It never falls.
    pub(crate) fn progress(&self) -> f32 {
        if self.is_done() { 1.0 } else { self.pace.progress() }
    }

    /// Takes the result out of a job that is done, and drops the job.
    pub(crate) fn poll(job: &mut Option<Self>) -> Option<T> {
        let result = match &mut job.as_mut()?.work {
            Work::Done(result) => result.take(),
            Work::Task(task) => check_ready(task),
            Work::Slices(result) => lock(result).take(),
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

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Jobs that are done in slices, on this thread.
#[derive(Resource, Default)]
pub(crate) struct JobSlices {
    /// In the order of their turns. A mutex, so that systems that start jobs need no exclusive access.
    queue: Mutex<VecDeque<Sliced>>,
    clock: Arc<SliceClock>,
}

struct Sliced {
    /// Stores its result where the job finds it.
    work: Pin<Box<dyn Future<Output = ()> + Send>>,
    is_dropped: Arc<AtomicBool>,
}

/// The time at which the slices of a frame end.
struct SliceClock {
    zero: Instant,
    /// Nanoseconds since then.
    end: AtomicU64,
}

impl Default for SliceClock {
    fn default() -> Self {
        Self { zero: Instant::now(), end: AtomicU64::new(0) }
    }
}

impl SliceClock {
    fn now(&self) -> u64 {
        self.zero.elapsed().as_nanos() as u64
    }

    fn begin(&self, time: Duration) {
        let time = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.end.store(self.now().saturating_add(time), Ordering::Relaxed);
    }

    fn is_over(&self) -> bool {
        self.now() >= self.end.load(Ordering::Relaxed)
    }
}

impl JobSlices {
    fn start<T, W>(&self, work: impl FnOnce(Pace) -> W) -> Job<T>
    where
        T: Send + 'static,
        W: Future<Output = T> + Send + 'static,
    {
        let clock = Arc::clone(&self.clock);
        let pace = Pace::new(move || clock.is_over());
        let (result, is_dropped) = (Arc::new(Mutex::new(None)), Arc::<AtomicBool>::default());
        let (work, place) = (work(pace.clone()), Arc::clone(&result));
        let work = Box::pin(async move {
            let result = work.await;
            *lock(&place) = Some(result);
        });
        lock(&self.queue).push_back(Sliced { work, is_dropped: Arc::clone(&is_dropped) });
        Job { work: Work::Slices(result), pace, is_dropped }
    }

    /// Does a frame's slices: of one job until it is done or the time is over, then of the next. The next frame begins
    /// with the next job.
    fn advance(&self, time: Duration) {
        let mut turns = std::mem::take(&mut *lock(&self.queue));
        turns.retain(|job| !job.is_dropped.load(Ordering::Relaxed));
        self.clock.begin(time);
        while let Some(mut job) = turns.pop_front() {
            if job.work.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending() {
                turns.push_back(job);
            }
            if self.clock.is_over() {
                break;
            }
        }
        let mut queue = lock(&self.queue);
        turns.append(&mut queue);
        *queue = turns;
    }
}

/// Advances the jobs that are done in slices, at the start of a frame.
pub(crate) fn advance_slices(settings: Res<JobSettings>, slices: Res<JobSlices>) {
    slices.advance(settings.slice_time);
}

/// Registers what jobs need, with their system in a schedule.
pub(crate) fn register(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.init_resource::<JobSettings>().init_resource::<JobSlices>().register_type::<JobSettings>();
    app.add_systems(schedule, advance_slices.before(VesselSystems::Source));
}
