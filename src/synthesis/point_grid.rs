//! An index over points that come, go and are asked for while vessels grow.
//!
//! A uniform grid in three levels. A table of bricks of 4×4×4 cells, of which only those with points exist, so a surface in
//! a large box costs little memory. Each brick knows its filled cells as the bits of one word: a question looks at those of
//! them that its box meets, and empty space costs next to nothing. And a cell is a chain of blocks, each of them one cache
//! line with up to four points, whose distances are found at once. Adding a point allocates nothing once the arrays have
//! room.
//!
//! Why not kiddo here: its mutable tree refuses more than 32 points that share a coordinate, as all of a disc at z = 0
//! do, and points cannot be removed from its immutable one. It serves where a point set is static (coverage of a
//! finished tree).

use crate::synthesis::spatial_order::SpatialOrder;
use bevy_math::{UVec3, Vec3, Vec3A, Vec4, bounding::Aabb3d};

/// Cells along each side of a brick.
const SIDE: u32 = 4;
/// Cells in a brick.
const CELLS: usize = (SIDE * SIDE * SIDE) as usize;
/// Most bricks in the table: 16 MiB. Coarser cells keep larger spaces below it, at the cost of speed alone.
const MAX_BRICKS: f64 = (1u32 << 22) as f64;
/// Points in a block.
const LANES: usize = 4;
/// The id of no point.
const NONE: u32 = u32::MAX;
/// The brick without points, which stands in the table where there is no other, and the block without points, which ends
/// every chain. With them a question needs not ask whether there is something to look at.
const EMPTY: u32 = 0;
/// Fewest points whose order in memory matters: less lie in the processor's cache however they are ordered.
const WORTH_ORDERING: usize = 20_000;
/// Questions that are asked at once.
const BATCH: usize = 32;

/// Points with dense ids in a box, found by distance.
///
/// Points outside the box are kept in its outermost cells: correct, if slower.
#[derive(Clone, Debug, Default)]
pub struct PointGrid {
    origin: Vec3A,
    cell: f32,
    inverse_cell: f32,
    /// Number of cells along each axis.
    cells: UVec3,
    /// Index of the last cell along each axis, as a number that coordinates are compared with.
    last: Vec3A,
    /// How much wider than asked for, in cells, a box is taken so that rounding leaves out no cell.
    margin: f32,
    /// Number of bricks along x, and in an xy layer.
    row: u32,
    layer: u32,
    table: Vec<u32>,
    bricks: Vec<Brick>,
    blocks: Vec<Block>,
    /// The block that follows each one in its cell, or among those that are free.
    next: Vec<u32>,
    /// First of the blocks that are free.
    free: u32,
    /// Points by id; [`REMOVED`] for those that are not there.
    points: Vec<Vec3>,
    /// Number of ids when the points were last put in order.
    ordered: usize,
    order: SpatialOrder,
}

/// 4×4×4 cells: which of them hold points, and the first block of each of these.
#[derive(Clone, Debug)]
struct Brick {
    filled: u64,
    heads: [u32; CELLS],
}

/// Up to four points of a cell. All blocks of a cell but the first are full, and points come before empty lanes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Block {
    x: Vec4,
    y: Vec4,
    z: Vec4,
    ids: [u32; LANES],
}

/// What stands for a removed point. No distance to it passes a comparison.
const REMOVED: Vec3 = Vec3::NAN;

impl Block {
    const EMPTY: Self = Self { x: Vec4::NAN, y: Vec4::NAN, z: Vec4::NAN, ids: [NONE; LANES] };

    fn set(&mut self, lane: usize, id: u32, point: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = (point.x, point.y, point.z);
        self.ids[lane] = id;
    }

    fn point(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    /// Number of points.
    fn len(&self) -> usize {
        self.ids.iter().take_while(|&&id| id != NONE).count()
    }

    /// Squared distances of all lanes, no number for empty ones.
    #[inline]
    fn distances(&self, center: Vec3) -> Vec4 {
        let (x, y, z) = (self.x - center.x, self.y - center.y, self.z - center.z);
        x * x + y * y + z * z
    }
}

impl Brick {
    const EMPTY: Self = Self { filled: 0, heads: [EMPTY; CELLS] };
}

impl PointGrid {
    /// An empty grid over a box. Cells have at least the side `cell`; more where the box would need too many.
    ///
    /// A cell twice as large as the distances asked for is a good choice.
    pub fn new(bounds: &Aabb3d, cell: f32) -> Self {
        let mut grid = Self::default();
        grid.reset(bounds, cell);
        grid
    }

