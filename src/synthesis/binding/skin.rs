//! A closed surface that follows the nodes of its tree.
//!
//! In: a [`SurfaceMesh`] and its tree at rest; then the present positions of the nodes. Out: the present vertices, with
//! normals and tangents, at a cost linear in them.
//!
//! Every node has a rotation: the one that best turns its segments from rest to where they point now (the polar factor
//! of the sum of their outer products, found by the iteration of Müller et al. 2016, "A robust method to extract the
//! rotational part of deformations"). Segments in one line say nothing of the turn around that line; there, the rotation
//! of the node before counts, so that vessels don't twist. A vertex keeps its offset from the axis of its segment, in
//! the rotation of both of the segment's nodes, blended by where it lies along it; the axis leaves both nodes as they turn. So joints are as smooth as at rest,
//! vessels keep their radii however they are stretched, and a rigid motion of the nodes moves all vertices rigidly.

use super::BindingError;
use crate::synthesis::{
    pace::{Pace, at_once},
    parallel,
    surface::SurfaceMesh,
    tree::{NO_PARENT, VesselTree, sweep::Children},
};
use bevy_math::{Mat3, Quat, Vec3, Vec4};

/// Fewest vertices worth handing to another thread.
const WORTH_SHARING: usize = 1024;

/// Weight of the node before, where segments have a weight of 1 each.
const INERTIA: f32 = 0.25;

/// Weight below which a segment is too short for a direction.
const LEAST_WEIGHT: f32 = 0.25;

/// Steps of the iteration for a node's rotation, and for the first one of all.
const STEPS: usize = 8;
const FIRST_STEPS: usize = 40;

/// A vertex of a moved surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkinVertex {
    /// Position, in tissue lengths.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Unit tangent; its sign stays that of the surface at rest.
    pub tangent: Vec3,
}

/// The vertices of a surface, bound to the nodes of its tree at rest.
///
/// Memory: about 90 bytes for a vertex, and 80 for a node.
#[derive(Clone, Debug)]
pub struct Skin {
    segments: Vec<Segment>,
    bonds: Vec<Bond>,
    /// Scratch: sums of the outer products, rotations, and vertices.
    sums: Vec<Mat3>,
    turns: Vec<Quat>,
    moved: Vec<SkinVertex>,
}

/// A segment at rest.
#[derive(Clone, Copy, Debug)]
struct Segment {
    parent: u32,
    /// Its weight in the rotations of its nodes: 1, or less if it is shorter than it is wide.
    weight: f32,
    /// Unit direction, zero if it has none.
    direction: Vec3,
}

/// A vertex at rest.
#[derive(Clone, Copy, Debug)]
struct Bond {
    node: u32,
    /// The node's parent; the node itself for a root.
    parent: u32,
    /// Share of the way from the parent to the node.
    share: f32,
    /// From the axis there to the vertex.
    offset: Vec3,
    normal: Vec3,
    tangent: Vec3,
}

