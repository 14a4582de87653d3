//! Wounded pairs of arteries and veins whose resistances lie in any ratio: of the bed, of the vessels, of the scale.

use super::{
    full_matrix::{FullMatrix, OUTSIDE, POOL},
    trees::{drawn_tree, rng},
};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{
        BedSettings, Bleeding, BleedingSettings, BloodVolume, BloodVolumeSettings, Circulation, Clotting, EndSide,
        FlowSettings, Interruption, Network, Pulse, RootPressure,
    },
    tree::{BedLink, NO_PARENT, NodeId, VesselTree},
    units::{BLOOD_DENSITY, Pressure, Resistance, Scale, Volume},
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// A tree whose tips split at random, with radii by Murray's law and lengths of ten radii.
fn branching_tree(rng: &mut ChaCha8Rng, terminals: usize) -> Outcome<VesselTree> {
    let (mut parents, mut tips) = (vec![NO_PARENT, 0], vec![1]);
    while tips.len() < terminals {
        let tip = tips.swap_remove(rng.random_range(0..tips.len()));
        for _ in 0..2 {
            tips.push(parents.len() as u32);
            parents.push(tip);
        }
    }
    let mut cubes = vec![0.0_f64; parents.len()];
    tips.iter().for_each(|&tip| cubes[tip as usize] = 1e-6);
    for node in (1..parents.len()).rev() {
        cubes[parents[node] as usize] += cubes[node];
    }
    let radii: Vec<f32> = cubes.iter().map(|cube| cube.cbrt() as f32).collect();
    let mut positions = vec![Vec3::ZERO; parents.len()];
    for node in 1..parents.len() {
        let direction = Vec3::from(std::array::from_fn(|_| rng.random_range(-1.0..1.0_f32)));
        positions[node] = positions[parents[node] as usize] + 10.0 * radii[node] * direction;
    }
    Ok(VesselTree::from_arrays(positions, parents, radii)?)
}

/// Cuts and clamps, half of them in trunks; at times a tourniquet around all of these.
fn wound(rng: &mut ChaCha8Rng, network: &mut Network, tree: &VesselTree) -> Outcome {
    for _ in 0..[0, 1, 4, 30][rng.random_range(0..4)] {
        let last = if rng.random_bool(0.5) { tree.len().min(8) } else { tree.len() };
        let node = rng.random_range(0..last);
        if tree.parents()[node] != NO_PARENT {
            let along = [0.0, 1.0, rng.random_range(0.0..1.0)][rng.random_range(0..3)];
            let gap = match rng.random_bool(0.2) {
                true => Interruption::clamp(along),
                false => Interruption::cut(along, tree.radii()[node]),
            };
            network.set_interruption(NodeId(node as u32), Some(gap))?;
        }
    }
    if rng.random_bool(0.15) {
        for (node, _) in tree.segments().filter(|&(_, parent)| tree.parents()[parent] == NO_PARENT) {
            network.set_interruption(NodeId(node as u32), Some(Interruption::clamp(0.5)))?;
        }
    }
    Ok(())
}

pub struct Pair {
    trees: [VesselTree; 2],
    links: Vec<BedLink>,
    circulation: Circulation,
}

impl Pair {
    /// Arteries with so many terminals, and veins with fewer.
    fn drawn(rng: &mut ChaCha8Rng, terminals: usize) -> Outcome<Self> {
        let fewer = terminals.div_ceil(rng.random_range(1..4));
        let is_orderly = rng.random_bool(0.7);
        let trees = if is_orderly {
            [branching_tree(rng, terminals)?, branching_tree(rng, fewer)?]
        } else {
            [drawn_tree(rng, 2 * terminals), drawn_tree(rng, 2 * fewer)]
        };
        let [arterial_tips, venous_tips] = [trees[0].tips(), trees[1].tips()];
        let mut links = Vec::new();
        for (number, &tip) in arterial_tips.iter().enumerate() {
            // Mostly to veins in the same order, so that neighbours share veins.
            let at = number * venous_tips.len() / arterial_tips.len();
            let at = if rng.random_bool(0.2) { rng.random_range(0..venous_tips.len()) } else { at };
            let venous =
                if rng.random_bool(0.1) { rng.random_range(0..trees[1].len() as u32) } else { venous_tips[at] };
            if rng.random_bool(0.9) {
                links.push(BedLink { arterial: NodeId(tip), venous: NodeId(venous) });
            }
        }
        let bed =
            [1e-290, 1e290, 10.0_f64.powf(rng.random_range(-20.0..20.0)), 10.0_f64.powf(rng.random_range(-3.0..5.0))];
        let resistance = Resistance::from_mmhg_min_per_ml(bed[[0, 1, 2, 2, 2, 2, 3, 3, 3, 3][rng.random_range(0..10)]]);
        let scale = [rng.random_range(-12.0..12.0), -3.0, -2.0][rng.random_range(0..3)];
        let scale = Scale::from_metres(10.0_f64.powf(scale))?;
        let ambient = Pressure::from_mmhg([0.0, 0.0, -100.0, 60.0, 300.0][rng.random_range(0..5)]);
        let bed = BedSettings { resistance: Some(resistance), ..BedSettings::default() };
        let pulse = FlowSettings { root: RootPressure::Pulsatile(Pulse::default()), ..FlowSettings::arterial() };
        let arterial = if rng.random_bool(0.3) { pulse } else { FlowSettings::arterial() };
        let network =
            |tree, settings: FlowSettings| Network::new(tree, FlowSettings { scale, ambient, bed, ..settings });
        let [mut arteries, mut veins] = [network(&trees[0], arterial)?, network(&trees[1], FlowSettings::venous())?];
        wound(rng, &mut arteries, &trees[0])?;
        wound(rng, &mut veins, &trees[1])?;
        let circulation = Circulation::new(arteries, veins, &links)?;
        Ok(Self { trees, links, circulation })
    }

