//! The parts of a point grid: bricks of cells, and their blocks of points.

use bevy_math::{Vec3, Vec4};

/// Cells along each side of a brick.
pub const SIDE: u32 = 4;
/// Cells in a brick.
pub const CELLS: usize = (SIDE * SIDE * SIDE) as usize;
/// Points in a block.
pub const LANES: usize = 4;
/// The id of no point.
pub const NONE: u32 = u32::MAX;
/// The brick without points, which fills empty places of the table, and the block without points, which ends every
/// chain. With them a query needs no test for existence.
pub const EMPTY: u32 = 0;

/// 4×4×4 cells: a mask of those with points, and the first block of each.
#[derive(Clone, Debug)]
pub struct Brick {
    pub filled: u64,
    pub heads: [u32; CELLS],
}

/// Up to four points of a cell. All blocks of a cell but the first are full, and points come before empty lanes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Block {
    x: Vec4,
    y: Vec4,
    z: Vec4,
    pub ids: [u32; LANES],
}

/// The mark of a removed point. No distance to it passes a comparison.
pub const REMOVED: Vec3 = Vec3::NAN;

impl Block {
    pub const EMPTY: Self = Self { x: Vec4::NAN, y: Vec4::NAN, z: Vec4::NAN, ids: [NONE; LANES] };

    pub fn set(&mut self, lane: usize, id: u32, point: Vec3) {
        (self.x[lane], self.y[lane], self.z[lane]) = (point.x, point.y, point.z);
        self.ids[lane] = id;
    }

    pub fn point(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.ids.iter().take_while(|&&id| id != NONE).count()
    }

    /// Squared distances of all lanes, NaN for empty ones.
    #[inline]
    pub fn distances(&self, center: Vec3) -> Vec4 {
        let (x, y, z) = (self.x - center.x, self.y - center.y, self.z - center.z);
        x * x + y * y + z * z
    }
}

impl Brick {
    pub const EMPTY: Self = Self { filled: 0, heads: [EMPTY; CELLS] };
}

/// The cells of a brick that lie in a range along x, y or z, by the range's [number](range).
pub const COLUMNS: [u64; 16] = cells_in_ranges(1);
pub const ROWS: [u64; 16] = cells_in_ranges(SIDE);
pub const LAYERS: [u64; 16] = cells_in_ranges(SIDE * SIDE);

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

/// Number of that part of a range of cells, `low` to `high` along an axis, which lies in a brick.
#[inline]
pub fn range(low: u32, high: u32, brick: u32) -> usize {
    let first = brick * SIDE;
    ((low.max(first) - first) * SIDE + high.min(first + SIDE - 1) - first) as usize
}
