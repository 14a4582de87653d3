//! Arteries and veins joined through the bed.

use super::trees::{drawn_tree, pieces, resisting, rng, wound};
use bevy_vessels::synthesis::{
    haemodynamics::{
        Bleeding, BleedingSettings, BloodVolume, BloodVolumeSettings, Circulation, EndSide, FlowError, FlowSettings,
        Interruption, Network, RootPressure,
    },
    tree::{BedLink, NO_PARENT, NodeId, VesselTree},
    units::{Pressure, Volume},
};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

struct Organ {
    trees: [VesselTree; 2],
    links: Vec<BedLink>,
    circulation: Circulation,
}

/// Two random trees and links between them, half of them between any nodes.
fn organ(rng: &mut ChaCha8Rng, nodes: usize, bed: f64) -> Organ {
    organ_under(Pressure::ZERO, rng, nodes, bed)
}

/// The same, with this pressure around.
fn organ_under(ambient: Pressure, rng: &mut ChaCha8Rng, nodes: usize, bed: f64) -> Organ {
    let trees = [drawn_tree(rng, nodes), drawn_tree(rng, nodes)];
    let node = |rng: &mut ChaCha8Rng, tree: &VesselTree| {
        let tips = tree.tips();
        NodeId(if rng.random_bool(0.5) {
            tips[rng.random_range(0..tips.len())]
        } else {
            rng.random_range(0..nodes as u32)
        })
    };
    let links: Vec<BedLink> =
        (0..nodes / 3).map(|_| BedLink { arterial: node(rng, &trees[0]), venous: node(rng, &trees[1]) }).collect();
    let arterial = FlowSettings { ambient, ..resisting(bed) };
    let venous = FlowSettings { root: RootPressure::Constant(Pressure::from_mmhg(4.0)), ..arterial };
    let networks = [
        Network::new(&trees[0], arterial).expect("valid numbers"),
        Network::new(&trees[1], venous).expect("valid numbers"),
    ];
    let [arterial, venous] = networks;
    let circulation = Circulation::new(arterial, venous, &links).expect("valid numbers");
    Organ { trees, links, circulation }
}

impl Organ {
    fn networks(&self) -> [&Network; 2] {
        [self.circulation.arterial(), self.circulation.venous()]
    }

    /// Flow through every link from the pressures at its ends, in m³/s.
    fn link_flow(&self, link: &BedLink) -> f64 {
        let [arterial, venous] = self.networks();
        let resistance =
            arterial.settings().bed.resistance.expect("a bed that resists").pascal_seconds_per_cubic_metre();
        (arterial.pressures()[link.arterial.index()] - venous.pressures()[link.venous.index()]) / resistance
    }

    /// Largest imbalance of a node of either tree, over the largest flow.
    fn imbalance(&self) -> f64 {
        let mut worst = 0.0_f64;
        for (side, (tree, network)) in self.trees.iter().zip(self.networks()).enumerate() {
            let mut left = network.flows().to_vec();
            for (node, parent) in tree.segments() {
                left[parent] -= network.flows()[node];
                if network.interruption(NodeId(node as u32)).is_some() {
                    left[node] -= network.flows()[node];
                }
            }
            for end in network.open_ends().iter().filter(|end| end.side == EndSide::Distal) {
                left[end.node.index()] -= end.flow().cubic_metres_per_second();
            }
            let mut is_linked = vec![false; tree.len()];
            for link in &self.links {
                let (node, sign) = if side == 0 { (link.arterial, 1.0) } else { (link.venous, -1.0) };
                is_linked[node.index()] = true;
                left[node.index()] -= sign * self.link_flow(link);
            }
            for node in 0..tree.len() {
                if !is_linked[node] {
                    left[node] -= network.bed_flow(node);
                }
            }
            let flows = network.flows().iter().copied();
            let largest =
                flows.chain(self.links.iter().map(|link| self.link_flow(link))).fold(1e-30, |a: f64, b| a.max(b.abs()));
            worst = worst.max(left.iter().fold(0.0, |a: f64, b| a.max(b.abs())) / largest);
        }
        worst
    }
}

