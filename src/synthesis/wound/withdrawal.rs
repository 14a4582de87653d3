//! Rest positions of severed ends, and the resulting changes of segments.
//!
//! In: a tree with its wounds, all places at which a blade severs it, and a [`Retraction`]. Out: the changes to each
//! segment, planned before any of them is made, so that the order of the places doesn't matter.
//!
//! An end retracts along the centre line, through nodes that only join two segments. Segments that it passes are
//! removed; the end lies on the one where it comes to rest.

use super::crossing::{Severed, segment};
use super::injury::{Gap, Injury, NO_INJURY, Removal, Tip};
use crate::synthesis::haemodynamics::EndSide;
use crate::synthesis::tree::{NodeId, Place, VesselTree};
use crate::synthesis::{segment_index::SegmentSearch, wound::Retraction};
use std::collections::BTreeMap;

/// [`Retraction::MOST`], for lengths.
const MOST: f64 = Retraction::MOST as f64;

/// A planned change of a segment.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// Opens a gap in the vessel.
    Open(Gap),
    /// Removes a stretch, and replaces its contents by a gap.
    TakeOut(Removal, Gap),
}

impl Change {
    /// Makes the change, and returns whether anything changed.
    pub fn apply(&self, injury: &mut Injury) -> bool {
        match *self {
            Self::Open(gap) => {
                injury.open(gap);
                true
            }
            Self::TakeOut(removal, gap) => injury.take_out(removal, gap),
        }
    }
}

/// A stretch of one segment on an end's path.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    node: NodeId,
    /// Share at which the path enters the segment.
    start: f32,
    /// Length of the segment.
    length: f64,
    /// Length of the stretch.
    available: f64,
}

/// The plan of all changes of a blade to a tree.
pub(super) struct Plan<'a, S> {
    tree: &'a VesselTree,
    injuries: &'a BTreeMap<u32, Injury>,
    /// In the order of the nodes, then from parent to node.
    hits: &'a [Severed],
    search: S,
    retraction: Retraction,
    /// The path of the end that came to rest last.
    way: Vec<Stretch>,
    /// Number of places at which a vessel is severed.
    pub severed: usize,
    /// By node, in any order.
    pub changes: Vec<(u32, Change)>,
}

impl<'a, S: SegmentSearch> Plan<'a, S> {
    pub fn new(
        tree: &'a VesselTree,
        injuries: &'a BTreeMap<u32, Injury>,
        hits: &'a [Severed],
        search: S,
        retraction: Retraction,
    ) -> Self {
        Self { tree, injuries, hits, search, retraction, way: Vec::new(), severed: 0, changes: Vec::new() }
    }

    /// Severs the vessel at each place where there is one. `new_end` returns the number of a new end, for the segment
    /// on which it comes to rest.
    pub fn cut(&mut self, mut new_end: impl FnMut(NodeId) -> u32) {
        for &Severed { node, from: share, .. } in self.hits {
            if self.injury(node).gap_at(share).is_none() {
                let (from, proximal) = self.draw_back(node, share, EndSide::Proximal, &mut new_end);
                let (to, distal) = self.draw_back(node, share, EndSide::Distal, &mut new_end);
                self.changes.push((node.0, Change::Open(Gap { from, to, proximal, distal })));
                self.severed += 1;
            }
        }
    }

    /// Removes the stretch of each place, and severs the vessel where it continues.
    pub fn take_out(&mut self, mut new_end: impl FnMut(NodeId) -> u32) {
        for &Severed { node, from, to, enters, leaves } in self.hits {
            let removal = Removal { from, to, enters, leaves };
            // If a side lies in a gap, the gap becomes longer, and keeps its end.
            let (from, proximal) = match self.injury(node).gap_at(from) {
                _ if !enters => (0.0, None),
                Some(gap) => (gap.from, gap.proximal),
                None => {
                    self.severed += 1;
                    self.draw_back(node, from, EndSide::Proximal, &mut new_end)
                }
            };
            let (to, distal) = match self.injury(node).gap_at(to) {
                _ if !leaves => (1.0, None),
                Some(gap) => (gap.to, gap.distal),
                None => {
                    self.severed += 1;
                    self.draw_back(node, to, EndSide::Distal, &mut new_end)
                }
            };
            self.changes.push((node.0, Change::TakeOut(removal, Gap { from, to, proximal, distal })));
        }
    }

