//! Finds the segments that a blade severs, and the places.
//!
//! In: a [`Blade`] in the tree's own space, a [`VesselTree`] and the segments that may be near. Out: one [`Severed`] for
//! every place at which a centre line is severed.
//!
//! # What counts
//!
//! - A vessel is severed where its **centre line** meets the blade. A blade that only nicks the wall, or a sweep that ends
//!   within a thick vessel before its middle, severs nothing.
//! - A segment owns its end at its own node, not the one at its parent. So a blade through a shared node severs the one
//!   segment that leads there and none of those that leave, and cuts every path from the root to a tip once. A root, to
//!   which no segment leads, is not severed.
//! - A segment within the plane of a triangle is not severed by it.
//! - A centre line that touches an edge or corner of a surface is severed there once, however many triangles share it.
//! - A line that touches a volume in only one point, between nodes, is not severed; a node on the boundary is inside.
//! - Crossings of one blade with one segment at the same share, as an `f32`, count as one.
//!
//! # Exactness
//!
//! For triangles every decision is a sign of [`orientation`], which is exact, so rounding neither loses nor repeats a
//! crossing. For curved shapes it is a sign in f64 that depends on the node alone, or, between two nodes on the same
//! side, on a root in f64. In both cases neighbours agree about their shared node.

use super::blade::{Blade, Disc, Part, Volume};
use crate::synthesis::segment_index::Region;
use crate::synthesis::space::exact_side::orientation;
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use bevy_math::{DVec3, Vec3};

/// The part of one segment that a blade removes: a stretch of its centre line, without length if the blade is a
/// surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Severed {
    /// The node in which the segment ends.
    pub node: NodeId,
    /// Share of the segment, from the parent, at which the stretch begins. Limits: 0 to 1.
    pub from: f32,
    /// Share at which it ends: `from` for a surface.
    pub to: f32,
    /// Whether the vessel continues towards the root from `from`, so that it is severed there. Otherwise the parent is
    /// inside the blade, too.
    pub enters: bool,
    /// Whether it continues towards the node from `to`.
    pub leaves: bool,
}

/// Clears `found` and collects in it what a blade severs: in the order of the nodes, then from parent to node.
///
/// The blade is in the tree's space. `candidates(region, visit)` calls `visit` with at least the nodes whose segments
/// meet the region; others, and repeats, do no harm.
pub fn severed(
    blade: &Blade,
    tree: &VesselTree,
    mut candidates: impl FnMut(&Region, &mut dyn FnMut(NodeId)),
    found: &mut Vec<Severed>,
) {
    found.clear();
    blade.parts(|region, part| {
        candidates(region, &mut |node| {
            if let Some([parent, end]) = segment(tree, node) {
                sever(part, node, parent, end, found);
            }
        });
    });
    found.sort_unstable_by(|a, b| a.node.cmp(&b.node).then(a.from.total_cmp(&b.from)));
    found.dedup_by(|a, b| a.node == b.node && a.from == b.from);
}

/// The ends of a segment; `None` for a root, or a node that is not in the tree.
pub(super) fn segment(tree: &VesselTree, node: NodeId) -> Option<[Vec3; 2]> {
    let parent = *tree.parents().get(node.index())?;
    (parent != NO_PARENT).then(|| [tree.positions()[parent as usize], tree.positions()[node.index()]])
}

fn sever(part: Part, node: NodeId, parent: Vec3, end: Vec3, found: &mut Vec<Severed>) {
    let at = |share: f64| {
        let share = share.clamp(0.0, 1.0) as f32;
        Severed { node, from: share, to: share, enters: true, leaves: true }
    };
    match part {
        Part::Triangles(triangles) => {
            found.extend(triangles.iter().filter_map(|&corners| crosses_triangle(parent, end, corners)).map(at));
        }
        Part::Disc(disc) => found.extend(crosses_disc(parent, end, disc).map(at)),
        Part::Volume(volume) => {
            found.extend(within(volume, parent, end).map(|inside| Severed {
                node,
                from: inside.from as f32,
                to: inside.to as f32,
                enters: !inside.parent,
                leaves: !inside.end,
            }));
        }
    }
}

/// The share at which a segment, without its start, passes through a triangle.
///
/// Triangles that share the edge or corner through which it passes give the same share bit for bit, since it is
/// computed from that edge or corner alone.
fn crosses_triangle(start: Vec3, end: Vec3, [a, b, c]: [Vec3; 3]) -> Option<f64> {
    if apart(start, end, [a, b, c]) {
        return None;
    }
    let before = orientation(a, b, c, start);
    let after = orientation(a, b, c, end);
    if before == 0.0 || (before > 0.0 && after > 0.0) || (before < 0.0 && after < 0.0) {
        return None;
    }
    let sides = [orientation(start, end, a, b), orientation(start, end, b, c), orientation(start, end, c, a)];
    if sides.iter().any(|&side| side > 0.0) && sides.iter().any(|&side| side < 0.0) {
        return None;
    }
    if after == 0.0 {
        return Some(1.0);
    }
    Some(match sides.map(|side| side == 0.0) {
        [true, false, false] => share_of_edge(start, end, a, b),
        [false, true, false] => share_of_edge(start, end, b, c),
        [false, false, true] => share_of_edge(start, end, c, a),
        [true, true, _] => share_of_corner(start, end, b),
        [_, true, true] => share_of_corner(start, end, c),
        [true, _, true] => share_of_corner(start, end, a),
        [false, false, false] => before / (before - after),
    })
}

/// Whether boxes alone show that a segment and a triangle share no point.
fn apart(start: Vec3, end: Vec3, [a, b, c]: [Vec3; 3]) -> bool {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    start.max(end).cmplt(low).any() || start.min(end).cmpgt(high).any()
}

