//! An index over points that come, go and are asked for while vessels grow.
//!
//! A uniform grid in two levels: a table of bricks of 4×4×4 cells, of which only those with points exist, so a probe of
//! empty space costs one load and a surface in a large box costs little memory. A cell is a chain through `next`, so
//! adding a point allocates nothing once the arrays have room.
//!
//! Why not kiddo here: its mutable tree refuses more than 32 points that share a coordinate, as all of a disc at z = 0
//! do, and points cannot be removed from its immutable one. It serves where a point set is static (coverage of a
//! finished tree).

use bevy_math::{UVec3, Vec3, bounding::Aabb3d};

/// Cells along each side of a brick.
const SIDE: u32 = 4;
/// Cells in a brick.
const CELLS: usize = (SIDE * SIDE * SIDE) as usize;
/// Most bricks in the table: 16 MiB. Coarser cells keep larger spaces below it, at the cost of speed alone.
const MAX_BRICKS: f64 = (1u32 << 22) as f64;
/// End of a chain, and the brick that is not there.
const NONE: u32 = u32::MAX;

/// Points with dense ids in a box, found by distance.
///
/// Points outside the box are kept in its outermost cells: correct, if slower.
#[derive(Clone, Debug, Default)]
pub struct PointGrid {
    origin: Vec3,
    cell: f32,
    inverse_cell: f32,
    /// Number of cells along each axis.
    cells: UVec3,
    /// Number of bricks along x, and in an xy layer.
    row: u32,
    layer: u32,
    bricks: Vec<u32>,
    heads: Vec<[u32; CELLS]>,
    points: Vec<Vec3>,
    next: Vec<u32>,
}

impl PointGrid {
    /// An empty grid over a box. Cells have at least the side `cell`; more where the box would need too many.
    ///
    /// A cell as large as the distances asked for is a good choice.
    pub fn new(bounds: &Aabb3d, cell: f32) -> Self {
        let mut grid = Self::default();
        grid.reset(bounds, cell);
        grid
    }