    /// Removes all points and lays the grid anew, keeping its memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32) {
        self.points.clear();
        self.ordered = 0;
        self.lay(bounds.min, bounds.max, cell);
    }

    /// Lays the grid anew with cells of another size; the points stay. Those that are near in space are near in memory from
    /// then on.
    pub fn resize_cells(&mut self, cell: f32) {
        let max = self.origin + self.cells.as_vec3a() * self.cell;
        self.lay(self.origin, max, cell);
        let mut order = std::mem::take(&mut self.order);
        order.sort(&Aabb3d { min: self.origin, max }, &self.points);
        for &id in order.indices() {
            if !self.points[id as usize].is_nan() {
                self.link(id);
            }
        }
        self.order = order;
        self.ordered = self.points.len();
    }

    /// Whether so many points have come since the last [`resize_cells`](Self::resize_cells) that it pays to lay the grid anew
    /// with cells of the same size, for the sake of the order in memory alone.
    pub fn is_scattered(&self) -> bool {
        self.points.len() > WORTH_ORDERING && self.points.len() > self.ordered + self.ordered / 2
    }

    fn lay(&mut self, min: Vec3A, max: Vec3A, cell: f32) {
        let size = (max - min).max(Vec3A::ZERO);
        let bricks = |cell: f32| {
            let along = |length: f32| (f64::from(length) / f64::from(cell) / f64::from(SIDE)).floor() + 1.0;
            along(size.x) * along(size.y) * along(size.z)
        };
        // A cell below this is lost in the rounding of the coordinates.
        let smallest = (size.max_element().max(min.abs().max(max.abs()).max_element()) * 1e-6).max(f32::MIN_POSITIVE);
        let mut cell = if cell.is_finite() { cell.max(smallest) } else { size.max_element().max(smallest) };
        while bricks(cell) > MAX_BRICKS {
            cell *= 1.25;
        }
        self.origin = min;
        self.cell = cell;
        self.inverse_cell = cell.recip();
        self.cells = (size * self.inverse_cell).as_uvec3() + UVec3::ONE;
        self.last = (self.cells - UVec3::ONE).as_vec3a();
        self.margin = 1e-3 + self.last.max_element() * 1e-6;
        let sides = (self.cells + (SIDE - 1)) / SIDE;
        self.row = sides.x;
        self.layer = sides.x * sides.y;
        self.table.clear();
        self.table.resize((self.layer * sides.z) as usize, EMPTY);
        self.bricks.clear();
        self.bricks.push(Brick::EMPTY);
        self.blocks.clear();
        self.blocks.push(Block::EMPTY);
        self.next.clear();
        self.next.push(EMPTY);
        self.free = EMPTY;
    }

    /// Side of a cell.
    pub fn cell(&self) -> f32 {
        self.cell
    }

    /// Number of ids given out, removed points included.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether no id has been given out.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The point of an id.
    pub fn point(&self, id: u32) -> Vec3 {
        self.points[id as usize]
    }

    /// Adds a point; its id is the number of ids before it.
    pub fn push(&mut self, point: Vec3) -> u32 {
        let id = self.points.len() as u32;
        self.points.push(point);
        self.link(id);
        id
    }

    /// Puts a new point at the id of a removed one.
    pub fn replace(&mut self, id: u32, point: Vec3) {
        debug_assert!(self.points[id as usize].is_nan());
        self.points[id as usize] = point;
        self.link(id);
    }

    /// Removes a point. Its id may be used again by [`replace`](Self::replace).
    pub fn remove(&mut self, id: u32) {
        let point = std::mem::replace(&mut self.points[id as usize], REMOVED);
        let (place, cell) = self.locate(self.cell_of(point));
        let brick = &mut self.bricks[self.table[place] as usize];
        let head = brick.heads[cell];
        // The last point of the cell's first block takes the place of the one that leaves.
        let last = self.blocks[head as usize].len() - 1;
        let (moved, at) = (self.blocks[head as usize].ids[last], self.blocks[head as usize].point(last));
        let mut block = head;
        let lane = loop {
            match self.blocks[block as usize].ids.iter().position(|&other| other == id) {
                Some(lane) => break lane,
                None => block = self.next[block as usize],
            }
        };
        self.blocks[block as usize].set(lane, moved, at);
        self.blocks[head as usize].set(last, NONE, REMOVED);
        if last == 0 {
            let after = std::mem::replace(&mut self.next[head as usize], self.free);
            self.free = head;
            brick.heads[cell] = after;
            if after == EMPTY {
                brick.filled &= !(1 << cell);
            }
        }
    }

