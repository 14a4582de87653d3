//! What injuries leave of their segments: to draw, to find, and for the flow.
//!
//! In: [`Wounds`] and their tree. Out: the pieces of vessel that are left of a segment, as shares of it or as
//! [`SegmentInstance`]s; the place nearest to a point where there still is a vessel; and how far blood may come into an
//! injured segment from both sides.

use super::crossing::segment;
use super::injury::{Gap, Injury, Tip};
use crate::synthesis::haemodynamics::{Interruption, Outlet};
use crate::synthesis::instances::{SegmentColors, SegmentInstance, segment_instance};
use crate::synthesis::tree::{NodeId, Place, VesselTree};
use crate::synthesis::{
    segment_index::Region,
    wound::{EndId, Wounds},
};
use bevy_math::Vec3;
use std::ops::Range;

/// Which piece of a severed segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PieceKind {
    /// Hangs on the parent's node.
    Proximal,
    /// Between two cuts.
    Floating,
    /// Hangs on the segment's own node.
    Distal,
}

/// A piece that is left of a severed segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentPiece {
    /// The node in which the segment ends.
    pub node: NodeId,
    /// Which piece.
    pub kind: PieceKind,
    /// Share of the segment, from the parent, at which it begins.
    pub from: f32,
    /// Share at which it ends; above `from`.
    pub to: f32,
}

/// How far blood may come into an injured segment.
///
/// From the parent it reaches the share `first`, from the node the share `last`; what lies between carries nothing. A
/// plain clamp has both at its place, and no end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blockage {
    /// The node in which the segment ends.
    pub node: NodeId,
    /// Share at which what the parent feeds is closed or severed.
    pub first: f32,
    /// Share at which what the node feeds back is closed or severed. At least `first`.
    pub last: f32,
    /// The open end at `first`; `None` where the lumen is closed.
    pub proximal: Option<EndId>,
    /// The open end at `last`; `None` where the lumen is closed.
    pub distal: Option<EndId>,
}

impl Blockage {
    /// The same as the flow has it, on a vessel of a radius in tissue lengths.
    pub fn interruption(&self, radius: f32) -> Interruption {
        let outlet = |end: Option<EndId>| end.map(|_| Outlet { radius });
        let Self { first, last, .. } = *self;
        Interruption { first, last, proximal: outlet(self.proximal), distal: outlet(self.distal) }
    }
}

/// How far the round end that a segment is drawn with reaches beyond its end, in radii.
pub(super) const END_DOME: f32 = 1.0;
/// The same beyond its start, where the dome is shallow.
pub(super) const START_DOME: f32 = 0.4;
/// How deep one looks into the lumen of an open end, in radii.
pub(super) const LUMEN_DEPTH: f32 = 1.2;
/// Most of a piece that the round ends of its cuts may take.
const MOST_DOME: f32 = 0.9;

impl Wounds {
    /// Whether the segment of a node is severed, so that only its pieces are left.
    pub fn is_severed(&self, node: NodeId) -> bool {
        self.injury(node).is_some_and(|injury| !injury.gaps().is_empty())
    }

    /// The severed segments, in the order of their nodes.
    pub fn severed_segments(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.severed_within(0..usize::MAX)
    }

