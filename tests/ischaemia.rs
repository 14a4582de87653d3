//! Supply of segments and of tissue, against trees whose flows are known.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{FlowSettings, Interruption, Network, Supply, TissueSupply, ViscosityLaw},
    tree::{NO_PARENT, NodeId, VesselTree},
    units::Pressure,
};

/// A root at the origin, a stem to node 1, and two equal branches, along x to nodes 2 and 3 and along y to 4 and 5.
fn fork() -> VesselTree {
    let positions = vec![Vec3::ZERO, Vec3::Z, Vec3::X, Vec3::X * 2.0, Vec3::Y, Vec3::Y * 2.0];
    VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 2, 1, 4], vec![0.5, 0.5, 0.1, 0.1, 0.1, 0.1])
        .expect("a well-formed tree")
}

fn network(tree: &VesselTree, settings: FlowSettings) -> Network {
    let settings = FlowSettings { viscosity: ViscosityLaw::WHOLE_BLOOD, ..settings };
    Network::new(tree, settings).expect("valid settings")
}

/// Supply after laying a gap over one segment.
fn supply(tree: &VesselTree, settings: FlowSettings, node: u32, gap: Interruption) -> Supply {
    let mut network = network(tree, settings);
    let mut supply = Supply::new(tree, &network).expect("flow that converges");
    network.set_interruption(NodeId(node), Some(gap)).expect("a valid gap");
    network.solve().expect("flow that converges");
    supply.update(tree, &network);
    supply
}

#[test]
fn an_intact_tree_supplies_everything() {
    let tree = fork();
    for settings in [FlowSettings::arterial(), FlowSettings::venous()] {
        let mut network = network(&tree, settings);
        network.solve().unwrap();
        let mut supply = Supply::new(&tree, &network).unwrap();
        supply.update(&tree, &network);
        assert!(supply.segments().iter().all(|&s| (s - 1.0).abs() < 1e-6), "{:?}", supply.segments());
        assert_eq!(supply.ischaemic_share(&tree, 0.5), 0.0);
    }
}

#[test]
fn what_lies_behind_a_clamp_has_none_and_the_stem_a_half() {
    let tree = fork();
    for settings in [FlowSettings::arterial(), FlowSettings::venous()] {
        let supply = supply(&tree, settings, 2, Interruption::clamp(0.5));
        let s = supply.segments();
        assert_eq!((s[2], s[3]), (0.0, 0.0), "{s:?}");
        assert_eq!(supply.ischaemic_share(&tree, 0.5), 0.5);
        // The other branch takes the stem's spare flow, and its supply is capped at 1.
        assert!((s[4] - 1.0).abs() < 1e-6 && (s[5] - 1.0).abs() < 1e-6, "{s:?}");
        assert!((s[1] - 0.5).abs() < 0.01, "{s:?}");
    }
}

#[test]
fn a_terminal_that_bleeds_back_supplies_nothing() {
    let supply = supply(&fork(), FlowSettings::arterial(), 3, Interruption::cut(0.5, 0.1));
    assert_eq!((supply.segments()[2], supply.segments()[3]), (0.0, 0.0), "{:?}", supply.segments());
}

#[test]
fn an_open_artery_steals_from_its_neighbours() {
    let tree = fork();
    let steals =
        supply(&tree, FlowSettings::arterial(), 1, Interruption { distal: None, ..Interruption::cut(1.0, 0.5) });
    assert!(steals.segments()[1] == 0.0);
    let mut wide = fork().radii().to_vec();
    wide[2] = 0.5;
    let tree = VesselTree::from_arrays(tree.positions().to_vec(), tree.parents().to_vec(), wide).unwrap();
    let cut = supply(&tree, FlowSettings::arterial(), 2, Interruption::cut(0.5, 0.5));
    assert!(cut.segments()[5] < 0.99, "{:?}", cut.segments());
}

