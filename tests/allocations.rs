//! A warm step allocates nothing: a restarted growth already has all the memory that it needs.

use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    preset::PresetName,
    roots::Roots,
    tissue::{Ball, Disc, Tissue},
    tree::VesselKind,
};
use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
    error::Error,
    sync::Arc,
};

thread_local! {
    /// Allocations of this thread.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes on to the system's allocator unchanged.
#[expect(unsafe_code, reason = "an allocator cannot be written otherwise")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { Heap.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { Heap.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn assert_warm(
    tissue: Arc<dyn Tissue>,
    settings: ColonizationSettings,
    roots: &Roots,
    seed: u64,
) -> Result<(), Box<dyn Error>> {
    let mut growth = Colonization::new(tissue, settings.clone(), roots, seed)?;
    growth.run();
    let nodes = growth.tree(VesselKind::Artery).len();
    growth.restart(settings, roots, seed)?;
    while !growth.is_finished() {
        let before = COUNT.with(Cell::get);
        let step = growth.step().step;
        assert_eq!(COUNT.with(Cell::get) - before, 0, "step {step} allocated");
    }
    assert_eq!(growth.tree(VesselKind::Artery).len(), nodes);
    Ok(())
}

#[test]
fn steps_of_a_growth_that_is_started_again_allocate_nothing() -> Result<(), Box<dyn Error>> {
    // One thread, since sharing work with others allocates outside the growth.
    let disc: Arc<dyn Tissue> = Arc::new(Disc::flat(0.5)?);
    let ball: Arc<dyn Tissue> = Arc::new(Ball::new(Default::default(), 0.5)?);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        for (tissue, preset, samples) in [
            (Arc::clone(&disc), PresetName::ReferenceDisc, 1000),
            (disc, PresetName::Paper, 20_000),
            (ball, PresetName::ReferenceBall, 1000),
        ] {
            let preset = preset.load();
            let settings = preset.generator.colonization().expect("presets colonize").clone();
            let settings = ColonizationSettings { samples, ..settings };
            assert_warm(tissue, settings, &preset.roots(), 3).map_err(|error| error.to_string())?;
        }
        Ok::<(), String>(())
    })
    .map_err(Into::into)
}