    /// The severed segments of a range of nodes, in their order, at the cost of those alone.
    pub fn severed_within(&self, nodes: Range<usize>) -> impl Iterator<Item = NodeId> + '_ {
        self.injuries_within(nodes).filter(|(_, injury)| !injury.gaps().is_empty()).map(|(node, _)| node)
    }

    /// Whether the segment of a node is drawn otherwise than it grew, by [`write_stumps_of`]: because it is severed, or
    /// because its round end would hide the gap of another.
    pub fn is_redrawn(&self, node: NodeId) -> bool {
        self.injury(node).is_some_and(Injury::is_redrawn)
    }

    /// The segments of a range of nodes that are drawn otherwise than they grew, in their order, at the cost of those that
    /// anything was done to.
    pub fn redrawn_within(&self, nodes: Range<usize>) -> impl Iterator<Item = NodeId> + '_ {
        self.injuries_within(nodes).filter(|(_, injury)| injury.is_redrawn()).map(|(node, _)| node)
    }

    /// What is left of a severed segment, from parent to node; nothing of one that is whole, or wholly taken out.
    pub fn pieces(&self, node: NodeId) -> impl Iterator<Item = SegmentPiece> + '_ {
        self.injury(node).into_iter().flat_map(move |injury| {
            let gaps = injury.gaps().len();
            let kind = move |index: usize| match index {
                0 => PieceKind::Proximal,
                _ if index == gaps => PieceKind::Distal,
                _ => PieceKind::Floating,
            };
            let pieces = injury.pieces().enumerate().filter(move |_| gaps > 0);
            let pieces = pieces.map(move |(index, [from, to])| SegmentPiece { node, kind: kind(index), from, to });
            pieces.filter(|piece| piece.from < piece.to)
        })
    }

    /// How far blood may come into a segment; `None` for one to which nothing was done.
    pub fn blockage(&self, node: NodeId) -> Option<Blockage> {
        self.injury(node).filter(|injury| injury.is_injured()).map(|injury| self.blockage_of(node, injury))
    }

    /// How far blood may come into each injured segment, in the order of their nodes.
    pub fn blockages(&self) -> impl Iterator<Item = Blockage> + '_ {
        let injured = self.injuries().filter(|(_, injury)| injury.is_injured());
        injured.map(|(node, injury)| self.blockage_of(node, injury))
    }

    fn blockage_of(&self, node: NodeId, injury: &Injury) -> Blockage {
        let (first, proximal) = injury.reach_from_parent();
        let (last, distal) = injury.reach_from_node();
        let id = |end: u32| self.end_id(end);
        Blockage { node, first, last, proximal: proximal.map(id), distal: distal.map(id) }
    }

    /// The injured segments as gaps for the flow, in the order of their nodes: what
    /// [`Network::set_interruptions`](crate::synthesis::haemodynamics::Network::set_interruptions) takes. A hole has the
    /// radius of its vessel. Segments that the tree doesn't have are left out.
    pub fn interruptions(&self, tree: &VesselTree) -> impl Iterator<Item = (NodeId, Interruption)> {
        self.blockages().filter_map(|blockage| {
            let radius = *tree.radii().get(blockage.node.index())?;
            Some((blockage.node, blockage.interruption(radius)))
        })
    }

    /// The place where a vessel still is that is nearest to a point, and its distance: what was clicked, or what an
    /// instrument touches.
    ///
    /// Distances are to the vessel's wall, negative within, so that a thick vessel that is touched is found before a thin
    /// one behind it. Of equally near vessels the one of the lowest node counts. `None` where none is within `reach`, or
    /// a number is not finite. Units: tissue lengths.
    pub fn nearest_place(
        &self,
        tree: &VesselTree,
        mut candidates: impl FnMut(&Region, &mut dyn FnMut(NodeId)),
        point: Vec3,
        reach: f32,
    ) -> Option<(Place, f32)> {
        let mut best: Option<(Place, f32)> = None;
        if !(point.is_finite() && reach >= 0.0 && reach.is_finite()) {
            return None;
        }
        candidates(&Region::between(point - reach, point + reach), &mut |node| {
            let Some([parent, end]) = segment(tree, node) else { return };
            let radius = tree.radii()[node.index()];
            let mut try_piece = |[from, to]: [f32; 2]| {
                let (along, distance) = nearest_on(parent, end, [from, to], point);
                let distance = distance - radius;
                let nearer = best.is_none_or(|(place, least)| {
                    distance < least || (distance == least && (node, along) < (place.node, place.along))
                });
                if distance <= reach && nearer {
                    best = Some((Place::new(node, along), distance));
                }
            };
            match self.injury(node) {
                None => try_piece([0.0, 1.0]),
                Some(injury) => injury.pieces().filter(|[from, to]| from < to).for_each(try_piece),
            }
        });
        best
    }
}

/// Share and distance of the point nearest to `point` on a piece of a segment.
fn nearest_on(start: Vec3, end: Vec3, [from, to]: [f32; 2], point: Vec3) -> (f32, f32) {
    let (start, end, point) = (start.as_dvec3(), end.as_dvec3(), point.as_dvec3());
    let along = end - start;
    let share = (point - start).dot(along) / along.length_squared();
    // Not a number where the segment has no length.
    let share = if share.is_nan() { from } else { share.clamp(f64::from(from), f64::from(to)) as f32 };
    (share, start.lerp(end, f64::from(share)).distance(point) as f32)
}

/// Appends to `out` what is left of the severed segments, and those beside them that are drawn otherwise, as instances: in
/// the order of their nodes, then from parent to node. Their own slots are to be hidden while [`Wounds::is_redrawn`].
///
/// `birth_steps` and `colors` as for [`write_segments`](crate::synthesis::instances::write_segments).
pub fn write_stumps(
    wounds: &Wounds,
    tree: &VesselTree,
    birth_steps: &[u32],
    colors: &SegmentColors,
    out: &mut Vec<SegmentInstance>,
) {
    for node in wounds.redrawn_within(0..tree.len()) {
        write_stumps_of(wounds, node, tree, birth_steps, colors, out);
    }
}

