//! The same question to several grids at once: what a place in one of them is, is found once for all.

use crate::synthesis::space::point_grid::PointGrid;
use crate::synthesis::space::point_grid::brick::{CELLS, EMPTY, SIDE};
use bevy_math::{BVec4A, UVec3, Vec3, Vec4};

/// Questions processed at once.
pub(super) const BATCH: usize = 32;

/// Whether a centre has a point within reach in any of several grids, each with a reach of its own. The grids have
/// [equal cells](PointGrid::has_cells_of).
#[derive(Clone, Copy, Debug)]
pub struct Blockers<'a, const N: usize> {
    grids: [&'a PointGrid; N],
    /// Squared reaches.
    limits: [f32; N],
    longest: f32,
}

impl<'a, const N: usize> Blockers<'a, N> {
    /// The points of some grids, with their reaches.
    pub fn new(grids: [(&'a PointGrid, f32); N]) -> Self {
        let longest = grids.iter().fold(0.0, |longest: f32, (_, reach)| longest.max(reach.abs()));
        debug_assert!(grids.iter().all(|(grid, _)| grid.has_cells_of(grids[0].0)));
        Self { grids: grids.map(|(grid, _)| grid), limits: grids.map(|(_, reach)| reach * reach), longest }
    }

    /// Marks the centres within reach of a point in the first two blocks of their own cell: the fastest question, and
    /// usually enough in filled space. Other marks stay.
    ///
    /// Each step is done for many centres, so that the processor waits for the memory of all of them at once.
    pub fn mark_beside(&self, centers: &[Vec3], marks: &mut [bool]) {
        let layout = self.grids[0];
        let mut cells = [(0, 0); BATCH];
        for (centers, marks) in centers.chunks(BATCH).zip(marks.chunks_mut(BATCH)) {
            for (cell, &center) in cells.iter_mut().zip(centers) {
                *cell = layout.locate(layout.cell_of(center));
            }
            for ((&(place, inner), &center), mark) in cells.iter().zip(centers).zip(marks) {
                let mut near = BVec4A::FALSE;
                for (grid, limit) in self.grids.into_iter().zip(self.limits) {
                    let head = grid.bricks[grid.brick_at(place)].heads[inner % CELLS] as usize;
                    let limit = Vec4::splat(limit);
                    near |= grid.blocks[head].distances(center).cmple(limit);
                    near |= grid.blocks[grid.next[head] as usize].distances(center).cmple(limit);
                }
                *mark |= near.any();
            }
        }
    }

    /// Whether a point lies within reach of `center`, the reach included.
    #[inline]
    pub fn any(&self, center: Vec3) -> bool {
        let layout = self.grids[0];
        let (low, high) = layout.cells_around(layout.local(center), self.longest);
        if (high - low).max_element() <= 1 {
            return self.any_in_eight(low, high, center);
        }
        self.grids.into_iter().zip(self.limits).any(|(grid, limit)| {
            let mut found = false;
            grid.for_cells(low, high, |head| {
                found = chains_reach(grid, [head], center, limit);
                !found
            });
            found
        })
    }

    /// Whether a point lies within reach of a centre, in the cells from `low` to `high`, at most two along each axis.
    ///
    /// All of them are checked, whatever is found: a search that may end at any time causes so many branch
    /// mispredictions that it takes longer. Each axis's part of the indices of [`locate`](PointGrid::locate) is computed
    /// only once, which saves a good part of the work.
    fn any_in_eight(&self, low: UVec3, high: UVec3, center: Vec3) -> bool {
        let layout = self.grids[0];
        let is_one_layer = low.z == high.z;
        let [low, high] = [low, high].map(|cell| {
            let (brick, inner) = (cell / SIDE, cell % SIDE);
            let place = UVec3::new(brick.x, brick.y * layout.row, brick.z * layout.layer);
            [place, UVec3::new(inner.x, inner.y * SIDE, inner.z * SIDE * SIDE)]
        });
        let cell = |x: &[UVec3; 2], y: &[UVec3; 2], z: &[UVec3; 2]| {
            ((x[0].x + y[0].y + z[0].z) as usize, (x[1].x + y[1].y + z[1].z) as usize % CELLS)
        };
        let four =
            |z: &[UVec3; 2]| [cell(&low, &low, z), cell(&high, &low, z), cell(&low, &high, z), cell(&high, &high, z)];
        let near = four(&low);
        if is_one_layer {
            return self.chains_reach(near, center);
        }
        let far = four(&high);
        self.chains_reach(
            std::array::from_fn::<_, 8, _>(|index| if index < 4 { near[index] } else { far[index - 4] }),
            center,
        )
    }

    /// Whether a point of some cells lies within reach of a centre, one grid after the other.
    #[inline]
    fn chains_reach<const C: usize>(&self, cells: [(usize, usize); C], center: Vec3) -> bool {
        self.grids.into_iter().zip(self.limits).any(|(grid, limit)| {
            let heads = cells.map(|(place, inner)| grid.bricks[grid.brick_at(place)].heads[inner]);
            chains_reach(grid, heads, center, limit)
        })
    }
}

/// Whether a point of some chains lies within a squared reach of a centre. Checks all first blocks, then all second
/// ones.
#[inline]
fn chains_reach<const C: usize>(grid: &PointGrid, mut blocks: [u32; C], center: Vec3, limit: f32) -> bool {
    let limit = Vec4::splat(limit);
    loop {
        let reached = blocks.map(|block| grid.blocks[block as usize].distances(center).cmple(limit));
        if reached.into_iter().fold(BVec4A::FALSE, |any, reached| any | reached).any() {
            return true;
        }
        blocks = blocks.map(|block| grid.next[block as usize]);
        if blocks.into_iter().fold(EMPTY, |any, block| any | block) == EMPTY {
            return false;
        }
    }
}
