//! Haustra: the pouches of the wall between the taeniae, row by row.

use crate::synthesis::{organ::centre_line::CentreLine, random::VesselRng};
use bevy_math::ops;
use rand::RngExt;

/// Rows of haustra, one between each pair of taeniae.
pub(super) const ROWS: usize = 3;

/// Least length of a haustrum, as a share of the mean.
const SHORTEST: f32 = 0.55;

/// One row of haustra along the colon.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    /// Arc length of each semilunar fold, ascending, in metres.
    folds: Vec<f32>,
    /// Bulge of the haustrum before each fold, relative to the mean.
    bulges: Vec<f32>,
}

/// The shape of the wall at one place of a row.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Haustrum {
    /// Bulge of the wall: 0 on a fold, about 1 in the middle of a haustrum.
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

/// Places folds between two arc lengths: irregular, staggered between the rows, and sometimes missing.
pub(super) fn rows(line: &CentreLine, from: f32, to: f32, length: f32, rng: &mut VesselRng) -> [Row; ROWS] {
    let mut rows: [Row; ROWS] = Default::default();
    let mean_radius = line.at(0.5 * (from + to)).radius;
    let mut arc = from;
    while arc < to {
        // Narrow parts have shorter haustra; those of the left colon are longer relative to their calibre.
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
