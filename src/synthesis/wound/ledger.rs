//! The ledger of wounds of one tree: its contents and queries.

use crate::synthesis::{
    haemodynamics::EndSide,
    tree::{NodeId, Place, VesselTree},
    wound::{
        ClampId, EndId, Retraction, SeveredEnd, WoundError,
        crossing::{Severed, segment},
        injury::{Closure, ClosureKind, End, Injury},
    },
};
use std::{collections::BTreeMap, ops::Range};

/// All wounds of one tree.
///
/// The tree itself is not changed. It may grow and move, and every place keeps its share of its segment. All calls take
/// the tree that the wounds belong to; call [`clear`](Self::clear) after it was replaced.
///
/// `candidates(region, visit)` is the index over the tree's segments: it calls `visit` with at least those that meet a
/// region, as [`SegmentIndex::candidates_in`](crate::synthesis::segment_index::SegmentIndex::candidates_in) does. A cut
/// makes further queries, which the same closure answers: see
/// [`SegmentSearch`](crate::synthesis::segment_index::SegmentSearch).
#[derive(Clone, Debug, Default)]
pub struct Wounds {
    pub(super) retraction: Retraction,
    /// By node. None of them is empty.
    pub(super) injuries: BTreeMap<u32, Injury>,
    pub(super) ends: Vec<Record>,
    pub(super) clamps: Vec<Record>,
    pub(super) history: Vec<Action>,
    /// Previous states of the segments that these actions changed, in order.
    pub(super) before: Vec<(u32, Injury)>,
    pub(super) generation: u32,
    /// Crossings of the last cut, kept as memory for the next.
    pub(super) hits: Vec<Severed>,
}

/// An end or a clamp, in the order of creation.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Record {
    pub(super) node: u32,
    pub(super) generation: u32,
}

/// Lengths of the ledger's lists before an action.
#[derive(Clone, Copy, Debug)]
pub(super) struct Action {
    pub ends: usize,
    pub clamps: usize,
    pub before: usize,
}

impl Wounds {
    /// No wounds yet.
    ///
    /// # Errors
    /// A retraction outside its limits.
    pub fn new(retraction: Retraction) -> Result<Self, WoundError> {
        retraction.validate()?;
        Ok(Self { retraction, ..Self::default() })
    }

    /// The retraction of ends.
    pub fn retraction(&self) -> Retraction {
        self.retraction
    }

    /// Changes the retraction of the ends of later cuts.
    ///
    /// # Errors
    /// A value outside its limits.
    pub fn set_retraction(&mut self, retraction: Retraction) -> Result<(), WoundError> {
        retraction.validate()?;
        self.retraction = retraction;
        Ok(())
    }

    /// Whether every segment is as it grew.
    pub fn is_empty(&self) -> bool {
        self.injuries.is_empty()
    }

    /// Whether a vessel is severed, tied off or sealed: anything but clamps, which are taken off again.
    pub fn are_lasting(&self) -> bool {
        let is_clamp = |closure: &Closure| matches!(closure.kind, ClosureKind::Clamp(_));
        let is_lasting = |injury: &Injury| !injury.gaps().is_empty() || !injury.closures().iter().all(is_clamp);
        self.injuries.values().any(is_lasting)
    }

    /// Number of the last action that changed anything. It only rises, even with undo and clear, so that it
    /// distinguishes earlier from later things.
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// Number of actions that can be undone.
    pub fn actions(&self) -> usize {
        self.history.len()
    }

    /// The severed end with an id, at its present position; `None` if it no longer exists.
    pub fn end(&self, id: EndId, tree: &VesselTree) -> Option<SeveredEnd> {
        let record = self.ends.get(id.index as usize).filter(|record| record.generation == id.generation)?;
        let injury = self.injuries.get(&record.node)?;
        let end = injury.ends().find(|end| end.index == id.index)?;
        self.locate(tree, record.node, end)
    }

    /// All severed ends, open or not, at their present positions: in the order of the nodes, then from parent to node.
    pub fn ends<'a>(&'a self, tree: &'a VesselTree) -> impl Iterator<Item = SeveredEnd> + 'a {
        let of_segment = move |(&node, injury): (&u32, &'a Injury)| {
            injury.ends().filter_map(move |end| self.locate(tree, node, end))
        };
        self.injuries.iter().flat_map(of_segment)
    }

    /// The place of a clamp; `None` if it is no longer on.
    pub fn clamp_place(&self, clamp: ClampId) -> Option<Place> {
        let record = self.clamps.get(clamp.index as usize).filter(|record| record.generation == clamp.generation)?;
        let closures = self.injuries.get(&record.node)?.closures();
        let found = closures.iter().find(|closure| closure.kind == ClosureKind::Clamp(clamp.index))?;
        Some(Place::new(NodeId(record.node), found.from))
    }

    /// The clamps that are on, in the order of their nodes.
    pub fn clamps(&self) -> impl Iterator<Item = ClampId> + '_ {
        let id = |index: u32| ClampId { index, generation: self.clamps[index as usize].generation };
        self.injuries.values().flat_map(Injury::clamps).map(id)
    }

    /// Whether every injured segment exists in a tree, so that this may be the ledger of that tree.
    pub fn fits(&self, tree: &VesselTree) -> bool {
        self.injuries.keys().all(|&node| segment(tree, NodeId(node)).is_some())
    }

    /// The wounds, without the undo history.
    #[must_use]
    pub fn without_history(&self) -> Self {
        let Self { retraction, generation, .. } = *self;
        let (injuries, ends, clamps) = (self.injuries.clone(), self.ends.clone(), self.clamps.clone());
        Self { retraction, generation, injuries, ends, clamps, ..Self::default() }
    }

    /// The injured segments, in the order of their nodes.
    pub fn injured(&self) -> impl Iterator<Item = NodeId> + '_ {
        self.injuries().map(|(node, _)| node)
    }

    pub(super) fn injury(&self, node: NodeId) -> Option<&Injury> {
        self.injuries.get(&node.0)
    }

    pub(super) fn injuries(&self) -> impl Iterator<Item = (NodeId, &Injury)> {
        self.injuries.iter().map(|(&node, injury)| (NodeId(node), injury))
    }

    pub(super) fn injuries_within(&self, nodes: Range<usize>) -> impl Iterator<Item = (NodeId, &Injury)> {
        let bound = |node: usize| u32::try_from(node).unwrap_or(u32::MAX);
        // An empty range may be inverted, which a map does not accept.
        let nodes = bound(nodes.start)..bound(nodes.end.max(nodes.start));
        self.injuries.range(nodes).map(|(&node, injury)| (NodeId(node), injury))
    }

    pub(super) fn end_id(&self, index: u32) -> EndId {
        EndId { index, generation: self.ends[index as usize].generation }
    }

    /// A severed end at its position in the tree; `None` if the tree has no such segment.
    pub(super) fn locate(&self, tree: &VesselTree, node: u32, end: End) -> Option<SeveredEnd> {
        let place = Place::new(NodeId(node), end.along);
        let [start, stop] = segment(tree, place.node)?;
        // In f64, since the square of a short length may underflow in f32.
        let along = (stop.as_dvec3() - start.as_dvec3()).normalize_or_zero().as_vec3();
        Some(SeveredEnd {
            id: self.end_id(end.index),
            place,
            side: end.side,
            is_open: end.is_open,
            position: tree.position_at(place),
            direction: if end.side == EndSide::Proximal { along } else { -along },
            radius: tree.radii()[place.node.index()],
        })
    }
}
