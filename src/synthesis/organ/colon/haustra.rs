//! Haustra: where the wall is drawn in between the taeniae, row by row.

use crate::synthesis::{organ::centre_line::CentreLine, random::VesselRng};
use bevy_math::ops;
use rand::RngExt;

/// Rows of haustra, one between each two taeniae.
pub(super) const ROWS: usize = 3;

/// Least share of the mean length that a haustrum has.
const SHORTEST: f32 = 0.55;

/// One row of haustra along the colon.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    /// Arc length of each semilunar fold, ascending, in metres.
    folds: Vec<f32>,
    /// How far the haustrum before each fold bulges, relative to the mean.
    bulges: Vec<f32>,
}

/// The wall's state at one place of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Haustrum {
    /// How far the wall bulges out: 0 on a fold, about 1 in the middle of a haustrum.
    pub bulge: f32,
    /// Distance to the nearest fold, in metres.
    pub to_fold: f32,
}

impl Row {
    /// Number of whole haustra.
    pub fn len(&self) -> usize {
        self.folds.len().saturating_sub(1)
    }

    /// The wall at an arc length.
    pub fn at(&self, arc: f32) -> Haustrum {
        let next = self.folds.partition_point(|&fold| fold <= arc);
        let (Some(&end), Some(&start)) = (self.folds.get(next), self.folds.get(next.wrapping_sub(1))) else {
            let nearest = if next == 0 { self.folds.first() } else { self.folds.last() };
            let to_fold = nearest.map_or(f32::INFINITY, |fold| (fold - arc).abs());
            return Haustrum { bulge: (to_fold / 0.012).min(1.0) * 0.6, to_fold };
        };
        let across = 2.0 * (arc - start) / (end - start) - 1.0;
        let bulge = self.bulges[next] * ops::powf((1.0 - across * across).max(0.0), 0.62);
        Haustrum { bulge, to_fold: (arc - start).min(end - arc) }
    }
}

/// Places folds between two arc lengths: irregular, staggered between the rows, now and then one missing.
pub(super) fn rows(line: &CentreLine, from: f32, to: f32, length: f32, rng: &mut VesselRng) -> [Row; ROWS] {
    let mut rows: [Row; ROWS] = Default::default();
    let mean_radius = line.at(0.5 * (from + to)).radius;
    let mut arc = from;
    while arc < to {
        // Narrow parts have shorter haustra, and those of the left colon are further apart for their calibre.
        let local = length * ops::powf(line.at(arc).radius / mean_radius, 0.6);
        arc += local * rng.random_range(0.74..=1.26);
        for row in &mut rows {
            let fold = arc + local * rng.random_range(-0.26..=0.26);
            let missing = rng.random_bool(0.06);
            let bulge = rng.random_range(0.78..=1.12);
            let clear = row.folds.last().is_none_or(|last| fold - last > SHORTEST * local);
            if clear && !missing && fold < to {
                row.folds.push(fold);
                row.bulges.push(bulge);
            }
        }
    }
    rows
}
