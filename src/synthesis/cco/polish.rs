//! Moves every bifurcation to the place of least volume under the final flows.
//!
//! OpenCCO leaves a bifurcation where it was best when it was made. Sweeps over all bifurcations, each with the others
//! as they are by then (Gauss–Seidel), take some per cent off the volume. A bifurcation moves only if there is room.
//!
//! Searching takes longest. It is done for many bifurcations at a time, from the same state of the trees. Each that
//! moves changes the flow's resistance for the others by very little. Only those next to it search again.

use super::{forest::NONE, joint::Joint, space::Space};
use crate::synthesis::parallel::Help;
use bevy_math::DVec3;
use std::ops::Range;

/// Shares of the way to the best place that are tried in turn, if there is no room at its end.
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
/// Way to the best place, in lengths of the shortest of the three segments, below which a bifurcation stays.
const STILL: f64 = 1.0e-4;
/// Nodes that a thread looks at in a row.
const IN_A_ROW: u32 = 8;

/// A bifurcation that should be somewhere else.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wish {
    node: u32,
    /// Where it and its neighbours are.
    from: [DVec3; 4],
    /// Its best place.
    to: DVec3,
}

impl Space {
    /// Moves all bifurcations of some nodes that were not given, if there is room and the trees become smaller.
    pub(super) fn polish(&mut self, nodes: Range<u32>, tolerance: f64, help: &mut Help) {
        let mut wishes = vec![None; nodes.len()];
        let mut rows: Vec<&mut [Option<Wish>]> = wishes.chunks_mut(IN_A_ROW as usize).collect();
        let look = |row: usize, wishes: &mut &mut [Option<Wish>]| {
            for (node, wish) in (nodes.start + row as u32 * IN_A_ROW..).zip(wishes.iter_mut()) {
                *wish = self.wish(node, tolerance);
            }
        };
        help.for_each(&mut rows, look, || ());
        for wish in wishes.into_iter().flatten() {
            self.fulfil(wish, tolerance);
        }
    }

    /// Where a node should be, if it is a bifurcation and not there.
    fn wish(&self, node: u32, tolerance: f64) -> Option<Wish> {
        let (forest, own) = (&self.forest, self.forest.node(node));
        if own.parent == NONE || own.children[1] == NONE || node < self.given {
            return None;
        }
        let from = self.around(node);
        let [start, ends @ ..] = from;
        let joint = Joint {
            ends,
            flows: own.children.map(|child| forest.node(child).flow),
            below: own.children.map(|child| forest.below(child)),
            exponent: forest.exponent,
        };
        let slope = forest.ascend(node, forest.sums(node), 0.0).slope;
        let to = joint.settle(start, &joint.sums(start), &slope, tolerance);
        let shortest = ends.into_iter().map(|end| end.distance(start)).fold(f64::MAX, f64::min);
        (to.distance(start) >= STILL * shortest).then_some(Wish { node, from, to })
    }

    /// Places of a bifurcation, its parent and its children.
    fn around(&self, node: u32) -> [DVec3; 4] {
        let [a, b] = self.forest.node(node).children;
        [node, self.forest.node(node).parent, a, b].map(|node| self.forest.place(node))
    }

    /// Moves a bifurcation as it wishes, if there is room and the tree becomes smaller. If its neighbours have moved
    /// meanwhile, it has another wish.
    fn fulfil(&mut self, wish: Wish, tolerance: f64) {
        let is_outdated = self.around(wish.node) != wish.from;
        let Some(wish) = (if is_outdated { self.wish(wish.node, tolerance) } else { Some(wish) }) else { return };
        let root = self.root_segment(self.forest.node(wish.node).tree);
        let before = self.forest.node(root).volume;
        for share in SHARES {
            if self.try_shift(wish.node, wish.from[0].lerp(wish.to, share).as_vec3().as_dvec3()) {
                if self.forest.node(root).volume < before {
                    return;
                }
                self.undo();
            }
        }
    }

    /// Moves a bifurcation if there is room; otherwise nothing is changed.
    pub(super) fn try_shift(&mut self, node: u32, place: DVec3) -> bool {
        let [a, b] = self.forest.node(node).children;
        let changed = [node, a, b];
        let lengths = changed.map(|segment| self.forest.length(segment));
        self.begin();
        self.shift(node, place);
        let are_long = changed.iter().zip(lengths).all(|(&own, before)| self.is_long_enough(own, before));
        let moves = are_long && self.has_room(&changed);
        if !moves {
            self.undo();
        }
        moves
    }
}
