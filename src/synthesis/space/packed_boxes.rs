//! Boxes in packs of eight: a search tree without links, quick to build and to refit.
//!
//! Boxes are given in an order in which neighbours in the list are neighbours in space, such as that of a
//! [`Curve`](super::morton::Curve). Eight consecutive boxes make a pack, eight consecutive packs a pack of the next
//! level, up to a single one: a packed R-tree (Kamel & Faloutsos, "On packing R-trees", CIKM 1993). A box's number
//! alone gives its place, so only boxes are stored, a changed box is corrected along one path, and the eight of a pack
//! are tested at once.
//!
//! Why not [`BoxTree`](super::bvh::BoxTree), which splits by surface area and stays as built: over a million segments,
//! this one is built in half the time and follows moving boxes; queries with a small box take four thirds of the time,
//! with a large box less. Why not a grid: segments lie on sheets and in clusters, and one long segment among short ones
//! would fill many cells.

use crate::synthesis::pace::{Pace, at_once};
use bevy_math::Vec3;

/// Boxes in a pack.
const LANES: usize = 8;
/// Most levels: 8¹¹ exceeds 2³².
const LEVELS: usize = 11;
/// Size of the stack of pending visits: seven siblings on each level, and eight slots on the last.
const STACK: usize = (LEVELS + 1) * LANES;

/// Corners of a box.
pub(crate) type Corners = (Vec3, Vec3);

/// Eight boxes, coordinate by coordinate, so that one comparison tests all eight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pack {
    min: [[f32; LANES]; 3],
    max: [[f32; LANES]; 3],
}

impl Pack {
    const EMPTY: Self = Self { min: [[f32::INFINITY; LANES]; 3], max: [[f32::NEG_INFINITY; LANES]; 3] };

    fn set(&mut self, lane: usize, (min, max): Corners) {
        for axis in 0..3 {
            self.min[axis][lane] = min[axis];
            self.max[axis][lane] = max[axis];
        }
    }

    fn get(&self, lane: usize) -> Corners {
        (
            Vec3::from_array(std::array::from_fn(|axis| self.min[axis][lane])),
            Vec3::from_array(std::array::from_fn(|axis| self.max[axis][lane])),
        )
    }

    /// The box around all eight.
    fn around(&self) -> Corners {
        let min = self.min.map(|lanes| lanes.into_iter().fold(f32::INFINITY, f32::min));
        let max = self.max.map(|lanes| lanes.into_iter().fold(f32::NEG_INFINITY, f32::max));
        (min.into(), max.into())
    }

    /// A bit for each box that shares a point with the given one; none if that holds NaN.
    pub(crate) fn overlaps(&self, (min, max): Corners) -> u8 {
        let mut meets = [true; LANES];
        for axis in 0..3 {
            for (lane, meets) in meets.iter_mut().enumerate() {
                *meets &= (self.min[axis][lane] <= max[axis]) & (self.max[axis][lane] >= min[axis]);
            }
        }
        bits(meets)
    }

    /// A bit for each box that may have a point between all pairs of planes. Only valid for boxes that overlap the
    /// slabs' box.
    pub(crate) fn enters(&self, slabs: &Slabs) -> u8 {
        let (mut middle, mut half) = ([[0f32; LANES]; 3], [[0f32; LANES]; 3]);
        for axis in 0..3 {
            for lane in 0..LANES {
                let (min, max) = (self.min[axis][lane], self.max[axis][lane]);
                middle[axis][lane] = 0.5 * min + 0.5 * max;
                half[axis][lane] = (0.5 * max - 0.5 * min) * WIDENED;
            }
        }
        let mut meets = [true; LANES];
        for &(axis, center, reach) in &slabs.0 {
            let (mut apart, mut room) = ([-center; LANES], [reach; LANES]);
            for (along, axis) in axis.to_array().into_iter().enumerate() {
                for lane in 0..LANES {
                    apart[lane] += axis * middle[along][lane];
                    room[lane] += axis.abs() * half[along][lane];
                }
            }
            for lane in 0..LANES {
                meets[lane] &= apart[lane].abs() <= room[lane];
            }
        }
        bits(meets)
    }

