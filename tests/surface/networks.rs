//! A thousand grown networks: all tissues, all presets of space colonization, many seeds, three widths.

use crate::common::tissues;
use crate::measures::{meeting, sound_surface, union_volume, volume, widened};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    mesh::{TriangleIndex, TriangleMesh},
    preset::{Preset, PresetName},
    surface::{Surface, SurfaceSettings},
    tree::{VesselKind, VesselTree},
};
use std::thread;

/// Networks of arteries, and as many of veins.
const NETWORKS: u64 = 500;

fn grow(seed: u64) -> [VesselTree; 2] {
    let cases = tissues();
    let case = &cases[seed as usize % cases.len()];
    let presets = PresetName::ALL.map(PresetName::load);
    let presets: Vec<&Preset> = presets.iter().filter(|preset| preset.generator.colonization().is_some()).collect();
    let preset = presets[(seed as usize / cases.len()) % presets.len()];
    let generator = preset.generator_for(case.tissue.extent());
    let settings = generator.colonization().expect("presets colonize").clone();
    let settings =
        ColonizationSettings { steps: settings.steps.min(30), samples: settings.samples.min(300), ..settings };
    let mut growth = Colonization::new(case.tissue.clone(), settings, &case.roots, seed).expect(case.name);
    growth.run();
    [VesselKind::Artery, VesselKind::Vein].map(|kind| (*growth.tree(kind)).clone())
}

#[test]
fn a_thousand_networks_have_closed_surfaces() {
    let threads = thread::available_parallelism().map_or(1, usize::from) as u64;
    thread::scope(|scope| {
        for thread in 0..threads {
            scope.spawn(move || {
                for seed in (thread..NETWORKS).step_by(threads as usize) {
                    for (kind, tree) in ["artery", "vein"].into_iter().zip(grow(seed)) {
                        for factor in [1.0, 4.0, 8.0] {
                            let name = format!("{kind}, seed {seed}, {} nodes, × {factor}", tree.len());
                            sound_surface(&name, &widened(&tree, factor), &SurfaceSettings::default());
                        }
                    }
                }
            });
        }
    });
}

/// The published share of bifurcations without a defect is 83 % at best. Here none has one at the presets' radii, but for
/// vessels that run through each other; at radii so wide that joints lack room, hardly any.
#[test]
fn faces_of_grown_networks_do_not_meet() {
    let trees: Vec<VesselTree> = (0..70).flat_map(grow).collect();
    for (factor, most) in [(1.0, 0), (4.0, 5), (8.0, 50)] {
        let (mut faces, mut own, mut all, mut remade, mut left) = (0, 0, 0, 0, 0);
        for tree in &trees {
            let tree = widened(tree, factor);
            let Surface { mesh, report } = Surface::new(&tree, &SurfaceSettings::default()).expect("a surface");
            let [meeting, its] = meeting(&tree, &mesh);
            (all, own, faces) = (all + meeting, own + its, faces + mesh.triangle_count());
            (remade, left) = (remade + report.remade.len(), left + report.left.len());
        }
        println!(
            "radii × {factor}: of {faces} triangles {all} meet others, {own} of them where no segments run through each other; {remade} joints made again, {left} left"
        );
        assert!(own * 100_000 <= most * faces, "× {factor}: {own} of {faces}");
    }
}

#[test]
fn volumes_of_grown_networks_are_those_of_their_round_cones() {
    for seed in 0..14 {
        for tree in grow(seed).into_iter().filter(|tree| tree.len() > 10) {
            let mesh = Surface::new(&tree, &SurfaceSettings::default()).expect("a surface").mesh;
            let ratio = volume(&mesh) / union_volume(&tree, 100_000);
            assert!((ratio - 1.0).abs() < 0.05, "seed {seed}, {} nodes: {ratio}", tree.len());
        }
    }
}