    fn networks(&self) -> [&Network; 2] {
        [self.circulation.arterial(), self.circulation.venous()]
    }

    fn end_flow(&self) -> f64 {
        let ends = self.networks().map(Network::open_ends);
        ends.iter().flat_map(|ends| ends.iter()).map(|end| end.flow().cubic_metres_per_second()).sum()
    }

    /// What enters and doesn't leave, in shares of the largest flow: of either tree's nodes, and of both trees together.
    fn imbalance(&self) -> f64 {
        let (mut left_over, mut largest, mut worst) = (-self.end_flow(), 1e-300, 0.0_f64);
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
            self.links.iter().for_each(|link| is_linked[[link.arterial, link.venous][side].index()] = true);
            for node in (0..tree.len()).filter(|&node| !is_linked[node]) {
                left[node] -= network.bed_flow(node);
                left_over -= network.bed_flow(node);
                worst = worst.max(left[node].abs());
            }
            left_over += tree.roots().map(|root| network.flows()[root]).sum::<f64>();
            // Rounding of the pressures in the widest vessel is a flow, too.
            let widest = network.resistances().filter(|&resistance| resistance > 0.0).fold(f64::INFINITY, f64::min);
            let pressure = network.pressures().iter().fold(0.0, |most: f64, at| most.max(at.abs()));
            let flows = network.flows().iter().map(|flow| flow.abs());
            largest = flows.chain([1e-8 * pressure / widest]).fold(largest, f64::max);
        }
        let links_at_roots = self
            .links
            .iter()
            .any(|link| self.trees[0].parent(link.arterial).is_none() || self.trees[1].parent(link.venous).is_none());
        worst.max(if links_at_roots { 0.0 } else { left_over.abs() }) / largest
    }

    /// The largest errors beside the oracle: of pressures, in shares of the largest; and of flows through open ends, in
    /// units of what is tolerated. An end is a resistance there, by the law Δp = R·Q + K·Q² at the flow that was found.
    fn errors_beside_oracle(&self) -> [f64; 2] {
        let networks = self.networks();
        let outside = networks[0].settings().ambient.pascals();
        let bed = networks[0].settings().bed.resistance.expect("a bed").pascal_seconds_per_cubic_metre();
        let bed = (1.0 / bed).clamp(1e-100, 1e100);
        let (mut oracle, mut ends) = (FullMatrix::new(self.trees.each_ref().map(VesselTree::len)), Vec::new());
        let is_linked = |side: usize, node| self.links.iter().any(|link| [link.arterial, link.venous][side].0 == node);
        for (side, (tree, network)) in self.trees.iter().zip(networks).enumerate() {
            for root in tree.roots() {
                oracle.place[side][root] = oracle.source(side);
            }
            for (node, parent) in tree.segments() {
                if network.interruption(NodeId(node as u32)).is_none() {
                    oracle.join((side, node), (side, parent), 1.0 / network.resistance(node));
                }
            }
            for tip in tree.tips() {
                if !is_linked(side, tip) && tree.parents()[tip as usize] != NO_PARENT {
                    oracle.join((side, tip as usize), POOL, bed);
                }
            }
            for end in network.open_ends() {
                let (node, share) = match end.side {
                    EndSide::Proximal => (tree.parents()[end.node.index()] as usize, f64::from(end.along)),
                    EndSide::Distal => (end.node.index(), 1.0 - f64::from(end.along)),
                };
                let radius = network.settings().scale.to_metres(end.outlet.radius);
                let discharge = f64::from(network.settings().discharge_coefficient);
                let passing = discharge * std::f64::consts::PI * radius * radius * end.opening;
                let orifice = BLOOD_DENSITY / (2.0 * passing * passing);
                let flow = end.flow().cubic_metres_per_second();
                let conductance = 1.0 / (network.resistance(end.node.index()) * f64::from(share) + orifice * flow);
                if flow > 0.0 {
                    oracle.join((side, node), OUTSIDE, conductance);
                }
                ends.push((side, node, flow, conductance));
            }
        }
        for link in &self.links {
            oracle.join((0, link.arterial.index()), (1, link.venous.index()), bed);
        }
        let [pool, arterial, venous] =
            [networks[0].bed_pressure(), networks[0].root_pressure(), networks[1].root_pressure()]
                .map(Pressure::pascals);
        let held = [0.0, pool - outside, arterial - outside, venous - outside];
        let mut opened = oracle.clone();
        let expected = oracle.pressures(held);
        let largest = [pool, arterial, venous, outside].iter().fold(1e-3, |largest: f64, at| largest.max(at.abs()));
        let mut errors = [0.0_f64; 2];
        for (expected, network) in expected.iter().zip(networks) {
            for (expected, found) in
                expected.iter().zip(network.pressures()).filter(|(expected, _)| expected.is_finite())
            {
                errors[0] = errors[0].max((expected + outside - found).abs() / largest);
            }
        }
        let all = networks.into_iter().flat_map(|network| network.flows());
        let largest_flow = all.fold(0.0, |largest: f64, flow| largest.max(flow.abs()));
        let oracle_flow = |&(side, node, _, conductance): &(usize, usize, f64, f64)| conductance * expected[side][node];
        for end in ends.iter().filter(|end| end.2 > 0.0) {
            let error = (end.2 - oracle_flow(end)).abs();
            errors[1] = errors[1].max(error / (1e-5 * end.2 + 1e-12 * largest_flow));
        }
        // Dry ends would give nothing if they were open.
        let wrongly_dry: Vec<_> = ends
            .iter()
            .filter(|&&(side, node, flow, _)| flow == 0.0 && expected[side][node] > 1e-8 * largest)
            .collect();
        if !wrongly_dry.is_empty() {
            wrongly_dry.iter().for_each(|end| opened.join((end.0, end.1), OUTSIDE, end.3));
            let expected = opened.pressures(held);
            for &&(side, node, _, conductance) in &wrongly_dry {
                errors[1] = errors[1].max(conductance * expected[side][node] / (1e-12 * largest_flow));
            }
        }
        errors
    }
}