    fn link(&mut self, id: u32) {
        let point = self.points[id as usize];
        let (place, cell) = self.locate(self.cell_of(point));
        let brick = &mut self.table[place];
        if *brick == EMPTY {
            *brick = self.bricks.len() as u32;
            self.bricks.push(Brick::EMPTY);
        }
        let brick = &mut self.bricks[*brick as usize];
        brick.filled |= 1 << cell;
        let head = &mut brick.heads[cell];
        let used = if *head == EMPTY { LANES } else { self.blocks[*head as usize].len() };
        if used < LANES {
            self.blocks[*head as usize].set(used, id, point);
            return;
        }
        let after = *head;
        if self.free == EMPTY {
            *head = self.blocks.len() as u32;
            self.blocks.push(Block::EMPTY);
            self.next.push(after);
        } else {
            *head = self.free;
            self.free = std::mem::replace(&mut self.next[*head as usize], after);
        }
        self.blocks[*head as usize].set(0, id, point);
    }

    /// Where a point lies, in cells.
    #[inline]
    fn local(&self, point: Vec3) -> Vec3A {
        (Vec3A::from(point) - self.origin) * self.inverse_cell
    }

    /// The cell at a place, clamped to the box; no number is cell 0.
    ///
    /// Where a fraction begins is of no matter, as long as greater places never have lower cells. So the place is rounded,
    /// for all three axes at once: added to 2²³ it is an integer that stands in the lowest bits.
    #[inline]
    fn cell_at(&self, local: Vec3A) -> UVec3 {
        let clamped = (local - 0.5).max(Vec3A::ZERO).min(self.last);
        UVec3::from_array((clamped + INTEGERS).to_array().map(f32::to_bits)) - UVec3::splat(INTEGERS.to_bits())
    }

    /// The cell of a point.
    #[inline]
    fn cell_of(&self, point: Vec3) -> UVec3 {
        self.cell_at(self.local(point))
    }

    /// Lowest and highest cell of the box around a ball.
    #[inline]
    fn cells_around(&self, local: Vec3A, radius: f32) -> (UVec3, UVec3) {
        let reach = radius * self.inverse_cell + self.margin;
        (self.cell_at(local - reach), self.cell_at(local + reach))
    }

    /// Index of a cell's brick in the table, and of the cell in the brick.
    #[inline]
    fn locate(&self, cell: UVec3) -> (usize, usize) {
        let brick = cell / SIDE;
        let inner = cell % SIDE;
        (
            (brick.x + brick.y * self.row + brick.z * self.layer) as usize,
            (inner.x + SIDE * (inner.y + SIDE * inner.z)) as usize,
        )
    }

    /// First block of a cell.
    #[inline]
    fn head(&self, cell: UVec3) -> u32 {
        let (place, inner) = self.locate(cell);
        self.bricks[self.table[place] as usize].heads[inner]
    }

    /// Calls `visit(first block)` for the filled cells of a box of cells, until it answers false.
    #[inline]
    fn for_cells(&self, low: UVec3, high: UVec3, mut visit: impl FnMut(u32) -> bool) {
        let (first, last) = (low / SIDE, high / SIDE);
        for z in first.z..=last.z {
            let layers = LAYERS[range(low.z, high.z, z)];
            for y in first.y..=last.y {
                let rows = layers & ROWS[range(low.y, high.y, y)];
                let place = (y * self.row + z * self.layer) as usize;
                for x in first.x..=last.x {
                    let brick = self.table[place + x as usize];
                    let brick = &self.bricks[brick as usize];
                    let mut cells = brick.filled & rows & COLUMNS[range(low.x, high.x, x)];
                    while cells != 0 {
                        if !visit(brick.heads[cells.trailing_zeros() as usize]) {
                            return;
                        }
                        cells &= cells - 1;
                    }
                }
            }
        }
    }

    /// Visits the points within a radius that may shrink on the way: `visit(id, squared distance)` answers with the squared
    /// radius from there on. The centre's own cell comes first, the others in no particular order.
    #[inline]
    fn scan(&self, center: Vec3, radius: f32, mut visit: impl FnMut(u32, f32) -> f32) {
        if self.points.is_empty() {
            return;
        }
        let mut limit = radius * radius;
        let local = self.local(center);
        let own = self.head(self.cell_at(local));
        self.scan_chain(own, center, &mut limit, &mut visit);
        let (low, high) = self.cells_around(local, radius.min(limit.sqrt()));
        self.for_cells(low, high, |head| {
            if head != own {
                self.scan_chain(head, center, &mut limit, &mut visit);
            }
            true
        });
    }

