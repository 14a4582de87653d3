//! Moves every bifurcation to the place of least volume under the final flows.
//!
//! OpenCCO leaves a bifurcation where it was best when it was made. Sweeps over all bifurcations, each with the others
//! as they are by then (Gauss–Seidel), take some per cent off the volume. A bifurcation moves only if there is room.

use super::{forest::NONE, joint::Joint, space::Space};
use bevy_math::DVec3;

/// Shares of the way to the best place that are tried in turn, if there is no room at its end.
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
/// Way to the best place, in lengths of the shortest of the three segments, below which a bifurcation stays.
const STILL: f64 = 1.0e-4;

impl Space {
    /// Moves a node, if it is a bifurcation that was not given and the tree becomes smaller. Returns whether it moved.
    pub(super) fn polish(&mut self, node: u32, tolerance: f64) -> bool {
        let (forest, own) = (&self.forest, self.forest.node(node));
        if own.parent == NONE || own.children[1] == NONE || node < self.given {
            return false;
        }
        let children = own.children;
        let joint = Joint {
            ends: [forest.place(own.parent), forest.place(children[0]), forest.place(children[1])],
            flows: children.map(|child| forest.node(child).flow),
            below: children.map(|child| forest.below(child)),
            exponent: forest.exponent,
        };
        let (start, tree) = (own.at.as_dvec3(), own.tree);
        let changed = [node, children[0], children[1]];
        let lengths = changed.map(|segment| forest.length(segment));
        let slope = forest.ascend(node, forest.sums(node), 0.0).slope;
        let best = joint.settle(start, &joint.sums(start), &slope, tolerance);
        if best.distance(start) < STILL * lengths.into_iter().fold(f64::MAX, f64::min) {
            return false;
        }
        let before = self.forest.node(self.root_segment(tree)).volume;
        SHARES.into_iter().any(|share| {
            let moves = self.try_shift(node, start.lerp(best, share).as_vec3().as_dvec3());
            let is_smaller = self.forest.node(self.root_segment(tree)).volume < before;
            if moves && !is_smaller {
                self.undo();
            }
            moves && is_smaller
        })
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
