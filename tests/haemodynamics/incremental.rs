//! A changed network equals a new one.

use super::trees::{random_gap, random_tree, resisting, rng, settings, wound};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{FlowError, Interruption, Network, NetworkUpdate},
    tree::{NO_PARENT, NodeId, VesselTree},
    units::Pressure,
};
use rand::RngExt;
use std::collections::BTreeSet;

/// The same tree and wounds in a new network.
fn anew(tree: &VesselTree, network: &Network) -> Network {
    let mut new = Network::new(tree, network.settings().clone()).expect("valid numbers");
    new.set_root_pressure(network.root_pressure()).expect("valid numbers");
    for (node, gap) in network.interruptions() {
        new.set_interruption(node, Some(gap)).expect("valid numbers");
    }
    for (index, end) in network.open_ends().iter().enumerate() {
        new.set_opening(index, end.opening).expect("valid numbers");
    }
    new.solve().expect("flow that converges");
    new
}

fn assert_same(network: &Network, expected: &Network, what: &str) {
    let largest = expected.flows().iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    for node in 0..expected.len() {
        let (found, flow) = (network.flows()[node], expected.flows()[node]);
        assert!((found - flow).abs() <= 1e-9 * largest, "{what}, node {node}: flow {found}, not {flow}");
        let (found, pressure) = (network.pressures()[node], expected.pressures()[node]);
        assert!((found - pressure).abs() <= 1e-4, "{what}, node {node}: {found} Pa, not {pressure}");
    }
    assert_eq!(network.open_ends().len(), expected.open_ends().len());
    for (found, end) in network.open_ends().iter().zip(expected.open_ends()) {
        assert!(
            (found.flow().ml_per_min() - end.flow().ml_per_min()).abs() <= 1e-7 * end.flow().ml_per_min(),
            "{what}: {found:?}, not {end:?}"
        );
    }
}

#[test]
fn changes_of_all_kinds_lead_to_the_full_solution() {
    for seed in 0..40 {
        let mut rng = rng(seed);
        let tree = random_tree(&mut rng, 400);
        let settings = if seed % 2 == 0 { settings() } else { resisting(1.0) };
        let mut network = Network::new(&tree, settings).unwrap();
        network.solve().unwrap();
        for round in 0..40 {
            let node = NodeId(rng.random_range(0..tree.len() as u32));
            match rng.random_range(0..5) {
                0 => network.set_root_pressure(Pressure::from_mmhg(rng.random_range(0.0..150.0))).unwrap(),
                1 if !network.open_ends().is_empty() => {
                    let index = rng.random_range(0..network.open_ends().len());
                    network.set_opening(index, rng.random_range(0.0..=1.0)).unwrap();
                }
                2 if tree.parent(node).is_some() => network.set_interruption(node, None).unwrap(),
                _ if tree.parent(node).is_some() => network.set_interruption(node, Some(random_gap(&mut rng))).unwrap(),
                _ => {}
            }
            let what = format!("seed {seed}, round {round}");
            // First along one path, without the sweep.
            let pressure = network.pressure_at(node).unwrap().pascals();
            let expected = anew(&tree, &network);
            assert!((pressure - expected.pressures()[node.index()]).abs() < 1e-4, "{what}: {pressure} Pa");
            network.solve().unwrap();
            assert_same(&network, &expected, &what);
        }
    }
}

#[test]
fn a_clamp_and_its_release_leave_no_trace() {
    for seed in 0..20 {
        let mut rng = rng(seed);
        let tree = random_tree(&mut rng, 300);
        let mut network = Network::new(&tree, settings()).unwrap();
        network.solve().unwrap();
        let (flows, pressures) = (network.flows().to_vec(), network.pressures().to_vec());
        wound(&mut rng, &mut network, &tree, 30);
        network.solve().unwrap();
        assert_ne!(network.flows(), flows);
        network.set_interruptions(&[]).unwrap();
        network.solve().unwrap();
        // Bit for bit.
        assert_eq!(network.flows(), flows, "seed {seed}");
        assert_eq!(network.pressures(), pressures, "seed {seed}");
    }
}

/// Gaps at random segments, each once, in the order of the nodes.
fn random_gaps(rng: &mut rand_chacha::ChaCha8Rng, tree: &VesselTree, count: usize) -> Vec<(NodeId, Interruption)> {
    let nodes: BTreeSet<u32> = (0..count).map(|_| rng.random_range(0..tree.len() as u32)).collect();
    let nodes = nodes.into_iter().map(NodeId).filter(|&node| tree.parent(node).is_some());
    nodes.map(|node| (node, random_gap(rng))).collect()
}

