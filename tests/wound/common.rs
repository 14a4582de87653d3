//! Random trees and a brute-force index.

use bevy_math::{Vec3, vec3};
use bevy_vessels::synthesis::instances::{FlatEnds, SegmentColors, SegmentInstance, write_stumps};
use bevy_vessels::synthesis::random::{Stream, VesselRng};
use bevy_vessels::synthesis::segment_index::Region;
use bevy_vessels::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use bevy_vessels::synthesis::wound::Wounds;
use rand::RngExt;

pub fn rng(seed: u64) -> VesselRng {
    Stream::Statistics.rng(seed)
}

pub fn tree(positions: Vec<Vec3>, parents: Vec<u32>, radii: Vec<f32>) -> VesselTree {
    VesselTree::from_arrays(positions, parents, radii).expect("a well-formed tree")
}

/// One vessel along x, with nodes at 0, 1, 2, … `segments` and a radius of 0.05.
pub fn straight(segments: u32) -> VesselTree {
    let nodes = segments as usize + 1;
    let positions = (0..nodes).map(|node| Vec3::X * node as f32).collect();
    let parents = (0..nodes as u32).map(|node| node.wrapping_sub(1)).collect();
    tree(positions, parents, vec![0.05; nodes])
}

/// A random forest of short segments in a cube of side 2 around the origin: some nodes are roots, the others have any
/// earlier node as parent, mostly a late one.
pub fn forest(seed: u64, size: usize) -> VesselTree {
    let mut rng = rng(seed);
    let (mut positions, mut parents): (Vec<Vec3>, Vec<u32>) = (Vec::new(), Vec::new());
    for node in 0..size as u32 {
        let root = node == 0 || rng.random_range(0..20) == 0;
        let reach = if rng.random_range(0..2) == 0 { node } else { node.min(3) };
        let parent = if root { NO_PARENT } else { node - 1 - rng.random_range(0..reach.max(1)) };
        let step = random_point(&mut rng) * 0.3;
        let near = if root { random_point(&mut rng) } else { positions[parent as usize] };
        positions.push((near + step).clamp(Vec3::NEG_ONE, Vec3::ONE));
        parents.push(parent);
    }
    let radii = (0..size).map(|_| 0.002 + 0.02 * rng.random::<f32>()).collect();
    tree(positions, parents, radii)
}

/// A point in the cube from −1 to 1.
pub fn random_point(rng: &mut VesselRng) -> Vec3 {
    let mut coordinate = || rng.random_range(-1.0f32..1.0);
    vec3(coordinate(), coordinate(), coordinate())
}

/// Candidates for any region: every node, roots included, the last first.
pub fn all(tree: &VesselTree) -> impl Fn(&Region, &mut dyn FnMut(NodeId)) + Copy {
    let nodes = tree.len() as u32;
    move |_, visit| (0..nodes).rev().for_each(|node| visit(NodeId(node)))
}

/// The segments with flat ends, computed from scratch.
pub fn flat_ends(wounds: &Wounds, tree: &VesselTree) -> FlatEnds {
    let children = tree.children();
    FlatEnds::new(wounds, tree, |node| children.of(node.index()).iter().map(|&child| NodeId(child)))
}

/// Everything that is drawn instead of whole segments.
pub fn stumps(wounds: &Wounds, tree: &VesselTree, colors: &SegmentColors) -> Vec<SegmentInstance> {
    let mut out = Vec::new();
    write_stumps(wounds, &flat_ends(wounds, tree), tree, &[], colors, &mut out);
    out
}