    #[inline]
    fn scan_chain(&self, head: u32, center: Vec3, limit: &mut f32, visit: &mut impl FnMut(u32, f32) -> f32) {
        let mut next = head;
        while next != EMPTY {
            let block = &self.blocks[next as usize];
            let distances = block.distances(center);
            let mut near = distances.cmple(Vec4::splat(*limit)).bitmask();
            while near != 0 {
                let lane = near.trailing_zeros() as usize;
                if distances[lane] <= *limit {
                    *limit = visit(block.ids[lane], distances[lane]);
                }
                near &= near - 1;
            }
            next = self.next[next as usize];
        }
    }

    /// Whether a point lies within `radius` of `center`, the radius included.
    pub fn any_within(&self, center: Vec3, radius: f32) -> bool {
        let limit = radius * radius;
        let (low, high) = self.cells_around(self.local(center), radius);
        let mut found = false;
        self.for_cells(low, high, |head| {
            found = self.chain_reaches(head, center, limit);
            !found
        });
        found
    }

    /// Marks those centres that have a point within `radius` in the first two blocks of their own cell: the quickest question,
    /// and mostly enough in space that is filled. The others stay as they are.
    ///
    /// Questions are asked a step at a time for many centres, so that the processor waits for the memory of all of them at
    /// once.
    pub fn mark_beside(&self, centers: &[Vec3], radius: f32, marks: &mut [bool]) {
        let limit = Vec4::splat(radius * radius);
        let mut heads = [EMPTY; BATCH];
        for (centers, marks) in centers.chunks(BATCH).zip(marks.chunks_mut(BATCH)) {
            for (head, &center) in heads.iter_mut().zip(centers) {
                *head = self.head(self.cell_of(center));
            }
            for ((&head, &center), mark) in heads.iter().zip(centers).zip(marks) {
                let first = self.blocks[head as usize].distances(center).cmple(limit);
                let second = self.blocks[self.next[head as usize] as usize].distances(center).cmple(limit);
                *mark |= (first | second).any();
            }
        }
    }

    #[inline]
    fn chain_reaches(&self, head: u32, center: Vec3, limit: f32) -> bool {
        let mut next = head;
        while next != EMPTY {
            if self.blocks[next as usize].distances(center).cmple(Vec4::splat(limit)).any() {
                return true;
            }
            next = self.next[next as usize];
        }
        false
    }

    /// Calls `visit(id, squared distance)` for every point within `radius`, in no particular order.
    pub fn for_each_within(&self, center: Vec3, radius: f32, mut visit: impl FnMut(u32, f32)) {
        let limit = radius * radius;
        self.scan(center, radius, |id, distance| {
            visit(id, distance);
            limit
        });
    }

    /// The nearest point within `radius` that `accepts` its id, with its squared distance. Of several at one distance
    /// the lowest id wins, whatever the order in which they were added.
    pub fn nearest_within(&self, center: Vec3, radius: f32, accepts: impl Fn(u32) -> bool) -> Option<(u32, f32)> {
        self.nearest_two(center, radius, radius, accepts).0
    }

    /// As [`nearest_within`](Self::nearest_within), and the squared distance of the nearest point of all within `reach`,
    /// infinite where there is none. `reach` is not below `radius`.
    pub fn nearest_two(
        &self,
        center: Vec3,
        reach: f32,
        radius: f32,
        accepts: impl Fn(u32) -> bool,
    ) -> (Option<(u32, f32)>, f32) {
        let (mut best, mut closest): (Option<(u32, f32)>, _) = (None, f32::INFINITY);
        let (mut limit, within) = (reach * reach, radius * radius);
        self.scan(center, reach, |id, distance| {
            closest = closest.min(distance);
            let closer = best.is_none_or(|(other, least)| distance < least || (distance == least && id < other));
            if distance <= within && closer && accepts(id) {
                best = Some((id, distance));
                limit = distance;
            }
            limit
        });
        (best, closest)
    }
}

/// From here on to its double every number is an integer.
const INTEGERS: f32 = (1 << 23) as f32;

/// The cells of a brick that lie in a range along x, y or z, by the range's [number](range).
const COLUMNS: [u64; 16] = cells_in_ranges(1);
const ROWS: [u64; 16] = cells_in_ranges(SIDE);
const LAYERS: [u64; 16] = cells_in_ranges(SIDE * SIDE);

