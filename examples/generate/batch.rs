//! Organs on threads, reported in the order of their seeds.

use super::organ::{Grower, Outcome};
use super::{Failure, Job};
use bevy_vessels::synthesis::growth::StepCount;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread;

/// Parts of an organ that the progress bar shows.
const PARTS: u64 = 1000;
/// Most organs that wait for a slow reader.
const WAITING: usize = 64;

/// Grows organs 0 to `organs` − 1, with the seeds from `seed_of`, and passes each outcome to `report`, in order.
///
/// Up to `threads` threads work, or as many as the system allows. The first failure in order ends the batch; the organs
/// before it are reported. Once `stop` is set, organs that have no files yet fail.
pub fn grow_all(
    job: &Job,
    organs: u64,
    seed_of: impl Fn(u64) -> u64 + Sync,
    threads: usize,
    stop: &AtomicBool,
    mut report: impl FnMut(&Outcome) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let bar = progress_bar(organs.saturating_mul(PARTS));
    let workers = threads.min(usize::try_from(organs).unwrap_or(usize::MAX));
    let next = AtomicU64::new(0);
    // Grows the organs that nobody else does, until there are none or their receiver wants no more.
    let work = |hand_on: &mut dyn FnMut(u64, Result<Outcome, Failure>) -> bool| {
        let mut grower = Grower::new(job, stop);
        loop {
            let organ = next.fetch_add(1, Ordering::Relaxed);
            if organ >= organs || !hand_on(organ, grower.grow(seed_of(organ), show_progress(&bar))) {
                break;
            }
        }
    };
    let mut report = |outcome: Result<Outcome, Failure>| bar.suspend(|| report(&outcome?));
    let result = thread::scope(|scope| {
        // Bounded, so that workers never run far ahead of a slow or failed reader.
        let (sender, receiver) = mpsc::sync_channel(workers.min(WAITING));
        let start = |_: &usize| {
            let (sender, work) = (sender.clone(), &work);
            let worker = move || {
                with_threads(threads / workers, || work(&mut |organ, outcome| sender.send((organ, outcome)).is_ok()));
            };
            thread::Builder::new().spawn_scoped(scope, worker).is_ok()
        };
        let started = (0..workers).take_while(start).count();
        drop(sender);
        if started < workers {
            eprintln!("generate: warning: only {started} of {workers} threads can be started; they do all the work");
        }
        let result = match started {
            0 => grow_here(&work, &mut report),
            _ => in_order(receiver.iter(), &mut report),
        };
        next.store(organs, Ordering::Relaxed);
        result
    });
    bar.finish_and_clear();
    result
}

/// Grows all organs on this thread, since no other can be started.
fn grow_here(
    work: &impl Fn(&mut dyn FnMut(u64, Result<Outcome, Failure>) -> bool),
    report: &mut impl FnMut(Result<Outcome, Failure>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut result = Ok(());
    on_this_thread(|| {
        work(&mut |_, outcome| {
            result = report(outcome);
            result.is_ok()
        });
    });
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

/// Runs the work of one organ on so many threads, or on half as many, and so on, until the system allows them.
#[cfg(feature = "parallel")]
fn with_threads(threads: usize, work: impl FnOnce() + Send) {
    let many = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
    let halved = std::iter::successors(Some(threads), |threads| Some(threads / 2)).take_while(|&threads| threads > 1);
    match halved.filter_map(many).next() {
        Some(pool) => pool.install(work),
        None => on_this_thread(work),
    }
}

/// Runs the work of one organ on this thread, since it can use no other.
#[cfg(not(feature = "parallel"))]
fn with_threads(_threads: usize, work: impl FnOnce()) {
    on_this_thread(work);
}

/// Runs work on this thread alone, as a pool that starts no other.
fn on_this_thread(work: impl FnOnce()) {
    // Fails only on a thread of another pool, and that has what it needs.
    #[cfg(feature = "parallel")]
    let _pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
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
