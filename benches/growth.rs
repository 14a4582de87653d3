//! The speed of growth, and of the grid that indexes nodes compared with other indices.
//!
//! `cargo bench --bench growth` runs everything; a part of a name after `--` selects benchmarks, such as
//! `cargo bench --bench growth -- reference`. Times on a shared machine vary: compare only lines of one run.

use bevy_math::{Vec3, bounding::Aabb3d};
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings, SystemSettings},
    io::load_mesh,
    preset::PresetName,
    random::Stream,
    roots::{RootPlacement, Roots},
    space::point_grid::PointGrid,
    tissue::{Ball, Disc, MeshSurface, Tissue},
    tree::{VesselTree, statistics},
};
use criterion::{
    BatchSize, BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
    measurement::WallTime,
};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::{
    hint::black_box,
    num::NonZero,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

/// A growth to measure: a tissue, settings that fit it, and roots.
struct Case {
    tissue: Arc<dyn Tissue>,
    settings: ColonizationSettings,
    roots: Roots,
}

impl Case {
    fn new(tissue: Arc<dyn Tissue>, preset: PresetName) -> Self {
        let preset = preset.load();
        let generator = preset.generator_for(tissue.extent());
        let settings = generator.colonization().expect("presets colonize").clone();
        Self { tissue, settings, roots: preset.roots() }
    }

    fn disc(preset: PresetName) -> Self {
        Self::new(Arc::new(Disc::flat(0.5).expect("a disc of radius 0.5")), preset)
    }

    fn ball() -> Self {
        Self::new(Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball of radius 0.5")), PresetName::ReferenceBall)
    }

    /// Other numbers of samples and steps, and shorter lengths to match.
    fn sized(mut self, samples: u32, steps: u32, lengths: f32) -> Self {
        self.settings = ColonizationSettings { samples, steps, ..self.settings.scaled(lengths) };
        self
    }

    fn arteries_only(mut self) -> Self {
        self.roots.placed.vein = RootPlacement::None;
        self
    }

    fn growth(&self) -> Colonization {
        Colonization::new(Arc::clone(&self.tissue), self.settings.clone(), &self.roots, 1).expect("valid settings")
    }
}

fn nodes(growth: &Colonization) -> usize {
    Colonization::KINDS.map(|kind| growth.tree(kind).len()).iter().sum()
}

/// The cases on which the paper's own program was measured, each with and without a second thread.
fn reference(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("reference");
    for (name, case) in [
        ("disc, arteries and veins", Case::disc(PresetName::ReferenceDisc)),
        ("disc, arteries and veins, lengths x 0.75", Case::disc(PresetName::ReferenceDisc).sized(1000, 100, 0.75)),
        ("ball, arteries", Case::ball().arteries_only()),
        ("ball, arteries and veins", Case::ball()),
        ("paper's settings on the disc", Case::disc(PresetName::Paper)),
    ] {
        on_threads(&mut group, name, &case);
    }
    group.finish();
}

/// Fifty discs, as a batch grows them: growth alone, and with all statistics.
fn batch(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("batch");
    group.sample_size(10);
    let case = Case::disc(PresetName::ReferenceDisc);
    let mut growth = case.growth();
    let mut points = Vec::new();
    case.tissue.draw(&mut Stream::Statistics.rng(0), 20_000, &mut points);
    let mut grow = |seed: u64| {
        growth.restart(case.settings.clone(), &case.roots, seed).expect("valid settings");
        growth.run();
        Colonization::KINDS.map(|kind| growth.grown(kind).tree.clone())
    };
    let reach = 1.0 / 3.0 * SystemSettings::DEFAULT_NODE_BIRTH_DISTANCE;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    group.bench_function("50 discs", |bencher| {
        pool.install(|| bencher.iter(|| (0..50).map(|seed| grow(seed)[0].len()).sum::<usize>()));
    });
    group.bench_function("50 discs with statistics", |bencher| {
        let measure = |tree: &VesselTree| {
            let outside = statistics::outside(tree, |node| case.tissue.contains(node));
            black_box((tree.statistics(), statistics::coverage(tree, &points, reach), outside));
        };
        pool.install(|| bencher.iter(|| (0..50).for_each(|seed| grow(seed).iter().for_each(measure))));
    });
    group.finish();
}

/// Growth on one thread and on two, beside other work that keeps all processors but one busy. To see what two threads do
/// then, pin the benchmark to two processors, such as with `taskset --cpu-list 0,1`.
fn busy(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("busy");
    let stop = AtomicBool::new(false);
    let others = std::thread::available_parallelism().map_or(1, NonZero::get).saturating_sub(1).max(1);
    std::thread::scope(|scope| {
        for _ in 0..others {
            scope.spawn(|| {
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        for (name, case) in [
            ("disc, arteries and veins", Case::disc(PresetName::ReferenceDisc)),
            ("ball, arteries", Case::ball().arteries_only()),
            ("ball, arteries and veins", Case::ball()),
        ] {
            on_threads(&mut group, name, &case);
        }
        stop.store(true, Ordering::Relaxed);
    });
    group.finish();
}

/// Measures a growth on one thread and on two.
fn on_threads(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, case: &Case) {
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        group.bench_function(BenchmarkId::new(name, format!("{threads} threads")), |bencher| {
            pool.install(|| bencher.iter_batched_ref(|| case.growth(), Colonization::run, BatchSize::LargeInput));
        });
    }
}

/// The start of a growth up to its first step, with another seed on the same tissue each time.
fn start(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("start");
    group.sample_size(10);
    let organs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/organs");
    for (organ, preset) in [("colon_vhf.glb", PresetName::Colon), ("kidney_left_vhf.glb", PresetName::Kidney)] {
        let Ok(mesh) = load_mesh(&organs.join(organ)) else {
            println!("no {organ} in {}; its case is left out", organs.display());
            continue;
        };
        let surface = MeshSurface::new(mesh).expect("an organ of ordinary size");
        group.bench_function(BenchmarkId::new(organ, "first"), |bencher| {
            let fresh = || Case::new(Arc::new(MeshSurface::new(surface.mesh().clone()).expect("as before")), preset);
            bencher.iter_batched(fresh, |case| case.growth(), BatchSize::LargeInput);
        });
        let case = Case::new(Arc::new(surface), preset);
        group.bench_function(BenchmarkId::new(organ, "again, another seed"), |bencher| {
            let (mut growth, mut seed) = (case.growth(), 0);
            bencher.iter(|| {
                seed += 1;
                growth.restart(case.settings.clone(), &case.roots, seed).expect("valid settings");
            });
        });
    }
    group.finish();
}

/// From ten thousand nodes to a million, with samples and lengths to match: 20 samples per arterial node. The nodes per
/// second should stay constant.
fn scale(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("scale");
    group.sample_size(10);
    let ball = |samples: u32, lengths: f32| Case::ball().sized(samples, 300, lengths / 1.5);
    let mut cases = vec![
        ("ball, arteries, 10k", ball(640, 3.945).arteries_only()),
        ("ball, arteries, 100k", ball(6400, 1.83).arteries_only()),
        ("ball, 100k + 60k", ball(6400, 1.83)),
        ("ball, arteries, 1M", ball(64_000, 0.85).arteries_only()),
        ("ball, 1M + 0.6M", ball(64_000, 0.85)),
    ];
    let colon = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/organs/colon_vhf.glb");
    match load_mesh(&colon).map(MeshSurface::new) {
        Ok(Ok(colon)) => {
            let colon: Arc<dyn Tissue> = Arc::new(colon);
            let case = || Case::new(Arc::clone(&colon), PresetName::Colon);
            cases.push(("colon, 27k + 22k", case()));
            cases.push(("colon, 116k + 98k", case().sized(8000, 300, 0.42)));
        }
        _ => println!("no real colon at {}; its cases are left out", colon.display()),
    }
    for (name, case) in cases {
        let mut grown = case.growth();
        grown.run();
        group.throughput(Throughput::Elements(nodes(&grown) as u64));
        on_threads(&mut group, name, &case);
    }
    group.finish();
}

/// The queries of a growth on its nodes, with the grid, with kiddo and by brute force.
///
/// kiddo's tree is for a fixed point set. Growth adds points between queries, so that tree would have to be rebuilt,
/// and kiddo's mutable tree refuses points that share a coordinate.
fn index(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("index");
    for count in [1000, 10_000, 100_000] {
        let mut rng = Stream::Statistics.rng(1);
        let ball = Ball::new(Vec3::ZERO, 0.5).expect("a ball of radius 0.5");
        let (mut points, mut centers) = (Vec::new(), Vec::new());
        ball.draw(&mut rng, count, &mut points);
        ball.draw(&mut rng, 1000, &mut centers);
        let radius = (0.52 / count as f32).cbrt();
        let mut grid = PointGrid::new(&Aabb3d::new(Vec3::ZERO, Vec3::splat(0.5)), 1.25 * radius);
        points.iter().for_each(|&point| _ = grid.push(point));
        let coordinates: Vec<[f32; 3]> = points.iter().map(|point| point.to_array()).collect();
        let tree = ImmutableKdTree::<f32, 3>::new_from_slice(&coordinates).expect("points to build from");

        group.throughput(Throughput::Elements(centers.len() as u64));
        group.bench_function(BenchmarkId::new("grid, any within", count), |bencher| {
            bencher.iter(|| centers.iter().filter(|&&center| grid.any_within(black_box(center), radius)).count());
        });
        group.bench_function(BenchmarkId::new("grid, nearest within", count), |bencher| {
            bencher.iter(|| centers.iter().filter_map(|&center| grid.nearest_within(center, radius, |_| true)).count());
        });
        group.bench_function(BenchmarkId::new("kiddo, nearest", count), |bencher| {
            let nearest =
                |center: &Vec3| tree.query(&center.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
            bencher.iter(|| centers.iter().map(|center| nearest(black_box(center)).distance).sum::<f32>());
        });
        if count <= 10_000 {
            group.bench_function(BenchmarkId::new("all points, nearest", count), |bencher| {
                let nearest =
                    |center: &Vec3| points.iter().map(|p| p.distance_squared(*center)).fold(f32::MAX, f32::min);
                bencher.iter(|| centers.iter().map(|center| nearest(black_box(center))).sum::<f32>());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, reference, batch, busy, start, scale, index);
criterion_main!(benches);