const fn cells_in_ranges(stride: u32) -> [u64; 16] {
    let mut masks = [0; 16];
    let mut cell = 0;
    while cell < CELLS as u32 {
        let along = cell / stride % SIDE;
        let mut range = 0;
        while range < 16 {
            if range / SIDE <= along && along <= range % SIDE {
                masks[range as usize] |= 1 << cell;
            }
            range += 1;
        }
        cell += 1;
    }
    masks
}

/// Number of the part of a range of cells, `low` to `high` along an axis, that lies in a brick.
#[inline]
fn range(low: u32, high: u32, brick: u32) -> usize {
    let first = brick * SIDE;
    ((low.max(first) - first) * SIDE + high.min(first + SIDE - 1) - first) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::rng::Stream;
    use rand::RngExt;

    fn unit_box() -> Aabb3d {
        Aabb3d::new(Vec3::splat(0.5), Vec3::splat(0.5))
    }

    /// Random points, one in five of them outside the box, some of them equal, and some removed.
    fn grid(seed: u64, flat: bool) -> (PointGrid, Vec<Option<Vec3>>) {
        let mut rng = Stream::Statistics.rng(seed);
        let mut grid = PointGrid::new(&unit_box(), 0.07);
        let mut twin: Vec<Option<Vec3>> = Vec::new();
        for i in 0..600u32 {
            let mut point = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.1..1.1)));
            if flat {
                point.z = 0.0;
            }
            if i % 50 == 7 {
                point = grid.point(i / 2);
            }
            assert_eq!(grid.push(point), i);
            twin.push(Some(point));
        }
        for id in (0..600u32).step_by(7) {
            grid.remove(id);
            twin[id as usize] = None;
        }
        for id in (0..600u32).step_by(21) {
            let point = Vec3::splat(rng.random_range(0.0..1.0));
            grid.replace(id, point);
            twin[id as usize] = Some(point);
        }
        (grid, twin)
    }

    fn brute_nearest(twin: &[Option<Vec3>], center: Vec3, radius: f32, step: u32) -> Option<(u32, f32)> {
        let candidates =
            twin.iter().enumerate().filter_map(|(id, p)| p.map(|p| (id as u32, p.distance_squared(center))));
        candidates
            .filter(|&(id, distance)| id % step == 0 && distance <= radius * radius)
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
    }

    #[test]
    fn answers_equal_brute_force() {
        for seed in 0..6 {
            let (mut grid, twin) = grid(seed, seed % 2 == 0);
            let mut rng = Stream::Roots.rng(seed);
            let mut marked = 0;
            for cell in [0.07, 0.021, 0.4] {
                grid.resize_cells(cell);
                for _ in 0..200 {
                    let center = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.2..1.2)));
                    let radius = rng.random_range(0.0..0.3);
                    let expected = brute_nearest(&twin, center, radius, 1);
                    assert_eq!(grid.nearest_within(center, radius, |_| true), expected);
                    assert_eq!(grid.any_within(center, radius), expected.is_some());
                    let mut marks = [false, true];
                    grid.mark_beside(&[center, center], radius, &mut marks);
                    assert!(marks[1] && (!marks[0] || expected.is_some()));
                    marked += u32::from(marks[0]);
                    let odd = brute_nearest(&twin, center, radius, 3);
                    assert_eq!(grid.nearest_within(center, radius, |id| id % 3 == 0), odd);
                    let mut count = 0;
                    grid.for_each_within(center, radius, |_, _| count += 1);
                    let all = twin.iter().flatten().filter(|p| p.distance_squared(center) <= radius * radius).count();
                    assert_eq!(count, all);
                }
            }
            assert!(marked > 20, "only {marked} were found in their own cells");
        }
    }

    #[test]
    fn extreme_cells_and_queries_neither_overflow_nor_hang() {
        for cell in [0.0, 1e-30, f32::NAN, f32::INFINITY, 1e30] {
            let mut grid = PointGrid::new(&unit_box(), cell);
            grid.push(Vec3::splat(0.3));
            assert!(grid.any_within(Vec3::splat(0.31), 0.1), "cell {cell}");
            assert!(!grid.any_within(Vec3::splat(9.0), 0.1));
        }
        let flat = Aabb3d::new(Vec3::ZERO, Vec3::new(1.0, 0.0, 0.0));
        let grid = PointGrid::new(&flat, 0.1);
        assert!(!grid.any_within(Vec3::ZERO, 1.0));
    }
}
