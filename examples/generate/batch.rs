//! Organs on threads, reported in the order of their seeds.

use super::organ::Grower;
use super::report::Line;
use super::{Failure, Job};
use bevy_vessels::synthesis::growth::StepCount;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;

/// Parts of an organ that the progress bar shows.
const PARTS: u64 = 1000;

/// Grows organs 0 to `organs` − 1, with the seeds from `seed_of`, and passes each line to `report`, in order.
///
/// Up to `threads` threads work. The first failure in order ends the batch; the organs before it are reported.
pub fn grow_all(
    job: &Job,
    organs: u64,
    seed_of: impl Fn(u64) -> u64 + Sync,
    threads: usize,
    mut report: impl FnMut(&Line) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let bar = progress_bar(organs.saturating_mul(PARTS));
    let workers = threads.min(usize::try_from(organs).unwrap_or(usize::MAX));
    let next = AtomicU64::new(0);
    let result = std::thread::scope(|scope| {
        // Bounded, so that workers never run far ahead of a slow or failed reader.
        let (sender, receiver) = mpsc::sync_channel(workers);
        for _ in 0..workers {
            let (sender, next, seed_of, bar) = (sender.clone(), &next, &seed_of, &bar);
            scope.spawn(move || {
                with_threads(threads / workers, || {
                    let mut grower = Grower::new(job);
                    loop {
                        let organ = next.fetch_add(1, Ordering::Relaxed);
                        if organ >= organs {
                            break;
                        }
                        let line = grower.grow(seed_of(organ), show_progress(bar));
                        // The receiver is gone once the batch has failed.
                        if sender.send((organ, line)).is_err() {
                            break;
                        }
                    }
                });
            });
        }
        drop(sender);
        let result = in_order(receiver.iter(), |line| bar.suspend(|| report(&line?)));
        next.store(organs, Ordering::Relaxed);
        result
    });
    bar.finish_and_clear();
    result
}

/// Passes on items that arrive with the numbers 0, 1, 2 … in any order, in the order of the numbers, until one fails.
fn in_order<T>(
    arriving: impl Iterator<Item = (u64, T)>,
    mut hand_on: impl FnMut(T) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut waiting = BTreeMap::new();
    let mut due = 0;
    for (number, item) in arriving {
        waiting.insert(number, item);
        while let Some(item) = waiting.remove(&due) {
            hand_on(item)?;
            due += 1;
        }
    }
    Ok(())
}

/// Runs the work of one organ on so many threads.
#[cfg(feature = "parallel")]
fn with_threads(threads: usize, work: impl FnOnce() + Send) {
    match rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).build() {
        Ok(pool) => pool.install(work),
        // No more threads are available; the organs are the same on this one.
        Err(_) => work(),
    }
}

/// Runs the work of one organ on this thread, since it can use no other.
#[cfg(not(feature = "parallel"))]
fn with_threads(_threads: usize, work: impl FnOnce()) {
    work();
}

/// Advances the bar by the share of one organ's steps that is done.
fn show_progress(bar: &ProgressBar) -> impl FnMut(StepCount) {
    let mut shown = 0;
    move |steps| {
        let now = PARTS * u64::from(steps.done) / u64::from(steps.all.max(1));
        bar.inc(now - shown);
        shown = now;
    }
}

/// A bar on standard error, drawn only if that is a terminal.
fn progress_bar(parts: u64) -> ProgressBar {
    let bar = ProgressBar::new(parts);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} % {elapsed} + {eta} left") {
        bar.set_style(style);
    }
    bar
}
