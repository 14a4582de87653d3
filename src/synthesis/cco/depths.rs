//! Known depths of a tissue, which bound those of all points.
//!
//! A depth changes by no more than the way between two points, so the value at the centre of a cell bounds those of all
//! its points from both sides. A coarse grid decides far from the border. A fine one is filled where it is asked.

use crate::synthesis::{parallel, tissue::Tissue};
use bevy_math::Vec3;
use std::sync::atomic::{AtomicU32, Ordering};

/// Cells of the fine grid along the longest side of the tissue.
const FINE: f32 = 160.0;
/// Those of the coarse grid.
const COARSE: f32 = 28.0;
/// Bits of a depth that is not known yet.
const UNKNOWN: u32 = f32::NAN.to_bits();
/// Excess of a lower bound, in cells, from which it serves as a depth: a walk along a vessel takes it for a step.
const CLEAR: f64 = 0.25;

/// Depths at the centres of two grids.
#[derive(Debug)]
pub(super) struct Depths {
    coarse: Grid,
    fine: Grid,
}

/// Depths at the centres of cells, as far as they are known.
///
/// A value is the same whichever thread finds it, so finding it twice does no harm.
#[derive(Debug)]
struct Grid {
    corner: Vec3,
    cell: f32,
    size: [usize; 3],
    depths: Vec<AtomicU32>,
}

impl Depths {
    /// Searches for the depths of the coarse grid over a box.
    pub(super) fn new(tissue: &dyn Tissue, min: Vec3, max: Vec3) -> Self {
        let (coarse, fine) = (Grid::new(min, max, COARSE), Grid::new(min, max, FINE));
        let numbers: Vec<usize> = (0..coarse.depths.len()).collect();
        let mut filled: Vec<f32> = Vec::new();
        parallel::map_into(&numbers, &mut filled, 0.0, |&number| coarse.depth(tissue, number));
        Self { coarse, fine }
    }

    /// The least and the largest depth that a point may have, if both are on one side of `need`; otherwise `None`.
    pub(super) fn bounds(&self, tissue: &dyn Tissue, point: Vec3, need: f64) -> Option<[f64; 2]> {
        [&self.coarse, &self.fine].into_iter().find_map(|grid| {
            let bounds = grid.bounds(tissue, point)?;
            let decides = bounds[0] > need + CLEAR * f64::from(self.fine.cell) || bounds[1] < need;
            decides.then_some(bounds)
        })
    }

    /// Whether the depth of a point may be so large.
    pub(super) fn may_be_above(&self, tissue: &dyn Tissue, point: Vec3, depth: f64) -> bool {
        let Some([least, most]) = self.coarse.bounds(tissue, point) else {
            return tissue.depth(point).is_some_and(|found| f64::from(found) >= depth);
        };
        least >= depth || most >= depth && self.fine.bounds(tissue, point).is_none_or(|[_, most]| most >= depth)
    }
}

impl Grid {
    fn new(min: Vec3, max: Vec3, resolution: f32) -> Self {
        let cell = (max - min).max_element() / resolution;
        let size = ((max - min) / cell).to_array().map(|count| (count.ceil() as usize).max(1));
        let count = size.iter().product();
        Self { corner: min, cell, size, depths: (0..count).map(|_| AtomicU32::new(UNKNOWN)).collect() }
    }

    fn center(&self, number: usize) -> Vec3 {
        let [x, y, _] = self.size;
        let cell = Vec3::new((number % x) as f32, (number / x % y) as f32, (number / (x * y)) as f32);
        self.corner + (cell + 0.5) * self.cell
    }

    /// The depth at the centre of a cell.
    fn depth(&self, tissue: &dyn Tissue, number: usize) -> f32 {
        let known = f32::from_bits(self.depths[number].load(Ordering::Relaxed));
        if !known.is_nan() {
            return known;
        }
        let depth = tissue.depth(self.center(number)).unwrap_or(f32::NEG_INFINITY);
        self.depths[number].store(depth.to_bits(), Ordering::Relaxed);
        depth
    }

    /// The least and the largest depth that a point may have; `None` beside the grid.
    fn bounds(&self, tissue: &dyn Tissue, point: Vec3) -> Option<[f64; 2]> {
        let local = (point - self.corner) / self.cell;
        let cell = local.to_array().map(|value| value as usize);
        let is_in = local.cmpge(Vec3::ZERO).all() && (0..3).all(|axis| cell[axis] < self.size[axis]);
        if !is_in {
            return None;
        }
        let number = (cell[2] * self.size[1] + cell[1]) * self.size[0] + cell[0];
        let away = f64::from(point.distance(self.center(number)));
        let depth = f64::from(self.depth(tissue, number));
        Some([depth - away, depth + away])
    }
}
