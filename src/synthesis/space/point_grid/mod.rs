//! An index over points that are added, removed and queried while vessels grow.
//!
//! A uniform grid in three levels. The table holds bricks of 4×4×4 cells. Only bricks with points exist, so a surface
//! in a large box costs little memory. Each brick marks its filled cells as the bits of one word: a query visits those
//! in its box, and empty space costs next to nothing. A cell is a chain of blocks, each one cache line with up to four
//! points, whose distances are computed at once. Adding a point allocates nothing once the arrays have room.
//!
//! Why not kiddo here: its mutable tree refuses more than 32 points that share a coordinate, as all of a disc at z = 0
//! do, and points cannot be removed from its immutable one. It is used where the nearest of static points are wanted,
//! however far they are (the web of samples between roots). Where only a distance is asked for, as for the coverage of a
//! finished tree, the grid answers several times faster.

mod brick;
mod questions;
mod together;

pub use together::Blockers;

use crate::synthesis::space::order::SpatialOrder;
use crate::synthesis::space::point_grid::brick::{Block, Brick, EMPTY, LANES, NONE, REMOVED, SIDE};
use bevy_math::{UVec3, Vec3, Vec3A, bounding::Aabb3d};

/// Most bricks in the table: 16 MiB. Larger spaces get coarser cells, which cost only speed.
const MAX_BRICKS: f64 = (1u32 << 22) as f64;
/// Most bricks of which all exist from the start: 264 KiB. Queries find them without the table.
const MOST_AT_HAND: usize = 1024;
/// Points for a brick from which more bricks than that exist from the start.
const WELL_FILLED: usize = 4;
/// Fewest points whose order in memory matters: fewer fit in the processor's cache in any order.
const WORTH_ORDERING: usize = 20_000;

/// Points with dense ids in a box, found by distance.
///
/// Points outside the box are kept in its outermost cells: correct, but slower.
#[derive(Clone, Debug, Default)]
pub struct PointGrid {
    origin: Vec3A,
    cell: f32,
    inverse_cell: f32,
    /// Number of cells along each axis.
    cells: UVec3,
    /// Index of the last cell along each axis, as a float to compare coordinates with.
    last: Vec3A,
    /// Margin added to a query's box, in cells, so that rounding leaves out no cell.
    margin: f32,
    /// Number of bricks along x, and in an xy layer.
    row: u32,
    layer: u32,
    /// Whether all bricks exist, in the order of their places. Otherwise the table has the brick of each place.
    is_full: bool,
    table: Vec<u32>,
    bricks: Vec<Brick>,
    blocks: Vec<Block>,
    /// The next block after each one, in its cell or among the free ones.
    next: Vec<u32>,
    /// First of the free blocks.
    free: u32,
    /// Points by id; [`REMOVED`] for removed ones.
    points: Vec<Vec3>,
    /// Number of ids when the points were last ordered.
    ordered: usize,
    order: SpatialOrder,
}

impl PointGrid {
    /// Side of a cell relative to the most frequent query distance: a little more than two, so that a ball of that
    /// radius meets at most two cells along each axis.
    pub const CELL: f32 = 2.01;

    /// An empty grid over a box. Cells have at least the side `cell`, and more if the box would need too many.
    ///
    /// A good choice is [`CELL`](Self::CELL) times the query distance.
    pub fn new(bounds: &Aabb3d, cell: f32) -> Self {
        let mut grid = Self::default();
        grid.reset(bounds, cell);
        grid
    }

    /// Removes all points and lays out the grid again, keeping its memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32) {
        self.points.clear();
        self.ordered = 0;
        self.lay(bounds.min, bounds.max, cell);
    }

    /// Lays out the grid again with cells of another size, keeping the points. Neighbours in space are then neighbours
    /// in memory.
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

    /// Whether so many points were added since the last [`resize_cells`](Self::resize_cells) that another call with the
    /// same size pays, just for the order in memory.
    pub fn is_scattered(&self) -> bool {
        self.points.len() > WORTH_ORDERING && self.points.len() > self.ordered + self.ordered / 2
    }

    fn lay(&mut self, min: Vec3A, max: Vec3A, cell: f32) {
        let size = (max - min).max(Vec3A::ZERO);
        let bricks = |cell: f32| {
            let along = |length: f32| (f64::from(length) / f64::from(cell) / f64::from(SIDE)).floor() + 1.0;
            along(size.x) * along(size.y) * along(size.z)
        };
        // Smaller cells would be lost in the rounding of the coordinates.
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
        let places = (self.layer * sides.z) as usize;
        self.is_full = places <= MOST_AT_HAND.max(self.points.len() / WELL_FILLED);
        self.table.clear();
        self.bricks.clear();
        if self.is_full {
            self.bricks.resize(places, Brick::EMPTY);
        } else {
            self.table.resize(places, EMPTY);
            self.bricks.push(Brick::EMPTY);
        }
        self.blocks.clear();
        self.blocks.push(Block::EMPTY);
        self.next.clear();
        self.next.push(EMPTY);
        self.free = EMPTY;
    }

    /// Whether the cells of both are the same.
    pub fn has_cells_of(&self, other: &Self) -> bool {
        self.origin == other.origin && self.cell == other.cell && self.cells == other.cells
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
        let index = self.brick_at(place);
        let brick = &mut self.bricks[index];
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
        if !self.is_full && self.table[place] == EMPTY {
            self.table[place] = self.bricks.len() as u32;
            self.bricks.push(Brick::EMPTY);
        }
        let index = self.brick_at(place);
        let brick = &mut self.bricks[index];
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

    /// Position of a point, in cells.
    #[inline]
    fn local(&self, point: Vec3) -> Vec3A {
        (Vec3A::from(point) - self.origin) * self.inverse_cell
    }

    /// The cell at a position, clamped to the box; NaN gives cell 0.
    ///
    /// Cells may begin at any fraction, as long as greater positions never have lower cells. So the position is
    /// rounded, on all three axes at once: added to 2²³, it is an integer in the lowest bits.
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

    /// Index of the brick at a place; that of the empty one if there is none.
    #[inline]
    fn brick_at(&self, place: usize) -> usize {
        if self.is_full { place } else { self.table[place] as usize }
    }

    /// Indices of a cell's brick in the table, and of the cell in the brick.
    #[inline]
    fn locate(&self, cell: UVec3) -> (usize, usize) {
        let brick = cell / SIDE;
        let inner = cell % SIDE;
        (
            (brick.x + brick.y * self.row + brick.z * self.layer) as usize,
            (inner.x + SIDE * (inner.y + SIDE * inner.z)) as usize,
        )
    }
}

/// From this number to its double, every float is an integer.
const INTEGERS: f32 = (1 << 23) as f32;

#[cfg(test)]
mod tests;
