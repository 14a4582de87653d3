//! Long work in short stretches, so that the caller can do something else in between.
//!
//! A builder that may take longer than a frame is an `async fn` that takes a [`Pace`]. It [rests](Pace::rest) after
//! every stretch of about a thousand items, and reports its progress with each rest. The caller gives the pace a
//! function that decides whether a rest becomes a pause. So nothing here knows a clock or a thread, and the result is
//! the same with any pauses.
//!
//! Each of these builders has a synchronous form, by [`at_once`].
//!
//! ```
//! use bevy_vessels::synthesis::{organ::LiverSettings, pace::Pace, tissue::MeshSurface};
//! use std::{pin::pin, task::{Context, Waker}};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mesh = LiverSettings::default().generate()?.mesh.triangle_mesh()?;
//! let pace = Pace::new(|| true);
//! let mut surface = pin!(MeshSurface::new_paced(mesh, &pace));
//! while surface.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending() {
//!     println!("{:.0} %", 100.0 * pace.progress());
//! }
//! # Ok(())
//! # }
//! ```

use std::{
    fmt,
    future::poll_fn,
    ops::Range,
    pin::pin,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    task::{Context, Poll, Waker},
};

/// Items between two rests, if each takes some tens of nanoseconds.
pub(crate) const STRETCH: usize = 1024;
/// Items between two rests, if each takes some microseconds.
pub(crate) const SHORT_STRETCH: usize = 64;

/// The pauses and the progress of long work.
///
/// A clone is a handle to the same pace. The default is the pace of work that is neither interrupted nor watched.
#[derive(Clone, Debug, Default)]
pub struct Pace {
    watch: Option<Arc<Watch>>,
    /// The part of the whole work that this pace covers.
    part: Part,
}

#[derive(Clone, Copy, Debug)]
struct Part {
    from: f32,
    span: f32,
}

impl Default for Part {
    fn default() -> Self {
        Self { from: 0.0, span: 1.0 }
    }
}

/// State shared by the work and its caller.
struct Watch {
    pauses: Box<dyn Fn() -> bool + Send + Sync>,
    /// Bits of an `f32` from 0 to 1. The bits of non-negative numbers have the order of the numbers.
    progress: AtomicU32,
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watch").field("progress", &f32::from_bits(self.progress.load(Ordering::Relaxed))).finish()
    }
}

impl Pace {
    /// The pace of work that pauses at each rest for which `pauses` is true.
    ///
    /// A pause ends when the future is polled again, whatever `pauses` returns then. So work that pauses at every rest
    /// ends, too.
    pub fn new(pauses: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        let watch = Watch { pauses: Box::new(pauses), progress: AtomicU32::new(0) };
        Self { watch: Some(Arc::new(watch)), part: Part::default() }
    }

    /// Share of the whole work that is done, from 0 to 1. It never falls. 0 for the default pace, which is not watched.
    pub fn progress(&self) -> f32 {
        self.watch.as_ref().map_or(0.0, |watch| f32::from_bits(watch.progress.load(Ordering::Relaxed)))
    }

    /// The pace of a part of this work, given by its shares at start and end.
    #[must_use]
    pub fn part(&self, shares: Range<f32>) -> Self {
        let Part { from, span } = self.part;
        let part = Part { from: from + span * shares.start, span: span * (shares.end - shares.start) };
        Self { watch: self.watch.clone(), part }
    }

    /// Rests: reports the share of this work that is done, from 0 to 1, and pauses if asked to.
    pub async fn rest(&self, done: f32) {
        let Some(watch) = &self.watch else { return };
        let progress = (self.part.from + self.part.span * done).clamp(0.0, 1.0);
        watch.progress.fetch_max(progress.to_bits(), Ordering::Relaxed);
        if (watch.pauses)() {
            pause().await;
        }
    }

    /// Calls `act` for ranges of `stretch` items, in order, and rests in between.
    pub(crate) async fn stretches(&self, items: usize, stretch: usize, mut act: impl FnMut(Range<usize>)) {
        for start in (0..items).step_by(stretch) {
            let end = items.min(start + stretch);
            act(start..end);
            self.rest(end as f32 / items as f32).await;
        }
    }

    /// Calls `act` for each of so many light items, in order, and rests in between.
    pub(crate) async fn each(&self, items: usize, mut act: impl FnMut(usize)) {
        self.stretches(items, STRETCH, |stretch| stretch.for_each(&mut act)).await;
    }

    /// Makes a list of so many light items.
    pub(crate) async fn collect<T>(&self, items: usize, item: impl Fn(usize) -> T) -> Vec<T> {
        let mut list = Vec::with_capacity(items);
        self.stretches(items, STRETCH, |stretch| list.extend(stretch.map(&item))).await;
        list
    }

    /// Sorts a list. The order of equal items doesn't matter: they are the same in every field.
    pub(crate) async fn sort<T: Ord + Copy>(&self, items: &mut Vec<T>) {
        if self.watch.is_none() {
            items.sort_unstable();
            return;
        }
        let len = items.len();
        let mut run = 4 * STRETCH;
        self.part(0.0..0.5).stretches(len, run, |run| items[run].sort_unstable()).await;
        // Merges two runs at a time, into another list.
        let mut merged = Vec::with_capacity(len);
        while run < len {
            merged.clear();
            for start in (0..len).step_by(2 * run) {
                let (middle, end) = (len.min(start + run), len.min(start + 2 * run));
                let mut taken = [0; 2];
                while merged.len() < end {
                    merge([&items[start..middle], &items[middle..end]], &mut taken, &mut merged);
                    self.rest(0.5 + 0.5 * run as f32 / len as f32).await;
                }
            }
            std::mem::swap(items, &mut merged);
            run *= 2;
        }
    }
}

/// Merges the next `STRETCH` items of two sorted lists, after those that have been `taken`, into `merged`.
fn merge<T: Ord + Copy>([first, second]: [&[T]; 2], taken: &mut [usize; 2], merged: &mut Vec<T>) {
    for _ in 0..STRETCH {
        let (next, side) = match (first.get(taken[0]), second.get(taken[1])) {
            (Some(a), Some(b)) if b < a => (b, 1),
            (Some(a), _) => (a, 0),
            (None, Some(b)) => (b, 1),
            (None, None) => return,
        };
        merged.push(*next);
        taken[side] += 1;
    }
}

/// Counts work with items of different size, and says when to rest.
#[derive(Debug, Default)]
pub(crate) struct Stretch {
    done: usize,
}

impl Stretch {
    /// Whether a stretch ends after so many more items. The next one begins then.
    pub fn ends_after(&mut self, items: usize) -> bool {
        self.done += items;
        let ends = self.done >= STRETCH;
        if ends {
            self.done = 0;
        }
        ends
    }
}

/// A future that is pending once.
async fn pause() {
    let mut has_paused = false;
    poll_fn(|context| {
        if std::mem::replace(&mut has_paused, true) {
            return Poll::Ready(());
        }
        // The work can go on at any time, so an executor that waits for a wake-up gets one.
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
}

/// Does paced work synchronously, to the end, through all pauses.
pub fn at_once<T>(work: impl Future<Output = T>) -> T {
    let mut work = pin!(work);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(result) = work.as_mut().poll(&mut context) {
            return result;
        }
    }
}
