//! Orders points in space, so that those that use the same memory are processed one after the other.

use bevy_math::{UVec3, Vec3, Vec3A, bounding::Aabb3d};

/// Points in a cell of the order, on average.
const POINTS_PER_CELL: f32 = 8.0;
/// Most cells along an axis.
const MOST_CELLS: f32 = 1024.0;

/// Sorts points into the cells of a box, row by row. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpatialOrder {
    cells: Vec<u32>,
    ends: Vec<u32>,
    indices: Vec<u32>,
}

impl SpatialOrder {
    /// Sorts some points. Those outside the box go to its outermost cells. Points of one cell keep their order.
    pub fn sort(&mut self, bounds: &Aabb3d, points: &[Vec3]) {
        let size = (bounds.max - bounds.min).max(Vec3A::ZERO);
        let longest = size.max_element().max(f32::MIN_POSITIVE);
        let per_axis = bevy_math::ops::cbrt(points.len() as f32 / POINTS_PER_CELL).ceil().clamp(1.0, MOST_CELLS);
        let scale = per_axis / longest;
        let last = (size * scale).min(Vec3A::splat(per_axis - 1.0)).floor();
        let sides = last.as_uvec3() + UVec3::ONE;
        let (row, layer) = (sides.x, sides.x * sides.y);
        self.ends.clear();
        self.ends.resize((layer * sides.z) as usize + 1, 0);
        self.cells.clear();
        self.cells.extend(points.iter().map(|&point| {
            let cell = ((Vec3A::from(point) - bounds.min) * scale).max(Vec3A::ZERO).min(last).as_uvec3();
            cell.x + cell.y * row + cell.z * layer
        }));
        for &cell in &self.cells {
            self.ends[cell as usize + 1] += 1;
        }
        for cell in 1..self.ends.len() {
            self.ends[cell] += self.ends[cell - 1];
        }
        self.indices.clear();
        self.indices.resize(points.len(), 0);
        for (index, &cell) in self.cells.iter().enumerate() {
            let place = &mut self.ends[cell as usize];
            self.indices[*place as usize] = index as u32;
            *place += 1;
        }
    }

    /// Indices of the points last sorted, in their order in space.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::random::Stream;
    use crate::synthesis::space::order::*;
    use rand::RngExt;

    #[test]
    fn every_point_comes_once_and_neighbours_come_together() {
        let bounds = Aabb3d::new(Vec3::splat(0.5), Vec3::splat(0.5));
        let mut rng = Stream::Statistics.rng(2);
        let mut point = || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.1..1.1)));
        let points: Vec<Vec3> = (0..5000).map(|_| point()).collect();
        let mut order = SpatialOrder::default();
        order.sort(&bounds, &points[..100]);
        order.sort(&bounds, &points);
        let mut indices = order.indices().to_vec();
        let way = |indices: &[u32]| {
            indices.windows(2).map(|pair| points[pair[0] as usize].distance(points[pair[1] as usize])).sum::<f32>()
        };
        let sorted = way(&indices);
        indices.sort_unstable();
        assert!(indices.iter().copied().eq(0..5000));
        assert!(sorted < 0.4 * way(&indices), "{sorted} of {}", way(&indices));
    }

    #[test]
    fn points_that_are_no_numbers_and_boxes_without_size_are_sorted_too() {
        let mut order = SpatialOrder::default();
        order.sort(&Aabb3d::new(Vec3::ONE, Vec3::ZERO), &[Vec3::ONE, Vec3::NAN, Vec3::INFINITY, Vec3::NEG_INFINITY]);
        assert_eq!(order.indices().len(), 4);
        order.sort(&Aabb3d::new(Vec3::ONE, Vec3::ZERO), &[]);
        assert!(order.indices().is_empty());
    }
}