    /// A bit for each box that passes a test.
    pub(crate) fn passes(&self, test: impl Fn(Vec3, Vec3) -> bool) -> u8 {
        bits(std::array::from_fn(|lane| {
            let (min, max) = self.get(lane);
            test(min, max)
        }))
    }

    /// Squared distance of each box from a point, never above that of any point of the box.
    pub(crate) fn distances_squared(&self, point: Vec3) -> [f32; LANES] {
        let mut sums = [0.0; LANES];
        for axis in 0..3 {
            for (lane, sum) in sums.iter_mut().enumerate() {
                let outside = (self.min[axis][lane] - point[axis]).max(point[axis] - self.max[axis][lane]).max(0.0);
                *sum += outside * outside;
            }
        }
        sums.map(|sum| sum * SHORTENED)
    }

    /// Distance along a ray at which each box begins, never after any point of the box; infinity if the ray misses it.
    pub(crate) fn entries(&self, ray: &Ray) -> [f32; LANES] {
        let (mut near, mut far) = ([0f32; LANES], [f32::INFINITY; LANES]);
        for axis in 0..3 {
            let (from, inverse) = (ray.from[axis], ray.inverse[axis]);
            for lane in 0..LANES {
                let (min, max) = (self.min[axis][lane], self.max[axis][lane]);
                // Margin for the rounding of the ray's direction over the distance to the box.
                let room = (min.abs().max(max.abs()) + from.abs()) * RAY_ROOM;
                let (a, b) = ((min - room - from) * inverse, (max + room - from) * inverse);
                near[lane] = near[lane].max(a.min(b));
                far[lane] = far[lane].min(a.max(b));
            }
        }
        std::array::from_fn(|lane| if near[lane] <= far[lane] { near[lane] * SHORTENED } else { f32::INFINITY })
    }
}

/// Factor that adds a few roundings to a length.
const WIDENED: f32 = 1.0 + 2.0e-6;
/// Factor that takes a few roundings off a length or its square.
const SHORTENED: f32 = 1.0 - 1.0e-6;
/// Amount by which a slab is widened, relative to the coordinates in it.
const SLAB_ROOM: f32 = 2.0e-6;
/// Amount by which a box is widened against a ray, relative to its coordinates.
const RAY_ROOM: f32 = 1.0e-6;

fn bits(flags: [bool; LANES]) -> u8 {
    (0..LANES).fold(0, |bits, lane| bits | (u8::from(flags[lane]) << lane))
}

/// A half-line, ready to be tested against packs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    from: Vec3,
    /// 1 / direction, but large instead of infinite for 0, so that no product with 0 is NaN.
    inverse: Vec3,
}

impl Ray {
    /// A ray with a unit direction.
    pub(crate) fn new(from: Vec3, direction: Vec3) -> Self {
        let inverse = |along: f32| if along.abs() < 1.0e-30 { 1.0e30 } else { along.recip() };
        Self { from, inverse: Vec3::from_array(direction.to_array().map(inverse)) }
    }
}

/// The space between three pairs of planes, ready to be tested against packs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs([(Vec3, f32, f32); 3]);

impl Slabs {
    /// Slabs across three directions, unit or zero, each from the least to the greatest product of a point with it. The
    /// shape in between lies within a box, and the slabs are only valid for boxes that overlap it.
    pub(crate) fn new((min, max): Corners, slabs: [(Vec3, [f64; 2]); 3]) -> Self {
        // The middle of an overlapping box is no farther out than this plus half that box. The rounding errors of its
        // product with an axis are in proportion.
        let far = min.abs().max(max.abs());
        Self(slabs.map(|(axis, [low, high])| {
            let room = SLAB_ROOM * axis.abs().dot(far);
            (axis, (0.5 * (low + high)) as f32, (0.5 * (high - low)) as f32 * WIDENED + room)
        }))
    }
}