#[test]
fn what_arteries_give_arrives_in_the_veins() {
    for seed in 0..60 {
        let mut rng = rng(seed);
        let bed = 10.0_f64.powf(rng.random_range(-1.0..2.0));
        let mut organ = organ(&mut rng, 150, bed);
        organ.circulation.solve().unwrap();
        assert!(organ.imbalance() < 1e-7, "seed {seed}: {}", organ.imbalance());
        assert!(organ.circulation.passes() < 200, "seed {seed}: {} passes", organ.circulation.passes());
        let trees = organ.trees.clone();
        wound(&mut rng, organ.circulation.arterial_mut(), &trees[0], 8);
        wound(&mut rng, organ.circulation.venous_mut(), &trees[1], 8);
        organ.circulation.solve().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert!(organ.imbalance() < 1e-7, "seed {seed}, cut: {}", organ.imbalance());
    }
}

impl Organ {
    /// Nodes of both trees whose pressure is held neither by a root nor by the pool, even through links.
    fn floating(&self) -> Vec<usize> {
        let n = self.trees[0].len();
        let pieces: Vec<Vec<usize>> =
            self.trees.iter().zip(self.networks()).map(|(tree, network)| pieces(tree, network)).collect();
        let mut held = [vec![false; n], vec![false; n]];
        for (side, tree) in self.trees.iter().enumerate() {
            for root in tree.roots() {
                held[side][root] = true;
            }
            for tip in tree.tips() {
                let is_linked = self.links.iter().any(|link| [link.arterial, link.venous][side].0 == tip);
                held[side][pieces[side][tip as usize]] |= !is_linked;
            }
        }
        for _ in 0..2 * n {
            for link in &self.links {
                let (a, v) = (pieces[0][link.arterial.index()], pieces[1][link.venous.index()]);
                let either = held[0][a] || held[1][v];
                (held[0][a], held[1][v]) = (either, either);
            }
        }
        (0..2 * n).filter(|&node| !held[node / n][pieces[node / n][node % n]]).collect()
    }
}

/// Pressures of both trees above the pool's, by LU decomposition of the whole circulation.
fn dense_pressures(organ: &Organ) -> Vec<f64> {
    let n = organ.trees[0].len();
    let [arterial, venous] = organ.networks();
    let bed = arterial.settings().bed.resistance.expect("a bed that resists").pascal_seconds_per_cubic_metre();
    let (mut matrix, mut sources) = (DMatrix::zeros(2 * n, 2 * n), DVector::zeros(2 * n));
    let mut join = |a: usize, b: usize, conductance: f64| {
        for (a, b) in [(a, b), (b, a)] {
            matrix[(a, a)] += conductance * bed;
            matrix[(a, b)] -= conductance * bed;
        }
    };
    for (side, (tree, network)) in organ.trees.iter().zip([arterial, venous]).enumerate() {
        for (node, parent) in tree.segments() {
            if network.interruption(NodeId(node as u32)).is_none() {
                join(side * n + node, side * n + parent, 1.0 / network.resistance(node));
            }
        }
    }
    for link in &organ.links {
        join(link.arterial.index(), n + link.venous.index(), 1.0 / bed);
    }
    for (side, (tree, network)) in organ.trees.iter().zip([arterial, venous]).enumerate() {
        for node in tree.tips() {
            let is_linked = organ.links.iter().any(|link| [link.arterial, link.venous][side].0 == node);
            if !is_linked && tree.parents()[node as usize] != NO_PARENT {
                matrix[(side * n + node as usize, side * n + node as usize)] += 1.0;
            }
        }
        for end in network.open_ends() {
            let node = match end.side {
                EndSide::Proximal => tree.parents()[end.node.index()] as usize,
                EndSide::Distal => end.node.index(),
            };
            sources[side * n + node] -= end.flow().cubic_metres_per_second() * bed;
        }
        for root in tree.roots() {
            matrix.row_mut(side * n + root).fill(0.0);
            matrix[(side * n + root, side * n + root)] = 1.0;
            sources[side * n + root] = network.root_pressure().pascals() - arterial.bed_pressure().pascals();
        }
    }
    for node in organ.floating() {
        matrix.row_mut(node).fill(0.0);
        matrix[(node, node)] = 1.0;
        sources[node] = organ.networks()[node / n].pressures()[node % n] - arterial.bed_pressure().pascals();
    }
    matrix.lu().solve(&sources).expect("a network that is held").iter().copied().collect()
}

