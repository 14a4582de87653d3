//! An index over the segments of a tree: which of them a box may meet, which is nearest, which a ray meets first.
//!
//! In: a [`VesselTree`], as it is, longer ([`extend`](SegmentIndex::extend)) or moved ([`refit`](SegmentIndex::refit)).
//! Out: end nodes of segments, or a [`Place`] on one.
//!
//! Nodes lie in the order of their birth, and what is born together is spread over the whole organ. So the index is a
//! row of runs, each the packed boxes of consecutive nodes, sorted along a space-filling curve. New nodes make a run,
//! and while the run before it is less than twice as long the two become one: runs at least halve from each to the next, so a tree
//! of n nodes has at most log₂ n of them, and a node is sorted anew log₂ n times at most while its tree grows.

use super::{
    Region,
    round_cone::{RoundCone, box_around},
};
use crate::synthesis::{
    packed_boxes::{Pack, PackedBoxes, Ray, curve_order},
    tree::{NO_PARENT, NodeId, Place, VesselTree},
};
use bevy_math::Vec3;
use std::ops::Range;

/// In place of a slot: a root, which has no segment.
const NONE: u32 = u32::MAX;

/// The segments of consecutive nodes.
#[derive(Clone, Debug)]
struct Run {
    nodes: Range<u32>,
    /// End node of each slot of `boxes`.
    ends: Vec<u32>,
    /// Slot of each node, [`NONE`] for a root.
    slots: Vec<u32>,
    boxes: PackedBoxes,
}

impl Run {
    fn new(tree: &VesselTree, nodes: Range<u32>) -> Self {
        let mut ends: Vec<u32> = nodes.clone().filter(|&node| tree.parents()[node as usize] != NO_PARENT).collect();
        let middles: Vec<Vec3> = ends
            .iter()
            .map(|&node| {
                let parent = tree.parents()[node as usize];
                tree.positions()[node as usize].midpoint(tree.positions()[parent as usize])
            })
            .collect();
        ends = curve_order(&middles).into_iter().map(|number| ends[number as usize]).collect();
        let mut slots = vec![NONE; nodes.len()];
        for (slot, &node) in ends.iter().enumerate() {
            slots[(node - nodes.start) as usize] = slot as u32;
        }
        let boxes = PackedBoxes::new(ends.len(), |slot| box_of(tree, ends[slot]));
        Self { nodes, ends, slots, boxes }
    }

    fn slot(&self, node: u32) -> Option<usize> {
        let slot = self.slots[(node - self.nodes.start) as usize];
        (slot != NONE).then_some(slot as usize)
    }
}

fn box_of(tree: &VesselTree, node: u32) -> (Vec3, Vec3) {
    box_around(tree, node).expect("roots have no slot")
}

/// An index over the segments of one tree.
///
/// A segment is known by its end node. Its box holds it with its radius, wherever the drawing may taper it from (see
/// [`MAX_FLARE`](crate::synthesis::instances::MAX_FLARE)). Boxes are those of the last [`extend`](Self::extend) or
/// refit; questions that take the tree measure it as it is.
///
/// Memory: 36 bytes a segment, counted by [`bytes`](Self::bytes).
#[derive(Clone, Debug, Default)]
pub struct SegmentIndex {
    runs: Vec<Run>,
}

impl SegmentIndex {
    /// Indexes all segments of a tree.
    pub fn new(tree: &VesselTree) -> Self {
        let mut index = Self::default();
        index.extend(tree);
        index
    }

    /// Number of nodes that are indexed, roots included.
    pub fn len(&self) -> usize {
        self.runs.last().map_or(0, |run| run.nodes.end as usize)
    }