/// A wounded pair that bleeds to the end. Returns what it was, and the error if there is one.
pub fn bled(seed: u64, most_terminals: f64) -> Outcome<usize> {
    let mut rng = rng(seed);
    let terminals = 10.0_f64.powf(rng.random_range(1.0..most_terminals.log10())) as usize;
    let mut pair = Pair::drawn(&mut rng, terminals)?;
    pair.circulation.solve()?;
    check(&pair, "at first")?;
    // A patient's blood, or so little that it is gone after a hundredth of a second to a hundred.
    let little = (pair.end_flow() * 10.0_f64.powi(rng.random_range(-2..3))).clamp(1e-12, 1e300);
    let total = if rng.random_bool(0.5) { 4.9e-3 } else { little };
    let mut blood =
        BloodVolume::new(BloodVolumeSettings { total: Volume::from_cubic_metres(total), ..Default::default() })?;
    let clotting = rng.random_bool(0.3).then(Clotting::default);
    let settings = BleedingSettings { clotting, longest_step: 2.0 };
    let [mut arteries, mut veins] = [Bleeding::new(settings)?, Bleeding::new(settings)?];
    for seconds in [0.0, 0.02, 0.5, 2.0, 2.0, 2.0] {
        let before = blood.lost_share();
        Bleeding::step_joined([&mut arteries, &mut veins], &mut pair.circulation, seconds, &mut blood)
            .map_err(|error| format!("{before} lost: {error}"))?;
        check(&pair, &format!("{before} lost"))?;
        let lost = arteries.lost().cubic_metres() + veins.lost().cubic_metres();
        if !(lost >= 0.0 && lost <= total * (1.0 + 1e-9)) {
            return Err(format!("{lost} of {total} m³ lost").into());
        }
    }
    Ok(terminals)
}

fn check(pair: &Pair, when: &str) -> Outcome {
    let finite = pair.networks().iter().all(|network| network.flows().iter().all(|flow| flow.is_finite()));
    let imbalance = pair.imbalance();
    let nodes = pair.trees[0].len() + pair.trees[1].len();
    let [pressures, ends] = if nodes <= 150 { pair.errors_beside_oracle() } else { [0.0; 2] };
    if !(finite && imbalance < 1e-6 && pressures < 1e-6 && ends <= 1.0) {
        return Err(format!("{when}: imbalance {imbalance:e}, pressures {pressures:e}, ends {ends:e}").into());
    }
    Ok(())
}

/// None may fail.
#[test]
#[ignore = "3 of the first 90 pairs fail: ends of nearly no flow, a balance after blood loss (issue 13)"]
fn pairs_of_any_resistances_are_solved_to_the_last_drop() {
    for seed in 0..60 {
        if let Err(error) = bled(seed, 300.0) {
            panic!("seed {seed}: {error}");
        }
    }
}
