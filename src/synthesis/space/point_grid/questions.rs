//! Queries of a point grid: whether any point is near, the nearest one, and all points around a position.

use crate::synthesis::space::point_grid::brick::{COLUMNS, EMPTY, LAYERS, ROWS, SIDE, range};
use crate::synthesis::space::point_grid::{Blockers, PointGrid, together::BATCH};
use bevy_math::{UVec3, Vec3, Vec4};

impl PointGrid {
    /// First block of a cell.
    #[inline]
    fn head(&self, cell: UVec3) -> u32 {
        let (place, inner) = self.locate(cell);
        self.bricks[self.brick_at(place)].heads[inner]
    }

    /// Calls `visit(first block)` for the filled cells of a box of cells, until it answers false.
    #[inline]
    pub(super) fn for_cells(&self, low: UVec3, high: UVec3, mut visit: impl FnMut(u32) -> bool) {
        let (first, last) = (low / SIDE, high / SIDE);
        for z in first.z..=last.z {
            let layers = LAYERS[range(low.z, high.z, z)];
            for y in first.y..=last.y {
                let rows = layers & ROWS[range(low.y, high.y, y)];
                let place = (y * self.row + z * self.layer) as usize;
                for x in first.x..=last.x {
                    let brick = &self.bricks[self.brick_at(place + x as usize)];
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
        Blockers::new([(self, radius)]).any(center)
    }

    /// Whether a point lies within `radius` of `center`, if the ball is much smaller than a cell: it is then seldom in
    /// more than one.
    pub fn any_close(&self, center: Vec3, radius: f32) -> bool {
        let (low, high) = self.cells_around(self.local(center), radius);
        if low != high {
            return self.any_within(center, radius);
        }
        let limit = Vec4::splat(radius * radius);
        let mut block = self.head(low);
        while block != EMPTY {
            if self.blocks[block as usize].distances(center).cmple(limit).any() {
                return true;
            }
            block = self.next[block as usize];
        }
        false
    }

    /// Marks the centres that have a point within `radius` in the first two blocks of their own cell. See
    /// [`Blockers::mark_beside`].
    pub fn mark_beside(&self, centers: &[Vec3], radius: f32, marks: &mut [bool]) {
        Blockers::new([(self, radius)]).mark_beside(centers, marks);
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
