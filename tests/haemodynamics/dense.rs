//! The two sweeps and the skeleton against a dense linear solver.

use super::trees::{drawn_tree, held_pieces, pieces, resisting, rng, settings, wound};
use bevy_vessels::synthesis::{
    haemodynamics::{EndSide, Network},
    tree::{NO_PARENT, NodeId, VesselTree},
};
use nalgebra::{DMatrix, DVector};

/// Pressures of all nodes above the bed's, by LU decomposition of the network's matrix, in units of the conductance of
/// a vessel that carries 1 mL/min at 1 mmHg. Open ends are given by their outflow.
fn dense_pressures(tree: &VesselTree, network: &Network) -> Vec<f64> {
    let unit = 1e-6 / 60.0 / 133.322_387_415;
    let bed = network.settings().bed;
    let n = tree.len();
    let counts = tree.child_counts();
    let (mut matrix, mut sources) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for node in 0..n {
        if tree.parents()[node] == NO_PARENT {
            continue;
        }
        let parent = tree.parents()[node] as usize;
        if network.interruption(NodeId(node as u32)).is_none() {
            let conductance = 1.0 / network.resistance(node) / unit;
            for (a, b) in [(parent, node), (node, parent)] {
                matrix[(a, a)] += conductance;
                matrix[(a, b)] -= conductance;
            }
        }
        if counts[node] == 0 {
            let held = 1e9 / network.resistance(node);
            let conductance = bed.resistance.map_or(held, |r| 1.0 / r.pascal_seconds_per_cubic_metre());
            matrix[(node, node)] += conductance / unit;
        }
    }
    for end in network.open_ends() {
        let node = match end.side {
            EndSide::Proximal => tree.parents()[end.node.index()] as usize,
            EndSide::Distal => end.node.index(),
        };
        sources[node] -= end.flow().cubic_metres_per_second() / unit;
    }
    for root in tree.roots() {
        for column in 0..n {
            matrix[(root, column)] = if column == root { 1.0 } else { 0.0 };
        }
        sources[root] = network.root_pressure().pascals() - bed.pressure.pascals();
    }
    // A piece without a held pressure has the bed's pressure, and no flow.
    let (pieces, held) = (pieces(tree, network), held_pieces(tree, network));
    for node in (0..n).filter(|&node| !held[pieces[node]]) {
        matrix.row_mut(node).fill(0.0);
        matrix[(node, node)] = 1.0;
        sources[node] = 0.0;
    }
    matrix.lu().solve(&sources).expect("a network that is held").iter().copied().collect()
}

#[test]
fn pressures_and_total_resistance_agree_with_a_dense_solver() {
    for seed in 0..200 {
        let mut rng = rng(seed);
        let tree = drawn_tree(&mut rng, 60);
        for settings in [settings(), resisting(2.0)] {
            let mut network = Network::new(&tree, settings).unwrap();
            for gaps in [0, 3, 10] {
                wound(&mut rng, &mut network, &tree, gaps);
                network.solve().unwrap();
                let bed = network.settings().bed.pressure.pascals();
                let drive = network.root_pressure().pascals() - bed;
                let dense = dense_pressures(&tree, &network);
                for (node, expected) in dense.iter().enumerate() {
                    let found = network.pressures()[node] - bed;
                    assert!(
                        (found - expected).abs() < 1e-5 * drive,
                        "seed {seed}, {gaps} gaps, node {node}: {found} Pa, not {expected}"
                    );
                }
                // The sum over the roots' segments, from the dense pressures.
                let inflow: f64 = tree
                    .segments()
                    .filter(|&(node, parent)| {
                        tree.parents()[parent] == NO_PARENT && network.interruption(NodeId(node as u32)).is_none()
                    })
                    .map(|(node, parent)| (dense[parent] - dense[node]) / network.resistance(node))
                    .sum();
                let stumps: f64 = network
                    .open_ends()
                    .iter()
                    .filter(|end| {
                        end.side == EndSide::Proximal
                            && tree.parents()[tree.parents()[end.node.index()] as usize] == NO_PARENT
                    })
                    .map(|end| end.flow().cubic_metres_per_second())
                    .sum();
                let (found, expected) = (network.inflow().cubic_metres_per_second(), inflow + stumps);
                assert!(
                    (found - expected).abs() < 1e-5 * expected.abs(),
                    "seed {seed}, {gaps} gaps: {found}, not {expected}"
                );
            }
        }
    }
}