    /// Removes all points and lays the grid anew, keeping its memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32) {
        self.points.clear();
        self.next.clear();
        self.lay(Vec3::from(bounds.min), Vec3::from(bounds.max), cell);
    }

    /// Lays the grid anew with cells of another size; the points stay.
    pub fn resize_cells(&mut self, cell: f32) {
        let max = self.origin + self.cells.as_vec3() * self.cell;
        self.lay(self.origin, max, cell);
        for id in 0..self.points.len() {
            if self.next[id] != REMOVED {
                self.link(id as u32);
            }
        }
    }

    fn lay(&mut self, min: Vec3, max: Vec3, cell: f32) {
        let size = (max - min).max(Vec3::ZERO);
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
        let sides = (self.cells + (SIDE - 1)) / SIDE;
        self.row = sides.x;
        self.layer = sides.x * sides.y;
        self.bricks.clear();
        self.bricks.resize((self.layer * sides.z) as usize, NONE);
        self.heads.clear();
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
        self.next.push(NONE);
        self.link(id);
        id
    }

    /// Puts a new point at the id of a removed one.
    pub fn replace(&mut self, id: u32, point: Vec3) {
        debug_assert_eq!(self.next[id as usize], REMOVED);
        self.points[id as usize] = point;
        self.link(id);
    }

    /// Removes a point. Its id may be used again by [`replace`](Self::replace).
    pub fn remove(&mut self, id: u32) {
        let (brick, cell) = self.locate(self.cell_of(self.points[id as usize]));
        let after = self.next[id as usize];
        let head = &mut self.heads[self.bricks[brick] as usize][cell];
        if *head == id {
            *head = after;
        } else {
            let mut before = *head;
            while self.next[before as usize] != id {
                before = self.next[before as usize];
            }
            self.next[before as usize] = after;
        }
        self.next[id as usize] = REMOVED;
    }

    fn link(&mut self, id: u32) {
        let (brick, cell) = self.locate(self.cell_of(self.points[id as usize]));
        if self.bricks[brick] == NONE {
            self.bricks[brick] = self.heads.len() as u32;
            self.heads.push([NONE; CELLS]);
        }
        let head = &mut self.heads[self.bricks[brick] as usize][cell];
        self.next[id as usize] = *head;
        *head = id;
    }

    /// Cell of a point, clamped to the box. The cast saturates, so points at infinity are as safe as NaN, which is cell 0.
    fn cell_of(&self, point: Vec3) -> UVec3 {
        ((point - self.origin) * self.inverse_cell).as_uvec3().min(self.cells - UVec3::ONE)
    }

    /// Index of a cell's brick in the table, and of the cell in the brick.
    fn locate(&self, cell: UVec3) -> (usize, usize) {
        let brick = cell / SIDE;
        let inner = cell % SIDE;
        (
            (brick.x + brick.y * self.row + brick.z * self.layer) as usize,
            (inner.x + SIDE * (inner.y + SIDE * inner.z)) as usize,
        )
    }

    /// First point of a cell's chain.
    fn head(&self, cell: UVec3) -> u32 {
        let (brick, inner) = self.locate(cell);
        match self.bricks[brick] {
            NONE => NONE,
            brick => self.heads[brick as usize][inner],
        }
    }

    /// Calls `visit(id, squared distance)` for points within `radius`, until it answers false. In no particular order.
    fn scan(&self, center: Vec3, radius: f32, mut visit: impl FnMut(u32, f32) -> bool) {
        if self.points.is_empty() {
            return;
        }
        let low = self.cell_of(center - radius);
        let high = self.cell_of(center + radius);
        let limit = radius * radius;
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let mut id = self.head(UVec3::new(x, y, z));
                    while id != NONE {
                        let distance = self.points[id as usize].distance_squared(center);
                        if distance <= limit && !visit(id, distance) {
                            return;
                        }
                        id = self.next[id as usize];
                    }
                }
            }
        }
    }

    /// Whether a point lies within `radius` of `center`, the radius included.
    pub fn any_within(&self, center: Vec3, radius: f32) -> bool {
        if self.points.is_empty() {
            return false;
        }
        // The centre's own cell answers for most of a filled tissue.
        let limit = radius * radius;
        let mut id = self.head(self.cell_of(center));
        while id != NONE {
            if self.points[id as usize].distance_squared(center) <= limit {
                return true;
            }
            id = self.next[id as usize];
        }
        let mut found = false;
        self.scan(center, radius, |_, _| {
            found = true;
            false
        });
        found
    }

    /// Calls `visit(id, squared distance)` for every point within `radius`, in no particular order.
    pub fn for_each_within(&self, center: Vec3, radius: f32, mut visit: impl FnMut(u32, f32)) {
        self.scan(center, radius, |id, distance| {
            visit(id, distance);
            true
        });
    }

    /// The nearest point within `radius` that `accepts` its id, with its squared distance. Of several at one distance
    /// the lowest id wins, whatever the order in which they were added.
    pub fn nearest_within(&self, center: Vec3, radius: f32, accepts: impl Fn(u32) -> bool) -> Option<(u32, f32)> {
        let mut best: Option<(u32, f32)> = None;
        self.scan(center, radius, |id, distance| {
            let closer = best.is_none_or(|(other, least)| distance < least || (distance == least && id < other));
            if closer && accepts(id) {
                best = Some((id, distance));
            }
            true
        });
        best
    }
}

/// What `next` holds for a removed point.
const REMOVED: u32 = u32::MAX - 1;

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
            for cell in [0.07, 0.021, 0.4] {
                grid.resize_cells(cell);
                for _ in 0..200 {
                    let center = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.2..1.2)));
                    let radius = rng.random_range(0.0..0.3);
                    let expected = brute_nearest(&twin, center, radius, 1);
                    assert_eq!(grid.nearest_within(center, radius, |_| true), expected);
                    assert_eq!(grid.any_within(center, radius), expected.is_some());
                    let odd = brute_nearest(&twin, center, radius, 3);
                    assert_eq!(grid.nearest_within(center, radius, |id| id % 3 == 0), odd);
                    let mut count = 0;
                    grid.for_each_within(center, radius, |_, _| count += 1);
                    let all = twin.iter().flatten().filter(|p| p.distance_squared(center) <= radius * radius).count();
                    assert_eq!(count, all);
                }
            }
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
