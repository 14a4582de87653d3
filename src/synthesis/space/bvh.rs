//! A bounding volume hierarchy: the index for queries near a point or along a line.
//!
//! [`BoxTree`] knows only boxes; their contents belong to the caller. It is built once by binned surface-area splits
//! (Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007) into one flat array in depth-first
//! order, and queried without allocating.

use crate::synthesis::pace::{Pace, STRETCH, Stretch, at_once};
use bevy_math::{BVec3A, Vec3, Vec3A};
use std::ops::Range;

/// Candidate planes per split, plus one.
const BINS: usize = 16;
/// Most boxes in a leaf.
const LEAF: usize = 4;
/// Depth from which boxes are halved by number, so that depth stays below [`STACK`] for any shape.
const DEEP: u32 = 48;
/// Size of the stack of pending nodes: [`DEEP`] levels and 2³² boxes halved by number.
const STACK: usize = 96;
/// Factor that lowers the square of a length by a few rounding errors.
const SHORTENED: f32 = 1.0 - 4.0 * f32::EPSILON;

/// An axis-aligned box, in the coordinates of the tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest corner.
    pub min: Vec3A,
    /// Highest corner.
    pub max: Vec3A,
}

impl Bounds {
    /// An empty box, which any point enlarges.
    pub const EMPTY: Self = Self { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn around(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, &point| bounds.with_point(point.into()))
    }

