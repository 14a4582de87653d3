//! Queries of a point grid: whether any point is near, the nearest one, and all points around a position.

use crate::synthesis::space::point_grid::PointGrid;
use crate::synthesis::space::point_grid::brick::{CELLS, COLUMNS, EMPTY, LAYERS, ROWS, SIDE, range};
use bevy_math::{BVec4A, UVec3, Vec3, Vec4};

/// Queries processed at once.
const BATCH: usize = 32;

impl PointGrid {
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

    /// Visits the points within a radius that may shrink on the way: `visit(id, squared distance)` returns the squared
    /// radius from then on, and below 0 to end. The centre's own cell comes first, the others in no particular order.
    #[inline]
    fn scan(&self, center: Vec3, radius: f32, mut visit: impl FnMut(u32, f32) -> f32) {
        if self.points.is_empty() {
            return;
        }
        let mut limit = radius * radius;
        let local = self.local(center);
        let own = self.head(self.cell_at(local));
        self.scan_chain(own, center, &mut limit, &mut visit);
        if limit < 0.0 {
            return;
        }
        let (low, high) = self.cells_around(local, radius.min(limit.sqrt()));
        self.for_cells(low, high, |head| {
            if head != own {
                self.scan_chain(head, center, &mut limit, &mut visit);
            }
            limit >= 0.0
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
        if (high - low).max_element() <= 1 {
            return self.any_in_eight(low, high, center, limit);
        }
        let mut found = false;
        self.for_cells(low, high, |head| {
            found = self.chains_reach([head], center, limit);
            !found
        });
        found
    }

    /// Whether a point lies within a squared radius of a centre, in the cells from `low` to `high`, at most two along
    /// each axis.
    ///
    /// All of them are checked, whatever is found: a search that may end at any time causes so many branch
    /// mispredictions that it takes longer. Each axis's part of the indices of [`locate`](Self::locate) is computed
    /// only once, which saves a good part of the work.
    fn any_in_eight(&self, low: UVec3, high: UVec3, center: Vec3, limit: f32) -> bool {
        let is_one_layer = low.z == high.z;
        let [low, high] = [low, high].map(|cell| {
            let (brick, inner) = (cell / SIDE, cell % SIDE);
            let place = UVec3::new(brick.x, brick.y * self.row, brick.z * self.layer);
            [place, UVec3::new(inner.x, inner.y * SIDE, inner.z * SIDE * SIDE)]
        });
        let head = |x: &[UVec3; 2], y: &[UVec3; 2], z: &[UVec3; 2]| {
            let brick = &self.bricks[self.table[(x[0].x + y[0].y + z[0].z) as usize] as usize];
            brick.heads[(x[1].x + y[1].y + z[1].z) as usize % CELLS]
        };
        let [a, b, c, d] =
            [head(&low, &low, &low), head(&high, &low, &low), head(&low, &high, &low), head(&high, &high, &low)];
        if is_one_layer {
            return self.chains_reach([a, b, c, d], center, limit);
        }
        let [e, f, g, h] =
            [head(&low, &low, &high), head(&high, &low, &high), head(&low, &high, &high), head(&high, &high, &high)];
        self.chains_reach([a, b, c, d, e, f, g, h], center, limit)
    }

    /// Whether a point of some chains lies within a squared radius of a centre. Checks all first blocks, then all
    /// second ones.
    fn chains_reach<const N: usize>(&self, mut blocks: [u32; N], center: Vec3, limit: f32) -> bool {
        let limit = Vec4::splat(limit);
        loop {
            let reached = blocks.map(|block| self.blocks[block as usize].distances(center).cmple(limit));
            if reached.into_iter().fold(BVec4A::FALSE, |any, reached| any | reached).any() {
                return true;
            }
            blocks = blocks.map(|block| self.next[block as usize]);
            if blocks.into_iter().fold(EMPTY, |any, block| any | block) == EMPTY {
                return false;
            }
        }
    }

    /// Marks the centres that have a point within `radius` in the first two blocks of their own cell: the fastest
    /// query, and usually enough in filled space. Other marks stay.
    ///
    /// Each step is done for many centres, so that the processor waits for the memory of all of them at once.
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

    /// The same with points that `accepts` for a centre, given their id.
    pub fn mark_beside_of(
        &self,
        centers: &[Vec3],
        radius: f32,
        marks: &mut [bool],
        accepts: impl Fn(u32, Vec3) -> bool,
    ) {
        let limit = Vec4::splat(radius * radius);
        let mut heads = [EMPTY; BATCH];
        for (centers, marks) in centers.chunks(BATCH).zip(marks.chunks_mut(BATCH)) {
            for (head, &center) in heads.iter_mut().zip(centers) {
                *head = self.head(self.cell_of(center));
            }
            for ((&head, &center), mark) in heads.iter().zip(centers).zip(marks) {
                for block in [head, self.next[head as usize]].map(|block| &self.blocks[block as usize]) {
                    let mut near = block.distances(center).cmple(limit).bitmask();
                    while near != 0 && !*mark {
                        let lane = near.trailing_zeros() as usize;
                        *mark = accepts(block.ids[lane], center);
                        near &= near - 1;
                    }
                }
            }
        }
    }

    /// Whether a point lies within `radius` of `center` that `accepts` its id.
    pub fn any_of_within(&self, center: Vec3, radius: f32, accepts: impl Fn(u32) -> bool) -> bool {
        let (limit, mut found) = (radius * radius, false);
        self.scan(center, radius, |id, _| {
            found = accepts(id);
            if found { -1.0 } else { limit }
        });
        found
    }

    /// Calls `visit(id, squared distance)` for every point within `radius`, in no particular order.
    pub fn for_each_within(&self, center: Vec3, radius: f32, mut visit: impl FnMut(u32, f32)) {
        let limit = radius * radius;
        self.scan(center, radius, |id, distance| {
            visit(id, distance);
            limit
        });
    }

    /// The nearest point within `radius` that `accepts` its id, with its squared distance. At equal distance the lowest
    /// id wins, in any order of insertion.
    pub fn nearest_within(&self, center: Vec3, radius: f32, accepts: impl Fn(u32) -> bool) -> Option<(u32, f32)> {
        self.nearest_two(center, radius, radius, accepts).0
    }

    /// As [`nearest_within`](Self::nearest_within), and the squared distance of the nearest of all points within
    /// `reach`, infinite if there is none. `reach` is not below `radius`.
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
