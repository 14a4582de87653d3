//! An index over the segments of a tree: those that a box may meet, the nearest, and the first that a ray hits.
//!
//! In: a [`VesselTree`], which may grow ([`extend`](SegmentIndex::extend)) or move ([`refit`](SegmentIndex::refit)).
//! Out: end nodes of segments, or a [`Place`] on one.
//!
//! Nodes are in the order of their birth, and nodes born together are spread over the whole organ. So the index is a
//! list of runs, each the packed boxes of consecutive nodes, sorted along a space-filling curve. New nodes make a run.
//! A run less than twice as long as the next is merged with it: at once if both are short, otherwise by a few steps in
//! each call, in proportion to the new nodes (Overmars & van Leeuwen, "Worst-case optimal insertion and deletion
//! methods for decomposable searching problems", Inf. Process. Lett. 12, 1981). So there are always few runs, and no
//! call takes long.

use crate::synthesis::segment_index::{
    RayCast, Region,
    ray_cast::Found,
    round_cone::RoundCone,
    run::{Run, box_of, curve_through},
};
use crate::synthesis::{
    pace::{Pace, at_once},
    space::{morton::Curve, packed_boxes::Pack},
    tree::{NodeId, Place, VesselTree},
};
use bevy_math::Vec3;

/// An index over the segments of one tree.
///
/// A segment is identified by its end node. Its box holds it with the largest radius that it may be drawn with (see
/// [`MAX_FLARE`](super::MAX_FLARE)). Boxes are those of the last [`extend`](Self::extend) or refit; queries that take
/// the tree measure it as it is.
///
/// Memory: 44 bytes a segment, twice that while it is merged, counted by [`bytes`](Self::bytes).
#[derive(Clone, Debug, Default)]
pub struct SegmentIndex {
    runs: Vec<Run>,
    /// All runs are sorted along it.
    curve: Curve,
}

impl SegmentIndex {
    /// Most nodes sorted again in one call, besides the new ones: some 2 ms.
    const AT_ONCE: usize = 8192;
    /// Steps of a merge for each new node. More than two, so that merges end before as many nodes wait for the next.
    const PACE: usize = 4;
    /// Least number of new nodes that a call counts.
    const LEAST_SHARE: usize = 256;