    fn with_point(self, point: Vec3A) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    pub(crate) fn with(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Half the surface area; 0 for an empty box.
    fn half_area(self) -> f32 {
        let size = (self.max - self.min).max(Vec3A::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Squared distance to a point, 0 inside; never above that of any point of the box, despite rounding.
    pub(crate) fn distance_squared(&self, point: Vec3A) -> f32 {
        let outside = (self.min - point).max(point - self.max).max(Vec3A::ZERO);
        outside.length_squared() * SHORTENED
    }

    /// Whether two boxes share a point.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        (self.min.cmple(other.max) & self.max.cmpge(other.min)).all()
    }

    /// Parameter at which a line enters the box, at or after 0 and before `limit`. `inverse` is 1 / direction.
    fn entry(&self, from: Vec3A, inverse: Vec3A, limit: f32) -> Option<f32> {
        let (a, b) = ((self.min - from) * inverse, (self.max - from) * inverse);
        // A line within a face gives 0 · ∞, NaN: count it as inside.
        let within: BVec3A = a.is_nan_mask() | b.is_nan_mask();
        let near = Vec3A::select(within, Vec3A::NEG_INFINITY, a.min(b));
        let far = Vec3A::select(within, Vec3A::INFINITY, a.max(b));
        let (enter, leave) = (near.max_element().max(0.0), far.min_element());
        (enter <= leave && enter <= limit).then_some(enter)
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// For a leaf, its first slot. For an inner node, its second child; the first child follows the node.
    link: u32,
    /// Number of boxes in a leaf, 0 for an inner node.
    count: u32,
}

/// The hierarchy over a list of boxes.
///
/// A box is identified by its slot, its place in [`order`](Self::order). Callers keep their own data in that order, so
/// that data used together lies together.
#[derive(Clone, Debug, Default)]
pub struct BoxTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// A box while the tree is built.
#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    id: u32,
    /// Its bin in the current split.
    bin: u32,
}

impl Item {
    /// Twice the centre.
    fn centre(&self) -> Vec3A {
        self.bounds.min + self.bounds.max
    }
}

impl BoxTree {
    /// Builds the tree over boxes, which may overlap, be flat or coincide.
    pub fn new(boxes: impl IntoIterator<Item = Bounds>) -> Self {
        let boxes: Vec<Bounds> = boxes.into_iter().collect();
        at_once(Self::new_paced(boxes.len(), |id| boxes[id], &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work, over `count` boxes, each requested once.
    pub async fn new_paced(count: usize, box_of: impl Fn(usize) -> Bounds, pace: &Pace) -> Self {
        let item = |id: usize| Item { bounds: box_of(id), id: id as u32, bin: 0 };
        let mut items: Vec<Item> = pace.part(0.0..0.1).collect(count, item).await;
        let (pace, last) = (pace.part(0.1..0.95), pace.part(0.95..1.0));
        let mut stretch = Stretch::default();
        let mut nodes: Vec<Node> = Vec::with_capacity(items.len());
        // Ranges that are not nodes yet, with the node whose second child they are.
        let mut pending = Vec::new();
        if !items.is_empty() {
            pending.push((0, items.len(), None::<usize>, 0u32));
        }
        while let Some((start, end, parent, depth)) = pending.pop() {
            let index = nodes.len();
            if let Some(parent) = parent {
                nodes[parent].link = index as u32;
            }
            let range = &mut items[start..end];
            // The items before are in their final places.
            let done = start as f32 / count as f32;
            if stretch.ends_after(range.len().min(STRETCH)) {
                pace.rest(done).await;
            }
            let (mut bounds, mut centres) = (Bounds::EMPTY, Bounds::EMPTY);
            for items in range.chunks(STRETCH) {
                for item in items {
                    bounds = bounds.with(item.bounds);
                    centres = centres.with_point(item.centre());
                }
                if items.len() == STRETCH {
                    pace.rest(done).await;
                }
            }
            if range.len() <= LEAF {
                nodes.push(Node { bounds, link: start as u32, count: range.len() as u32 });
                continue;
            }
            nodes.push(Node { bounds, link: 0, count: 0 });
            let middle = start
                + match Split::new(&centres, depth) {
                    None => halve(range, &centres),
                    Some(split) if range.len() <= STRETCH => split.carry_out(range),
                    Some(split) => split.carry_out_paced(range, &pace, done).await,
                };
            pending.push((middle, end, Some(index), depth + 1));
            pending.push((start, middle, None, depth + 1));
        }
        let order = last.collect(count, |slot| items[slot].id).await;
        Self { nodes, order }
    }

    /// For every slot, the index of its box in the list that the tree was built from.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Visits boxes in order of their distance to a point, while they can be nearer than the best found.
    ///
    /// `visit(slot, best)` measures the contents of the box and returns the squared distance of the best so far. The
    /// search begins with `limit`. A box exactly as far as the best is still visited, so that ties can be broken by the
    /// caller.
    #[inline]
    pub fn nearest(&self, point: Vec3, limit: f32, mut visit: impl FnMut(usize, f32) -> f32) {
        let point = Vec3A::from(point);
        let mut best = limit;
        let mut stack = [(0u32, 0f32); STACK];
        let mut depth = 0;
        let mut next = self.nodes.first().map(|root| (0, root.bounds.distance_squared(point)));
        while let Some((index, distance)) = next {
            if distance <= best {
                let node = &self.nodes[index as usize];
                if node.count == 0 {
                    let (near, far) = (index + 1, node.link);
                    let to_near = self.nodes[near as usize].bounds.distance_squared(point);
                    let to_far = self.nodes[far as usize].bounds.distance_squared(point);
                    let (first, second) = if to_near <= to_far {
                        ((near, to_near), (far, to_far))
                    } else {
                        ((far, to_far), (near, to_near))
                    };
                    if second.1 <= best {
                        stack[depth] = second;
                        depth += 1;
                    }
                    next = Some(first);
                    continue;
                }
                for slot in node.link..node.link + node.count {
                    best = visit(slot as usize, best);
                }
            }
            next = depth.checked_sub(1).map(|top| {
                depth = top;
                stack[top]
            });
        }
    }

    /// Visits every box that shares a point with `region`, until `visit` returns false.
    pub fn overlapping(&self, region: &Bounds, visit: impl FnMut(usize) -> bool) {
        self.walk(|bounds| bounds.overlaps(region), visit);
    }

    /// Visits boxes along the segment between two points, while they can be hit before the first hit found.
    ///
    /// `visit(slot, limit)` returns the share of the segment, 0 to 1, up to which the search goes on.
    pub fn along(&self, from: Vec3, to: Vec3, mut visit: impl FnMut(usize, f32) -> f32) {
        let from = Vec3A::from(from);
        let inverse = (Vec3A::from(to) - from).recip();
        let limit = std::cell::Cell::new(1.0);
        self.walk(
            |bounds| bounds.entry(from, inverse, limit.get()).is_some(),
            |slot| {
                limit.set(visit(slot, limit.get()));
                true
            },
        );
    }

    /// Depth-first traversal of the nodes whose box passes `enters`, until `visit` returns false.
    fn walk(&self, enters: impl Fn(&Bounds) -> bool, mut visit: impl FnMut(usize) -> bool) {
        let mut stack = [0u32; STACK];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index as usize];
            if !enters(&node.bounds) {
                continue;
            }
            if node.count == 0 {
                stack[depth] = node.link;
                stack[depth + 1] = index + 1;
                depth += 2;
                continue;
            }
            for slot in node.link..node.link + node.count {
                if !visit(slot as usize) {
                    return;
                }
            }
        }
    }
}

/// Splits items into equal numbers, along the longest axis of their centres, and returns how many are on the first
/// side.
fn halve(items: &mut [Item], centres: &Bounds) -> usize {
    let axis = (centres.max - centres.min).max_position();
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |a, b| a.centre()[axis].total_cmp(&b.centre()[axis]).then(a.id.cmp(&b.id)));
    half
}

/// A split of items by a plane across an axis. It may process some of them at a time.
struct Split {
    axis: usize,
    /// Start of the bins, and their number per length.
    min: f32,
    scale: f32,
    bins: [(Bounds, u32); BINS],
    /// Items found on the first side so far.
    middle: usize,
}

impl Split {
    /// `None` if centres coincide or their extent is degenerate, so that only a split by number is possible.
    fn new(centres: &Bounds, depth: u32) -> Option<Self> {
        let size = centres.max - centres.min;
        let axis = size.max_position();
        let is_possible = depth < DEEP && size[axis] > 0.0;
        is_possible.then(|| Self {
            axis,
            min: centres.min[axis],
            scale: BINS as f32 / size[axis],
            bins: [(Bounds::EMPTY, 0); BINS],
            middle: 0,
        })
    }

    /// Sorts some items into bins.
    fn sort_into_bins(&mut self, items: &mut [Item]) {
        for item in items {
            item.bin = (((item.centre()[self.axis] - self.min) * self.scale) as u32).min(BINS as u32 - 1);
            let (bounds, count) = &mut self.bins[item.bin as usize];
            *bounds = bounds.with(item.bounds);
            *count += 1;
        }
    }

    /// Moves those of some items that are before a plane to the first side.
    fn part_at(&mut self, plane: u32, items: &mut [Item], range: Range<usize>) {
        for i in range {
            if items[i].bin < plane {
                items.swap(i, self.middle);
                self.middle += 1;
            }
        }
    }

    /// Number of items on the first side: at least one, and not all.
    fn end(&self, items: &[Item]) -> usize {
        // The first and the last bin hold the outermost centres, so a side is empty only because of rounding.
        if self.middle == 0 || self.middle == items.len() { items.len() / 2 } else { self.middle }
    }

    /// Sorts items to the two sides of the cheapest plane, and returns how many are on the first.
    fn carry_out(mut self, items: &mut [Item]) -> usize {
        self.sort_into_bins(items);
        let plane = cheapest_plane(&self.bins);
        self.part_at(plane, items, 0..items.len());
        self.end(items)
    }

    /// The same as [paced](crate::synthesis::pace) work.
    async fn carry_out_paced(mut self, items: &mut [Item], pace: &Pace, done: f32) -> usize {
        for items in items.chunks_mut(STRETCH) {
            self.sort_into_bins(items);
            pace.rest(done).await;
        }
        let plane = cheapest_plane(&self.bins);
        for start in (0..items.len()).step_by(STRETCH) {
            self.part_at(plane, items, start..items.len().min(start + STRETCH));
            pace.rest(done).await;
        }
        self.end(items)
    }
}

/// The bin before which to split so that area times number, over both sides, is least.
fn cheapest_plane(bins: &[(Bounds, u32); BINS]) -> u32 {
    let mut left = [0.0; BINS];
    let (mut bounds, mut count) = (Bounds::EMPTY, 0);
    for plane in 1..BINS {
        bounds = bounds.with(bins[plane - 1].0);
        count += bins[plane - 1].1;
        left[plane] = bounds.half_area() * count as f32;
    }
    let (mut bounds, mut count) = (Bounds::EMPTY, 0);
    let mut best = (f32::INFINITY, BINS / 2);
    for plane in (1..BINS).rev() {
        bounds = bounds.with(bins[plane].0);
        count += bins[plane].1;
        let cost = left[plane] + bounds.half_area() * count as f32;
        if cost < best.0 {
            best = (cost, plane);
        }
    }
    best.1 as u32
}
