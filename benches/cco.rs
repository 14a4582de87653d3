//! The speed of constrained constructive optimisation, on one thread: per terminal in a disc and a ball, as OpenCCO was
//! measured (12.9 ms a terminal for 1000 in a ball), and of tens of thousands of terminals in real organs.
//!
//! `cargo bench --bench cco` runs everything up to 20,000 terminals; `-- large` grows 20,000, 100,000 and 500,000 in a
//! liver, once each, and prints CPU seconds, the longest step and the most bytes at a time. A number after `large` is
//! the most terminals to grow. Organs are found as `CONTRIBUTING.md` says; without them they are left out.
//! Times on a shared machine vary: compare only lines of one run.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings},
    io::load_mesh,
    roots::{RootPlacement, RootPlacements},
    tissue::{Ball, Disc, Extent, MeshVolume, Tissue},
};
use cpu_time::ProcessTime;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group};
use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

/// Bytes in use, and the most of them so far.
static BYTES: AtomicUsize = AtomicUsize::new(0);
static MOST_BYTES: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: every call goes on to the system's allocator unchanged.
#[expect(unsafe_code, reason = "an allocator cannot be written otherwise")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let bytes = BYTES.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST_BYTES.fetch_max(bytes, Ordering::Relaxed);
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        BYTES.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { Heap.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// An organ's volume, in metres.
fn organ(name: &str) -> Option<Arc<dyn Tissue>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../shared/data/organs/{name}.glb"));
    let mesh = load_mesh(&path).inspect_err(|error| eprintln!("left out: {error}")).ok()?;
    Some(Arc::new(MeshVolume::new(&mesh, MeshVolume::DEFAULT_RESOLUTION).expect("a closed organ")))
}

/// Prepares the arteries of an organ whose lengths are metres, without sweeps at the end.
fn start(tissue: &Arc<dyn Tissue>, terminals: u32, root: RootPlacement) -> Cco {
    let perfusion = match tissue.extent() {
        Extent::Volume(volume) | Extent::Sheet { volume, .. } => volume * 1e9,
        Extent::Area(area) => area * 1e6,
        Extent::Length(_) => unreachable!("it has no inside"),
    };
    let settings = CcoSettings { terminals, perfusion, polish_sweeps: 0, ..CcoSettings::default() };
    let roots = RootPlacements { artery: root, vein: RootPlacement::None, ..RootPlacements::default() };
    Cco::new(Arc::clone(tissue), settings, &roots.into(), 1).expect("a growth")
}

/// Grows them.
fn grow(tissue: &Arc<dyn Tissue>, terminals: u32, root: RootPlacement) -> Cco {
    let mut growth = start(tissue, terminals, root);
    growth.run().expect("room for all terminals");
    growth
}

fn on_one_thread<R: Send>(act: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("threads").install(act)
}

/// The sizes on which OpenCCO was measured.
fn shapes(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("shapes");
    group.sample_size(10);
    let disc: Arc<dyn Tissue> = Arc::new(Disc::flat(0.08).expect("a disc"));
    let ball: Arc<dyn Tissue> = Arc::new(Ball::new(Vec3::ZERO, 0.03).expect("a ball"));
    for (name, tissue, root) in [("disc", disc, Vec3::Y * 0.08), ("ball", ball, Vec3::Y * 0.03)] {
        for terminals in [250, 1000, 4000] {
            group.throughput(Throughput::Elements(terminals.into()));
            group.bench_function(BenchmarkId::new(name, terminals), |bencher| {
                on_one_thread(|| bencher.iter(|| grow(&tissue, terminals, RootPlacement::Nearest(vec![root]))));
            });
        }
    }
    group.finish();
}

/// Real organs.
fn organs(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("organs");
    group.sample_size(10);
    for name in ["liver_vhf", "colon_vhf"] {
        let Some(tissue) = organ(name) else { continue };
        group.throughput(Throughput::Elements(20_000));
        group.bench_function(BenchmarkId::new(name, 20_000), |bencher| {
            on_one_thread(|| bencher.iter(|| grow(&tissue, 20_000, RootPlacement::Spread(1))));
        });
    }
    group.finish();
}

/// Up to a million vessels: CPU seconds, the longest step, and bytes.
fn large(most_terminals: u32) {
    let Some(tissue) = organ("liver_vhf") else { return };
    for terminals in [20_000, 100_000, 500_000].into_iter().filter(|&terminals| terminals <= most_terminals) {
        let before = BYTES.load(Ordering::Relaxed);
        MOST_BYTES.store(before, Ordering::Relaxed);
        let begun = ProcessTime::now();
        let mut longest = Duration::ZERO;
        let growth = on_one_thread(|| {
            let mut growth = start(&tissue, terminals, RootPlacement::Spread(1));
            while !growth.is_finished() {
                let step = ProcessTime::now();
                growth.advance();
                longest = longest.max(step.elapsed());
            }
            growth.settle();
            growth
        });
        let (seconds, longest) = (begun.elapsed().as_secs_f64(), 1e3 * longest.as_secs_f64());
        let most = MOST_BYTES.load(Ordering::Relaxed) - before;
        let each = [most, growth.bytes()].map(|bytes| bytes as f64 / f64::from(terminals));
        println!(
            "liver, {terminals} terminals: {seconds:.2} CPU s, longest step {longest:.2} CPU ms, at most {:.1} MB \
             ({:.0} bytes a terminal, {:.0} of them the growth's), {} overlaps",
            most as f64 / 1e6,
            each[0],
            each[1],
            growth.overlaps()
        );
    }
}

criterion_group!(benches, shapes, organs);

fn main() {
    let mut arguments = std::env::args().skip_while(|argument| argument != "large").skip(1);
    if std::env::args().any(|argument| argument == "large") {
        return large(arguments.find_map(|most| most.parse().ok()).unwrap_or(u32::MAX));
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
