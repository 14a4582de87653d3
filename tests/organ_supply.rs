//! Vessels supply real organs as a whole: with the defaults or an organ preset, no part is left without vessels.
//!
//! The organs are stored beside the checkout, as `CONTRIBUTING.md` says; without them these tests are skipped.

#![cfg(all(feature = "mesh_files", feature = "serialize"))]

#[path = "common/shared.rs"]
mod shared;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::Colonization,
    io::{SwcReadOptions, load_mesh, load_swc},
    preset::PresetName,
    random::Stream,
    tissue::{SourceData, Tissue, TissueMode},
    tree::{VesselKind, statistics},
};
use std::sync::Arc;

const SEEDS: u64 = 3;
const SAMPLES: usize = 20_000;
/// Octants with fewer samples are ignored.
const LEAST_SAMPLES: usize = 100;

/// Samples of the tissue, by the octant of its box in which they lie.
fn octants(tissue: &dyn Tissue) -> Vec<Vec<Vec3>> {
    let mut rng = Stream::Statistics.rng(1);
    let bounds = tissue.bounds();
    let middle = Vec3::from(bounds.min + bounds.max) * 0.5;
    let mut octants = vec![Vec::new(); 8];
    for sample in (0..SAMPLES).filter_map(|_| tissue.sample(&mut rng)) {
        let side = sample.cmpgt(middle).bitmask();
        octants[side as usize].push(sample);
    }
    octants.retain(|samples| samples.len() >= LEAST_SAMPLES);
    octants
}

/// Share of the least supplied octant within two final birth distances of a node.
fn worst(growth: &Colonization, octants: &[Vec<Vec3>], kind: VesselKind) -> f32 {
    let reach =
        2.0 * growth.settings().system(kind).expect("it is grown").node_birth_distance * growth.length_scale(kind);
    let shares = octants.iter().filter_map(|samples| statistics::coverage(growth.tree(kind), samples, reach));
    shares.fold(1.0, f32::min)
}

/// Grows organs with several seeds. In the worst octant arteries and veins must supply at least these shares.
fn check(organs: &[&str], preset: PresetName, mode: TissueMode, least: [f32; 2]) {
    for name in organs {
        let Some(path) = shared::folder(&format!("data/organs/{name}.glb")) else { continue };
        let mesh = load_mesh(&path).unwrap_or_else(|error| panic!("{error}"));
        let mut preset = preset.load();
        preset.tissue = mode.into();
        let data = SourceData { mesh: Some(Arc::new(mesh)), ..SourceData::default() };
        let prepared = preset.tissue.prepare(&data).unwrap_or_else(|error| panic!("{name}: {error}"));
        let tissue = prepared.tissue();
        let generator = preset.generator_for(tissue.extent());
        let settings = generator.colonization().expect("presets colonize");
        let octants = octants(tissue.at_step(settings.steps));
        for seed in 0..SEEDS {
            let mut growth = Colonization::new(Arc::clone(tissue), settings.clone(), &preset.roots(), seed)
                .unwrap_or_else(|error| panic!("{name}: {error}"));
            growth.run();
            let shares = Colonization::KINDS.map(|kind| worst(&growth, &octants, kind));
            println!("{name}, {mode:?}, seed {seed}: {:.2} and {:.2} in the worst octant", shares[0], shares[1]);
            assert!(
                shares[0] >= least[0] && shares[1] >= least[1],
                "{name}, {mode:?}, seed {seed}: only {shares:?} of the worst octant is supplied"
            );
        }
    }
}

#[test]
fn the_colon_preset_supplies_guts() {
    let guts = ["colon_vhf", "colon_vhm", "small_intestine_vhf"];
    check(&guts, PresetName::Colon, TissueMode::Surface, [0.9, 0.85]);
}

#[test]
fn the_kidney_preset_supplies_the_kidney() {
    check(&["kidney_left_vhf"], PresetName::Kidney, TissueMode::Volume, [0.85, 0.75]);
}

/// The trunk enters the kidney where the same body's renal artery does: within a fifth of the kidney's length, since the
/// artery's segments end in the sinus.
#[test]
fn the_kidneys_trunk_enters_at_the_hilum() {
    let Some(kidney) = shared::folder("data/organs/kidney_left_vhf.glb") else { return };
    let Some(artery) = shared::folder("data/vessels/kidney_left_renal_artery_vhf.swc") else { return };
    let real = load_swc(artery, &SwcReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let mesh = Arc::new(load_mesh(&kidney).unwrap_or_else(|error| panic!("{error}")));
    for mode in [TissueMode::Surface, TissueMode::Volume] {
        let mut preset = PresetName::Kidney.load();
        preset.tissue = mode.into();
        let data = SourceData { mesh: Some(Arc::clone(&mesh)), ..SourceData::default() };
        let prepared = preset.tissue.prepare(&data).unwrap_or_else(|error| panic!("{error}"));
        let tissue = prepared.tissue();
        let spacing = preset.generator_for(tissue.extent()).root_spacing(tissue.extent());
        for seed in 0..8 {
            let roots = preset.roots().resolve(&**tissue, &spacing, seed).unwrap_or_else(|error| panic!("{error}"));
            // The kidney is in metres, the artery in millimetres.
            let root = 1e3 * roots.artery[0].position;
            let away = real.positions().iter().map(|at| at.distance(root)).fold(f32::INFINITY, f32::min);
            assert!(away < 26.0, "{mode:?}, seed {seed}: {root} is {away} mm from the renal artery");
        }
    }
}

#[test]
fn the_liver_preset_supplies_solid_organs() {
    check(&["liver_vhf", "spleen_vhf_uv"], PresetName::Liver, TissueMode::Volume, [0.85, 0.75]);
    check(&["liver_vhf"], PresetName::Liver, TissueMode::Staged { surface_steps: 100 }, [0.7, 0.6]);
}

#[test]
fn the_eyes_presets_supply_the_eyeball() {
    check(&["eyeball_mh"], PresetName::Conjunctiva, TissueMode::Surface, [0.9, 0.8]);
    check(&["eyeball_mh"], PresetName::Retina, TissueMode::Surface, [0.9, 0.8]);
}

#[test]
fn the_defaults_supply_every_surface() {
    let compact = ["bladder_vhf", "eyeball_mh", "heart_vhf", "kidney_left_vhf", "liver_vhf", "spleen_vhf_uv"];
    check(&compact, PresetName::Paper, TissueMode::Surface, [0.9, 0.8]);
    check(&["colon_vhf", "colon_vhm"], PresetName::Paper, TissueMode::Surface, [0.9, 0.8]);
    // Not the small intestine: the paper's lengths, fitted to its whole surface, exceed the width of its loops.
}

#[test]
fn the_defaults_supply_every_volume() {
    let solid = ["bladder_vhf", "eyeball_mh", "kidney_left_vhf", "liver_vhf", "spleen_vhf_uv"];
    check(&solid, PresetName::Paper, TissueMode::Volume, [0.7, 0.6]);
    // Parts of these are narrower than the lengths, which are fitted to the whole.
    check(&["heart_vhf", "colon_vhf", "colon_vhm"], PresetName::Paper, TissueMode::Volume, [0.4, 0.35]);
}
