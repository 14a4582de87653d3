//! Which segment a new terminal joins: the one that makes the smallest tree.
//!
//! As in sections 4.3 to 4.5 of the paper, the nearest segments are candidates, each gets the best place for a
//! bifurcation, and the one with the least volume of the whole tree is taken. The paper does all that for every
//! candidate, and tests it for intersections. Here each gets a lower bound of its cost first, from one look at it. The
//! best place is searched for, and room looked for, in the order of bounds and costs, until one candidate is connected:
//! the same choice (branch and bound).
//!
//! Ranking changes nothing, so that several terminals are ranked at a time. If a segment has changed until its
//! terminal's turn comes, the terminal is ranked anew.

use super::{
    clearance::APART,
    distance::squared_to_segment,
    forest::NONE,
    joint::{Joint, JointSums},
    paths::Paths,
    space::Space,
    sums::{Below, Slope},
};
use crate::synthesis::segment_index::round_cone::RoundCone;
use bevy_math::DVec3;

/// How much more a search may gain than its first step promises, for a bound. A test compares the choices with those of
/// full searches.
const PROMISE: f64 = 4.0;

/// A way to connect a terminal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// The segment to be split.
    pub segment: u32,
    /// Its ends.
    pub ends: [DVec3; 2],
    /// Where it is split.
    pub place: DVec3,
    /// Volume that it adds, over π and the square of the radius of a load of 1.
    pub cost: f64,
}

/// A segment that a terminal may join, whose best place is not known yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guess {
    segment: u32,
    joint: Joint,
    at_start: JointSums,
    slope: Slope,
    /// Less than what it costs.
    bound: f64,
}

/// What is known of a candidate.
#[derive(Clone, Copy, Debug)]
struct Rank {
    guess: Guess,
    /// Its best place, once that has been searched for.
    known: Option<Candidate>,
}

impl Rank {
    /// The least cost that it may have, and its segment, which decides between equals.
    fn key(&self) -> (f64, u32) {
        (self.known.map_or(self.guess.bound, |known| known.cost), self.guess.segment)
    }
}

/// Finds candidates, and keeps the buffers for them.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    /// Distance within which enough segments are expected.
    reach: f64,
    found: Vec<(f64, u32)>,
    ranks: Vec<Rank>,
    paths: Paths,
    /// Whether no segment is left, or the point is within a vessel.
    is_hopeless: bool,
}

/// How an attempt to connect a terminal ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attempt {
    Connected,
    /// None of the candidates had room.
    Failed,
    /// No segment is left, or the place is within a vessel.
    Hopeless,
    /// A segment has changed since it was ranked.
    Outdated,
}