#[test]
fn pressures_of_both_trees_agree_with_a_dense_solver() {
    for seed in 0..40 {
        let mut rng = rng(seed);
        let mut organ = organ(&mut rng, 60, 3.0);
        let trees = organ.trees.clone();
        for gaps in [0, 5] {
            wound(&mut rng, organ.circulation.arterial_mut(), &trees[0], gaps);
            wound(&mut rng, organ.circulation.venous_mut(), &trees[1], gaps);
            organ.circulation.solve().unwrap();
            let pool = organ.circulation.arterial().bed_pressure().pascals();
            let dense = dense_pressures(&organ);
            let found = organ.networks().map(|network| network.pressures().to_vec()).concat();
            for (node, (found, expected)) in found.iter().zip(&dense).enumerate() {
                assert!(
                    (found - pool - expected).abs() < 1e-2,
                    "seed {seed}, {gaps} gaps, node {node}: {} Pa, not {expected}",
                    found - pool
                );
            }
        }
    }
}

#[test]
fn links_may_come_and_go() {
    for seed in 0..10 {
        let mut rng = rng(seed);
        let mut organ = organ(&mut rng, 80, 2.0);
        organ.circulation.solve().unwrap();
        let before = organ.circulation.arterial().flows().to_vec();
        let links = std::mem::take(&mut organ.links);
        organ.circulation.set_links(&links[..5]).unwrap();
        organ.links = links[..5].to_vec();
        organ.circulation.solve().unwrap();
        assert!(organ.imbalance() < 1e-7, "seed {seed}: {}", organ.imbalance());
        organ.circulation.set_links(&links).unwrap();
        organ.circulation.solve().unwrap();
        let largest = before.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        for (found, expected) in organ.circulation.arterial().flows().iter().zip(&before) {
            assert!((found - expected).abs() < 1e-9 * largest, "seed {seed}: {found}, not {expected}");
        }
        // Separated again, they are the original networks.
        let [mut arterial, _] = organ.circulation.clone().into_networks();
        arterial.solve().unwrap();
        let mut alone = Network::new(&organ.trees[0], resisting(2.0)).unwrap();
        alone.solve().unwrap();
        assert_eq!(arterial.flows(), alone.flows(), "seed {seed}");
    }
}

#[test]
fn trees_that_change_are_solved_as_new_ones() {
    for seed in 0..10 {
        let mut rng = rng(seed);
        let mut organ = organ(&mut rng, 90, 2.0);
        organ.circulation.solve().unwrap();
        for (side, tree) in organ.trees.iter_mut().enumerate() {
            // Half the vessels widen, and one more grows.
            let last = tree.len() as u32 - 1;
            let positions = [tree.positions(), &[tree.positions()[last as usize] + 0.5]].concat();
            let parents = [tree.parents(), &[last]].concat();
            let radii = (0..=last as usize).map(|node| tree.radii()[node] * (1.0 + 0.2 * (node % 2) as f32));
            let radii = radii.chain([0.01]).collect();
            *tree = VesselTree::from_arrays(positions, parents, radii).unwrap();
            let network = if side == 0 { organ.circulation.arterial_mut() } else { organ.circulation.venous_mut() };
            assert_eq!(network.update(tree).unwrap().appended, 1);
        }
        organ.circulation.solve().unwrap();
        let mut venous = resisting(2.0);
        venous.root = RootPressure::Constant(Pressure::from_mmhg(4.0));
        let [arterial, venous] = [(0, resisting(2.0)), (1, venous)]
            .map(|(side, settings): (usize, _)| Network::new(&organ.trees[side], settings).unwrap());
        let mut anew = Circulation::new(arterial, venous, &organ.links).unwrap();
        anew.solve().unwrap();
        let flows = [&organ.circulation, &anew].map(|both| [both.arterial().flows(), both.venous().flows()].concat());
        let largest = flows[1].iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        for (node, (found, expected)) in flows[0].iter().zip(&flows[1]).enumerate() {
            assert!((found - expected).abs() < 1e-8 * largest, "seed {seed}, {node}: {found}, not {expected}");
        }
    }
}