/// Share of a segment at which it meets an edge that it is known to meet.
fn share_of_edge(start: Vec3, end: Vec3, a: Vec3, b: Vec3) -> f64 {
    // Makes the result the same for both directions of the edge.
    let (a, b) = if a.to_array() <= b.to_array() { (a, b) } else { (b, a) };
    let (start, a) = (start.as_dvec3(), a.as_dvec3());
    let edge = b.as_dvec3() - a;
    let across = (end.as_dvec3() - start).cross(edge);
    (a - start).cross(edge).dot(across) / across.length_squared()
}

/// Share of a segment at which it passes a point that it is known to pass.
fn share_of_corner(start: Vec3, end: Vec3, corner: Vec3) -> f64 {
    let start = start.as_dvec3();
    let along = end.as_dvec3() - start;
    (corner.as_dvec3() - start).dot(along) / along.length_squared()
}

/// The share at which a segment, without its start, passes through a disc.
fn crosses_disc(start: Vec3, end: Vec3, disc: &Disc) -> Option<f64> {
    let [start, end] = [start, end].map(|point| disc.frame.inward.transform_point3(point.as_dvec3()) - disc.center);
    let (before, after) = (start.dot(disc.normal), end.dot(disc.normal));
    if before == 0.0 || (before > 0.0 && after > 0.0) || (before < 0.0 && after < 0.0) {
        return None;
    }
    let share = if after == 0.0 { 1.0 } else { before / (before - after) };
    (start.lerp(end, share).length_squared() <= disc.radius * disc.radius).then_some(share)
}

/// The part of a segment that lies in a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Within {
    pub from: f64,
    pub to: f64,
    /// Whether the parent's end is inside; then `from` is 0.
    pub parent: bool,
    /// Whether the node's end is inside; then `to` is 1.
    pub end: bool,
}

/// The part of a segment that lies in a volume; `None` if they share at most one point between the ends.
pub(super) fn within(volume: &Volume, start: Vec3, end: Vec3) -> Option<Within> {
    let [start, end] = [start, end].map(|point| volume.frame.inward.transform_point3(point.as_dvec3()));
    let (parent_inside, end_inside) = (volume.contains(start), volume.contains(end));
    let range = if parent_inside && end_inside { None } else { volume.along(start, end - start) };
    let (from, to) = match (parent_inside, end_inside) {
        (true, true) => (0.0, 1.0),
        // If rounding finds no root beside a node on the boundary, it is at the node.
        (true, false) => (0.0, range.map_or(0.0, |[_, to]| to)),
        (false, true) => (range.map_or(1.0, |[from, _]| from), 1.0),
        (false, false) => {
            let [from, to] = range?;
            // The line enters and then leaves, between the ends or not at all.
            if !(from < to && from > 0.0 && to < 1.0) {
                return None;
            }
            (from, to)
        }
    };
    Some(Within { from: from.clamp(0.0, 1.0), to: to.clamp(0.0, 1.0), parent: parent_inside, end: end_inside })
}

impl Volume {
    /// Whether a point of the shape's space lies within, the boundary included.
    fn contains(&self, point: DVec3) -> bool {
        let axis = self.to - self.from;
        let offset = point - self.from;
        let share = (offset.dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
        // The share is NaN if the axis has no length.
        let nearest = if share.is_nan() { offset } else { offset - share * axis };
        nearest.length_squared() <= self.radius * self.radius
    }

    /// Positions at which a line of the shape's space enters and leaves, in multiples of `along`.
    fn along(&self, start: DVec3, along: DVec3) -> Option<[f64; 2]> {
        // A capsule is convex, so its intersection with the line is one piece, from the first entry into one of its
        // three parts to the last exit.
        let ends = [self.from, self.to].map(|center| in_ball(start - center, along, self.radius));
        let parts = [ends[0], ends[1], self.in_cylinder(start, along)];
        parts.into_iter().flatten().reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
    }

    /// Positions at which a line enters and leaves the cylinder between the two ends.
    fn in_cylinder(&self, start: DVec3, along: DVec3) -> Option<[f64; 2]> {
        let axis = (self.to - self.from).try_normalize()?;
        let offset = start - self.from;
        let (height, climb) = (offset.dot(axis), along.dot(axis));
        let round = if along.reject_from_normalized(axis) == DVec3::ZERO {
            // Along the axis: inside everywhere or nowhere.
            let inside = offset.reject_from_normalized(axis).length_squared() <= self.radius * self.radius;
            inside.then_some([f64::NEG_INFINITY, f64::INFINITY])
        } else {
            in_ball(offset - height * axis, along - climb * axis, self.radius)
        }?;
        let length = (self.to - self.from).length();
        let slab = if climb == 0.0 {
            (0.0..=length).contains(&height).then_some([f64::NEG_INFINITY, f64::INFINITY])
        } else {
            let (a, b) = (-height / climb, (length - height) / climb);
            Some([a.min(b), a.max(b)])
        }?;
        let [from, to] = [round[0].max(slab[0]), round[1].min(slab[1])];
        (from <= to).then_some([from, to])
    }
}

/// Positions at which a line enters and leaves the ball of a radius around the origin.
fn in_ball(start: DVec3, along: DVec3, radius: f64) -> Option<[f64; 2]> {
    let length_squared = along.length_squared();
    if length_squared == 0.0 {
        return None;
    }
    // From the point nearest to the centre, so that a distant start costs no accuracy.
    let middle = -start.dot(along) / length_squared;
    let height_squared = (start + middle * along).length_squared();
    let half = ((radius * radius - height_squared) / length_squared).sqrt();
    // NaN if the line misses.
    (half >= 0.0).then_some([middle - half, middle + half])
}