/// Appends what is left of one segment; nothing if it is drawn as it grew, wholly taken out, or not of the tree.
///
/// A piece is drawn with the taper that the whole segment has. An end with a lumen is
/// [open](SegmentInstance::is_open), and ends flat. A sealed one is round; its round end stays within the piece, and one
/// too short for it ends more bluntly. Whole segments whose round ends would reach past it are open, too, where the next
/// segment covers that. So gaps are as wide as the ledger has them.
pub fn write_stumps_of(
    wounds: &Wounds,
    node: NodeId,
    tree: &VesselTree,
    birth_steps: &[u32],
    colors: &SegmentColors,
    out: &mut Vec<SegmentInstance>,
) {
    let (Some(injury), Some([start, end])) = (wounds.injury(node), segment(tree, node)) else { return };
    if !injury.is_redrawn() {
        return;
    }
    let birth = birth_steps.get(node.index()).copied().unwrap_or(0);
    let whole = segment_instance(tree, node.index(), birth, colors);
    let cover = cover(wounds, tree, node, end - start);
    for [from, to] in injury.pieces().filter(|[from, to]| from < to) {
        out.push(draw(&whole, [start, end], [from, to], ends(injury, [from, to]), cover));
    }
}

/// How far a segment is drawn into its parent, to cover the rim of that where it is flat and the vessel bends there. 0
/// where the parent has its round end.
fn cover(wounds: &Wounds, tree: &VesselTree, node: NodeId, along: Vec3) -> f32 {
    let Some(parent) = tree.parent(node) else { return 0.0 };
    if !wounds.injury(parent).is_some_and(|injury| injury.flat()[1]) {
        return 0.0;
    }
    let (before, along) = (tree.segment_vector(parent.index()).normalize_or_zero(), along.normalize_or_zero());
    let sine = if before.dot(along) > 0.0 { before.cross(along).length() } else { 1.0 };
    sine * tree.radii()[parent.index()]
}

/// How a piece ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum PieceEnd {
    /// In the segment's own node, or its parent's.
    Node,
    /// At a cut that was sealed.
    Sealed,
    /// At a cut, with its lumen open, or in a node where a round end would be in the way.
    Open,
}

/// How a piece ends towards the parent, and towards the node.
fn ends(injury: &Injury, [from, to]: [f32; 2]) -> [PieceEnd; 2] {
    let end = |gap: Option<&Gap>, tip: fn(&Gap) -> Option<Tip>, flat: bool| match gap.map(tip) {
        None if !flat => PieceEnd::Node,
        None => PieceEnd::Open,
        Some(Some(tip)) if !tip.sealed => PieceEnd::Open,
        Some(_) => PieceEnd::Sealed,
    };
    let before = injury.gaps().iter().find(|gap| gap.to == from);
    let after = injury.gaps().iter().find(|gap| gap.from == to);
    let [flat_start, flat_end] = injury.flat();
    [end(before, |gap| gap.distal, flat_start), end(after, |gap| gap.proximal, flat_end)]
}

fn draw(
    whole: &SegmentInstance,
    [start, end]: [Vec3; 2],
    [from, to]: [f32; 2],
    ends: [PieceEnd; 2],
    cover: f32,
) -> SegmentInstance {
    let length = start.distance(end);
    let radius = |share: f32| whole.start_radius + (whole.end_radius - whole.start_radius) * share;
    let room = MOST_DOME * length * (to - from);
    let domes = [
        if ends[0] == PieceEnd::Sealed { START_DOME * radius(from) } else { 0.0 },
        if ends[1] == PieceEnd::Sealed { END_DOME * radius(to) } else { 0.0 },
    ];
    // How much of their size the round ends have room for.
    let fit = (room / (domes[0] + domes[1]).max(f32::MIN_POSITIVE)).min(1.0);
    let [mut back, ahead] = domes.map(|dome| fit * dome / length);
    if ends[0] == PieceEnd::Node {
        back = -cover / length;
    }
    let size = |end: PieceEnd, share: f32| match end {
        PieceEnd::Node => radius(share),
        PieceEnd::Sealed => fit * radius(share),
        PieceEnd::Open => -radius(share),
    };
    SegmentInstance {
        start: start.lerp(end, from + back).to_array(),
        start_radius: size(ends[0], from),
        end: start.lerp(end, to - ahead).to_array(),
        end_radius: size(ends[1], to),
        ..*whole
    }
}