impl Skin {
    /// Binds a surface to the nodes of its tree, both at rest.
    ///
    /// # Errors
    /// [`BindingError::VertexNode`] if the surface is that of another tree.
    pub fn new(mesh: &SurfaceMesh, tree: &VesselTree) -> Result<Self, BindingError> {
        at_once(Self::new_paced(mesh, tree, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(mesh: &SurfaceMesh, tree: &VesselTree, pace: &Pace) -> Result<Self, BindingError> {
        let tangents = mesh.tangents_paced(&pace.part(0.0..0.1)).await;
        Self::with_tangents_paced(mesh, &tangents, tree, &pace.part(0.1..1.0)).await
    }

    /// The same for a surface whose [tangents](SurfaceMesh::tangents) are known.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub(crate) async fn with_tangents_paced(
        mesh: &SurfaceMesh,
        tangents: &[Vec4],
        tree: &VesselTree,
        pace: &Pace,
    ) -> Result<Self, BindingError> {
        let nodes = tree.len();
        if let Some(vertex) = mesh.nodes.iter().position(|&node| node as usize >= nodes) {
            return Err(BindingError::VertexNode { vertex, node: mesh.nodes[vertex], nodes });
        }
        let segment = |node: usize| {
            let along = tree.segment_vector(node);
            let weight = (along.length() / tree.radii()[node]).min(1.0);
            let weight = if weight.is_nan() { 0.0 } else { weight };
            Segment { parent: tree.parents()[node], weight, direction: along.normalize_or_zero() }
        };
        let segments = pace.part(0.0..0.2).collect(nodes, segment).await;
        let nearby = Nearby { tree, children: &tree.children() };
        let bond = |vertex: usize| Bond::of(mesh, vertex, tangents[vertex].truncate(), &nearby);
        let bonds = pace.part(0.2..1.0).collect(mesh.nodes.len(), bond).await;
        let (sums, turns) = (vec![Mat3::ZERO; nodes], vec![Quat::IDENTITY; nodes]);
        Ok(Self { segments, moved: vec![SkinVertex::default(); bonds.len()], bonds, sums, turns })
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    /// Whether there is no vertex.
    pub fn is_empty(&self) -> bool {
        self.bonds.is_empty()
    }

    /// The vertices for these positions of the nodes, in the order of the surface.
    ///
    /// With the feature `parallel`, many vertices are shared among the threads of the pool, with the same result.
    ///
    /// # Errors
    /// A number of positions other than that of the nodes.
    pub fn follow(&mut self, positions: &[Vec3]) -> Result<&[SkinVertex], BindingError> {
        if positions.len() != self.segments.len() {
            return Err(BindingError::NodeCount { bound: self.segments.len(), given: positions.len() });
        }
        self.turn(positions);
        let (turns, segments) = (&self.turns, &self.segments);
        let moved = |_, bond: &Bond| bond.moved(positions, turns, segments[bond.node as usize].direction);
        parallel::map_all(&self.bonds, &mut self.moved, WORTH_SHARING, moved);
        Ok(&self.moved)
    }

    /// Finds the rotations of all nodes.
    fn turn(&mut self, positions: &[Vec3]) {
        let Self { segments, sums, turns, .. } = self;
        sums.fill(Mat3::ZERO);
        let mut whole = Mat3::ZERO;
        for (node, segment) in segments.iter().enumerate().filter(|(_, segment)| segment.parent != NO_PARENT) {
            let parent = segment.parent as usize;
            let now = (positions[node] - positions[parent]).normalize_or_zero() * segment.weight;
            let Vec3 { x, y, z } = segment.direction;
            let product = Mat3::from_cols(now * x, now * y, now * z);
            sums[node] += product;
            sums[parent] += product;
            whole += product;
        }
        let first = first_rotation(whole);
        for (node, segment) in segments.iter().enumerate() {
            let before = if segment.parent == NO_PARENT { first } else { turns[segment.parent as usize] };
            let start = if segment.parent == NO_PARENT || segment.weight < LEAST_WEIGHT {
                before
            } else {
                let now = (positions[node] - positions[segment.parent as usize]).normalize_or_zero();
                aligned(before, segment.direction, now)
            };
            turns[node] = rotation(sums[node] + Mat3::from_quat(start) * INERTIA, start, STEPS);
        }
    }
}

impl Bond {
    fn of(mesh: &SurfaceMesh, vertex: usize, tangent: Vec3, nearby: &Nearby) -> Self {
        let (at, tree) = (mesh.positions[vertex], nearby.tree);
        let node = nearby.nearest(mesh.nodes[vertex], at);
        let normal = mesh.normals.get(vertex).copied().unwrap_or_default();
        let (parent, start, share) = nearby.foot(node, at);
        Self { node, parent, share, offset: at - start.lerp(tree.positions()[node as usize], share), normal, tangent }
    }

    #[inline]
    fn moved(&self, positions: &[Vec3], turns: &[Quat], direction: Vec3) -> SkinVertex {
        let (parent, node) = (self.parent as usize, self.node as usize);
        let (before, after) = (turns[parent], turns[node]);
        let after = if before.dot(after) < 0.0 { -after } else { after };
        let turn = Mat3::from_quat((before * (1.0 - self.share) + after * self.share).normalize());
        let axis = leaves_as_turned([positions[parent], positions[node]], [before, after], direction, self.share);
        SkinVertex { position: axis + turn * self.offset, normal: turn * self.normal, tangent: turn * self.tangent }
    }
}

/// The point of a moved segment's axis at a share of the way: on a cubic that leaves both nodes as their rotations turn
/// the segment's direction at rest. So the wall around a joint turns as one, whichever of its segments a vertex has.
#[inline]
fn leaves_as_turned([from, to]: [Vec3; 2], turns: [Quat; 2], direction: Vec3, share: f32) -> Vec3 {
    let chord = to - from;
    let along = direction * chord.length();
    let straight = from + chord * share;
    if along == Vec3::ZERO {
        return straight;
    }
    let rest = 1.0 - share;
    let [first, last] = turns.map(|turn| turn * along - chord);
    straight + (first * rest - last * share) * (share * rest)
}

/// The segments around a vertex. A surface's faces may be longer than segments, so that a vertex lies beside another
/// segment than that of its node.
struct Nearby<'a> {
    tree: &'a VesselTree,
    children: &'a Children,
}

impl Nearby<'_> {
    /// The most segments between a vertex's node and its segment.
    const MOST_STEPS: usize = 256;
    /// Distance up to which a vertex counts as beside its segment, in radii: smooth curves bow out of segments.
    const BESIDE: f32 = 3.0;
    /// Another segment counts as nearer only if it is so by more than rounding errors.
    const NEARER: f32 = 0.999;

    /// The segment whose axis is nearest to a point, in its radii: found from one segment to the next.
    fn nearest(&self, mut node: u32, at: Vec3) -> u32 {
        let (_, _, share) = self.foot(node, at);
        let mut least = self.distance(node, at);
        // A vertex beside its own segment stays there, even where another one passes near by.
        if share > 0.0 && share < 1.0 && least < Self::BESIDE {
            return node;
        }
        for _ in 0..Self::MOST_STEPS {
            let parent = self.tree.parents()[node as usize];
            let siblings = if parent == NO_PARENT { &[][..] } else { self.children.of(parent as usize) };
            let others = self.children.of(node as usize).iter().chain(siblings).copied();
            let others = others.chain((parent != NO_PARENT).then_some(parent));
            let best = others.map(|other| (self.distance(other, at), other)).min_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((distance, other)) if distance < least * Self::NEARER => (least, node) = (distance, other),
                _ => break,
            }
        }
        node
    }

