//! No two segments of any trees overlap, unless they share a node, and none leaves the tissue.
//!
//! A segment is the round cone that it is drawn and meshed as: it begins wider than it ends, with its parent's radius
//! or [`FLARE`] times its own, whichever is less. Only a root's segment is a cylinder. The ratio of both radii, its
//! *flare*, changes with every terminal, too. So a segment has room for a flare 5 % above its own, and is looked at
//! again when its start has outgrown that.
//!
//! A new terminal changes the radii of all segments of its tree a little, so a look at the new ones is not enough.
//! Every segment has a *bound*: a radius that it may have without touching others at theirs, or the border. Each
//! subtree keeps its *strain*, the largest ratio of radius to bound in it, for a radius of 1 at its top. If the root's
//! radius times the root's strain is at most 1, all segments of the tree are within their bounds: one comparison for a
//! million segments. Otherwise the strains lead to those that are not. They get wider bounds, if their neighbours leave
//! room.
//!
//! A bound is 5 % above the radius, so a segment is looked at again only after it grew by that. If two bounds leave no
//! room between two segments while their radii do, both bounds are drawn in.

use super::{
    distance::squared_between,
    forest::{FLARE, Flare, Forest, NONE},
    space::{SLACK, Space},
};
use crate::synthesis::segment_index::round_cone::RoundCone;

/// Least distance between two segments, as a multiple of the sum of their radii. It is above 1 by more than the
/// rounding of a tree in f32.
pub(super) const APART: f64 = 1.0 + 2.0e-6;
/// Least length of a new segment, in radii.
const LEAST_LENGTH: f64 = 2.0;

/// A bound in f32 that is no larger, so that it never takes what it was not given; [`APART`] leaves room for that.
fn rounded_down(bound: f64) -> f32 {
    (bound * (1.0 - 1.0e-7)) as f32
}

impl Space {
    /// Whether the segments of a change, which are in the index, and all others whose radii it changed have room. If
    /// so, all bounds and strains are up to date.
    pub(super) fn has_room(&mut self, changed: &[u32]) -> bool {
        for &segment in changed {
            if !self.clear(segment, self.reserve) {
                return false;
            }
        }
        // From the ends up: the joint is the first of them.
        for &segment in changed.iter().rev() {
            let strain = self.forest.strain_of(segment);
            self.change(segment).strain = strain;
        }
        let Some(&top) = changed.first() else { return true };
        self.strain_above(top);
        self.fit(self.forest.node(top).tree)
    }

    /// Whether a segment is long enough for its radius, or at least as long as before.
    pub(super) fn is_long_enough(&self, segment: u32, before: f64) -> bool {
        let length = self.forest.length(segment);
        length >= LEAST_LENGTH * self.radius(segment) || length >= before
    }

    /// Brings every segment of a tree within its bound.
    fn fit(&mut self, tree: u32) -> bool {
        let root = self.root_segment(tree);
        let radius = self.radius(root);
        if radius * f64::from(self.forest.node(root).strain) <= 1.0 {
            return true;
        }
        let (mut wide, mut stack) = (std::mem::take(&mut self.wide), std::mem::take(&mut self.stack));
        wide.clear();
        stack.clear();
        stack.push((root, radius, radius));
        while let Some((segment, radius, parent_radius)) = stack.pop() {
            let node = self.forest.node(segment);
            let bound = f64::from(node.bound);
            if radius > bound || Forest::start_radius(parent_radius, radius) > node.flare.ratio() * bound {
                wide.push(segment);
            }
            if radius * f64::from(node.strain) > 1.0 {
                let children = node.children.iter().filter(|&&child| child != NONE);
                let radius_of = |child: u32| radius * self.forest.thinning(child).sqrt().sqrt();
                stack.extend(children.map(|&child| (child, radius_of(child), radius)));
            }
        }
        let fits = wide.iter().all(|&segment| {
            let fits = self.clear(segment, 1.0);
            if fits {
                self.strain_from(segment);
            } else {
                self.blocked = Some([segment, self.in_the_way]);
            }
            fits
        });
        (self.wide, self.stack) = (wide, stack);
        fits
    }

    /// A segment as the round cone with this radius and flare.
    pub(super) fn cone(&self, segment: u32, radius: f64, flare: Flare) -> RoundCone {
        let own = self.forest.node(segment);
        let [start, end] = [self.forest.place(own.parent), own.at.as_dvec3()];
        RoundCone { start, end, start_radius: flare.ratio() * radius, end_radius: radius }
    }

