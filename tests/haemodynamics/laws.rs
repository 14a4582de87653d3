//! Laws that every solution keeps.

use super::trees::{random_tree, resisting, rng, settings, tube, wound};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{EndSide, FlowError, FlowSettings, Interruption, Network, Outlet, RootPressure, ViscosityLaw},
    tree::{NO_PARENT, NodeId, VesselTree},
    units::{Pressure, Scale, Viscosity},
};
use std::f64::consts::PI;

fn solved(tree: &VesselTree, settings: FlowSettings) -> Network {
    let mut network = Network::new(tree, settings).expect("valid numbers");
    network.solve().expect("flow that converges");
    network
}

#[test]
fn a_straight_tube_obeys_poiseuille() {
    let (length, radius) = (40.0_f32, 0.8_f32);
    let tree = tube(16, length, radius);
    let network = solved(&tree, settings());
    let (l, r) = (f64::from(length) * 1e-3, f64::from(radius) * 1e-3);
    let drop = Pressure::from_mmhg(80.0).pascals();
    let expected = drop * PI * r.powi(4) / (8.0 * 3.6e-3 * l);
    for node in 0..tree.len() {
        assert!((network.flows()[node] / expected - 1.0).abs() < 1e-12, "node {node}: {}", network.flows()[node]);
        let along = node as f64 / 16.0;
        let pressure = Pressure::from_mmhg(100.0 - 80.0 * along).pascals();
        assert!((network.pressures()[node] - pressure).abs() < 1e-9 * drop, "node {node}");
    }
    let velocity = expected / (PI * r * r);
    assert!((network.velocity(3) / velocity - 1.0).abs() < 1e-12);
    // The force on the wall carries the whole drop of pressure.
    let shear = drop * r / (2.0 * l);
    assert!((network.wall_shear_stress(3) / shear - 1.0).abs() < 1e-12);
    assert!((network.inflow().cubic_metres_per_second() / expected - 1.0).abs() < 1e-12);
}

#[test]
fn flow_falls_with_the_fourth_power_of_the_radius() {
    let flow = |radius| solved(&tube(3, 10.0, radius), settings()).flows()[1];
    for radius in [0.01_f32, 0.1, 1.0, 10.0] {
        let ratio = flow(2.0 * radius) / flow(radius);
        assert!((ratio - 16.0).abs() < 1e-5, "radius {radius}: {ratio}");
    }
}

