//! Finds the whole segments beside a cut that are drawn with a flat end.
//!
//! In: the tips of severed vessels, from [`Wounds`], and their tree. Out: [`FlatEnds`], and the segments whose look
//! changes when wounds are made or undone.
//!
//! If segments are shorter than they are wide, the round ends of whole segments near a tip would reach past it and hide
//! the gap, or fill the visible lumen. These ends are drawn flat, if the next segment covers them.
//!
//! The ends that a tip flattens depend only on its place in the tree: not on the order of cuts, nor on other actions.
//! So a new or removed tip is one small change, and undo leaves no trace. Segments beyond the next gap, which are not
//! visible through the lumen, are flattened, too: they are also flat for that gap's own tip.

use crate::synthesis::{
    instances::{END_DOME, LUMEN_DEPTH, MAX_FLARE, START_DOME},
    segment_index::start_radius,
    tree::{NodeId, Place, VesselTree},
    wound::{EndSide, Wounds},
};
use std::{
    collections::{BTreeMap, BTreeSet, btree_map::Entry},
    ops::Range,
};

/// Largest relative width of another branch beside which a vessel's end is drawn flat. A wider branch would visibly end
/// in the air.
const THIN_BRANCH: f32 = 0.5;

/// The segments of a cut tree that are drawn with a flat end because of a gap beside them.
///
/// It is derived from the wounds and the tree of the last call. After a cut, call [`update`](Self::update) with the
/// segments that the cut changed; after a tree grew, moved or was replaced, call [`rebuild`](Self::rebuild).
///
/// `children(node)` gives the children of a node, as [`Children::of`](crate::synthesis::tree::sweep::Children::of) does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlatEnds {
    /// The ends that the tips of each severed segment flatten, by node. No list is empty.
    of_tips: BTreeMap<u32, Vec<FlatEnd>>,
    /// Number of tips that flatten each segment at its start and at its end, by node. None is 0 at both.
    counts: BTreeMap<u32, [u32; 2]>,
}

/// An end of a segment that is drawn flat.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FlatEnd {
    /// The node in which the segment ends.
    node: u32,
    /// 0 at its start, 1 at its end.
    side: usize,
}

impl FlatEnds {
    /// The flat ends for all wounds of a tree.
    pub fn new<C: IntoIterator<Item = NodeId>>(
        wounds: &Wounds,
        tree: &VesselTree,
        children: impl Fn(NodeId) -> C,
    ) -> Self {
        let mut flat = Self::default();
        flat.rebuild(wounds, tree, children);
        flat
    }

    /// Updates the flat ends for the tips of some segments: all that a cut or an undo
    /// [changed](crate::synthesis::wound::WoundReport::changed); others do no harm.
    ///
    /// Returns the segments whose look changed because of another, in rising order. The cost is that of the segments
    /// given.
    pub fn update<C: IntoIterator<Item = NodeId>>(
        &mut self,
        wounds: &Wounds,
        tree: &VesselTree,
        children: impl Fn(NodeId) -> C,
        changed: impl IntoIterator<Item = NodeId>,
    ) -> Vec<NodeId> {
        let mut touched: BTreeMap<u32, [bool; 2]> = BTreeMap::new();
        let mut flattened = Vec::new();
        for node in changed {
            flattened.clear();
            let mut reach = Reach { tree, children: &children, flattened: &mut flattened };
            wounds.tips(node).for_each(|(tip, side)| reach.flatten_around(tip, side));
            self.replace(node, &flattened, &mut touched);
        }
        let changed = touched.iter().filter(|&(&node, before)| self.sides(NodeId(node)) != *before);
        let mut others = BTreeSet::new();
        for (&node, before) in changed {
            others.insert(NodeId(node));
            // A segment begins deeper in a flat one.
            if self.sides(NodeId(node))[1] != before[1] && (node as usize) < tree.len() {
                others.extend(children(NodeId(node)));
            }
        }
        others.into_iter().collect()
    }

    /// Updates the flat ends for all wounds, after the tree changed. Returns the same as [`update`](Self::update). The
    /// cost is that of all severed segments.
    pub fn rebuild<C: IntoIterator<Item = NodeId>>(
        &mut self,
        wounds: &Wounds,
        tree: &VesselTree,
        children: impl Fn(NodeId) -> C,
    ) -> Vec<NodeId> {
        let known: Vec<NodeId> = self.of_tips.keys().map(|&node| NodeId(node)).collect();
        let all = known.into_iter().chain(wounds.severed_segments());
        self.update(wounds, tree, children, all)
    }

    /// Whether a segment is drawn flat at its start, and at its end.
    pub fn sides(&self, node: NodeId) -> [bool; 2] {
        self.counts.get(&node.0).map_or([false; 2], |counts| counts.map(|count| count > 0))
    }

    /// Whether [`write_stumps_of`](super::write_stumps_of) draws the segment of a node differently than it grew:
    /// because it is severed, or because its round end would hide the gap of another.
    pub fn is_redrawn(&self, wounds: &Wounds, node: NodeId) -> bool {
        self.counts.contains_key(&node.0) || wounds.is_severed(node)
    }

