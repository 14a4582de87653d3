//! Vessels baked into textures, in CPU time: the vessels of a procedural colon, many segments on a square, and the
//! unwrapping of a mesh.

use bevy_math::{Vec2, Vec3};
use bevy_vessels::synthesis::{
    colonization::Colonization,
    mesh::TriangleMesh,
    organ::{Colon, ColonSettings},
    preset::PresetName,
    texture::{Bake, BakeSettings, Canvas, Layer, VesselLook},
    tissue::{MeshSurface, Tissue},
    tree::{NO_PARENT, VesselKind, VesselTree},
};
use cpu_time::ProcessTime;
use criterion::{Criterion, criterion_group, criterion_main};
use std::{sync::Arc, time::Duration};

/// The lining of a colon with its vessels.
fn lining(colon: &Colon) -> [VesselTree; 2] {
    let mesh = colon.mesh.part(colon.inner.clone()).triangle_mesh().expect("a mesh");
    let tissue: Arc<dyn Tissue> = Arc::new(MeshSurface::new(mesh).expect("a surface"));
    let preset = PresetName::Colon.load();
    let settings = preset.generator_for(tissue.extent()).colonization().expect("space colonization").clone();
    let mut growth = Colonization::new(tissue, settings, &preset.roots(), 1).expect("a growth");
    growth.run();
    [VesselKind::Vein, VesselKind::Artery].map(|kind| growth.vessels(kind))
}

/// Short segments, spread over the unit square.
fn scattered(segments: u32) -> VesselTree {
    let (mut positions, mut parents) = (Vec::new(), Vec::new());
    for segment in 0..segments {
        // The additive recurrence of the plastic number: no two are near.
        let share = |ratio: f64| ((f64::from(segment) * ratio) % 1.0) as f32;
        let at = Vec3::new(share(0.754_877_666_246_693), share(0.569_840_290_998_053), 0.0);
        let turn = Vec2::from_angle(segment as f32) * 0.004;
        positions.extend([at, at + turn.extend(0.0)]);
        parents.extend([NO_PARENT, 2 * segment]);
    }
    let radii = vec![0.0004; positions.len()];
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

fn cpu(repeats: u64, mut act: impl FnMut()) -> Duration {
    let start = ProcessTime::now();
    (0..repeats).for_each(|_| act());
    start.elapsed()
}

fn bake(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("texture");
    group.sample_size(10);
    let colon = ColonSettings::default().generate().expect("a colon");
    let [veins, arteries] = lining(&colon);
    let layers = [(&veins, VesselKind::Vein), (&arteries, VesselKind::Artery)]
        .map(|(tree, kind)| Layer { tree, look: VesselLook::of(kind) });
    group.bench_function("albedo and normal of the colon's lining, 2048", |bencher| {
        bencher.iter_custom(|repeats| {
            cpu(repeats, || {
                let canvas = Canvas::of_shaded(&colon.mesh).expect("a canvas");
                Bake::new(&canvas, &layers, None, &BakeSettings::default()).expect("a bake");
            })
        });
    });
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    let uvs = corners.iter().map(|corner| corner.truncate()).collect();
    let square = TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]], Some(uvs)).expect("a mesh");
    let (canvas, tree) = (Canvas::of_mesh(&square).expect("a canvas"), scattered(100_000));
    let layers = [Layer { tree: &tree, look: VesselLook::default() }];
    let settings = BakeSettings { size: 4096, ..BakeSettings::default() };
    group.bench_function("100,000 segments, 4096", |bencher| {
        bencher.iter_custom(|repeats| {
            cpu(repeats, || drop(Bake::new(&canvas, &layers, None, &settings).expect("a bake")))
        });
    });
    let mesh = ColonSettings { triangles: 60_000, ..ColonSettings::default() }.generate().expect("a colon").mesh;
    let mesh = TriangleMesh::new(mesh.positions, mesh.triangles, None).expect("a mesh");
    group.bench_function("unwrapping of 60,000 triangles", |bencher| {
        bencher.iter_custom(|repeats| cpu(repeats, || drop(Canvas::unwrapped(&mesh, None, 2048).expect("a canvas"))));
    });
    group.finish();
}

criterion_group!(benches, bake);
criterion_main!(benches);