/// The tree over boxes in a given order. A box is identified by its slot, its place in that order.
#[derive(Clone, Debug, Default)]
pub(crate) struct PackedBoxes {
    /// All levels, the lowest first.
    packs: Vec<Pack>,
    /// First pack of each level, and the end of the last.
    starts: Vec<u32>,
    /// Number of boxes.
    len: usize,
}

impl PackedBoxes {
    /// Packs `len` boxes, in the order of their slots.
    pub(crate) async fn new(len: usize, box_at: impl FnMut(usize) -> Corners, pace: &Pace) -> Self {
        let mut tree = Self::reserve(len);
        tree.packs.resize(tree.starts.last().map_or(0, |&end| end as usize), Pack::EMPTY);
        tree.refit_paced(box_at, pace).await;
        tree
    }

    /// Room for `len` boxes, which are to be [pushed](Self::push) and then [raised](Self::raise).
    pub(crate) fn reserve(len: usize) -> Self {
        let (mut starts, mut total, mut items) = (vec![0], 0, len);
        while items > 0 {
            items = items.div_ceil(LANES);
            total += items;
            starts.push(total as u32);
            if items == 1 {
                break;
            }
        }
        Self { packs: Vec::with_capacity(total), starts, len }
    }

    /// Adds the box of the next slot.
    pub(crate) fn push(&mut self, slot: usize, corners: Corners) {
        self.put(slot / LANES, slot % LANES, corners);
    }

    /// Adds one pack, the next in the order of the levels, to the pack above. Returns whether there was one.
    pub(crate) fn raise(&mut self, index: usize) -> bool {
        let level = self.starts.partition_point(|&start| start as usize <= index) - 1;
        if level + 1 >= self.levels() {
            return false;
        }
        let item = index - self.starts[level] as usize;
        let around = self.packs[index].around();
        self.put(self.starts[level + 1] as usize + item / LANES, item % LANES, around);
        true
    }

    /// Sets a box of the last pack or the next.
    fn put(&mut self, index: usize, lane: usize, corners: Corners) {
        if index == self.packs.len() {
            self.packs.push(Pack::EMPTY);
        }
        self.packs[index].set(lane, corners);
    }

    /// The box of a slot.
    pub(crate) fn get(&self, slot: usize) -> Corners {
        self.packs[slot / LANES].get(slot % LANES)
    }

    /// Measures every box again.
    pub(crate) fn refit(&mut self, box_at: impl FnMut(usize) -> Corners) {
        at_once(self.refit_paced(box_at, &Pace::default()));
    }

    async fn refit_paced(&mut self, mut box_at: impl FnMut(usize) -> Corners, pace: &Pace) {
        let packs = &mut self.packs;
        let measure = |slot: usize| packs[slot / LANES].set(slot % LANES, box_at(slot));
        pace.part(0.0..0.8).each(self.len, measure).await;
        for level in 1..self.levels() {
            let (below, start) = (self.starts[level - 1] as usize, self.starts[level] as usize);
            let packs = &mut self.packs;
            let raise = |item: usize| {
                let around = packs[below + item].around();
                packs[start + item / LANES].set(item % LANES, around);
            };
            pace.part(0.8..1.0).each(start - below, raise).await;
        }
    }

    /// Changes one box, and the boxes around it that have been raised.
    pub(crate) fn set(&mut self, slot: usize, corners: Corners) {
        let (mut item, mut corners) = (slot, corners);
        for level in 0..self.levels() {
            let Some(pack) = self.packs.get_mut(self.starts[level] as usize + item / LANES) else { return };
            if pack.get(item % LANES) == corners {
                return;
            }
            pack.set(item % LANES, corners);
            corners = pack.around();
            item /= LANES;
        }
    }

    /// Bytes on the heap.
    pub(crate) fn bytes(&self) -> usize {
        self.packs.capacity() * size_of::<Pack>() + self.starts.capacity() * size_of::<u32>()
    }

    fn levels(&self) -> usize {
        self.starts.len() - 1
    }

    /// Bits of the used lanes of a pack.
    fn used(&self, level: usize, index: u32) -> u8 {
        let items = match level {
            0 => self.len,
            _ => (self.starts[level] - self.starts[level - 1]) as usize,
        };
        let rest = items - index as usize * LANES;
        if rest >= LANES { u8::MAX } else { (1 << rest) - 1 }
    }

