//! The speed of closed meshes: of the networks on which other programs were measured, of networks of 10,000 to a million
//! nodes, of their check for faces that meet, and of meshes that follow their moved nodes.
//!
//! `cargo bench --bench surface` runs everything but the million; a part of a name after `--` selects benchmarks, such
//! as `cargo bench --bench surface -- reference`. Times on a shared machine vary: compare only lines of one run.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    binding::Skin,
    colonization::{Colonization, ColonizationSettings},
    preset::PresetName,
    roots::RootPlacement,
    surface::{Surface, SurfaceSettings},
    tissue::{Ball, Disc, Tissue},
    tree::{VesselKind, VesselTree},
};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::{hint::black_box, sync::Arc};

/// Arteries of a preset with seed 1; with other numbers of samples and steps, and shorter lengths to match, if given.
fn arteries(tissue: Arc<dyn Tissue>, preset: PresetName, sized: Option<(u32, u32, f32)>) -> VesselTree {
    let preset = preset.load();
    let generator = preset.generator_for(tissue.extent());
    let mut settings = generator.colonization().expect("presets colonize").clone();
    let mut roots = preset.roots();
    if let Some((samples, steps, lengths)) = sized {
        settings = ColonizationSettings { samples, steps, ..settings.scaled(lengths) };
        roots.placed.vein = RootPlacement::None;
    }
    let mut growth = Colonization::new(tissue, settings, &roots, 1).expect("valid settings");
    growth.run();
    (*growth.tree(VesselKind::Artery)).clone()
}

fn disc() -> VesselTree {
    arteries(Arc::new(Disc::flat(0.5).expect("a disc")), PresetName::ReferenceDisc, None)
}

fn ball(sized: Option<(u32, u32, f32)>) -> VesselTree {
    arteries(Arc::new(Ball::new(Vec3::ZERO, 0.5).expect("a ball")), PresetName::ReferenceBall, sized)
}

fn measure(group: &mut criterion::BenchmarkGroup<'_, criterion::measurement::WallTime>, name: &str, tree: &VesselTree) {
    let settings = SurfaceSettings::default();
    let triangles = Surface::new(tree, &settings).expect("a surface").mesh.triangle_count();
    group.throughput(Throughput::Elements(triangles as u64));
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("threads");
    group.bench_function(BenchmarkId::new(name, format!("{} nodes", tree.len())), |bencher| {
        threads.install(|| bencher.iter_with_large_drop(|| Surface::new(black_box(tree), &settings)));
    });
}

/// The cases on which other programs were measured, with one subdivision, on one thread.
fn reference(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("reference");
    measure(&mut group, "disc, arteries", &disc());
    measure(&mut group, "ball, arteries", &ball(None));
    group.finish();
}

/// From ten thousand nodes to a hundred thousand: the triangles per second should stay constant.
fn scale(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("scale");
    group.sample_size(10);
    measure(&mut group, "ball", &ball(Some((640, 300, 3.945 / 1.5))));
    measure(&mut group, "ball", &ball(Some((6_400, 300, 1.83 / 1.5))));
    group.finish();
}

/// The exact check of a surface.
fn check(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("check");
    group.sample_size(10);
    let mesh = Surface::new(&disc(), &SurfaceSettings::default()).expect("a surface").mesh;
    group.throughput(Throughput::Elements(mesh.triangle_count() as u64));
    group.bench_function("disc, arteries", |bencher| bencher.iter(|| black_box(&mesh).validate()));
    group.finish();
}

/// A surface that follows its moved nodes, on one thread: 100,000 vertices should take far less than a frame.
fn follow(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("follow");
    let tree = disc();
    let settings = SurfaceSettings { level: 2, ..SurfaceSettings::default() };
    let mesh = Surface::new(&tree, &settings).expect("a surface").mesh;
    let mut skin = Skin::new(&mesh, &tree).expect("its own");
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("threads");
    group.throughput(Throughput::Elements(mesh.positions.len() as u64));
    group.bench_function("disc, arteries", |bencher| {
        threads.install(|| bencher.iter(|| skin.follow(black_box(tree.positions())).map(<[_]>::len)));
    });
    group.finish();
}

criterion_group!(benches, reference, scale, check, follow);
criterion_main!(benches);
