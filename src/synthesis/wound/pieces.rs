//! The remains of injured segments: pieces of vessel, and paths for the blood.
//!
//! In: [`Wounds`] and their tree. Out: the remaining pieces of a segment, as shares of it, and how each of them ends;
//! the nearest place of a remaining vessel to a point; and how far blood may flow into an injured segment from both
//! sides. The look of a piece is defined in [`instances`](crate::synthesis::instances).

use super::crossing::segment;
use super::injury::{Injury, Tip};
use crate::synthesis::haemodynamics::{EndSide, Interruption, Outlet};
use crate::synthesis::tree::{NodeId, Place, VesselTree};
use crate::synthesis::{
    segment_index::Region,
    wound::{EndId, Wounds},
};
use bevy_math::Vec3;
use std::ops::Range;

/// The kind of a piece of a severed segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PieceKind {
    /// Attached to the parent's node.
    Proximal,
    /// Between two cuts.
    Floating,
    /// Attached to the segment's own node.
    Distal,
}

/// How a piece ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PieceEnd {
    /// At the segment's own node, or its parent's, where the vessel continues.
    Node,
    /// At a cut that was sealed.
    Sealed,
    /// At a cut, with its lumen open. A clamp or tie on the piece makes no difference.
    Open,
}

/// A remaining piece of a severed segment.
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
    /// How it ends at `from` and at `to`.
    pub ends: [PieceEnd; 2],
}

/// How far blood may flow into an injured segment.
///
/// From the parent it reaches the share `first`, from the node the share `last`; the part in between carries nothing. A
/// clamp has both at its place, and no end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blockage {
    /// The node in which the segment ends.
    pub node: NodeId,
    /// Share at which the part fed by the parent is closed or severed.
    pub first: f32,
    /// Share at which the part fed back by the node is closed or severed. At least `first`.
    pub last: f32,
    /// The open end at `first`; `None` if the lumen is closed.
    pub proximal: Option<EndId>,
    /// The open end at `last`; `None` if the lumen is closed.
    pub distal: Option<EndId>,
}

impl Blockage {
    /// The same for the flow, on a vessel of a radius in tissue lengths.
    pub fn interruption(&self, radius: f32) -> Interruption {
        let outlet = |end: Option<EndId>| end.map(|_| Outlet { radius });
        let Self { first, last, .. } = *self;
        Interruption { first, last, proximal: outlet(self.proximal), distal: outlet(self.distal) }
    }
}

impl Wounds {
    /// Whether the segment of a node is severed, so that only its pieces remain.
    pub fn is_severed(&self, node: NodeId) -> bool {
        self.injury(node).is_some_and(|injury| !injury.gaps().is_empty())
    }

    /// The severed segments, in the order of their nodes.
    pub fn severed_segments(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.severed_within(0..usize::MAX)
    }

    /// The severed segments of a range of nodes, in order. The cost is that of these segments alone.
    pub fn severed_within(&self, nodes: Range<usize>) -> impl Iterator<Item = NodeId> + '_ {
        self.injuries_within(nodes).filter(|(_, injury)| !injury.gaps().is_empty()).map(|(node, _)| node)
    }

    /// The remaining pieces of a severed segment, from parent to node; none for a whole or wholly removed one.
    pub fn pieces(&self, node: NodeId) -> impl Iterator<Item = SegmentPiece> + '_ {
        self.injury(node).into_iter().flat_map(move |injury| {
            let gaps = injury.gaps();
            let piece = move |(index, [from, to]): (usize, [f32; 2])| {
                let kind = match index {
                    0 => PieceKind::Proximal,
                    _ if index == gaps.len() => PieceKind::Distal,
                    _ => PieceKind::Floating,
                };
                let before = index.checked_sub(1).map(|before| gaps[before].distal);
                let after = gaps.get(index).map(|gap| gap.proximal);
                SegmentPiece { node, kind, from, to, ends: [piece_end(before), piece_end(after)] }
            };
            let pieces = injury.pieces().enumerate().filter(move |_| !gaps.is_empty());
            pieces.map(piece).filter(|piece| piece.from < piece.to)
        })
    }

    /// Places of the severed ends of a segment, with their side of the cut, from parent to node: as in
    /// [`ends`](Self::ends), but without a tree.
    pub fn tips(&self, node: NodeId) -> impl Iterator<Item = (Place, EndSide)> + '_ {
        let gaps = self.injury(node).map_or(&[][..], Injury::gaps);
        gaps.iter().flat_map(move |gap| {
            let proximal = gap.proximal.map(|_| (Place::new(node, gap.from), EndSide::Proximal));
            let distal = gap.distal.map(|_| (Place::new(node, gap.to), EndSide::Distal));
            proximal.into_iter().chain(distal)
        })
    }

    /// How far blood may flow into a segment; `None` for an uninjured one.
    pub fn blockage(&self, node: NodeId) -> Option<Blockage> {
        self.injury(node).map(|injury| self.blockage_of(node, injury))
    }

    /// How far blood may flow into each injured segment, in the order of their nodes.
    pub fn blockages(&self) -> impl Iterator<Item = Blockage> + '_ {
        self.injuries().map(|(node, injury)| self.blockage_of(node, injury))
    }

    fn blockage_of(&self, node: NodeId, injury: &Injury) -> Blockage {
        let (first, proximal) = injury.reach_from_parent();
        let (last, distal) = injury.reach_from_node();
        let id = |end: u32| self.end_id(end);
        Blockage { node, first, last, proximal: proximal.map(id), distal: distal.map(id) }
    }

    /// The injured segments as gaps for the flow, in the order of their nodes, for
    /// [`Network::set_interruptions`](crate::synthesis::haemodynamics::Network::set_interruptions). A hole has the
    /// radius of its vessel. Segments that the tree doesn't have are left out.
    pub fn interruptions(&self, tree: &VesselTree) -> impl Iterator<Item = (NodeId, Interruption)> {
        self.blockages().filter_map(|blockage| {
            let radius = *tree.radii().get(blockage.node.index())?;
            Some((blockage.node, blockage.interruption(radius)))
        })
    }

    /// The nearest place of a remaining vessel to a point, and its distance: the vessel clicked, or touched by an
    /// instrument.
    ///
    /// Distances are to the vessel's wall, negative inside, so that a touched thick vessel is found before a thin one
    /// behind it. Of equally near vessels, the one with the lowest node is returned. `None` if none is within `reach`,
    /// or a number is not finite. Units: tissue lengths.
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

/// The end of a piece at a gap with that tip, or at a node if there is no gap.
fn piece_end(gap: Option<Option<Tip>>) -> PieceEnd {
    match gap {
        None => PieceEnd::Node,
        Some(Some(tip)) if !tip.sealed => PieceEnd::Open,
        Some(_) => PieceEnd::Sealed,
    }
}

/// Share and distance of the point nearest to `point` on a piece of a segment.
fn nearest_on(start: Vec3, end: Vec3, [from, to]: [f32; 2], point: Vec3) -> (f32, f32) {
    let (start, end, point) = (start.as_dvec3(), end.as_dvec3(), point.as_dvec3());
    let along = end - start;
    let share = (point - start).dot(along) / along.length_squared();
    // NaN if the segment has no length.
    let share = if share.is_nan() { from } else { share.clamp(f64::from(from), f64::from(to)) as f32 };
    (share, start.lerp(end, f64::from(share)).distance(point) as f32)
}