#[test]
fn a_clamped_artery_leaves_the_vein_to_the_pool() {
    let tree = super::trees::tube(4, 4.0, 0.2);
    let mut venous = resisting(1.0);
    venous.root = RootPressure::Constant(Pressure::from_mmhg(4.0));
    let networks = [Network::new(&tree, resisting(1.0)).unwrap(), Network::new(&tree, venous).unwrap()];
    let [arterial, venous] = networks;
    let link = BedLink { arterial: NodeId(4), venous: NodeId(4) };
    let mut circulation = Circulation::new(arterial, venous, &[link]).unwrap();
    circulation.solve().unwrap();
    // One vessel from 100 to 4 mmHg: two tubes and the link in a row.
    let tube: f64 = (1..=4).map(|node| circulation.arterial().resistance(node)).sum();
    let bed = circulation.arterial().settings().bed.resistance.unwrap().pascal_seconds_per_cubic_metre();
    let expected = Pressure::from_mmhg(96.0).pascals() / (2.0 * tube + bed);
    assert!((circulation.arterial().flows()[2] / expected - 1.0).abs() < 1e-9);
    assert!((circulation.venous().flows()[2] / expected + 1.0).abs() < 1e-9);
    circulation.arterial_mut().set_interruption(NodeId(2), Some(Interruption::clamp(0.5))).unwrap();
    circulation.solve().unwrap();
    assert!(
        circulation.venous().flows().iter().all(|flow| flow.abs() < 1e-9 * expected),
        "{:?}",
        circulation.venous().flows()
    );
    assert!((circulation.arterial().pressures()[4] - Pressure::from_mmhg(4.0).pascals()).abs() < 1e-3);
}

#[test]
fn a_bed_without_resistance_joins_nothing() {
    let tree = super::trees::tube(2, 1.0, 1.0);
    let network = Network::new(&tree, super::trees::settings()).unwrap();
    let error = Circulation::new(network.clone(), network, &[]).unwrap_err();
    assert_eq!(error, FlowError::BedWithoutResistance);
    let network = Network::new(&tree, resisting(1.0)).unwrap();
    let link = BedLink { arterial: NodeId(2), venous: NodeId(7) };
    assert_eq!(
        Circulation::new(network.clone(), network, &[link]).unwrap_err(),
        FlowError::NoSuchNode { node: 7, nodes: 3 }
    );
}

/// The flow that leaves all open ends of a circulation, in m³/s.
fn bleeding_rate(circulation: &Circulation) -> f64 {
    let ends = circulation.arterial().open_ends().iter().chain(circulation.venous().open_ends());
    ends.map(|end| end.flow().cubic_metres_per_second()).sum()
}

/// However fast, a patient bleeds out and no further, and the solver sees it through to the end, when nothing flows.
#[test]
fn bleeding_out_is_solved_to_the_last_drop() -> Result<(), Box<dyn std::error::Error>> {
    for seed in 0..60 {
        let mut rng = rng(seed);
        let suction = seed % 3 == 2;
        let ambient = Pressure::from_mmhg(if suction { -100.0 } else { 0.0 });
        let mut organ = organ_under(ambient, &mut rng, 80, 0.01);
        wound(&mut rng, organ.circulation.arterial_mut(), &organ.trees[0], 4);
        wound(&mut rng, organ.circulation.venous_mut(), &organ.trees[1], 4);
        organ.circulation.solve()?;
        let rate = bleeding_rate(&organ.circulation);
        // From a hundred steps' worth of blood to a hundredth of one.
        let total = Volume::from_cubic_metres((rate * 100.0 / 10.0_f64.powi(seed as i32 % 5)).max(1e-12));
        let settings = BloodVolumeSettings { total, ..BloodVolumeSettings::default() };
        let mut blood = BloodVolume::new(settings)?;
        let never = BleedingSettings { clotting: None, longest_step: 1.0 };
        let [mut arteries, mut veins] = [Bleeding::new(never)?, Bleeding::new(never)?];
        for step in 0..200 {
            let before = blood.lost_share();
            Bleeding::step_joined([&mut arteries, &mut veins], &mut organ.circulation, 1.0, &mut blood)
                .map_err(|error| format!("seed {seed}, step {step}, {before} lost: {error}"))?;
            let lost = arteries.lost().cubic_metres() + veins.lost().cubic_metres();
            assert!(lost <= total.cubic_metres() * (1.0 + 1e-9), "seed {seed}: {lost} of {total:?}");
            assert!((blood.lost().cubic_metres() - lost).abs() <= 1e-9 * total.cubic_metres());
        }
        let share = blood.lost_share();
        assert!(share <= 0.45 + 1.0 / 32.0 || suction, "seed {seed}: {share} lost without any pressure left");
    }
    Ok(())
}