/// A binary tree of equal segments in each generation.
fn symmetric(generations: u32) -> VesselTree {
    let (mut positions, mut parents, mut radii) = (vec![Vec3::ZERO], vec![NO_PARENT], vec![1.0]);
    let mut row = vec![0u32];
    for generation in 0..generations {
        let mut next = Vec::new();
        for &parent in &row {
            for side in [-1.0_f32, 1.0].into_iter().take(if generation == 0 { 1 } else { 2 }) {
                next.push(positions.len() as u32);
                positions.push(positions[parent as usize] + Vec3::new(0.6 * side, 0.8, 0.0));
                parents.push(parent);
                radii.push(2.0_f32.powi(-(generation as i32)));
            }
        }
        row = next;
    }
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

#[test]
fn a_symmetric_tree_halves_its_flow_at_every_split() {
    let tree = symmetric(9);
    let network = solved(&tree, settings());
    let depths = tree.depths();
    // One segment, then 2, 4, ...: each generation has 16 times the resistance and twice the segments of the last.
    let unit = 8.0 * 3.6e-3 * 1e-3 / (PI * 1e-12);
    let total: f64 = (0..9).map(|generation| unit * 8.0_f64.powi(generation)).sum();
    let inflow = Pressure::from_mmhg(80.0).pascals() / total;
    for (node, &depth) in depths.iter().enumerate().skip(1) {
        let expected = inflow / 2.0_f64.powi(depth as i32 - 1);
        assert!((network.flows()[node] / expected - 1.0).abs() < 1e-6, "node {node}: {}", network.flows()[node]);
    }
}

/// Largest imbalance of a node, over the largest flow.
fn imbalance(network: &Network, tree: &VesselTree) -> f64 {
    let mut left: Vec<f64> = network.flows().to_vec();
    for (node, parent) in tree.segments() {
        left[parent] -= network.flows()[node];
        if network.interruption(NodeId(node as u32)).is_some() {
            // The flow that enters an interrupted segment does not arrive at its node.
            left[node] -= network.flows()[node];
        }
    }
    for end in network.open_ends().iter().filter(|end| end.side == EndSide::Distal) {
        left[end.node.index()] -= end.flow().cubic_metres_per_second();
    }
    for (node, left) in left.iter_mut().enumerate() {
        *left -= network.bed_flow(node);
    }
    // A root's flow is the flow into its tree, so that a root balances, too.
    let largest = network.flows().iter().fold(1e-30, |a: f64, b| a.max(b.abs()));
    left.iter().fold(0.0, |a: f64, b| a.max(b.abs())) / largest
}

#[test]
fn as_much_leaves_every_node_as_arrives() {
    for seed in 0..100 {
        let mut rng = rng(seed);
        let tree = random_tree(&mut rng, 300);
        for settings in [settings(), resisting(3.0)] {
            let mut network = solved(&tree, settings);
            assert!(imbalance(&network, &tree) < 1e-9, "seed {seed}: {}", imbalance(&network, &tree));
            wound(&mut rng, &mut network, &tree, 12);
            network.solve().unwrap();
            assert!(imbalance(&network, &tree) < 1e-9, "seed {seed}, cut: {}", imbalance(&network, &tree));
        }
    }
}

#[test]
fn flow_and_pressure_obey_poiseuille_in_every_segment() {
    for seed in 0..100 {
        let mut rng = rng(seed);
        let tree = random_tree(&mut rng, 300);
        let mut network = solved(&tree, resisting(0.5));
        wound(&mut rng, &mut network, &tree, 12);
        network.solve().unwrap();
        for (node, parent) in tree.segments() {
            if network.interruption(NodeId(node as u32)).is_none() {
                let drop = network.pressures()[parent] - network.pressures()[node];
                let expected = network.resistance(node) * network.flows()[node];
                assert!((drop - expected).abs() < 1e-6, "seed {seed}, node {node}: {drop} Pa, not {expected}");
            }
        }
    }
}

#[test]
fn every_open_end_obeys_the_orifice_law() {
    let mut open = 0;
    for seed in 0..100 {
        let mut rng = rng(seed);
        let tree = random_tree(&mut rng, 200);
        let mut network = solved(&tree, resisting(1.0));
        wound(&mut rng, &mut network, &tree, 20);
        for index in 0..network.open_ends().len() {
            network.set_opening(index, 1.0 / (index + 1) as f64).unwrap();
        }
        network.solve().unwrap();
        for end in network.open_ends() {
            let area = PI * (f64::from(end.outlet.radius) * 1e-3).powi(2) * end.opening;
            let ideal = end.flow().cubic_metres_per_second() / (0.29 * area);
            // Relative to the atmosphere. Below that nothing flows.
            let (found, expected) = (end.pressure().pascals().max(0.0), 530.0 * ideal * ideal);
            assert!(
                (found - expected).abs() <= 1e-6 * expected + 1e-8,
                "seed {seed}, {end:?}: {found} Pa, not {expected}"
            );
            open += 1;
        }
    }
    assert!(open > 500, "{open} open ends");
}

#[test]
fn blood_flows_towards_a_root_of_low_pressure() {
    let tree = symmetric(5);
    let network = solved(&tree, FlowSettings::venous());
    assert!(network.flows().iter().all(|&flow| flow < 0.0));
    let level = solved(&tree, FlowSettings { root: RootPressure::Constant(Pressure::from_mmhg(20.0)), ..settings() });
    assert!(level.flows().iter().all(|&flow| flow == 0.0));
}

#[test]
fn degenerate_trees_have_a_solution() {
    assert!(solved(&VesselTree::new(), settings()).is_empty());
    // Two roots, one of them alone; a segment of no length that is a terminal; radii over twelve orders of magnitude.
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Y, Vec3::ONE, Vec3::Z];
    let parents = vec![NO_PARENT, NO_PARENT, 0, 2, 2, 4];
    let tree = VesselTree::from_arrays(positions, parents, vec![1.0, 1.0, 1e3, 1.0, 1e-6, 1e-9]).unwrap();
    let mut network = solved(&tree, settings());
    assert!(network.flows().iter().chain(network.pressures()).all(|x| x.is_finite()));
    assert_eq!(network.flows()[1], 0.0);
    assert_eq!(network.pressures()[1], Pressure::from_mmhg(100.0).pascals());
    assert!(network.flows()[3] > 0.0);
    network.set_interruption(NodeId(3), Some(Interruption::cut(1.0, 1.0))).unwrap();
    network.set_interruption(NodeId(2), Some(Interruption::cut(0.0, 1.0))).unwrap();
    network.solve().unwrap();
    assert!(network.flows().iter().chain(network.pressures()).all(|x| x.is_finite()));
    assert!(network.open_ends().iter().all(|end| end.flow().ml_per_min().is_finite()));
}

