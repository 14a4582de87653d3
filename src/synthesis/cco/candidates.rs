//! Which segment a new terminal joins: the one that makes the smallest tree.
//!
//! As in sections 4.3 to 4.5 of the paper, the nearest segments are candidates, each gets the best place for a
//! bifurcation, and the one with the least volume of the whole tree is taken. The paper tests every candidate for
//! intersections. That takes longest, so here the candidates are sorted by volume, and the first that has room is taken:
//! the same choice.

use super::{
    distance::squared_to_segment,
    forest::NONE,
    joint::Joint,
    space::Space,
    sums::Below,
};
use bevy_math::DVec3;

/// A way to connect a terminal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// The segment to be split.
    pub segment: u32,
    /// Where it is split.
    pub place: DVec3,
    /// Volume that it adds, over π and the square of the radius of a load of 1.
    pub cost: f64,
}

/// Finds candidates, and keeps the buffers for them.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    /// Distance within which enough segments are expected.
    reach: f64,
    found: Vec<(f64, u32)>,
    pub sorted: Vec<Candidate>,
}

impl Candidates {
    /// The nearest segments to a point, among those of trees that `may_join` accepts: at most `count`, the nearest first.
    fn nearest(&mut self, space: &Space, point: DVec3, count: usize, may_join: impl Fn(u32) -> bool) {
        let most = space.domain.diagonal();
        self.reach = if self.reach > 0.0 { self.reach } else { 0.1 * most };
        loop {
            let (found, square) = (&mut self.found, self.reach * self.reach);
            found.clear();
            space.index.near(point, point, self.reach, |segment| {
                let node = space.forest.node(segment);
                if may_join(node.tree) {
                    let distance = squared_to_segment(point, space.forest.place(node.parent), node.at.as_dvec3());
                    if distance <= square {
                        found.push((distance, segment));
                    }
                }
                true
            });
            if found.len() >= count || self.reach >= most {
                break;
            }
            self.reach *= 1.3;
        }
        // In trees that become denser, the reach follows.
        if self.found.len() > 2 * count {
            self.reach *= 0.9;
        }
        self.found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.found.truncate(count);
    }

    /// Lists the ways to connect a point to its `count` nearest segments, the cheapest first. Returns how many segments
    /// were looked at.
    pub(super) fn list(
        &mut self,
        space: &Space,
        point: DVec3,
        count: usize,
        tolerance: f64,
        may_join: impl Fn(u32) -> bool,
    ) -> usize {
        self.nearest(space, point, count, may_join);
        self.sorted.clear();
        self.sorted.extend(self.found.iter().filter_map(|&(_, segment)| space.candidate(segment, point, tolerance)));
        self.sorted.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.segment.cmp(&b.segment)));
        self.found.len()
    }
}

impl Space {
    /// The best way to connect a point to a segment; `None` if the new segments would be too short for their radii.
    pub(super) fn candidate(&self, segment: u32, point: DVec3, tolerance: f64) -> Option<Candidate> {
        let (forest, node) = (&self.forest, self.forest.node(segment));
        let joint = Joint {
            ends: [forest.place(node.parent), node.at.as_dvec3(), point],
            flows: [node.flow, 1.0],
            below: [node.below(forest.exponent), Below::default()],
            exponent: forest.exponent,
        };
        let start = joint.start();
        let slope = forest.ascend(segment, joint.sums(start).trunk, 1.0).slope;
        // Rounded, as it will be kept.
        let place = joint.settle(start, &slope, tolerance).as_vec3().as_dvec3();
        let sums = joint.sums(place);
        let ascent = forest.ascend(segment, sums.trunk, 1.0);
        let trunk = self.unit[node.tree as usize] * ascent.root.load * ascent.thinning;
        let fourths = [
            trunk,
            trunk * sums.children[0].load / sums.below.load,
            trunk * sums.children[1].load / sums.below.load,
        ];
        // 2r ≤ l, as fourth powers.
        let is_long = |(fourth, length): (f64, f64)| 16.0 * fourth <= (length * length) * (length * length);
        let before = forest.node(self.root_segment(node.tree)).sums.volume;
        let cost = ascent.root.volume - before;
        debug_assert!(node.parent != NONE);
        (fourths.into_iter().zip(sums.lengths).all(is_long) && cost.is_finite())
            .then_some(Candidate { segment, place, cost })
    }

    /// Connects a terminal as a candidate says, if there is room; otherwise nothing is changed.
    pub(super) fn connect(&mut self, candidate: &Candidate, terminal: DVec3) -> bool {
        self.begin();
        let [joint, end] = self.split(candidate.segment, candidate.place, terminal);
        let has_room = !self.domain.is_forbidden(candidate.place) && self.has_room(&[joint, candidate.segment, end]);
        if !has_room {
            self.undo();
        }
        has_room
    }
}
