//! Jobs in all modes: equal results, progress, an end by dropping, and panics that stop nothing else.

use crate::plugin::job::{
    slices::{JobSlices, advance_slices},
    *,
};
use bevy::ecs::{
    system::{RunSystemOnce, SystemState},
    world::World,
};
use std::{
    sync::{Mutex, PoisonError, atomic::AtomicUsize},
    thread,
    time::{Duration, Instant},
};

/// Items of the work in these tests, and of a stretch of it.
const ITEMS: usize = 100;
const STRETCH: usize = 10;
/// All modes: at once, in the task pool, and in the shortest slices.
const AT_ONCE: JobSettings = JobSettings { mode: JobMode::Auto, at_once: usize::MAX, slice_time: Duration::ZERO };
const TASK_POOL: JobSettings = JobSettings { mode: JobMode::TaskPool, at_once: 0, slice_time: Duration::ZERO };
const SLICES: JobSettings = JobSettings { mode: JobMode::Slices, ..TASK_POOL };
const PLACES: [JobSettings; 3] = [AT_ONCE, TASK_POOL, SLICES];

/// A world with what jobs need.
fn world(settings: JobSettings) -> World {
    let mut world = World::new();
    world.insert_resource(settings);
    world.init_resource::<JobSlices>();
    world
}

fn start<T, W>(world: &mut World, items: usize, work: impl FnOnce(Pace) -> W) -> Option<Job<T>>
where
    T: Send + 'static,
    W: Future<Output = T> + Send + 'static,
{
    let mut jobs = SystemState::<Jobs>::new(world);
    Some(jobs.get(world).expect("jobs have their resources").start(items, work))
}

fn frame(world: &mut World) {
    world.run_system_once(advance_slices).expect("slices have their resources");
}

/// Runs frames until something holds.
#[track_caller]
fn frames_until(world: &mut World, what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited in vain: {what}");
        frame(world);
        thread::yield_now();
    }
}

#[track_caller]
fn result<T: Send + 'static>(world: &mut World, mut job: Option<Job<T>>) -> Outcome<T> {
    let mut found = None;
    frames_until(world, "a result", || {
        found = Job::poll(&mut job);
        found.is_some()
    });
    assert!(job.is_none(), "a job that gave its result is gone");
    found.expect("it was waited for")
}

/// Work that adds up numbers, and counts how many it has added.
async fn sum(count: Arc<AtomicUsize>, pace: Pace) -> usize {
    let mut sum = 0;
    let add = |stretch: std::ops::Range<usize>| {
        count.fetch_add(stretch.len(), Ordering::SeqCst);
        sum += stretch.sum::<usize>();
    };
    pace.stretches(ITEMS, STRETCH, add).await;
    sum
}

/// Work that never ends.
async fn endless(count: Arc<AtomicUsize>, pace: Pace) {
    loop {
        count.fetch_add(1, Ordering::SeqCst);
        pace.rest(0.5).await;
    }
}

#[test]
fn results_are_the_same_wherever_they_are_made() {
    for settings in PLACES {
        let mut world = world(settings);
        let job = start(&mut world, ITEMS, |pace| sum(Arc::default(), pace));
        assert_eq!(result(&mut world, job), Ok(ITEMS * (ITEMS - 1) / 2), "{settings:?}");
    }
}

#[test]
fn an_error_is_a_result_like_any_other() {
    for settings in PLACES {
        let mut world = world(settings);
        let job = start(&mut world, ITEMS, async |_: Pace| Err::<(), _>("no area"));
        assert_eq!(result(&mut world, job), Ok(Err("no area")), "{settings:?}");
    }
}

#[test]
fn little_work_is_done_when_it_has_begun_and_more_waits_for_frames() {
    for mode in [JobMode::Auto, JobMode::TaskPool, JobMode::Slices] {
        let mut world = world(JobSettings { mode, at_once: ITEMS, ..SLICES });
        let mut job = start(&mut world, ITEMS, |pace| sum(Arc::default(), pace));
        assert_eq!(job.as_ref().map(|job| (job.is_done(), job.progress())), Some((true, 1.0)));
        assert!(Job::poll(&mut job).is_some() && job.is_none());
        assert!(Job::poll(&mut job).is_none(), "there is one result");
    }
    let mut world = world(JobSettings { at_once: ITEMS, ..SLICES });
    let count = Arc::<AtomicUsize>::default();
    let job = start(&mut world, ITEMS + 1, |pace| sum(Arc::clone(&count), pace));
    assert_eq!((count.load(Ordering::SeqCst), job.as_ref().map(Job::is_done)), (0, Some(false)));
    assert!(result(&mut world, job).is_ok());
}

#[test]
fn nothing_is_done_at_once_where_no_item_may_be() {
    let mut world = world(SLICES);
    let job = start(&mut world, 0, |pace| sum(Arc::default(), pace));
    assert_eq!(job.as_ref().map(Job::is_done), Some(false));
    assert!(result(&mut world, job).is_ok());
}

#[test]
fn auto_means_the_task_pool_where_there_are_threads() {
    assert_eq!(JobMode::Auto.is_sliced(), cfg!(target_arch = "wasm32"));
    assert!(JobMode::Slices.is_sliced() && !JobMode::TaskPool.is_sliced());
}