    /// Distance of a point from a segment's axis, in its radii.
    fn distance(&self, node: u32, at: Vec3) -> f32 {
        let (_, start, share) = self.foot(node, at);
        at.distance(start.lerp(self.tree.positions()[node as usize], share)) / self.tree.radii()[node as usize]
    }

    /// The parent of a segment's node, its position, and the share of the segment that is nearest to a point. A root is
    /// its own parent.
    fn foot(&self, node: u32, at: Vec3) -> (u32, Vec3, f32) {
        let (tree, end) = (self.tree, self.tree.positions()[node as usize]);
        let parent = match tree.parents()[node as usize] {
            NO_PARENT => return (node, end, 1.0),
            parent => parent,
        };
        let start = tree.positions()[parent as usize];
        let along = end - start;
        let share = ((at - start).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (parent, start, if share.is_nan() { 1.0 } else { share })
    }
}

/// A rotation, turned on by the shortest way so that it takes a direction at rest to the present one.
fn aligned(before: Quat, rest: Vec3, now: Vec3) -> Quat {
    let turned = before * rest;
    if turned == Vec3::ZERO || now == Vec3::ZERO {
        return before;
    }
    (Quat::from_rotation_arc(turned.normalize(), now) * before).normalize()
}

/// The rotation nearest to a matrix, from any start: the best of four that lie far apart.
fn first_rotation(matrix: Mat3) -> Quat {
    if matrix == Mat3::ZERO {
        return Quat::IDENTITY;
    }
    let starts = [(0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)];
    let ends = starts.map(|(x, y, z, w)| rotation(matrix, Quat::from_xyzw(x, y, z, w), FIRST_STEPS));
    let agreement = |turn: Quat| {
        let turn = Mat3::from_quat(turn);
        turn.x_axis.dot(matrix.x_axis) + turn.y_axis.dot(matrix.y_axis) + turn.z_axis.dot(matrix.z_axis)
    };
    // The first of equals, so that straight vessels at rest have no rotation.
    let better = |best: Quat, end: Quat| if agreement(end) > agreement(best) + 1e-4 { end } else { best };
    let best = ends.into_iter().reduce(better).unwrap_or_default();
    // A start that is almost a turn by two right angles away leaves it slowly.
    rotation(matrix, best, FIRST_STEPS)
}

/// The rotation nearest to a matrix, from a start.
fn rotation(matrix: Mat3, start: Quat, steps: usize) -> Quat {
    let mut turn = start;
    for _ in 0..steps {
        let Mat3 { x_axis: x, y_axis: y, z_axis: z } = Mat3::from_quat(turn);
        let torque = x.cross(matrix.x_axis) + y.cross(matrix.y_axis) + z.cross(matrix.z_axis);
        let size = x.dot(matrix.x_axis) + y.dot(matrix.y_axis) + z.dot(matrix.z_axis);
        let step = torque / (size.abs() + f32::MIN_POSITIVE);
        if !(step.length_squared() > 1e-12) || !step.is_finite() {
            break;
        }
        // The half angle's tangent in place of the angle: no farther than meant, and without trigonometry.
        let Vec3 { x, y, z } = 0.5 * step;
        turn = (Quat::from_xyzw(x, y, z, 1.0).normalize() * turn).normalize();
    }
    turn
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_found_from_afar_and_left_alone_where_nothing_is_known() {
        for angle in [0.0f32, 0.5, 2.0, 3.1, std::f32::consts::PI] {
            for axis in [Vec3::X, Vec3::new(1.0, -2.0, 0.5).normalize(), Vec3::Z] {
                let turn = Quat::from_axis_angle(axis, angle);
                let stretched = Mat3::from_quat(turn) * Mat3::from_diagonal(Vec3::new(3.0, 1.0, 0.5));
                let found = first_rotation(stretched);
                assert!(found.angle_between(turn) < 1e-3, "{angle} about {axis}: {found}");
            }
        }
        assert_eq!(first_rotation(Mat3::ZERO), Quat::IDENTITY);
        let line = Mat3::from_cols(Vec3::X, Vec3::ZERO, Vec3::ZERO);
        assert_eq!(first_rotation(line), Quat::IDENTITY);
    }
}
