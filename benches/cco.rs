//! The speed of constrained constructive optimisation, on one thread: per terminal in a disc and a ball, as OpenCCO was
//! measured (12.9 ms a terminal for 1000 in a ball), and of tens of thousands of terminals in real organs.
//!
//! `cargo bench --bench cco` runs everything up to 20,000 terminals; `-- large` runs 100,000 and 500,000 in a liver,
//! once each, and prints bytes a terminal. Organs are found as `CONTRIBUTING.md` says; without them they are left out.
//! Times on a shared machine vary: compare only lines of one run.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    cco::{Cco, CcoSettings},
    io::load_mesh,
    roots::{RootPlacement, RootPlacements},
    tissue::{Ball, Disc, Extent, MeshVolume, Tissue},
};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group};
use std::{path::Path, sync::Arc, time::Instant};

/// An organ's volume, in metres.
fn organ(name: &str) -> Option<Arc<dyn Tissue>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../shared/data/organs/{name}.glb"));
    let mesh = load_mesh(&path).inspect_err(|error| eprintln!("left out: {error}")).ok()?;
    Some(Arc::new(MeshVolume::new(&mesh, MeshVolume::DEFAULT_RESOLUTION).expect("a closed organ")))
}

/// Grows the arteries of an organ whose lengths are metres, without sweeps at the end.
fn grow(tissue: &Arc<dyn Tissue>, terminals: u32, root: RootPlacement) -> Cco {
    let perfusion = match tissue.extent() {
        Extent::Volume(volume) | Extent::Sheet { volume, .. } => volume * 1e9,
        Extent::Area(area) => area * 1e6,
        Extent::Length(_) => unreachable!("it has no inside"),
    };
    let settings = CcoSettings { terminals, perfusion, polish_sweeps: 0, ..CcoSettings::default() };
    let roots = RootPlacements { artery: root, vein: RootPlacement::None, ..RootPlacements::default() };
    let mut growth = Cco::new(Arc::clone(tissue), settings, &roots.into(), 1).expect("a growth");
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

/// Up to a million vessels: seconds, and bytes a terminal.
fn large() {
    let Some(tissue) = organ("liver_vhf") else { return };
    for terminals in [20_000, 100_000, 500_000] {
        let start = Instant::now();
        let growth = on_one_thread(|| grow(&tissue, terminals, RootPlacement::Spread(1)));
        let bytes = growth.bytes() as f64 / f64::from(terminals);
        println!("liver, {terminals} terminals: {:.1} s, {bytes:.0} bytes each", start.elapsed().as_secs_f64());
    }
}

criterion_group!(benches, shapes, organs);

fn main() {
    if std::env::args().any(|argument| argument == "large") {
        return large();
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
