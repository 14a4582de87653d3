//! The order in which points lie in space, so that those that ask for the same memory come one after the other.

use bevy_math::{UVec3, Vec3, Vec3A, bounding::Aabb3d};

/// Points in a cell of the order, on average.
const POINTS_PER_CELL: f32 = 8.0;
/// Most cells along an axis.
const MOST_CELLS: f32 = 1024.0;

/// Sorts points into the cells of a box, row by row. Keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct SpatialOrder {
    cells: Vec<u32>,
    ends: Vec<u32>,
    indices: Vec<u32>,
}

impl SpatialOrder {
    /// Sorts some points, those outside the box with its outermost cells. Points of a cell stay in their order.
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