    /// Whether no node is indexed.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        let run = |run: &Run| size_of::<Run>() + 4 * (run.ends.capacity() + run.slots.capacity()) + run.boxes.bytes();
        self.runs.iter().map(run).sum()
    }

    /// Indexes the nodes that were appended to the tree since the last call.
    ///
    /// Takes time in proportion to the new nodes, times the logarithm of all, on average over many calls; a single call
    /// may sort the whole tree anew. A tree with fewer nodes than are indexed is taken for another one, and indexed from
    /// the beginning.
    pub fn extend(&mut self, tree: &VesselTree) {
        if tree.len() < self.len() {
            self.runs.clear();
        }
        let (mut start, end) = (self.len() as u32, tree.len() as u32);
        if start == end {
            return;
        }
        while let Some(run) = self.runs.pop_if(|run| run.nodes.len() < 2 * (end - start) as usize) {
            start = run.nodes.start;
        }
        self.runs.push(Run::new(tree, start..end));
    }

    /// Measures the boxes of all indexed segments anew, after nodes moved or radii changed.
    ///
    /// Questions stay as quick as they were while neighbours stay neighbours, as in tissue that bends and stretches.
    /// After nodes were scattered, an index made [anew](Self::new) is quicker.
    ///
    /// # Panics
    /// When the tree has fewer nodes than are indexed.
    pub fn refit(&mut self, tree: &VesselTree) {
        for Run { ends, boxes, .. } in &mut self.runs {
            boxes.refit(|slot| box_of(tree, ends[slot]));
        }
    }

    /// Measures the boxes of some segments anew.
    ///
    /// A node whose radius changed is to be named; of a node that moved, the node and its children. Roots and nodes that
    /// are not indexed yet are skipped. Takes time in proportion to the nodes named.
    ///
    /// # Panics
    /// When the tree has fewer nodes than are indexed.
    pub fn refit_nodes(&mut self, tree: &VesselTree, nodes: impl IntoIterator<Item = NodeId>) {
        for NodeId(node) in nodes {
            let run = self.runs.partition_point(|run| run.nodes.end <= node);
            let Some(run) = self.runs.get_mut(run) else { continue };
            if let Some(slot) = run.slot(node) {
                run.boxes.set(slot, box_of(tree, node));
            }
        }
    }

    /// Visits the end node of every segment whose box has a point in common with the box between two corners.
    ///
    /// In no particular order, but always in the same. Nothing is visited where a corner holds NaN, or where `min`
    /// exceeds `max`.
    pub fn candidates(&self, min: Vec3, max: Vec3, mut visit: impl FnMut(NodeId)) {
        if min.cmple(max).all() {
            for run in &self.runs {
                run.boxes.walk(|pack| pack.overlaps((min, max)), |slot| visit(NodeId(run.ends[slot])));
            }
        }
    }

    /// Visits the end node of every segment whose box may have a point in common with a region, and perhaps others.
    ///
    /// In no particular order, but always in the same.
    pub fn candidates_in(&self, region: &Region, mut visit: impl FnMut(NodeId)) {
        let Some(slabs) = region.slabs() else { return self.candidates(region.min(), region.max(), visit) };
        for run in &self.runs {
            let meets = |pack: &Pack| match pack.overlaps(region.corners()) {
                0 => 0,
                overlaps => overlaps & pack.enters(slabs),
            };
            run.boxes.walk(meets, |slot| visit(NodeId(run.ends[slot])));
        }
    }

    /// Visits the end node of every segment whose box, and all boxes around that, pass a test.
    ///
    /// `meets(min, max)` says whether a region may have a point in common with a box. For regions whose own box is
    /// mostly empty, such as a plane that lies aslant.
    pub fn candidates_where(&self, meets: impl Fn(Vec3, Vec3) -> bool, mut visit: impl FnMut(NodeId)) {
        for run in &self.runs {
            run.boxes.walk(|pack| pack.passes(&meets), |slot| visit(NodeId(run.ends[slot])));
        }
    }

    /// The place on any segment's centre line that is nearest to a point, and how far it is: at most `reach`.
    ///
    /// Of equally near segments the one with the lower node counts. `None` where nothing is that near, and where the
    /// point isn't finite or `reach` isn't a number.
    ///
    /// # Panics
    /// When the tree has fewer nodes than are indexed.
    pub fn nearest(&self, tree: &VesselTree, point: Vec3, reach: f32) -> Option<(Place, f32)> {
        if !(point.is_finite() && reach >= 0.0) {
            return None;
        }
        let from = point.as_dvec3();
        let mut found = Found::up_to(f64::from(reach) * f64::from(reach));
        for run in &self.runs {
            let limit = found.least as f32;
            let visit = |slot: usize, _: f32| {
                let node = run.ends[slot];
                if let Some(segment) = RoundCone::of(tree, node) {
                    let (along, distance_squared) = segment.nearest(from);
                    found.offer(node, along, distance_squared);
                }
                found.least as f32
            };
            run.boxes.best_first(limit, |pack| pack.distances_squared(point), visit);
        }
        found.place.map(|place| (place, found.least.sqrt() as f32))
    }

    /// The place that a ray meets first, and how far along the ray: at most `reach`.
    ///
    /// Segments are round cones, as they are drawn. The place is the centre of the ball that the ray meets. From inside
    /// a segment the distance is 0; of segments met at the same distance the one with the lower node counts. `direction`
    /// may have any length. `None` where nothing is met, and where `from` or `direction` isn't finite, `direction` is
    /// zero or `reach` isn't a number.
    ///
    /// # Panics
    /// When the tree has fewer nodes than are indexed.
    pub fn first_hit(&self, tree: &VesselTree, from: Vec3, direction: Vec3, reach: f32) -> Option<(Place, f32)> {
        let unit = direction.as_dvec3().try_normalize()?;
        if !(from.is_finite() && direction.is_finite() && reach >= 0.0) {
            return None;
        }
        let ray = Ray::new(from, unit.as_vec3());
        let from = from.as_dvec3();
        let mut found = Found::up_to(reach.into());
        for run in &self.runs {
            let limit = found.least as f32;
            let visit = |slot: usize, _: f32| {
                let node = run.ends[slot];
                if let Some((distance, along)) = RoundCone::of(tree, node).and_then(|cone| cone.hit(from, unit)) {
                    found.offer(node, along, distance);
                }
                found.least as f32
            };
            run.boxes.best_first(limit, |pack| pack.entries(&ray), visit);
        }
        found.place.map(|place| (place, found.least as f32))
    }
}

/// The best place so far.
struct Found {
    least: f64,
    place: Option<Place>,
}

impl Found {
    fn up_to(limit: f64) -> Self {
        Self { least: limit, place: None }
    }

    fn offer(&mut self, node: u32, along: f64, distance: f64) {
        let better = match self.place {
            None => distance <= self.least,
            Some(place) => distance < self.least || (distance == self.least && node < place.node.0),
        };
        if better {
            self.least = distance;
            self.place = Some(Place::new(NodeId(node), along as f32));
        }
    }
}