    /// Visits every slot whose box `meets` marks in its pack. `meets` must also mark the boxes around that one.
    pub(crate) fn walk(&self, meets: impl Fn(&Pack) -> u8, mut visit: impl FnMut(usize)) {
        let Some(top) = self.levels().checked_sub(1) else { return };
        let enter = |level: usize, index: u32| {
            (index, meets(&self.packs[(self.starts[level] + index) as usize]) & self.used(level, index))
        };
        // The current pack on each level, and its lanes still to be visited.
        let mut stack = [(0u32, 0u8); LEVELS];
        let mut level = top;
        stack[level] = enter(level, 0);
        loop {
            let (index, lanes) = stack[level];
            if lanes == 0 {
                if level == top {
                    return;
                }
                level += 1;
                continue;
            }
            stack[level].1 &= lanes - 1;
            let item = index * LANES as u32 + lanes.trailing_zeros();
            if level == 0 {
                visit(item as usize);
            } else {
                level -= 1;
                stack[level] = enter(level, item);
            }
        }
    }

    /// Visits slots from the lowest bound up, while they can be better than the best found.
    ///
    /// `bounds` gives a lower bound for each box of a pack. `visit(slot, best)` measures the contents of a box and
    /// returns the best so far. The search begins with `limit` and returns the best. A box whose bound equals the best
    /// is still visited, so that ties can be broken by the caller.
    pub(crate) fn best_first(
        &self,
        limit: f32,
        bounds: impl Fn(&Pack) -> [f32; LANES],
        mut visit: impl FnMut(usize, f32) -> f32,
    ) -> f32 {
        let mut best = limit;
        // Pending visits: the bound, the number of levels below, and the number on its level. A slot has no level
        // below.
        let mut stack = [(0f32, 0u8, 0u32); STACK];
        let mut depth = 0;
        let mut next = (self.levels() > 0).then_some((f32::NEG_INFINITY, self.levels() as u8, 0));
        while let Some((bound, height, item)) = next {
            if bound <= best {
                if let Some(level) = height.checked_sub(1) {
                    let bounds = bounds(&self.packs[(self.starts[level as usize] + item) as usize]);
                    let used = self.used(level as usize, item);
                    let first = depth;
                    for (lane, &bound) in bounds.iter().enumerate() {
                        // NaN fails it, too.
                        if used & (1 << lane) != 0 && bound <= best {
                            // Kept in order, so that the nearest is on top.
                            let mut at = depth;
                            while at > first && stack[at - 1].0 < bound {
                                stack[at] = stack[at - 1];
                                at -= 1;
                            }
                            stack[at] = (bound, level, item * LANES as u32 + lane as u32);
                            depth += 1;
                        }
                    }
                } else {
                    best = visit(item as usize, best);
                }
            }
            next = depth.checked_sub(1).map(|top| {
                depth = top;
                stack[top]
            });
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::space::packed_boxes::*;

    #[test]
    fn levels_hold_any_number_of_boxes() {
        for len in [0, 1, 7, 8, 9, 63, 64, 65, 512, 513, 5000] {
            let unit = |slot: usize| (Vec3::splat(slot as f32), Vec3::splat(slot as f32 + 0.5));
            let tree = at_once(PackedBoxes::new(len, unit, &Pace::default()));
            let everywhere = (Vec3::NEG_INFINITY, Vec3::INFINITY);
            let mut slots = Vec::new();
            tree.walk(|pack| pack.overlaps(everywhere), |slot| slots.push(slot));
            assert_eq!(slots, (0..len).collect::<Vec<_>>());
            let last = len.wrapping_sub(1) as f32;
            let mut slots = Vec::new();
            tree.walk(|pack| pack.overlaps((Vec3::splat(last), Vec3::splat(last))), |slot| slots.push(slot));
            assert_eq!(slots, (0..len).skip(len.saturating_sub(1)).collect::<Vec<_>>());
        }
    }
}