impl Candidates {
    /// The nearest segments to a point, of trees that `may_join` accepts: at most `count`, the nearest first.
    fn nearest(&mut self, space: &Space, point: DVec3, count: usize, may_join: impl Fn(u32) -> bool) {
        let most = space.domain.diagonal();
        self.reach = if self.reach > 0.0 { self.reach } else { 0.1 * most };
        loop {
            let (found, reach) = (&mut self.found, self.reach);
            let square = reach * reach;
            found.clear();
            space.index.near(point, point, reach, |segment| {
                let node = space.forest.node(segment);
                let end = reach + node.reach();
                if point.distance_squared(node.at.as_dvec3()) <= end * end && may_join(node.tree) {
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
            self.reach *= 1.25;
        }
        // In trees that become denser, the reach follows.
        if 2 * self.found.len() > 3 * count {
            self.reach *= 0.95;
        }
        self.found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.found.truncate(count);
    }

    /// Ranks a point's `count` nearest segments, without the first `known`, up to the best of them. Nothing is changed,
    /// so it may be done for several points at a time.
    pub(super) fn rank(
        &mut self,
        space: &Space,
        point: DVec3,
        [known, count]: [usize; 2],
        tolerance: f64,
        may_join: impl Fn(u32) -> bool,
    ) {
        self.nearest(space, point, count, may_join);
        let is_within = |&(square, segment): &(f64, u32)| {
            let bound = f64::from(space.forest.node(segment).bound);
            square < bound * bound && square.sqrt() < space.radius(segment)
        };
        self.ranks.clear();
        self.is_hopeless = self.found.len() <= known || known == 0 && self.found.iter().any(is_within);
        if self.is_hopeless {
            return;
        }
        self.paths.clear();
        for &(_, segment) in &self.found[known..] {
            self.ranks.push(Rank { guess: space.guess(segment, point, &mut self.paths), known: None });
        }
        self.best(space, tolerance);
    }

    /// Connects a point to the best of the segments that were [ranked](Self::rank) for it and have room.
    pub(super) fn connect(&mut self, space: &mut Space, point: DVec3, tolerance: f64) -> Attempt {
        if self.is_hopeless {
            return Attempt::Hopeless;
        }
        while let Some((rank, best)) = self.best(space, tolerance) {
            if !space.is_there(best.segment, best.ends) {
                return Attempt::Outdated;
            }
            if space.connect(&best, point) {
                return Attempt::Connected;
            }
            self.ranks.swap_remove(rank);
        }
        Attempt::Failed
    }

    /// The candidate with the least cost, and its rank. The least bound or cost comes next: a cost below all bounds is
    /// the least cost.
    fn best(&mut self, space: &Space, tolerance: f64) -> Option<(usize, Candidate)> {
        loop {
            let best = (0..self.ranks.len()).min_by(|&a, &b| {
                let (a, b) = (self.ranks[a].key(), self.ranks[b].key());
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
            })?;
            let rank = &mut self.ranks[best];
            if let Some(known) = rank.known {
                return Some((best, known));
            }
            rank.known = space.search(&rank.guess, tolerance);
            if rank.known.is_none() {
                self.ranks.swap_remove(best);
            }
        }
    }
}

impl Space {
    /// Bounds what it costs to connect a point to a segment.
    pub(super) fn guess(&self, segment: u32, point: DVec3, paths: &mut Paths) -> Guess {
        let (forest, node) = (&self.forest, self.forest.node(segment));
        debug_assert!(node.parent != NONE);
        let joint = Joint {
            ends: [forest.place(node.parent), node.at.as_dvec3(), point],
            flows: [node.flow, self.share],
            below: [forest.below(segment), Below::default()],
            exponent: forest.exponent,
        };
        let start = joint.start();
        let at_start = joint.sums(start);
        let (volume, slope) = paths.ascend(forest, segment, at_start.trunk, self.share);
        let before = forest.node(self.root_segment(node.tree)).volume;
        let bound = volume - before - PROMISE * joint.promise(start, &at_start, &slope);
        Guess { segment, joint, at_start, slope, bound: if bound.is_finite() { bound } else { f64::NEG_INFINITY } }
    }

    /// The best way to connect a point to a segment; `None` if the new segments would be too short for their radii.
    pub(super) fn search(&self, guess: &Guess, tolerance: f64) -> Option<Candidate> {
        let Guess { segment, joint, at_start, slope, .. } = guess;
        let (forest, node) = (&self.forest, self.forest.node(*segment));
        // Rounded, as it will be kept.
        let place = joint.settle(joint.start(), at_start, slope, tolerance).as_vec3().as_dvec3();
        let sums = joint.sums(place);
        let ascent = forest.ascend(*segment, sums.trunk, self.share);
        let trunk = self.unit[node.tree as usize] * ascent.root.load * ascent.thinning;
        let child = |child: usize| trunk * sums.children[child].load / sums.below.load;
        // 2r ≤ l, as fourth powers.
        let is_long = |(fourth, length): (f64, f64)| 16.0 * fourth <= (length * length) * (length * length);
        let before = forest.node(self.root_segment(node.tree)).volume;
        let cost = ascent.root.volume - before;
        let fourths = [trunk, child(0), child(1)];
        let are_long = fourths.into_iter().zip(sums.lengths).all(is_long);
        let ends = [joint.ends[0], joint.ends[1]];
        let is_good = are_long && cost.is_finite() && self.are_inside(guess, place, fourths);
        is_good.then_some(Candidate { segment: *segment, ends, place, cost })
    }

    /// Whether three segments to a place, as cylinders of these radii to the fourth, would be inside the tissue. Where
    /// they are not, there is no need to try; and what this finds out about the border serves those who try.
    fn are_inside(&self, guess: &Guess, place: DVec3, fourths: [f64; 3]) -> bool {
        let is_inside = |(end, fourth): (DVec3, f64)| {
            let radius = APART * fourth.sqrt().sqrt();
            self.domain.holds(&RoundCone { start: place, end, start_radius: radius, end_radius: radius }, false)
        };
        // An entrance need not be inside with all its length.
        let parent = self.forest.node(guess.segment).parent;
        let first = usize::from(self.forest.node(parent).parent == NONE);
        guess.joint.ends.into_iter().zip(fourths).skip(first).all(is_inside)
    }

    /// Whether a segment has these ends.
    fn is_there(&self, segment: u32, ends: [DVec3; 2]) -> bool {
        [self.forest.node(segment).parent, segment].map(|node| self.forest.place(node)) == ends
    }

    /// Connects a terminal as a candidate says, if there is room; otherwise nothing is changed.
    pub(super) fn connect(&mut self, candidate: &Candidate, terminal: DVec3) -> bool {
        self.begin();
        let [joint, end] = self.split(candidate.segment, candidate.place, terminal);
        let has_room = self.has_room(&[joint, candidate.segment, end]);
        if !has_room {
            self.undo();
        }
        has_room
    }
}
