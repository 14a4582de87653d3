//! Trees and settings for tests of flow.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    haemodynamics::{BedSettings, FlowSettings, Interruption, Network, Outlet, RootPressure, ViscosityLaw},
    tree::{NO_PARENT, NodeId, VesselTree},
    units::{Pressure, Resistance, Viscosity},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A straight vessel of equal segments along x.
pub fn tube(segments: usize, length: f32, radius: f32) -> VesselTree {
    let step = length / segments as f32;
    let positions = (0..=segments).map(|i| Vec3::X * (step * i as f32)).collect();
    let parents = (0..=segments as u32).map(|i| i.checked_sub(1).unwrap_or(NO_PARENT)).collect();
    VesselTree::from_arrays(positions, parents, vec![radius; segments + 1]).expect("a well-formed tree")
}

/// A forest in which every node's parent is any node before it, and about one in twenty is a root. One segment in
/// twenty has no length.
pub fn random_tree(rng: &mut ChaCha8Rng, nodes: usize) -> VesselTree {
    let tree = drawn_tree(rng, nodes);
    let mut positions = tree.positions().to_vec();
    for node in 1..nodes {
        if tree.parents()[node] != NO_PARENT && rng.random_bool(0.05) {
            positions[node] = positions[tree.parents()[node] as usize];
        }
    }
    VesselTree::from_arrays(positions, tree.parents().to_vec(), tree.radii().to_vec()).expect("a well-formed tree")
}

/// The same without segments of zero length, whose conductances leave a dense solver no accuracy.
pub fn drawn_tree(rng: &mut ChaCha8Rng, nodes: usize) -> VesselTree {
    let mut positions = Vec::new();
    let mut parents = Vec::new();
    let mut radii = Vec::new();
    for node in 0..nodes as u32 {
        let is_root = node == 0 || rng.random_bool(0.05);
        // Long vessels, broad fans, and shapes in between.
        let parent = if rng.random_bool(0.5) { node.saturating_sub(1) } else { rng.random_range(0..node.max(1)) };
        parents.push(if is_root { NO_PARENT } else { parent });
        positions.push(Vec3::from(std::array::from_fn(|_| rng.random_range(-5.0..5.0_f32))));
        radii.push(10.0_f32.powf(rng.random_range(-1.5..0.5)));
    }
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

/// Arteries with a constant viscosity, held at 100 mmHg over a bed of 20 mmHg.
pub fn settings() -> FlowSettings {
    FlowSettings {
        viscosity: ViscosityLaw::Constant(Viscosity::from_centipoise(3.6)),
        root: RootPressure::Constant(Pressure::from_mmhg(100.0)),
        bed: BedSettings { pressure: Pressure::from_mmhg(20.0), resistance: None },
        ..FlowSettings::default()
    }
}

/// The same with a bed that resists.
pub fn resisting(mmhg_min_per_ml: f64) -> FlowSettings {
    let mut settings = settings();
    settings.bed.resistance = Some(Resistance::from_mmhg_min_per_ml(mmhg_min_per_ml));
    settings
}

/// A gap at any place in a segment, with each end open or closed.
pub fn random_gap(rng: &mut ChaCha8Rng) -> Interruption {
    let (a, b) = (rng.random_range(0.0..=1.0_f32), rng.random_range(0.0..=1.0_f32));
    let outlet = |rng: &mut ChaCha8Rng| {
        rng.random_bool(0.7).then(|| Outlet { radius: 10.0_f32.powf(rng.random_range(-2.0..0.0)) })
    };
    Interruption { first: a.min(b), last: a.max(b), proximal: outlet(rng), distal: outlet(rng) }
}

/// Lays gaps over about so many segments.
pub fn wound(rng: &mut ChaCha8Rng, network: &mut Network, tree: &VesselTree, gaps: usize) {
    for _ in 0..gaps {
        let node = NodeId(rng.random_range(0..tree.len() as u32));
        if tree.parent(node).is_some() {
            let gap = random_gap(rng);
            network.set_interruption(node, Some(gap)).expect("valid numbers");
        }
    }
}

/// The piece of every node: the root, or the node of the interrupted segment, that it hangs from.
pub fn pieces(tree: &VesselTree, network: &Network) -> Vec<usize> {
    let mut pieces: Vec<usize> = (0..tree.len()).collect();
    for (node, parent) in tree.segments() {
        if network.interruption(NodeId(node as u32)).is_none() {
            pieces[node] = pieces[parent];
        }
    }
    pieces
}

/// For every piece, whether a root or the bed's pool holds its pressure.
pub fn held_pieces(tree: &VesselTree, network: &Network) -> Vec<bool> {
    let mut held = vec![false; tree.len()];
    let pieces = pieces(tree, network);
    for node in tree.tips() {
        held[pieces[node as usize]] = true;
    }
    for root in tree.roots() {
        held[root] = true;
    }
    held
}
