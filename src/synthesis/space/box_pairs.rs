//! All pairs of boxes that overlap.
//!
//! In: boxes. Out: each pair once. The boxes are sorted along a space-filling curve; every few that follow each other
//! get a box around them, and so on up to a single one. Then the tree is joined with itself, from the top: two nodes
//! that overlap have their children compared. Memory is linear in the number of boxes, and so is time, but for the pairs
//! themselves.

use crate::synthesis::{
    pace::{Pace, Stretch},
    space::{bvh::Bounds, morton::Curve},
};
use bevy_math::Vec3;
use std::ops::Range;

/// Children of a node. More make fewer levels, and more comparisons of neighbours that don't overlap.
const CHILDREN: usize = 4;

/// A tree over boxes, for their pairs.
///
/// As in a [`BoxTree`](super::bvh::BoxTree), a box is identified by its slot, its place in [`order`](Self::order).
pub(crate) struct BoxPairs {
    order: Vec<u32>,
    /// The boxes in this order, then those around every few of the level below.
    levels: Vec<Vec<Bounds>>,
}

/// Two nodes of the same level, or one node twice, whose children have to be compared.
#[derive(Clone, Copy)]
struct NodePair {
    level: usize,
    nodes: [usize; 2],
}

impl BoxPairs {
    /// Builds the tree as [paced](crate::synthesis::pace) work, over `count` boxes without NaN.
    pub async fn new_paced(count: usize, box_of: impl Fn(usize) -> Bounds, pace: &Pace) -> Self {
        let mut around = Bounds::EMPTY;
        pace.part(0.0..0.1).each(count, |id| around = around.with(box_of(id))).await;
        let curve = Curve::around([around.min, around.max].map(Vec3::from).into_iter(), 1.0);
        let keyed = |id: usize| {
            let Bounds { min, max } = box_of(id);
            (curve.key(min.midpoint(max).into()), id as u32)
        };
        let mut keys: Vec<(u64, u32)> = pace.part(0.1..0.2).collect(count, keyed).await;
        pace.part(0.2..0.7).sort(&mut keys).await;
        let order: Vec<u32> = pace.part(0.7..0.75).collect(count, |slot| keys[slot].1).await;
        drop(keys);
        let mut levels = vec![pace.part(0.75..0.85).collect(count, |slot| box_of(order[slot] as usize)).await];
        let pace = pace.part(0.85..1.0);
        while let Some(below) = levels.last()
            && below.len() > 1
        {
            let enclose =
                |node: usize| below[children(node, below.len())].iter().copied().fold(Bounds::EMPTY, Bounds::with);
            let level = pace.collect(below.len().div_ceil(CHILDREN), enclose).await;
            levels.push(level);
        }
        pace.rest(1.0).await;
        Self { order, levels }
    }

    /// For every slot, the index of its box in the list that the tree was built from.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Visits all pairs of different boxes that share a point, by slot, the lower slot first, as
    /// [paced](crate::synthesis::pace) work. The order of pairs is always the same.
    pub async fn each_paced(&self, mut visit: impl FnMut(usize, usize), pace: &Pace) {
        let top = self.levels.len() - 1;
        let (mut stretch, mut done) = (Stretch::default(), 0);
        let mut pending = Vec::new();
        if top > 0 {
            pending.push(NodePair { level: top, nodes: [0, 0] });
        }
        while let Some(pair) = pending.pop() {
            let pairs = self.open(pair, &mut pending, &mut visit);
            // A node of the lowest level is compared with itself before it is with those after it.
            if pair.level == 1 && pair.nodes[0] == pair.nodes[1] {
                done += CHILDREN;
            }
            if stretch.ends_after(pairs + 1) {
                pace.rest(done as f32 / self.order.len() as f32).await;
            }
        }
        pace.rest(1.0).await;
    }