    /// Finds a bound for a segment, drawing in those of its neighbours if need be; `false` if there is no room for
    /// radii that are `reserve` times as wide.
    pub(super) fn clear(&mut self, segment: u32, reserve: f64) -> bool {
        self.in_the_way = segment;
        let radius = self.radius(segment);
        let parent = self.forest.node(segment).parent;
        let ends = [self.forest.place(parent), self.forest.place(segment)];
        let is_entrance = self.forest.node(parent).parent == NONE;
        // Some room for the flare to grow, too, where there is any.
        let widening = self.forest.widening(segment);
        let [tight, mut flare] =
            [APART, SLACK].map(|more| Flare::at_least(if is_entrance { 1.0 } else { more * widening }));
        let mut bound = SLACK * radius;
        let is_given = segment < self.given && parent < self.given;
        if !is_given && !self.domain.holds(&self.cone(segment, bound, flare), is_entrance) {
            (bound, flare) = (radius * reserve.max(APART), tight);
            if !self.domain.holds(&self.cone(segment, bound, flare), is_entrance) {
                return false;
            }
        }
        let mut tightened = std::mem::take(&mut self.tightened);
        tightened.clear();
        let (mut has_room, mut in_the_way) = (true, segment);
        let (middle, half) = (ends[0].midpoint(ends[1]), 0.5 * ends[0].distance(ends[1]));
        self.index.near(ends[0], ends[1], FLARE * bound, |other| {
            let node = self.forest.node(other);
            let sum = FLARE * (bound + f64::from(node.bound));
            // Most are too far away, which one of their ends shows.
            let reach = half + node.reach() + sum;
            if middle.distance_squared(node.at.as_dvec3()) >= reach * reach {
                return true;
            }
            if other == segment || self.forest.are_incident(segment, other) {
                return true;
            }
            let other_ends = [self.forest.place(node.parent), node.at.as_dvec3()];
            let square = squared_between(ends, other_ends);
            if square >= sum * sum {
                return true;
            }
            let beside = self.cone(other, node.bound.into(), node.flare);
            if self.cone(segment, bound, flare).depth_in(&beside, 0.0) <= 0.0 {
                return true;
            }
            // Now as tight as may be.
            let other_radius = self.least_bound(other);
            flare = tight;
            let depth = |share: f64| {
                let other = self.cone(other, share * other_radius, node.flare);
                self.cone(segment, share * radius, flare).depth_in(&other, 0.0)
            };
            // What is plain from the axes needs no search.
            let least = APART * (radius + other_radius);
            let spare = if square < least * least { -1.0 } else { -depth(APART) };
            if spare < 0.0 || reserve > APART && depth(reserve) > 0.0 {
                (has_room, in_the_way) = (false, other);
                return false;
            }
            // Half of the room for each, but no bound becomes wider. A start takes up to FLARE times as much.
            let other_bound = rounded_down(APART * other_radius + 0.5 * spare / FLARE).min(node.bound);
            tightened.push((other, other_bound));
            let taken = (f64::from(other_bound) - APART * other_radius).max(0.0);
            bound = bound.min(APART * radius + spare / FLARE - taken);
            true
        });
        if has_room {
            let own = self.change(segment);
            (own.bound, own.flare) = (rounded_down(bound), flare);
            self.index.refit(&self.forest, segment);
            for &(other, bound) in &tightened {
                let node = self.change(other);
                node.bound = node.bound.min(bound);
                self.strain_from(other);
            }
        }
        self.tightened = tightened;
        self.in_the_way = in_the_way;
        has_room
    }

    /// The least bound that a segment may have: its radius, or more if it starts wider than its flare says.
    fn least_bound(&self, segment: u32) -> f64 {
        let widening = self.forest.widening(segment).min(FLARE);
        self.radius(segment) * (widening / self.forest.node(segment).flare.ratio()).max(1.0)
    }

    /// Number of pairs of segments that overlap, as they are drawn, without a common node.
    pub(super) fn overlaps(&self) -> usize {
        let segments = || (0..self.forest.nodes.len() as u32).filter(|&node| self.forest.node(node).parent != NONE);
        let radii: Vec<f64> = (0..self.forest.nodes.len() as u32)
            .map(|node| if self.forest.node(node).parent == NONE { 0.0 } else { self.radius(node) })
            .collect();
        let cone = |segment: u32| {
            let (parent, end_radius) = (self.forest.node(segment).parent, radii[segment as usize]);
            let [start, end] = [parent, segment].map(|node| self.forest.place(node));
            let is_entrance = self.forest.node(parent).parent == NONE;
            let above = if is_entrance { end_radius } else { radii[parent as usize] };
            RoundCone { start, end, start_radius: Forest::start_radius(above, end_radius), end_radius }
        };
        let mut pairs = Vec::new();
        for segment in segments() {
            let own = cone(segment);
            self.index.near(own.start, own.end, own.widest(), |other| {
                let is_pair = other < segment && !self.forest.are_incident(segment, other);
                if !is_pair {
                    return true;
                }
                let beside = cone(other);
                let reach = own.widest() + beside.widest();
                let ends = [[own.start, own.end], [beside.start, beside.end]];
                if squared_between(ends[0], ends[1]) < reach * reach && own.depth_in(&beside, 0.0) > 0.0 {
                    pairs.push((segment, other));
                }
                true
            });
        }
        // Some may be visited twice.
        pairs.sort_unstable();
        pairs.dedup();
        pairs.len()
    }

    /// Carries the strain of a changed segment up to the root. All radii on the way have changed.
    fn strain_above(&mut self, segment: u32) {
        let mut parent = self.forest.node(segment).parent;
        while self.forest.node(parent).parent != NONE {
            let strain = self.forest.strain_of(parent);
            self.change(parent).strain = strain;
            parent = self.forest.node(parent).parent;
        }
    }

    /// Carries a changed bound up, as far as it changes any strain: that of the parent may change alone, since it holds
    /// the segment's start. A strain on the path of a change is not up to date yet, but will be.
    fn strain_from(&mut self, changed: u32) {
        let mut segment = changed;
        while self.forest.node(segment).parent != NONE {
            let strain = self.forest.strain_of(segment);
            if strain == self.forest.node(segment).strain && segment != changed {
                return;
            }
            self.change(segment).strain = strain;
            segment = self.forest.node(segment).parent;
        }
    }
}