#[test]
fn a_slice_without_time_is_one_stretch_and_progress_rises_with_each() {
    let mut world = world(SLICES);
    let count = Arc::<AtomicUsize>::default();
    let mut job = start(&mut world, ITEMS, |pace| sum(Arc::clone(&count), pace));
    for done in (STRETCH..=ITEMS).step_by(STRETCH) {
        assert_eq!(job.as_ref().map(Job::is_done), Some(false));
        frame(&mut world);
        assert_eq!(count.load(Ordering::SeqCst), done, "a stretch a frame");
        assert_eq!(job.as_ref().map(Job::progress), Some(done as f32 / ITEMS as f32));
        assert!(Job::poll(&mut job).is_none());
    }
    frame(&mut world);
    assert_eq!(job.as_ref().map(|job| (job.is_done(), job.progress())), Some((true, 1.0)));
    assert!(Job::poll(&mut job).is_some());
}

#[test]
fn progress_never_falls_and_ends_at_one() {
    for settings in PLACES {
        let mut world = world(settings);
        let job = start(&mut world, ITEMS, |pace| sum(Arc::default(), pace)).expect("a job");
        let mut last = 0.0;
        frames_until(&mut world, "an end", || {
            let progress = job.progress();
            assert!((last..=1.0).contains(&progress), "{progress} after {last}, {settings:?}");
            last = progress;
            job.is_done()
        });
        assert_eq!(job.progress(), 1.0);
    }
}

#[test]
fn all_is_done_in_one_frame_that_has_the_time() {
    let mut world = world(JobSettings { slice_time: Duration::MAX, ..SLICES });
    let jobs = [0; 5].map(|_| start(&mut world, ITEMS, |pace| sum(Arc::default(), pace)).expect("a job"));
    frame(&mut world);
    assert!(jobs.iter().all(Job::is_done));
}

#[test]
fn jobs_in_slices_take_turns() {
    let mut world = world(SLICES);
    let counts = [0; 3].map(|_| Arc::<AtomicUsize>::default());
    let jobs = counts.each_ref().map(|count| start(&mut world, ITEMS, |pace| sum(Arc::clone(count), pace)));
    for _ in 0..ITEMS / STRETCH {
        jobs.iter().for_each(|_| frame(&mut world));
        let [first, others @ ..] = counts.each_ref().map(|count| count.load(Ordering::SeqCst));
        assert_eq!(others, [first; 2], "each had one turn");
    }
}

#[test]
fn letting_go_of_a_job_stops_its_work_and_drops_what_it_holds() {
    for settings in [TASK_POOL, SLICES] {
        let mut world = world(settings);
        let count = Arc::<AtomicUsize>::default();
        let job = start(&mut world, ITEMS, |pace| endless(Arc::clone(&count), pace));
        let other = start(&mut world, ITEMS, |pace| sum(Arc::default(), pace));
        frames_until(&mut world, "its work", || count.load(Ordering::SeqCst) > 3);
        drop(job);
        frames_until(&mut world, "its end", || Arc::strong_count(&count) == 1);
        let done = count.load(Ordering::SeqCst);
        (0..3).for_each(|_| frame(&mut world));
        assert_eq!(count.load(Ordering::SeqCst), done, "{settings:?}");
        assert!(result(&mut world, other).is_ok(), "others go on");
    }
}

#[test]
fn a_job_that_nobody_waits_for_never_begins_in_slices() {
    let mut world = world(SLICES);
    let count = Arc::<AtomicUsize>::default();
    drop(start(&mut world, ITEMS, |pace| sum(Arc::clone(&count), pace)));
    frame(&mut world);
    assert_eq!((count.load(Ordering::SeqCst), Arc::strong_count(&count)), (0, 1));
}

/// A silent panic hook would affect all tests, so these panics are printed.
#[test]
fn a_panic_is_a_result_too_and_stops_nothing_else() {
    for settings in PLACES {
        let mut world = world(settings);
        let held = Arc::new(());
        let what = Arc::clone(&held);
        let job = start(&mut world, ITEMS, async move |pace: Pace| {
            pace.rest(0.5).await;
            assert!(Arc::strong_count(&what) == 0, "vertex {} of 7", 9);
        });
        let other = start(&mut world, ITEMS, |pace| sum(Arc::default(), pace));
        let panic = result(&mut world, job).expect_err("it panicked");
        assert_eq!(panic.message, "vertex 9 of 7", "{settings:?}");
        assert!(panic.to_string().contains("vertex 9 of 7") && panic.to_string().contains("report"), "{panic}");
        frames_until(&mut world, "its memory", || Arc::strong_count(&held) == 1);
        assert!(result(&mut world, other).is_ok(), "others go on");
    }
}

#[test]
fn panics_without_a_text_have_none() {
    assert_eq!(JobPanic::new(&7).message, "no message");
    assert_eq!(JobPanic::new(&"a word").message, "a word");
}

#[test]
fn where_a_job_is_done_is_settled_when_it_begins() {
    let mut world = world(SLICES);
    let thread = thread::current().id();
    let places = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&places);
    let job = start(&mut world, ITEMS, async move |_: Pace| {
        seen.lock().unwrap_or_else(PoisonError::into_inner).push(thread::current().id());
    });
    world.insert_resource(AT_ONCE);
    assert!(result(&mut world, job).is_ok());
    assert_eq!(*places.lock().unwrap_or_else(PoisonError::into_inner), [thread]);
}
