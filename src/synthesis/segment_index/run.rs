//! The segments of consecutive nodes, sorted along a curve, and the incremental merge of two such runs.
//!
//! In: a [`VesselTree`], or two runs. Out: a [`Run`]. All runs of an index are sorted along one curve, so a merge of
//! two visits each segment once, without a sort, and can stop anywhere.

use crate::synthesis::segment_index::round_cone::box_around;
use crate::synthesis::{
    pace::Pace,
    space::{morton::Curve, packed_boxes::PackedBoxes},
    tree::{NO_PARENT, VesselTree},
};
use bevy_math::Vec3;
use std::ops::Range;

/// The segments of consecutive nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct Run {
    pub nodes: Range<u32>,
    /// End node of each slot of `boxes`.
    pub ends: Vec<u32>,
    pub boxes: PackedBoxes,
    /// Place of each slot on the curve, when it was sorted.
    keys: Vec<u64>,
    /// Slot of each node plus 1, or 0 for a root, which has no segment. Zeroed memory is not touched before it is
    /// written.
    slots: Vec<u32>,
    /// The merge of this run and the next.
    pub merge: Option<Box<Merge>>,
}

/// The middle of the segment that ends in a node; `None` for a root.
fn middle(tree: &VesselTree, node: u32) -> Option<Vec3> {
    let parent = tree.parents()[node as usize];
    (parent != NO_PARENT).then(|| tree.positions()[node as usize].midpoint(tree.positions()[parent as usize]))
}

/// A curve through the segments of a tree, with room for those that grow later.
pub(super) async fn curve_through(tree: &VesselTree, pace: &Pace) -> Curve {
    /// Ratio of the curve's box to that of the segments.
    const ROOM: f32 = 8.0;
    let mut corners: Option<[Vec3; 2]> = None;
    let enlarge = |node: usize| {
        if let Some(middle) = middle(tree, node as u32) {
            let [min, max] = corners.unwrap_or([middle; 2]);
            corners = Some([min.min(middle), max.max(middle)]);
        }
    };
    pace.each(tree.len(), enlarge).await;
    Curve::around(corners.into_iter().flatten(), ROOM)
}

pub(super) fn box_of(tree: &VesselTree, node: u32) -> (Vec3, Vec3) {
    box_around(tree, node).expect("roots have no slot")
}

impl Run {
    pub async fn new(tree: &VesselTree, nodes: Range<u32>, curve: &Curve, pace: &Pace) -> Self {
        let mut places: Vec<(u64, u32)> = Vec::with_capacity(nodes.len());
        let place = |number: usize| {
            let node = nodes.start + number as u32;
            if let Some(middle) = middle(tree, node) {
                places.push((curve.key(middle), node));
            }
        };
        pace.part(0.0..0.2).each(nodes.len(), place).await;
        pace.part(0.2..0.6).sort(&mut places).await;
        let keys = pace.part(0.6..0.63).collect(places.len(), |slot| places[slot].0).await;
        let ends: Vec<u32> = pace.part(0.63..0.66).collect(places.len(), |slot| places[slot].1).await;
        let mut slots = vec![0; nodes.len()];
        let enter = |slot: usize| slots[(ends[slot] - nodes.start) as usize] = slot as u32 + 1;
        pace.part(0.66..0.7).each(ends.len(), enter).await;
        let boxes = PackedBoxes::new(ends.len(), |slot| box_of(tree, ends[slot]), &pace.part(0.7..1.0)).await;
        Self { nodes, ends, boxes, keys, slots, merge: None }
    }

    fn slot(&self, node: u32) -> Option<usize> {
        self.slots[(node - self.nodes.start) as usize].checked_sub(1).map(|slot| slot as usize)
    }

    /// Measures the box of one segment again.
    pub fn refit_node(&mut self, tree: &VesselTree, node: u32) {
        if let Some(slot) = self.slot(node) {
            self.boxes.set(slot, box_of(tree, node));
        }
    }

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        let lists = 4 * (self.ends.capacity() + self.slots.capacity()) + 8 * self.keys.capacity();
        let merge = self.merge.as_ref().map_or(0, |merge| size_of::<Merge>() + merge.run.bytes());
        size_of::<Self>() + lists + self.boxes.bytes() + merge
    }

    /// Begins to merge the run with the next one.
    pub fn begin_merge(&mut self, next: &Self) {
        let len = self.ends.len() + next.ends.len();
        let run = Self {
            nodes: self.nodes.start..next.nodes.end,
            ends: Vec::with_capacity(len),
            boxes: PackedBoxes::reserve(len),
            keys: Vec::with_capacity(len),
            slots: vec![0; self.nodes.len() + next.nodes.len()],
            merge: None,
        };
        self.merge = Some(Box::new(Merge { taken: [0; 2], raised: 0, run }));
    }
}

/// A merge of two runs under way. Until it ends, both stay complete and can be queried.
#[derive(Clone, Debug)]
pub(super) struct Merge {
    /// Slots taken from each of the two.
    taken: [usize; 2],
    /// Packs that have been added to the packs above.
    raised: usize,
    /// The merged part.
    run: Run,
}

impl Merge {
    /// Does up to so many more steps: one for each segment and each pack. Returns the run once it is complete.
    pub fn advance(&mut self, runs: [&Run; 2], mut steps: usize) -> Option<Run> {
        let Self { taken, raised, run } = self;
        let [first, second] = runs;
        while steps > 0 && taken[0] + taken[1] < first.ends.len() + second.ends.len() {
            // Of equal keys the lower node comes first, as in a run that is sorted as a whole.
            let takes_first = match (first.keys.get(taken[0]), second.keys.get(taken[1])) {
                (Some(a), Some(b)) => a <= b,
                (a, _) => a.is_some(),
            };
            let side = usize::from(!takes_first);
            let (from, slot) = (runs[side], taken[side]);
            run.ends.push(from.ends[slot]);
            run.keys.push(from.keys[slot]);
            run.slots[(from.ends[slot] - run.nodes.start) as usize] = run.ends.len() as u32;
            run.boxes.push(run.ends.len() - 1, from.boxes.get(slot));
            taken[side] += 1;
            steps -= 1;
        }
        while steps > 0 && run.boxes.raise(*raised) {
            *raised += 1;
            steps -= 1;
        }
        (steps > 0).then(|| std::mem::take(run))
    }

    /// Measures the box of one segment again, if it has been merged.
    pub fn refit_node(&mut self, tree: &VesselTree, node: u32) {
        self.run.refit_node(tree, node);
    }
}
