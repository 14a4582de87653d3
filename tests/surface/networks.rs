//! A thousand grown networks: all tissues, all presets of space colonization, many seeds, three widths.

use crate::common::tissues;
use crate::measures::{sound_surface, union_volume, volume, widened};
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
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

/// The published share of bifurcations without a defect is 83 % at best. Here, of nodes, it is above 99.9 %.
#[test]
fn hardly_a_face_of_a_grown_network_meets_another() {
    let (mut faces, mut meeting, mut sound, mut remade, mut left) = (0, 0, 0, 0, 0);
    for seed in 0..70 {
        for tree in grow(seed) {
            let Surface { mesh, report } = sound_surface(&format!("seed {seed}"), &tree, &SurfaceSettings::default());
            let check = mesh.validate();
            faces += mesh.triangle_count();
            meeting += check.intersecting_triangles();
            sound += u32::from(check.is_sound());
            remade += report.remade.len();
            left += report.left.len();
        }
    }
    println!(
        "{meeting} of {faces} triangles meet others; {sound} of 140 networks are sound; {remade} joints made again, {left} left"
    );
    assert!((meeting as f64) < 3e-4 * faces as f64, "{meeting} of {faces}");
    assert!(sound >= 130 && remade > 5 && left < 16, "{sound} are sound, {remade} joints made again, {left} left");
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
