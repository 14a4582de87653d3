//! Joints of a tree that are worth a look: the widest one, and the one where its mesh leaves the vessels the most.

use crate::scene::light::KEY_LIGHT;
use bevy::prelude::*;
use bevy_vessels::synthesis::{
    segment_index::{SegmentIndex, start_radius},
    surface::SurfaceMesh,
    tree::{NodeId, VesselTree},
};

/// A place to look at.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Its middle.
    pub center: Vec3,
    /// Radius of the vessel there.
    pub radius: f32,
    /// A unit direction from which both vessels of a joint are seen from the side, in the light.
    pub from: Vec3,
}

impl Sight {
    /// Distance of the eye, in radii.
    pub const DISTANCE: f32 = 10.0;
}

/// The widest joint, the root left out; the root's if there is no other, `None` for a tree without joints.
pub fn widest_joint(tree: &VesselTree) -> Option<Sight> {
    let index = SegmentIndex::new(tree);
    let counts = tree.child_counts();
    let is_root = |node: usize| tree.parent(NodeId(node as u32)).is_none();
    let joints = (0..tree.len()).filter(|&node| counts[node] > 1);
    let width = |node: usize| if is_root(node) { 0.0 } else { tree.radii()[node] };
    let joint = joints.max_by(|&a, &b| width(a).total_cmp(&width(b)))?;
    Some(sight(tree, &index, joint, tree.positions()[joint]))
}

/// The vertex near the beginning of a segment that leaves a joint which is farthest from the round cones of all vessels
/// near it, in radii of that segment, and that distance.
pub fn worst_lateral(tree: &VesselTree, mesh: &SurfaceMesh) -> Option<(Sight, f32)> {
    let (index, counts) = (SegmentIndex::new(tree), tree.child_counts());
    let is_at_joint = |&vertex: &usize| {
        let joint = tree.parent(NodeId(mesh.nodes[vertex])).map(NodeId::index).filter(|&node| counts[node] > 1);
        // A long segment of a coarse tree may bow farther off; here the joint itself counts.
        joint.is_some_and(|node| mesh.positions[vertex].distance(tree.positions()[node]) < 2.5 * tree.radii()[node])
    };
    let vertices = (0..mesh.unique()).filter(is_at_joint);
    let distances = vertices.map(|vertex| {
        let (node, point) = (mesh.nodes[vertex] as usize, mesh.positions[vertex]);
        // Its own segment first, then all whose boxes come near.
        let mut least = clearance(tree, node, point);
        let near = Vec3::splat(mesh.radii[vertex]);
        index.candidates(point - near, point + near, |NodeId(node)| {
            least = least.min(clearance(tree, node as usize, point));
        });
        (vertex, least.abs() / tree.radii()[node])
    });
    let (vertex, distance) = distances.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((sight(tree, &index, mesh.nodes[vertex] as usize, mesh.positions[vertex]), distance))
}

/// A sight at a node's joint, or at the joint where its segment begins, if that is one.
fn sight(tree: &VesselTree, index: &SegmentIndex, node: usize, center: Vec3) -> Sight {
    let parent = |node: usize| tree.parent(NodeId(node as u32)).map(NodeId::index);
    let counts = tree.child_counts();
    let joint = if counts[node] > 1 { node } else { parent(node).unwrap_or(node) };
    let arms: Vec<Vec3> = (0..tree.len())
        .filter(|&child| parent(child) == Some(joint))
        .chain(parent(joint).map(|_| joint))
        .map(|child| tree.segment_vector(child).normalize_or_zero())
        .collect();
    let pairs = arms.iter().enumerate().flat_map(|(at, a)| arms[at + 1..].iter().map(move |b| a.cross(*b)));
    let across = pairs.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let across = across.and_then(Vec3::try_normalize).unwrap_or(Vec3::Z);
    let radius = tree.radii()[joint];
    // From the side, or at an angle to it if other vessels are in the way there.
    let tilts = arms.iter().flat_map(|arm| [*arm, -arm]).chain([Vec3::ZERO]);
    let views = tilts.flat_map(|tilt| [across, -across].map(|side| (side + 0.6 * tilt).normalize_or(side)));
    let view = |from: &Vec3| open_view(tree, index, center, radius, *from) + 0.2 * from.dot(KEY_LIGHT.normalize());
    let from = views.max_by(|a, b| view(a).total_cmp(&view(b))).unwrap_or(across);
    Sight { center, radius, from }
}

/// How much of a joint is seen from a direction, with the eye [`Sight::DISTANCE`] radii away: 1 for all of it, −1 if the
/// eye is inside a vessel.
fn open_view(tree: &VesselTree, index: &SegmentIndex, center: Vec3, radius: f32, from: Vec3) -> f32 {
    const RAYS: usize = 5;
    let aside = from.any_orthonormal_vector();
    let up = from.cross(aside);
    let targets = [Vec3::ZERO, aside, -aside, up, -up].map(|to| center + 1.5 * radius * to);
    let far = Sight::DISTANCE * radius;
    if index.first_hit(tree, center + far * from, -from, 0.0).is_some() {
        return -1.0;
    }
    // Up to the vessels of the joint itself.
    let is_free = |target: &Vec3| index.first_hit(tree, *target + far * from, -from, far - 3.0 * radius).is_none();
    targets.iter().filter(|target| is_free(target)).count() as f32 / RAYS as f32
}

/// Distance from a point to a segment's side, negative inside.
fn clearance(tree: &VesselTree, node: usize, point: Vec3) -> f32 {
    let (end, axis) = (tree.positions()[node], tree.segment_vector(node));
    let start = end - axis;
    let share = ((point - start).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    let share = if share.is_nan() { 1.0 } else { share };
    let radius = start_radius(tree, node);
    let radius = if radius > 0.0 { radius } else { tree.radii()[node] };
    point.distance(start + share * axis) - (radius + share * (tree.radii()[node] - radius))
}