    /// Retracts an end through all segments after the first. Returns the extent of the gap in the first, and the end if
    /// it lies there.
    fn draw_back(
        &mut self,
        node: NodeId,
        share: f32,
        side: EndSide,
        new_end: &mut impl FnMut(NodeId) -> u32,
    ) -> (f32, Option<Tip>) {
        let rest = self.rest(node, share, side);
        let injury = self.injury(node);
        let is_proximal = side == EndSide::Proximal;
        let sealed = if is_proximal { injury.is_sealed_below(share) } else { injury.is_sealed_above(share) };
        let tip = Some(Tip { end: new_end(rest.node), sealed });
        if rest.node == node {
            return (rest.along, tip);
        }
        for stretch in &self.way[1..] {
            let gap = match side {
                _ if stretch.node != rest.node => Gap::WHOLE,
                EndSide::Proximal => Gap { from: rest.along, proximal: tip, ..Gap::WHOLE },
                EndSide::Distal => Gap { to: rest.along, distal: tip, ..Gap::WHOLE },
            };
            self.changes.push((stretch.node.0, Change::Open(gap)));
        }
        (if is_proximal { 0.0 } else { 1.0 }, None)
    }

    /// Rest position of an end; `way` then leads there. An end that would lie at a node that it passes lies beyond it.
    fn rest(&mut self, node: NodeId, share: f32, side: EndSide) -> Place {
        let radius = self.tree.radii()[node.index()];
        let wish = f64::from(self.retraction.radii) * f64::from(radius) + f64::from(self.retraction.length);
        let run = self.trace(node, share, side, wish / MOST);
        let mut left = wish.min(MOST * run);
        let (mut at, last) = (0, self.way.len() - 1);
        while at < last && left >= self.way[at].available {
            left -= self.way[at].available;
            at += 1;
        }
        self.way.truncate(at + 1);
        let Stretch { node, start, length, .. } = self.way[at];
        let moved = if length > 0.0 { left / length } else { 0.0 };
        let along = f64::from(start) + if side == EndSide::Proximal { -moved } else { moved };
        Place::new(node, along.clamp(0.0, 1.0) as f32)
    }

    /// Follows the vessel from a place, away from the cut, until its length is `enough` or something holds the end.
    /// Returns the length of that `way`.
    fn trace(&mut self, node: NodeId, share: f32, side: EndSide, enough: f64) -> f64 {
        let [near, far] = if side == EndSide::Proximal { [1.0, 0.0] } else { [0.0, 1.0] };
        self.way.clear();
        let (mut node, mut from, mut run) = (node, Some(share), 0.0);
        loop {
            let hold = self.hold(node, from, side);
            let (start, end) = (from.unwrap_or(near), hold.unwrap_or(far));
            let length = self.length(node);
            let available = f64::from((end - start).abs()) * length;
            self.way.push(Stretch { node, start, length, available });
            run += available;
            if hold.is_some() || run >= enough {
                return run;
            }
            let Some(next) = self.next(node, side) else { return run };
            (node, from) = (next, None);
        }
    }

    /// The share at which a wound of the segment, or another place of the blade, holds an end. `from` is the share of
    /// the cut, `None` if the end came from the next segment.
    fn hold(&self, node: NodeId, from: Option<f32>, side: EndSide) -> Option<f32> {
        let injury = self.injury(node);
        let first = self.hits.partition_point(|hit| hit.node < node);
        let hits = self.hits[first..].iter().take_while(|hit| hit.node == node);
        if side == EndSide::Proximal {
            let others = hits.map(|hit| hit.to).filter(|&hit| from.is_none_or(|from| hit < from));
            others.chain(injury.hold_below(from.unwrap_or(1.0))).reduce(f32::max)
        } else {
            let others = hits.map(|hit| hit.from).filter(|&hit| from.is_none_or(|from| hit > from));
            others.chain(injury.hold_above(from.unwrap_or(f32::NEG_INFINITY))).reduce(f32::min)
        }
    }

    /// The only segment in which the vessel continues, if there is exactly one.
    fn next(&mut self, node: NodeId, side: EndSide) -> Option<NodeId> {
        let (joint, next) = match side {
            EndSide::Proximal => {
                let parent = self.tree.parent(node)?;
                self.tree.parent(parent)?;
                (parent, Some(parent))
            }
            EndSide::Distal => (node, None),
        };
        let (mut child, mut several) = (None, false);
        self.children(joint, |other| several |= *child.get_or_insert(other) != other);
        if several { None } else { next.or(child) }
    }

    /// The segments that leave a node, possibly with repeats.
    fn children(&mut self, node: NodeId, mut visit: impl FnMut(NodeId)) {
        let parents = self.tree.parents();
        self.search.leaving(self.tree, node, &mut |child| {
            if parents.get(child.index()) == Some(&node.0) {
                visit(child);
            }
        });
    }

    fn injury(&self, node: NodeId) -> &'a Injury {
        self.injuries.get(&node.0).unwrap_or(&NO_INJURY)
    }

    /// In f64, since the square of a short length may underflow in f32.
    fn length(&self, node: NodeId) -> f64 {
        segment(self.tree, node).map_or(0.0, |[start, end]| start.as_dvec3().distance(end.as_dvec3()))
    }
}
