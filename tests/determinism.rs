//! The same seed grows the same vessels, bit for bit: in repeated runs, any portions, and on any number of threads.

mod common;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    mesh::TriangleMesh,
    organ::ColonSettings,
    preset::PresetName,
    roots::{RootPlacement, RootPlacements, Roots},
    tissue::{Ball, Disc, MeshSurface, Tissue},
    tree::hash_trees,
};
use common::{Case, tissues};
use std::{collections::BTreeMap, sync::Arc};

/// Many samples per step, so that threads share the work, and few steps.
fn settings() -> ColonizationSettings {
    ColonizationSettings { steps: 30, samples: 5000, ..ColonizationSettings::default() }
}

fn start(case: &Case, seed: u64) -> Colonization {
    Colonization::new(case.tissue.clone(), settings(), &case.roots, seed).expect("settings within limits")
}

/// All results of a growth, as one number and the normals' bits.
fn outcome(growth: &Colonization) -> (u64, Vec<u32>) {
    let channels = Colonization::KINDS.into_iter().flat_map(|kind| {
        let normals = growth.normals(kind).iter().flat_map(|normal| normal.to_array()).map(f32::to_bits);
        normals.chain(growth.birth_steps(kind).iter().copied()).collect::<Vec<_>>()
    });
    (hash(growth), channels.collect())
}

fn hash(growth: &Colonization) -> u64 {
    hash_trees(Colonization::KINDS.map(|kind| growth.tree(kind)))
}

fn grown(case: &Case, seed: u64) -> (u64, Vec<u32>) {
    let mut growth = start(case, seed);
    growth.run();
    let nodes = Colonization::KINDS.map(|kind| growth.tree(kind).len());
    assert!(nodes[0] > 100 && nodes[1] > 1, "{}: {nodes:?} are too few nodes to compare", case.name);
    outcome(&growth)
}

#[test]
fn a_growth_repeats_itself() {
    for case in tissues() {
        assert_eq!(grown(&case, 7), grown(&case, 7), "{}", case.name);
    }
}

#[test]
fn portions_of_steps_change_nothing() {
    for case in tissues() {
        let whole = grown(&case, 7);
        for portion in [1, 3, 7] {
            let mut growth = start(&case, 7);
            while !growth.is_finished() {
                // Between portions, all results are read, as in a frame.
                for _ in 0..portion {
                    growth.step();
                }
                for kind in Colonization::KINDS {
                    let _ = (growth.vessels(kind), growth.drains(kind).count());
                }
            }
            assert_eq!(outcome(&growth), whole, "{} in portions of {portion}", case.name);
        }
    }
}

/// A second thread that other work keeps busy for ever is not waited for.
#[cfg(feature = "parallel")]
#[test]
fn a_thread_that_never_comes_changes_nothing() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    for case in tissues() {
        let (free, wait) = std::sync::mpsc::channel::<()>();
        let (here, is_here) = std::sync::mpsc::channel();
        let case = &case;
        let blocked = pool.install(move || {
            rayon::spawn(move || {
                here.send(()).expect("somebody to hear");
                wait.recv().expect_err("nothing is sent");
            });
            is_here.recv().expect("the other thread takes the work");
            grown(case, 7)
        });
        drop(free);
        assert_eq!(blocked, grown(case, 7), "{}", case.name);
    }
}

#[test]
fn steps_after_the_last_change_nothing() {
    let case = &tissues()[0];
    let mut growth = start(case, 7);
    growth.run();
    let before = outcome(&growth);
    for _ in 0..5 {
        let report = growth.step();
        assert_eq!((report.step, report.sampled, report.born), (growth.settings().steps, 0, 0));
    }
    growth.run();
    assert_eq!(outcome(&growth), before);
}

#[cfg(feature = "parallel")]
#[test]
fn the_number_of_threads_changes_nothing() {
    for case in tissues() {
        let mut outcomes = BTreeMap::new();
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            outcomes.insert(threads, pool.install(|| grown(&case, 11)));
        }
        for (threads, outcome) in &outcomes {
            assert_eq!(outcome, &outcomes[&1], "{} on {threads} threads", case.name);
        }
    }
}