/// Widths across the vessels, from wall to wall: away from joints, tips and other vessels, 98 of 100 are within 3 %.
#[test]
fn vessels_are_as_wide_as_their_radii() {
    let settings = SurfaceSettings { most_sides: 16, least_sides: 16, ..SurfaceSettings::default() };
    // A polygon with the area of a circle has corners outside of it.
    let chord = std::f32::consts::TAU / 32.0;
    let corner = (chord / chord.sin()).sqrt();
    for seed in [0, 5, 8, 16, 23, 40] {
        let [tree, _] = grow(seed);
        let mesh = Surface::new(&tree, &settings).expect("a surface").mesh;
        let triangles: Vec<[u32; 3]> = mesh.closed_triangles().collect();
        let walls = TriangleMesh::new(mesh.positions.clone(), triangles, None).expect("a mesh");
        let walls = TriangleIndex::new(&walls);
        let mut children = vec![0; tree.len()];
        tree.segments().for_each(|(_, parent)| children[parent] += 1);
        let widest_at = |node: usize| {
            let parent = tree.parents()[node] as usize;
            tree.radii()[node].max(tree.radii().get(parent).copied().unwrap_or(0.0))
        };
        let others: Vec<usize> = (0..tree.len()).filter(|&node| children[node] != 1).collect();
        let is_away =
            |point: Vec3| others.iter().all(|&node| tree.positions()[node].distance(point) > 4.0 * widest_at(node));
        let mut widths: Vec<f32> = (0..mesh.unique())
            .step_by(7)
            .filter(|&vertex| is_away(mesh.positions[vertex]))
            .filter_map(|vertex| {
                let (point, normal, radius) = (mesh.positions[vertex], mesh.normals[vertex], mesh.radii[vertex]);
                let wall = walls.first_hit(point - normal * (0.2 * radius), point - normal * (4.0 * radius))?;
                Some(wall.position.distance(point) / (2.0 * corner * radius))
            })
            .collect();
        widths.sort_by(f32::total_cmp);
        let (count, off) = (widths.len(), widths.iter().filter(|width| (**width - 1.0).abs() > 0.03).count());
        println!("seed {seed}: {count} widths, median {}, {off} off by more than 3 %", widths[count / 2]);
        assert!(count > 1000 && (widths[count / 2] - 1.0).abs() < 0.01, "seed {seed}: {}", widths[count / 2]);
        assert!(off * 50 < count, "seed {seed}: {off} of {count} widths are off by more than 3 %");
    }
}

/// An organ is 0.2 m, 1 or 200 mm long, wherever it lies.
#[test]
fn the_unit_and_the_place_of_an_organ_change_nothing() {
    let [tree, _] = grow(5);
    let settings = SurfaceSettings::default();
    let one = Surface::new(&tree, &settings).expect("a surface");
    // Powers of two scale without rounding; others move the nodes by some of their last digits.
    for (scale, tolerance) in [(0.125, 0.0), (256.0, 0.0), (0.2, 0.05), (200.0, 0.05)] {
        let positions = tree.positions().iter().map(|position| *position * scale).collect();
        let radii = tree.radii().iter().map(|radius| radius * scale).collect();
        let scaled = VesselTree::from_arrays(positions, tree.parents().to_vec(), radii).expect("a tree");
        let other = Surface::new(&scaled, &settings).expect("a surface");
        assert_eq!((&other.report, &other.mesh.faces), (&one.report, &one.mesh.faces), "× {scale}");
        for ((a, b), radius) in one.mesh.positions.iter().zip(&other.mesh.positions).zip(&one.mesh.radii) {
            let off = (*a * scale).distance(*b) / scale;
            assert!(off <= tolerance * radius, "× {scale}: {a} became {b}");
        }
    }
}

#[test]
fn the_place_and_the_number_of_threads_change_nothing() {
    let [tree, _] = grow(3);
    let settings = SurfaceSettings::default();
    let one = rayon_pool(1, || Surface::new(&tree, &settings).expect("a surface"));
    for threads in [2, 5] {
        assert!(rayon_pool(threads, || Surface::new(&tree, &settings).expect("a surface")) == one, "{threads} threads");
    }
}

fn rayon_pool<T: Send>(threads: usize, act: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(act)
}