#[test]
fn many_gaps_at_once_are_the_same_as_one_by_one() {
    for seed in 0..30 {
        let mut rng = rng(seed);
        // Large enough that few gaps are summed along their paths, but many in one sweep.
        let tree = random_tree(&mut rng, 6_000);
        let settings = if seed % 2 == 0 { settings() } else { resisting(1.0) };
        let mut at_once = Network::new(&tree, settings).expect("valid numbers");
        at_once.solve().expect("flow that converges");
        let mut one_by_one = at_once.clone();
        for count in [25, 40, 900, 30, 0, 700] {
            let mut gaps = random_gaps(&mut rng, &tree, count);
            // Some stay as they are, and keep their openings.
            gaps.extend(at_once.interruptions().filter(|(node, _)| node.0 % 3 == 0));
            gaps.sort_by_key(|&(node, _)| node);
            gaps.dedup_by_key(|&mut (node, _)| node);
            at_once.set_interruptions(&gaps).expect("gaps");
            for node in tree.segments().map(|(node, _)| NodeId(node as u32)) {
                let gap = gaps.binary_search_by_key(&node, |&(node, _)| node).ok().map(|at| gaps[at].1);
                one_by_one.set_interruption(node, gap).expect("a gap");
            }
            let what = format!("seed {seed}, {} gaps", gaps.len());
            assert!(at_once.interruptions().eq(gaps.iter().copied()), "{what}");
            for network in [&mut at_once, &mut one_by_one] {
                let ends = network.open_ends().len();
                (0..ends).step_by(5).for_each(|end| network.set_opening(end, 0.5).expect("a share"));
                network.solve().expect("flow that converges");
            }
            // Bit for bit.
            assert_eq!(at_once.open_ends(), one_by_one.open_ends(), "{what}");
            assert_eq!(at_once.flows(), one_by_one.flows(), "{what}");
            assert_eq!(at_once.pressures(), one_by_one.pressures(), "{what}");
        }
    }
}

#[test]
fn a_faulty_list_of_gaps_changes_nothing() {
    let mut rng = rng(5);
    let tree = random_tree(&mut rng, 200);
    let mut network = Network::new(&tree, settings()).expect("valid numbers");
    let gaps = random_gaps(&mut rng, &tree, 40);
    network.set_interruptions(&gaps).expect("gaps");
    let mut unordered = gaps.clone();
    unordered.swap(3, 7);
    let fault = network.set_interruptions(&unordered);
    assert!(matches!(fault, Err(FlowError::InterruptionsUnordered { .. })), "{fault:?}");
    let mut backwards = gaps.clone();
    (backwards[9].1.first, backwards[9].1.last) = (0.9, 0.1);
    assert!(matches!(network.set_interruptions(&backwards), Err(FlowError::InterruptionBackwards { .. })));
    assert!(network.interruptions().eq(gaps));
}

#[test]
fn a_network_grows_with_its_tree() {
    for seed in 0..20 {
        let mut rng = rng(seed);
        let whole = random_tree(&mut rng, 300);
        let part = |nodes: usize, rng: &mut rand_chacha::ChaCha8Rng, change: f64| {
            let mut factor = |by: f32| if rng.random_bool(change) { by } else { 1.0 };
            let radii = whole.radii()[..nodes].iter().map(|&r| r * factor(1.25)).collect();
            let positions = whole.positions()[..nodes].iter().map(|&p| p * factor(1.1)).collect();
            VesselTree::from_arrays(positions, whole.parents()[..nodes].to_vec(), radii).unwrap()
        };
        let mut network = Network::new(&part(50, &mut rng, 0.0), resisting(1.0)).unwrap();
        let mut before = 50;
        for nodes in [50, 51, 120, 300] {
            let tree = part(nodes, &mut rng, 0.1);
            let update = network.update(&tree).unwrap();
            assert_eq!((update.appended, update.replaced), (nodes - before, false), "seed {seed}");
            before = nodes;
            wound(&mut rng, &mut network, &tree, 3);
            network.solve().unwrap();
            assert_same(&network, &anew(&tree, &network), &format!("seed {seed}, {nodes} nodes"));
            assert_eq!(network.update(&tree).unwrap(), NetworkUpdate::default(), "nothing changed");
        }
        let another = VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![1.0; 2]).unwrap();
        assert!(network.update(&another).unwrap().replaced);
        network.solve().unwrap();
        assert_same(&network, &anew(&another, &network), "another tree");
    }
}