    /// Indexes all segments of a tree.
    pub fn new(tree: &VesselTree) -> Self {
        at_once(Self::new_paced(tree, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn new_paced(tree: &VesselTree, pace: &Pace) -> Self {
        let mut index = Self::default();
        if !tree.is_empty() {
            index.curve = curve_through(tree, &pace.part(0.0..0.1)).await;
            let nodes = 0..tree.len() as u32;
            index.runs.push(Run::new(tree, nodes, &index.curve, &pace.part(0.1..1.0)).await);
        }
        index
    }

    /// Number of indexed nodes, roots included.
    pub fn len(&self) -> usize {
        self.runs.last().map_or(0, |run| run.nodes.end as usize)
    }

    /// Whether no node is indexed.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        self.runs.iter().map(Run::bytes).sum()
    }

    /// Indexes the nodes appended to the tree since the last call.
    ///
    /// Every call takes time in proportion to the new nodes, times the logarithm of all. A call without new nodes
    /// continues the work that earlier ones left, for a fraction of a millisecond. A tree with fewer nodes than the
    /// index counts as another tree, and is indexed from the beginning.
    pub fn extend(&mut self, tree: &VesselTree) {
        if tree.len() < self.len() {
            self.runs.clear();
        }
        let end = tree.len() as u32;
        let new = end as usize - self.len();
        if new > 0 {
            self.append(tree, end);
        }
        self.merge(Self::PACE * new.max(Self::LEAST_SHARE));
    }

    /// Makes a run of the new nodes, together with earlier ones if they are few enough to be sorted again.
    fn append(&mut self, tree: &VesselTree, end: u32) {
        let mut start = self.len() as u32;
        let is_short = |run: &Run, start: u32| {
            run.nodes.len() < 2 * (end - start) as usize && (end - run.nodes.start) as usize <= Self::AT_ONCE
        };
        while let Some(last) = self.runs.pop_if(|run| is_short(run, start)) {
            start = last.nodes.start;
            // Its merge was with a run that no longer exists.
            if let Some(run) = self.runs.last_mut() {
                run.merge = None;
            }
        }
        if start == 0 {
            self.curve = at_once(curve_through(tree, &Pace::default()));
        }
        self.runs.push(at_once(Run::new(tree, start..end, &self.curve, &Pace::default())));
    }

    /// Begins merges that are due, and advances each by some steps.
    fn merge(&mut self, steps: usize) {
        for at in (1..self.runs.len()).rev() {
            let is_taken = self.runs.get(at.wrapping_sub(2)).is_some_and(|before| before.merge.is_some());
            let (before, after) = self.runs.split_at_mut(at);
            let (run, next) = (&mut before[at - 1], &after[0]);
            let is_free = !is_taken && run.merge.is_none() && next.merge.is_none();
            if is_free && run.nodes.len() < 2 * next.nodes.len() {
                run.begin_merge(next);
            }
        }
        for at in (1..self.runs.len()).rev() {
            let Some(mut merge) = self.runs[at - 1].merge.take() else { continue };
            match merge.advance([&self.runs[at - 1], &self.runs[at]], steps) {
                Some(run) => _ = self.runs.splice(at - 1..=at, [run]),
                None => self.runs[at - 1].merge = Some(merge),
            }
        }
    }

    /// Measures the boxes of all indexed segments again, after nodes moved or radii changed.
    ///
    /// Queries stay as fast while neighbours stay neighbours, as in tissue that bends and stretches. After nodes were
    /// scattered, a [new](Self::new) index is faster.
    ///
    /// # Panics
    /// If the tree has fewer nodes than the index.
    pub fn refit(&mut self, tree: &VesselTree) {
        while self.runs.iter().any(|run| run.merge.is_some()) {
            self.merge(usize::MAX);
        }
        for Run { ends, boxes, .. } in &mut self.runs {
            boxes.refit(|slot| box_of(tree, ends[slot]));
        }
    }

    /// Measures the boxes of some segments again.
    ///
    /// Name each node whose radius changed, and each node that moved with its children. Roots and nodes that are not
    /// indexed yet are skipped. Takes time in proportion to the nodes named.
    ///
    /// # Panics
    /// If the tree has fewer nodes than the index.
    pub fn refit_nodes(&mut self, tree: &VesselTree, nodes: impl IntoIterator<Item = NodeId>) {
        for NodeId(node) in nodes {
            let at = self.runs.partition_point(|run| run.nodes.end <= node);
            let Some(run) = self.runs.get_mut(at) else { continue };
            run.refit_node(tree, node);
            // It may already be part of a merge, with the next run or with the one before.
            for pair in [Some(at), at.checked_sub(1)].into_iter().flatten() {
                if let Some(merge) = &mut self.runs[pair].merge {
                    merge.refit_node(tree, node);
                }
            }
        }
    }

    /// Visits the end node of every segment whose box shares a point with the box between two corners.
    ///
    /// The order is unspecified, but always the same. Nothing is visited if a corner holds NaN, or if `min` exceeds
    /// `max`.
    pub fn candidates(&self, min: Vec3, max: Vec3, mut visit: impl FnMut(NodeId)) {
        if min.cmple(max).all() {
            for run in &self.runs {
                run.boxes.walk(|pack| pack.overlaps((min, max)), |slot| visit(NodeId(run.ends[slot])));
            }
        }
    }

    /// Visits the end node of every segment whose box may share a point with a region, and perhaps others.
    ///
    /// The order is unspecified, but always the same.
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
    /// `meets(min, max)` returns whether a region may share a point with a box. For regions whose own box is mostly
    /// empty, such as an oblique plane.
    pub fn candidates_where(&self, meets: impl Fn(Vec3, Vec3) -> bool, mut visit: impl FnMut(NodeId)) {
        for run in &self.runs {
            run.boxes.walk(|pack| pack.passes(&meets), |slot| visit(NodeId(run.ends[slot])));
        }
    }

    /// The place on any segment's centre line that is nearest to a point, and its distance: at most `reach`.
    ///
    /// Of equally near segments, the one with the lowest node is returned. `None` if nothing is that near, the point
    /// isn't finite, or `reach` is NaN.
    ///
    /// # Panics
    /// If the tree has fewer nodes than the index.
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

    /// The place that a ray hits first, and its distance along the ray: at most `reach`.
    ///
    /// Segments are round cones, as drawn. The place is the centre of the ball that the ray hits. From inside a segment
    /// the distance is 0; of segments hit at the same distance, the one with the lowest node is returned. `direction`
    /// may have any length. `None` if nothing is hit, `from` or `direction` isn't finite, `direction` is zero, or
    /// `reach` is NaN.
    ///
    /// # Panics
    /// If the tree has fewer nodes than the index.
    pub fn first_hit(&self, tree: &VesselTree, from: Vec3, direction: Vec3, reach: f32) -> Option<(Place, f32)> {
        let mut cast = RayCast::new(from, direction, reach)?;
        self.cast(tree, &mut cast, |_| [[0.0, 1.0]]);
        cast.found()
    }

    /// Casts a ray against the segments in its way, the nearest boxes first. `pieces` gives the remaining parts of
    /// each, as for [`RayCast::meet`].
    ///
    /// # Panics
    /// If the tree has fewer nodes than the index.
    pub fn cast<Pieces: IntoIterator<Item = [f32; 2]>>(
        &self,
        tree: &VesselTree,
        cast: &mut RayCast,
        pieces: impl Fn(NodeId) -> Pieces,
    ) {
        let ray = cast.ray;
        for run in &self.runs {
            let limit = cast.found.least as f32;
            let visit = |slot: usize, _: f32| {
                let node = NodeId(run.ends[slot]);
                cast.meet(tree, node, pieces(node));
                cast.found.least as f32
            };
            run.boxes.best_first(limit, |pack| pack.entries(&ray), visit);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::segment_index::index::*;
    use crate::synthesis::{
        random::{Stream, VesselRng},
        tree::NO_PARENT,
    };
    use rand::RngExt;

    fn any_point(rng: &mut VesselRng) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
    }

    /// Segments anywhere, in the order of their nodes, with roots among them.
    fn scattered(nodes: usize, rng: &mut VesselRng) -> (Vec<Vec3>, Vec<u32>) {
        let (mut positions, mut parents) = (Vec::new(), Vec::new());
        for node in 0..nodes as u32 {
            let is_root = node % 2 == 0;
            let near = if is_root { any_point(rng) } else { positions[node as usize - 1] };
            positions.push(near + 0.01 * any_point(rng));
            parents.push(if is_root { NO_PARENT } else { node - 1 });
        }
        (positions, parents)
    }

    fn found(index: &SegmentIndex, min: Vec3, max: Vec3) -> Vec<NodeId> {
        let mut found = Vec::new();
        index.candidates(min, max, |node| found.push(node));
        found.sort_unstable();
        found
    }

    /// Runs are few, consecutive, and each in one merge at most.
    fn check_runs(index: &SegmentIndex, what: &str) {
        let most = 2 * index.len().max(2).ilog2() as usize;
        assert!(index.runs.len() <= most, "{what}: {} runs of {} nodes", index.runs.len(), index.len());
        for pair in index.runs.windows(2) {
            assert_eq!(pair[0].nodes.end, pair[1].nodes.start, "{what}");
            assert!(pair[0].merge.is_none() || pair[1].merge.is_none(), "{what}");
        }
        assert!(index.runs.last().is_none_or(|run| run.merge.is_none()), "{what}");
    }

    #[test]
    fn merges_in_steps_change_no_answer() {
        let mut rng = Stream::Statistics.rng(3);
        let nodes = 60_000;
        let (mut positions, parents) = scattered(nodes, &mut rng);
        let mut index = SegmentIndex::default();
        let (mut len, mut merging, mut call) = (0, 0, 0);
        while len < nodes {
            let before = len;
            len = (len + rng.random_range(0..600)).min(nodes);
            call += 1;
            // Some of the nodes that were there move, with their segments and children.
            let moved: Vec<usize> = (0..20.min(before)).map(|_| rng.random_range(0..before)).collect();
            for &node in &moved {
                positions[node] += 0.1 * any_point(&mut rng);
            }
            let tree = VesselTree::from_arrays(positions[..len].to_vec(), parents[..len].to_vec(), vec![1e-4; len])
                .expect("a tree");
            let touched = moved.iter().flat_map(|&node| [node, node + 1]).map(|node| NodeId(node as u32));
            index.refit_nodes(&tree, touched);
            index.extend(&tree);
            if call % 97 == 0 {
                index.refit(&tree);
            }
            check_runs(&index, &format!("call {call}"));
            merging += usize::from(index.runs.iter().any(|run| run.merge.is_some()));
            if call % 10 == 0 || len == nodes {
                let anew = SegmentIndex::new(&tree);
                for _ in 0..20 {
                    let (center, half) = (any_point(&mut rng), 0.1 * any_point(&mut rng).abs());
                    let [fast, slow] = [&index, &anew].map(|index| found(index, center - half, center + half));
                    assert_eq!(fast, slow, "call {call}");
                }
            }
        }
        assert!(merging > 50, "{merging} calls left a merge");
    }

    #[test]
    fn runs_stay_few_and_steps_in_proportion() {
        let mut rng = Stream::Statistics.rng(4);
        let nodes = 400_000;
        let (positions, parents) = scattered(nodes, &mut rng);
        let mut index = SegmentIndex::default();
        let mut tree = VesselTree::from_arrays(positions, parents, vec![1e-4; nodes]).expect("a tree");
        let mut len = 0;
        while len < nodes {
            let before = len;
            len = (len + [700, 3_000, 40, 12_000][rng.random_range(0..4)]).min(nodes);
            index.append(&tree, len as u32);
            index.merge(SegmentIndex::PACE * (len - before).max(SegmentIndex::LEAST_SHARE));
            check_runs(&index, &format!("{len} nodes"));
        }
        // Pending merges finish without growth.
        for _ in 0..nodes / SegmentIndex::LEAST_SHARE {
            index.extend(&tree);
        }
        assert!(index.runs.iter().all(|run| run.merge.is_none()));
        assert!(index.runs.windows(2).all(|pair| pair[0].nodes.len() >= 2 * pair[1].nodes.len()));
        tree = VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![1e-4; 2]).expect("a tree");
        index.extend(&tree);
        assert_eq!((index.len(), found(&index, Vec3::ZERO, Vec3::X)), (2, vec![NodeId(1)]));
    }
}
