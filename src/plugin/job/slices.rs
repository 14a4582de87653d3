//! Jobs in slices: a little work in each frame, on the thread that runs the schedule.

use crate::plugin::job::settings::JobSettings;
use crate::synthesis::pace::Pace;
use bevy::{
    ecs::{change_detection::Res, resource::Resource},
    platform::time::Instant,
};
use std::{
    collections::VecDeque,
    pin::Pin,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    task::{Context, Waker},
    time::Duration,
};

/// Jobs that are done in slices.
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

/// Where a job finds its result.
pub(super) struct Place<T>(Arc<Mutex<Option<T>>>);

impl<T> Place<T> {
    pub(super) fn is_filled(&self) -> bool {
        lock(&self.0).is_some()
    }

    pub(super) fn take(&self) -> Option<T> {
        lock(&self.0).take()
    }
}

/// The time at which the slices of a frame end.
struct SliceClock {
    zero: Instant,
    /// Nanoseconds since `zero`.
    end: AtomicU64,
}

impl Default for SliceClock {
    fn default() -> Self {
        Self { zero: Instant::now(), end: AtomicU64::new(0) }
    }
}

impl SliceClock {
    fn now(&self) -> u64 {
        nanoseconds(self.zero.elapsed())
    }

    fn begin(&self, time: Duration) {
        self.end.store(self.now().saturating_add(nanoseconds(time)), Ordering::Relaxed);
    }

    fn is_over(&self) -> bool {
        self.now() >= self.end.load(Ordering::Relaxed)
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

/// No code panics while it holds one of these locks; even then the guarded data would still be consistent.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl JobSlices {
    /// The pace of work that pauses when a frame's time is over.
    pub(super) fn pace(&self) -> Pace {
        let clock = Arc::clone(&self.clock);
        Pace::new(move || clock.is_over())
    }

    /// Appends work to the queue. Its result will be stored in `place`.
    pub(super) fn add<T: Send + 'static>(
        &self,
        work: impl Future<Output = T> + Send + 'static,
        is_dropped: Arc<AtomicBool>,
    ) -> Place<T> {
        let result = Arc::new(Mutex::new(None));
        let place = Place(Arc::clone(&result));
        let work = Box::pin(async move {
            let outcome = work.await;
            *lock(&result) = Some(outcome);
        });
        lock(&self.queue).push_back(Sliced { work, is_dropped });
        place
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

/// Whether there are jobs that are done in slices.
pub(crate) fn has_slices(slices: Res<JobSlices>) -> bool {
    !lock(&slices.queue).is_empty()
}

/// Advances the jobs that are done in slices, at the start of a frame.
pub(crate) fn advance_slices(settings: Res<JobSettings>, slices: Res<JobSlices>) {
    slices.advance(settings.slice_time);
}
