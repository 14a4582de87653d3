//! An index over the segments of a tree: which of them a box may meet, which is nearest, which a ray meets first.
//!
//! In: a [`VesselTree`], as it is, longer ([`extend`](SegmentIndex::extend)) or moved ([`refit`](SegmentIndex::refit)).
//! Out: end nodes of segments, or a [`Place`] on one.
//!
//! Nodes lie in the order of their birth, and what is born together is spread over the whole organ. So the index is a
//! row of runs, each the packed boxes of consecutive nodes, sorted along a space-filling curve. New nodes make a run. A
//! run less than twice as long as the next is merged with that: at once while both are short, otherwise a few steps in
//! each call, in proportion to the new nodes (Overmars & van Leeuwen, "Worst-case optimal insertion and deletion methods
//! for decomposable searching problems", Inf. Process. Lett. 12, 1981). So there are never many runs, and no call takes
//! long.

use crate::synthesis::segment_index::{
    RayCast, Region,
    ray_cast::Found,
    round_cone::RoundCone,
    run::{Run, box_of, curve_through},
};
use crate::synthesis::{
    space::{morton::Curve, packed_boxes::Pack},
    tree::{NodeId, Place, VesselTree},
};
use bevy_math::Vec3;

/// An index over the segments of one tree.
///
/// A segment is known by its end node. Its box holds it with its radius, wherever the drawing may taper it from (see
/// [`MAX_FLARE`](crate::synthesis::instances::MAX_FLARE)). Boxes are those of the last [`extend`](Self::extend) or
/// refit; questions that take the tree measure it as it is.
///
/// Memory: 44 bytes a segment, twice that while it is merged, counted by [`bytes`](Self::bytes).
#[derive(Clone, Debug, Default)]
pub struct SegmentIndex {
    runs: Vec<Run>,
    /// That all runs are sorted along.
    curve: Curve,
}

impl SegmentIndex {
    /// Most nodes that are sorted anew in one call, beside the new ones: some 2 ms.
    const AT_ONCE: usize = 8192;
    /// Steps of a merge for each new node. More than two, so that merges end before as many nodes wait for the next.
    const PACE: usize = 4;
    /// New nodes that a call counts at least.
    const LEAST_SHARE: usize = 256;

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
        self.runs.iter().map(Run::bytes).sum()
    }

    /// Indexes the nodes that were appended to the tree since the last call.
    ///
    /// Every call takes time in proportion to the new nodes, times the logarithm of all; one without new nodes goes on
    /// with what earlier ones have left, for a fraction of a millisecond. A tree with fewer nodes than are indexed is
    /// taken for another one, and indexed from the beginning.
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

    /// Makes a run of the new nodes, with those before that are quickly sorted anew.
    fn append(&mut self, tree: &VesselTree, end: u32) {
        let mut start = self.len() as u32;
        let is_short = |run: &Run, start: u32| {
            run.nodes.len() < 2 * (end - start) as usize && (end - run.nodes.start) as usize <= Self::AT_ONCE
        };
        while let Some(last) = self.runs.pop_if(|run| is_short(run, start)) {
            start = last.nodes.start;
            // A merge with what has gone.
            if let Some(run) = self.runs.last_mut() {
                run.merge = None;
            }
        }
        if start == 0 {
            self.curve = curve_through(tree, 0..end);
        }
        self.runs.push(Run::new(tree, start..end, &self.curve));
    }

    /// Begins merges where they are due, and goes on with each for some steps.
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

    /// Measures the boxes of all indexed segments anew, after nodes moved or radii changed.
    ///
    /// Questions stay as quick as they were while neighbours stay neighbours, as in tissue that bends and stretches.
    /// After nodes were scattered, an index made [anew](Self::new) is quicker.
    ///
    /// # Panics
    /// When the tree has fewer nodes than are indexed.
    pub fn refit(&mut self, tree: &VesselTree) {
        while self.runs.iter().any(|run| run.merge.is_some()) {
            self.merge(usize::MAX);
        }
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
            let at = self.runs.partition_point(|run| run.nodes.end <= node);
            let Some(run) = self.runs.get_mut(at) else { continue };
            run.refit_node(tree, node);
            // It may have been taken into a merge, with the next run or with the one before.
            for pair in [Some(at), at.checked_sub(1)].into_iter().flatten() {
                if let Some(merge) = &mut self.runs[pair].merge {
                    merge.refit_node(tree, node);
                }
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
        let mut cast = RayCast::new(from, direction, reach)?;
        self.cast(tree, &mut cast, |_| [[0.0, 1.0]]);
        cast.found()
    }

    /// Lets a ray meet the segments that lie in its way, the nearest boxes first: of each the `pieces` that are left of
    /// it, as [`RayCast::meet`] takes them.
    ///
    /// # Panics
    /// When the tree has fewer nodes than are indexed.
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

    /// Segments anywhere, in the order of their nodes, and roots among them.
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

    /// Runs are few, lie end to end, and are each in one merge at most.
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
        // What is left over ends without growth.
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