#[cfg(feature = "parallel")]
#[test]
fn growths_that_share_threads_change_nothing() {
    use rayon::prelude::*;
    for case in tissues().into_iter().take(2) {
        let alone: Vec<u64> = (0..4).map(|seed| grown(&case, seed).0).collect();
        for threads in [2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            // While one growth waits for its own work, its thread runs others.
            let together: Vec<u64> =
                pool.install(|| (0..40).into_par_iter().map(|seed| grown(&case, seed % 4).0).collect());
            let expected = alone.iter().cycle().take(40);
            assert!(together.iter().eq(expected), "{} on {threads} threads", case.name);
        }
    }
}

#[test]
fn a_restart_leaves_no_trace_of_what_was() {
    for case in tissues() {
        let mut growth = start(&case, 3);
        growth.run();
        // A very different growth in between: other lengths, hence another grid, and other channels in use.
        let other = ColonizationSettings { steps: 8, ..settings().scaled(2.5) };
        let mut alone = case.roots.clone();
        alone.placed.vein = RootPlacement::None;
        growth.restart(other, &alone, 4).expect("settings within limits");
        growth.step();
        growth.restart(settings(), &case.roots, 7).expect("settings within limits");
        assert_eq!(growth.steps_done(), 0);
        growth.run();
        assert_eq!(outcome(&growth), grown(&case, 7), "{}", case.name);
    }
}

#[test]
fn a_restart_that_fails_changes_nothing() {
    let case = &tissues()[0];
    let mut growth = start(case, 7);
    (0..10).for_each(|_| _ = growth.step());
    let before = outcome(&growth);
    let bad = ColonizationSettings { steps: 0, ..settings() };
    assert!(growth.restart(bad, &case.roots, 1).is_err());
    assert_eq!((outcome(&growth), growth.steps_done()), (before, 10));
    growth.run();
    assert_eq!(outcome(&growth), grown(case, 7));
}

#[test]
fn seeds_differ() {
    for case in tissues() {
        let mut hashes: Vec<u64> = (0..12).map(|seed| grown(&case, seed).0).collect();
        // The highest bits of a seed count, too.
        hashes.extend([1 << 32, 1 << 63, u64::MAX].map(|seed| grown(&case, seed).0));
        let runs = hashes.len();
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), runs, "{}: two seeds grew the same", case.name);
    }
}

/// The results of the built-in presets in this version. A changed hash must be noted in the changelog, since the organs
/// of all seeds change with it.
#[test]
fn known_growths_come_out_as_ever() -> Result<(), Box<dyn std::error::Error>> {
    let colon = ColonSettings::default().generate()?;
    let outer = colon.mesh.part(colon.outer.clone());
    let outer = TriangleMesh::new(outer.positions, outer.triangles, None)?;
    let beside = |sites: &[Vec3]| RootPlacement::Nearest(sites.to_vec());
    let (artery, vein) = (beside(&colon.roots.arterial), beside(&colon.roots.venous));
    let colon_roots = Some(RootPlacements { artery, vein, ..RootPlacements::default() });
    let cases: [(PresetName, Arc<dyn Tissue>, _, u64); 4] = [
        (PresetName::ReferenceDisc, Arc::new(Disc::flat(0.5)?), None, 0x8eb0_b115_be09_6464),
        (PresetName::ReferenceBall, Arc::new(Ball::new(Vec3::ZERO, 0.5)?), None, 0x345e_e03e_8ef1_4a58),
        (PresetName::Paper, Arc::new(Disc::flat(0.5)?), None, 0xeb55_719c_9c4c_dea3),
        (PresetName::Colon, Arc::new(MeshSurface::new(outer)?), colon_roots, 0x66fb_4d7d_776d_1a1b),
    ];
    let mut changed = Vec::new();
    for (name, tissue, roots, expected) in cases {
        let preset = name.load();
        let generator = preset.generator_for(tissue.extent());
        let settings = generator.colonization().expect("presets colonize").clone();
        let roots = roots.map_or_else(|| preset.roots(), Roots::from);
        let mut growth = Colonization::new(tissue, settings, &roots, 0)?;
        growth.run();
        if hash(&growth) != expected {
            changed.push(format!("{name}: {:#018x}", hash(&growth)));
        }
    }
    assert!(changed.is_empty(), "{changed:?}");
    Ok(())
}