#[test]
fn falling_pressure_starves_all_alike() {
    let tree = fork();
    let mut network = network(&tree, FlowSettings::arterial());
    let mut supply = Supply::new(&tree, &network).unwrap();
    let bed = network.bed_pressure().mmhg();
    let root = network.root_pressure().mmhg();
    network.set_root_pressure(Pressure::from_mmhg(bed + 0.25 * (root - bed))).unwrap();
    network.solve().unwrap();
    supply.update(&tree, &network);
    assert!(supply.segments().iter().all(|&s| (s - 0.25).abs() < 1e-6), "{:?}", supply.segments());
    assert_eq!(supply.ischaemic_share(&tree, 0.5), 1.0);
}

#[test]
fn vertices_have_the_supply_of_the_terminals_next_to_them() {
    let tree = fork();
    let vertices = [Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::ZERO, Vec3::NAN];
    let mut tissue = TissueSupply::new(&tree, &vertices);
    assert_eq!(tissue.vertices(), [1.0; 4]);
    let supply = supply(&tree, FlowSettings::arterial(), 2, Interruption::clamp(0.5));
    tissue.update(supply.segments());
    let found = tissue.vertices();
    assert!(found[0] < 1e-3 && found[1] > 0.999 && (found[2] - 0.5).abs() < 1e-3 && found[3] == 1.0, "{found:?}");
    assert_eq!(tissue.ischaemic_share(0.25, None), 0.25);
    assert_eq!(tissue.ischaemic_share(0.25, Some(&[3.0, 1.0, 0.0, 0.0])), 0.75);
}

#[test]
fn weights_agree_with_brute_force() {
    // Terminals on a spiral, all from one root.
    let spiral = |i: u32| {
        let t = i as f32 * 0.37;
        Vec3::new(t.cos() * t, t.sin() * t, t)
    };
    let positions: Vec<Vec3> = (0..200).map(spiral).collect();
    let parents = (0..200u32).map(|i| if i == 0 { NO_PARENT } else { 0 }).collect();
    let tree = VesselTree::from_arrays(positions.clone(), parents, vec![0.1; 200]).unwrap();
    let segments: Vec<f32> = (0..200).map(|i| (i * 37 % 200) as f32 / 199.0).collect();
    let vertices: Vec<Vec3> = (0..500).map(|i| spiral(i) * 0.4 + Vec3::ONE).collect();
    let mut tissue = TissueSupply::new(&tree, &vertices);
    tissue.update(&segments);
    for (vertex, &found) in vertices.iter().zip(tissue.vertices()) {
        let mut near: Vec<(f32, usize)> = (1..200).map(|i| (positions[i].distance_squared(*vertex), i)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let weights: Vec<f64> = near[..4].iter().map(|&(d, _)| 1.0 / f64::from(d + 1e-6 * near[3].0)).collect();
        let sum: f64 = weights.iter().zip(&near).map(|(w, &(_, i))| w * f64::from(segments[i])).sum();
        let expected = sum / weights.iter().sum::<f64>();
        assert!((f64::from(found) - expected).abs() < 1e-4, "{vertex}: {found}, not {expected}");
    }
}

#[test]
fn trees_without_terminals_starve_no_one() {
    let root = VesselTree::from_arrays(vec![Vec3::ZERO], vec![NO_PARENT], vec![1.0]).unwrap();
    for tree in [VesselTree::new(), root] {
        let mut network = network(&tree, FlowSettings::arterial());
        network.solve().unwrap();
        let mut supply = Supply::new(&tree, &network).unwrap();
        supply.update(&tree, &network);
        let mut tissue = TissueSupply::new(&tree, &[Vec3::ONE]);
        tissue.update(supply.segments());
        assert_eq!((tissue.vertices(), supply.ischaemic_share(&tree, 0.5)), (&[1.0_f32][..], 0.0));
    }
    assert_eq!(TissueSupply::new(&fork(), &[]).ischaemic_share(0.5, None), 0.0);
}
