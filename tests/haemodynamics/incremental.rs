//! A network that was changed is the same as one made anew.

use super::trees::{random_gap, random_tree, resisting, rng, settings, wound};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{Network, NetworkUpdate},
    tree::{NO_PARENT, NodeId, VesselTree},
    units::Pressure,
};
use rand::RngExt;

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
            // Along one path first, without the sweep.
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
