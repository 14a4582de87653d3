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

/// A part of the whole work, given by its shares at start and end.
#[derive(Clone, Copy, Debug)]
struct Part {
    from: f32,
    to: f32,
}

impl Default for Part {
    fn default() -> Self {
        Self { from: 0.0, to: 1.0 }
    }
}

impl Part {
    /// The share of the whole work that is done at a share of the part. At the part's end it is exactly the part's end,
    /// also for nested parts.
    fn at(self, share: f32) -> f32 {
        if share >= 1.0 { self.to } else { self.from + (self.to - self.from) * share.max(0.0) }
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
        let part = Part { from: self.part.at(shares.start), to: self.part.at(shares.end) };
        Self { watch: self.watch.clone(), part }
    }

    /// Rests: reports the share of this work that is done, from 0 to 1, and pauses if asked to.
    pub async fn rest(&self, done: f32) {
        let Some(watch) = &self.watch else { return };
        let progress = self.part.at(done).clamp(0.0, 1.0);
        watch.progress.fetch_max(progress.to_bits(), Ordering::Relaxed);
        if (watch.pauses)() {
            pause().await;
        }
    }

    /// Calls `act` for ranges of `stretch` items, in order, and rests after each.
    pub(crate) async fn stretches(&self, items: usize, stretch: usize, mut act: impl FnMut(Range<usize>)) {
        if items == 0 {
            self.rest(1.0).await;
        }
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

    /// The first of `items` cheap items for which `is_it` is true.
    pub(crate) async fn find(&self, items: usize, is_it: impl Fn(usize) -> bool) -> Option<usize> {
        let mut found = None;
        for start in (0..items).step_by(STRETCH) {
            found = (start..items.min(start + STRETCH)).find(|&item| is_it(item));
            if found.is_some() {
                break;
            }
            self.rest(start as f32 / items as f32).await;
        }
        self.rest(1.0).await;
        found
    }

    /// The sum of `items` cheap items, from the first to the last.
    pub(crate) async fn sum(&self, items: usize, item: impl Fn(usize) -> f64) -> f64 {
        let mut sum = 0.0;
        self.each(items, |number| sum += item(number)).await;
        sum
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
        let (merging, passes) = (self.part(0.5..1.0), len.div_ceil(run).max(1).next_power_of_two().ilog2());
        for pass in 0..passes {
            let pace = merging.part(pass as f32 / passes as f32..(pass + 1) as f32 / passes as f32);
            merged.clear();
            for start in (0..len).step_by(2 * run) {
                let (middle, end) = (len.min(start + run), len.min(start + 2 * run));
                let mut taken = [0; 2];
                while merged.len() < end {
                    merge([&items[start..middle], &items[middle..end]], &mut taken, &mut merged);
                    pace.rest(merged.len() as f32 / len as f32).await;
                }
            }
            std::mem::swap(items, &mut merged);
            run *= 2;
        }
        self.rest(1.0).await;
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

#[cfg(test)]
mod tests {
    use crate::synthesis::pace::*;
    use std::{cell::Cell, cmp::Ordering as Order, sync::atomic::AtomicUsize};

    /// Numbers without an order to see.
    fn mixed(count: usize) -> Vec<u32> {
        (0..count as u32).map(|number| number.wrapping_mul(2_654_435_761) >> 20).collect()
    }

    /// Does work that pauses at every rest. Returns its result, the number of rests, and the most items counted between
    /// two of them.
    fn measured<T, W: Future<Output = T>>(work: impl FnOnce(Pace, Arc<AtomicUsize>) -> W) -> (T, usize, usize) {
        let [count, longest, rests] = [0; 3].map(|_| Arc::<AtomicUsize>::default());
        let pace = Pace::new({
            let (count, longest, rests) = (Arc::clone(&count), Arc::clone(&longest), Arc::clone(&rests));
            move || {
                longest.fetch_max(count.swap(0, Ordering::Relaxed), Ordering::Relaxed);
                rests.fetch_add(1, Ordering::Relaxed);
                true
            }
        });
        let result = at_once(work(pace.clone(), count.clone()));
        assert_eq!(pace.progress(), 1.0, "at the end");
        let longest = longest.load(Ordering::Relaxed).max(count.load(Ordering::Relaxed));
        (result, rests.load(Ordering::Relaxed), longest)
    }

    #[test]
    fn there_are_never_more_items_than_a_stretch_between_two_rests() {
        for items in [0, 1, STRETCH - 1, STRETCH, STRETCH + 1, 10 * STRETCH + 5] {
            let least = items.div_ceil(STRETCH);
            let tick = |count: &AtomicUsize| count.fetch_add(1, Ordering::Relaxed);
            let (sum, rests, longest) = measured(async |pace, count| {
                let mut sum = 0;
                let add = |item| {
                    tick(&count);
                    sum += item;
                };
                pace.each(items, add).await;
                sum
            });
            assert_eq!(sum, (0..items).sum::<usize>());
            assert!(rests >= least && longest <= STRETCH, "{items} items: {rests} rests, {longest} between");
            let item = |count: &AtomicUsize, item: usize| {
                tick(count);
                item
            };
            let (list, rests, longest) =
                measured(async |pace, count| pace.collect(items, |number| item(&count, number)).await);
            assert!(list.into_iter().eq(0..items) && rests >= least && longest <= STRETCH);
            let (sum, rests, longest) =
                measured(async |pace, count| pace.sum(items, |number| item(&count, number) as f64).await);
            assert!(sum == (0..items).sum::<usize>() as f64 && rests >= least && longest <= STRETCH);
            let (found, rests, longest) =
                measured(async |pace, count| pace.find(items, |number| item(&count, number) + 1 == items).await);
            assert!(found == items.checked_sub(1) && rests >= least && longest <= STRETCH);
        }
        let (found, ..) = measured(async |pace, _| pace.find(5000, |number| number > 7000).await);
        assert_eq!(found, None);
    }

    #[test]
    fn stretches_of_items_of_different_size_end_when_they_are_full() {
        let mut stretch = Stretch::default();
        let ends: Vec<bool> =
            [STRETCH / 2, STRETCH / 2 - 1, 1, 0, 5 * STRETCH].map(|size| stretch.ends_after(size)).into();
        assert_eq!(ends, [false, false, true, false, true]);
    }

    thread_local! {
        static COMPARISONS: Cell<usize> = const { Cell::new(0) };
    }

    /// A number that counts how often it is compared.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    struct Counted(u32);

    impl Ord for Counted {
        fn cmp(&self, other: &Self) -> Order {
            COMPARISONS.set(COMPARISONS.get() + 1);
            self.0.cmp(&other.0)
        }
    }

    impl PartialOrd for Counted {
        fn partial_cmp(&self, other: &Self) -> Option<Order> {
            Some(self.cmp(other))
        }
    }

    #[test]
    fn a_list_is_sorted_as_at_once_with_few_comparisons_between_two_rests() {
        const RUN: usize = 4 * STRETCH;
        for count in [0, 1, 2, RUN - 1, RUN, RUN + 1, 2 * RUN, 3 * RUN + 7, 9 * RUN - 1] {
            let mut expected = mixed(count);
            expected.sort_unstable();
            let longest = Arc::<AtomicUsize>::default();
            let pace = Pace::new({
                let longest = Arc::clone(&longest);
                move || {
                    longest.fetch_max(COMPARISONS.replace(0), Ordering::Relaxed);
                    true
                }
            });
            let mut list: Vec<Counted> = mixed(count).into_iter().map(Counted).collect();
            COMPARISONS.set(0);
            at_once(pace.sort(&mut list));
            assert!(list.iter().map(|counted| counted.0).eq(expected), "{count}");
            // A run is sorted without rests, by about n log₂ n comparisons.
            let most = 2 * RUN * RUN.ilog2() as usize;
            assert!(longest.load(Ordering::Relaxed) <= most, "{count}: {longest:?} comparisons");
            assert_eq!(pace.progress(), 1.0, "{count}");
        }
    }

    #[test]
    fn parts_of_parts_end_exactly_where_the_whole_does() {
        let pace = Pace::new(|| false);
        for cut in [0.1, 0.3, 0.7, 1.0 / 3.0] {
            let inner = pace.part(cut..1.0).part(1.0 - cut..1.0).part(cut..1.0);
            assert_eq!(inner.part.to, 1.0, "cut at {cut}");
            at_once(inner.rest(1.0));
            assert_eq!(pace.progress(), 1.0);
        }
    }

    #[test]
    fn progress_never_falls_and_stays_within_its_part() {
        let pace = Pace::new(|| false);
        let part = pace.part(0.2..0.6);
        for (done, expected) in [(0.5, 0.4), (0.25, 0.4), (-3.0, 0.4), (f32::NAN, 0.4), (7.0, 0.6)] {
            at_once(part.rest(done));
            assert!((pace.progress() - expected).abs() < 1e-6, "{done}: {}", pace.progress());
        }
        assert_eq!(Pace::default().progress(), 0.0, "nobody watches");
    }

    #[test]
    fn a_pause_ends_when_the_work_is_polled_again() {
        let pace = Pace::new(|| true);
        let mut work = pin!(async {
            pace.rest(0.5).await;
            pace.rest(1.0).await;
        });
        let mut context = Context::from_waker(Waker::noop());
        let polls: Vec<bool> = (0..3).map(|_| work.as_mut().poll(&mut context).is_ready()).collect();
        assert_eq!(polls, [false, false, true]);
    }
}