#[test]
fn a_closed_piece_has_no_flow_and_an_isolated_one_the_beds_pressure() {
    let tree = tube(4, 4.0, 1.0);
    let mut network = solved(&tree, settings());
    network.set_interruption(NodeId(2), Some(Interruption::clamp(0.5))).unwrap();
    network.set_interruption(NodeId(4), Some(Interruption::clamp(0.5))).unwrap();
    network.solve().unwrap();
    let mmhg: Vec<f64> = network.pressures().iter().map(|&p| Pressure::from_pascals(p).mmhg()).collect();
    for (found, expected) in mmhg.iter().zip([100.0, 100.0, 20.0, 20.0, 20.0]) {
        assert!((found - expected).abs() < 1e-9, "{mmhg:?}");
    }
    assert!(network.flows().iter().all(|&flow| flow == 0.0), "{:?}", network.flows());
}

#[test]
fn what_cannot_flow_is_refused_with_its_number_and_a_remedy() {
    let tree = tube(2, 1.0, 1.0);
    let refuses = |settings: FlowSettings, words: [&str; 2]| {
        let message = Network::new(&tree, settings).unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    assert!(Scale::from_metres(-2.0).unwrap_err().to_string().contains("-2 m"));
    let viscosity = ViscosityLaw::Constant(Viscosity::from_pascal_seconds(-1.0));
    refuses(FlowSettings { viscosity, ..settings() }, ["-1", "above 0"]);
    let pries = ViscosityLaw::Pries { plasma: Viscosity::from_centipoise(1.2), haematocrit: 2.0 };
    refuses(FlowSettings { viscosity: pries, ..settings() }, ["2", "0 to 0.95"]);
    refuses(FlowSettings { ambient: Pressure::from_mmhg(f64::NAN), ..settings() }, ["NaN", "finite"]);

    let mut network = Network::new(&tree, settings()).unwrap();
    let mut gap = |node, gap| network.set_interruption(NodeId(node), Some(gap)).unwrap_err();
    assert_eq!(gap(9, Interruption::clamp(0.5)), FlowError::NoSuchNode { node: 9, nodes: 3 });
    assert_eq!(gap(0, Interruption::clamp(0.5)), FlowError::NoSegment { node: 0 });
    assert!(gap(1, Interruption::clamp(1.5)).to_string().contains("1.5"));
    assert!(gap(1, Interruption::clamp(f32::NAN)).to_string().contains("NaN"));
    let backwards = Interruption { first: 0.75, last: 0.5, proximal: None, distal: None };
    assert!(gap(1, backwards).to_string().contains("0.75 to 0.5"));
    assert!(gap(1, Interruption::cut(0.5, 0.0)).to_string().contains("radius"));
    let huge = Interruption { proximal: Some(Outlet { radius: f32::INFINITY }), ..Interruption::clamp(0.5) };
    assert!(gap(1, huge).to_string().contains("inf"));
    assert!(network.set_root_pressure(Pressure::from_mmhg(f64::NAN)).is_err());
    assert_eq!(network.interruptions().len(), 0);
}