    /// Compares the children of two nodes: visits those that overlap if they are boxes, or else adds them to the
    /// pending pairs. Returns how many were visited.
    fn open(&self, pair: NodePair, pending: &mut Vec<NodePair>, visit: &mut impl FnMut(usize, usize)) -> usize {
        let NodePair { level, nodes: [first, second] } = pair;
        let (below, other) = (&self.levels[level - 1], &self.levels[level][second]);
        let mut visited = 0;
        // The last added is the first taken, so they are added in reverse order.
        for a in children(first, below.len()).rev() {
            let bounds = &below[a];
            if first != second && !bounds.overlaps(other) {
                continue;
            }
            for b in children(second, below.len()).rev() {
                if b < a || !bounds.overlaps(&below[b]) {
                    continue;
                }
                if level > 1 {
                    pending.push(NodePair { level: level - 1, nodes: [a, b] });
                } else if a != b {
                    visit(a, b);
                    visited += 1;
                }
            }
        }
        visited
    }
}

/// The children of a node, in a level of so many nodes.
fn children(node: usize, len: usize) -> Range<usize> {
    CHILDREN * node..len.min(CHILDREN * (node + 1))
}

#[cfg(test)]
mod tests {
    use crate::synthesis::{
        pace::{Pace, at_once},
        random::Stream,
        space::box_pairs::*,
    };
    use bevy_math::Vec3A;
    use rand::{Rng, RngExt};

    /// Random boxes in a cube of a side; their corners are whole numbers, so that many just touch.
    fn boxes(count: usize, side: i32, largest: i32, rng: &mut impl Rng) -> Vec<Bounds> {
        let mut corner = |most: i32| Vec3A::from_array(std::array::from_fn(|_| rng.random_range(0..=most) as f32));
        let mut bounds = || {
            let min = corner(side);
            Bounds { min, max: min + corner(largest) }
        };
        (0..count).map(|_| bounds()).collect()
    }

    /// The pairs in the order of the visit, by number of box, the lower first.
    fn pairs(boxes: &[Bounds], pace: &Pace) -> Vec<[u32; 2]> {
        at_once(async {
            let tree = BoxPairs::new_paced(boxes.len(), |id| boxes[id], &pace.part(0.0..0.5)).await;
            let mut pairs = Vec::new();
            let visit = |a: usize, b: usize| {
                assert!(a < b, "slots {a} and {b}");
                let [a, b] = [a, b].map(|slot| tree.order()[slot]);
                pairs.push([a.min(b), a.max(b)]);
            };
            tree.each_paced(visit, &pace.part(0.5..1.0)).await;
            pairs
        })
    }

    fn by_brute_force(boxes: &[Bounds]) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for (a, first) in boxes.iter().enumerate() {
            for (b, second) in boxes.iter().enumerate().skip(a + 1) {
                if (0..3).all(|axis| first.min[axis].max(second.min[axis]) <= first.max[axis].min(second.max[axis])) {
                    pairs.push([a as u32, b as u32]);
                }
            }
        }
        pairs
    }

    #[test]
    fn every_pair_is_visited_once() {
        let mut rng = Stream::Statistics.rng(3);
        for count in [0, 1, 2, 3, 4, 5, 16, 17, 64, 65, 300, 1500] {
            // Flat boxes, small ones, and some that overlap most others.
            for (side, largest) in [(12, 0), (30, 3), (8, 8), (0, 0), (1000, 60)] {
                let boxes = boxes(count, side, largest, &mut rng);
                let mut found = pairs(&boxes, &Pace::default());
                found.sort_unstable();
                assert_eq!(found, by_brute_force(&boxes), "{count} boxes of {largest} in {side}");
            }
        }
    }

    #[test]
    fn pauses_change_nothing_and_progress_ends_at_one() {
        let boxes = boxes(5000, 60, 4, &mut Stream::Statistics.rng(4));
        let pace = Pace::new(|| true);
        assert_eq!(pairs(&boxes, &pace), pairs(&boxes, &Pace::default()));
        assert_eq!(pace.progress(), 1.0);
    }

    #[test]
    fn infinite_and_huge_boxes_are_found() {
        let whole = Bounds { min: Vec3A::NEG_INFINITY, max: Vec3A::INFINITY };
        let huge = Bounds { min: Vec3A::splat(-3e38), max: Vec3A::splat(3e38) };
        let unit = Bounds { min: Vec3A::ZERO, max: Vec3A::ONE };
        let far = Bounds { min: Vec3A::splat(2.0), max: Vec3A::splat(f32::MAX) };
        let mut found = pairs(&[whole, huge, unit, far], &Pace::default());
        found.sort_unstable();
        assert_eq!(found, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3]]);
    }
}