    /// The segments of a range of nodes that are drawn differently than they grew, in order. The cost is that of the
    /// affected segments.
    pub fn redrawn_within<'a>(&'a self, wounds: &'a Wounds, nodes: Range<usize>) -> impl Iterator<Item = NodeId> + 'a {
        let bound = |node: usize| u32::try_from(node).unwrap_or(u32::MAX);
        // An empty range may be inverted, which a map does not accept.
        let range = bound(nodes.start)..bound(nodes.end.max(nodes.start));
        let mut flat = self.counts.range(range).map(|(&node, _)| NodeId(node)).peekable();
        let mut severed = wounds.severed_within(nodes).peekable();
        std::iter::from_fn(move || {
            let next = flat.peek().into_iter().chain(severed.peek()).min().copied()?;
            flat.next_if_eq(&next);
            severed.next_if_eq(&next);
            Some(next)
        })
    }

    /// Replaces the ends that the tips of a segment flatten, and records the previous sides of the touched segments.
    fn replace(&mut self, node: NodeId, flattened: &[FlatEnd], touched: &mut BTreeMap<u32, [bool; 2]>) {
        let known = self.of_tips.get(&node.0).map_or(&[][..], Vec::as_slice);
        if known == flattened {
            return;
        }
        for end in known.iter().chain(flattened) {
            touched.entry(end.node).or_insert_with(|| self.sides(NodeId(end.node)));
        }
        for end in flattened {
            self.counts.entry(end.node).or_default()[end.side] += 1;
        }
        let former = match flattened {
            [] => self.of_tips.remove(&node.0),
            _ => self.of_tips.insert(node.0, flattened.to_vec()),
        };
        for end in former.into_iter().flatten() {
            if let Entry::Occupied(mut counts) = self.counts.entry(end.node) {
                counts.get_mut()[end.side] -= 1;
                if *counts.get() == [0; 2] {
                    counts.remove();
                }
            }
        }
    }
}

/// Finds the ends that a tip flattens.
struct Reach<'a, F> {
    tree: &'a VesselTree,
    children: &'a F,
    flattened: &'a mut Vec<FlatEnd>,
}

impl<C: IntoIterator<Item = NodeId>, F: Fn(NodeId) -> C> Reach<'_, F> {
    /// Flattens whole segments whose round ends would reach past a tip, or into its lumen. A tip outside the tree
    /// flattens none.
    fn flatten_around(&mut self, tip: Place, side: EndSide) {
        let Some(&radius) = self.tree.radii().get(tip.node.index()) else { return };
        let lumen = f64::from(LUMEN_DEPTH * radius);
        let length = self.length(tip.node);
        match side {
            EndSide::Proximal => self.flatten_above(tip.node, f64::from(tip.along) * length, lumen),
            EndSide::Distal => self.flatten_below(tip.node, f64::from(1.0 - tip.along) * length, lumen),
        }
    }

    /// Flattens segments from a tip, which lies `distance` beyond the start of its segment, towards the root.
    fn flatten_above(&mut self, mut child: NodeId, mut distance: f64, lumen: f64) {
        let tree = self.tree;
        while let Some(node) = tree.parent(child).filter(|&node| tree.parent(node).is_some()) {
            let dome = f64::from(END_DOME * tree.radii()[node.index()]);
            if distance >= dome + lumen || !self.is_continued(node, child) {
                return;
            }
            self.flattened.push(FlatEnd { node: node.0, side: 1 });
            distance += self.length(node);
            child = node;
        }
    }

    /// Whether a child continues a segment with its whole width, so that the segment's end is not visible.
    fn is_continued(&self, node: NodeId, child: NodeId) -> bool {
        let radii = self.tree.radii();
        let radius = radii[node.index()];
        let is_thin = |other: NodeId| other == child || radii[other.index()] <= THIN_BRANCH * radius;
        radius <= MAX_FLARE * radii[child.index()] && (self.children)(node).into_iter().all(is_thin)
    }

    /// Flattens segments towards the tips, each of which begins within the round end of another: from the end of a
    /// segment, which is `distance` from the tip.
    fn flatten_below(&mut self, node: NodeId, distance: f64, lumen: f64) {
        let mut ends = vec![(node, distance)];
        while let Some((node, distance)) = ends.pop() {
            for child in (self.children)(node) {
                let dome = f64::from(START_DOME * start_radius(self.tree, child.index()));
                if distance < dome + lumen {
                    self.flattened.push(FlatEnd { node: child.0, side: 0 });
                    ends.push((child, distance + self.length(child)));
                }
            }
        }
    }

    /// In f64, since the square of a short length may underflow in f32.
    fn length(&self, node: NodeId) -> f64 {
        let positions = self.tree.positions();
        let start = self.tree.parent(node).map_or(positions[node.index()], |parent| positions[parent.index()]);
        start.as_dvec3().distance(positions[node.index()].as_dvec3())
    }
}
