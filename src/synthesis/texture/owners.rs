//! Which triangle has each texel of a tile.

use super::face::Face;
use super::texels::{MARGIN, TILE, TILE_TEXELS};
use bevy_math::DVec2;
use std::ops::Range;

/// Owner of a texel that no triangle has.
pub(super) const NOBODY: u32 = u32::MAX;
/// Least weight of a corner at a point well within a triangle.
const WITHIN: f32 = 0.01;

/// Which triangle has each texel of a tile.
#[derive(Default)]
pub(super) struct Owners {
    /// For each texel, the place of its triangle among those of the tile.
    owners: Vec<u32>,
    /// For each texel that is in no triangle, the squared distance from the nearest one; below 0 for the others. Empty
    /// in tiles without a border.
    distances: Vec<f64>,
}

impl Owners {
    /// The place of a texel's triangle.
    pub fn of(&self, texel: usize) -> u32 {
        self.owners[texel]
    }

    /// Whether a texel with an owner lies beyond the border of its chart.
    pub fn is_beside(&self, texel: usize) -> bool {
        self.distances.get(texel).is_some_and(|distance| *distance >= 0.0)
    }

    /// Gives the texels within triangles to the first of them, and the others to nobody. Returns how many another one
    /// claims as well.
    pub fn own(&mut self, tile: &[Range<i64>; 2], faces: &[Face]) -> usize {
        self.owners.clear();
        self.owners.resize(TILE_TEXELS, NOBODY);
        self.distances.clear();
        let mut overlaps = 0;
        for (number, face) in faces.iter().enumerate() {
            let [_, rows] = within(tile, &face.placed.region(0.0));
            for row in rows {
                let span = face.placed.span(row);
                for column in span.start.max(tile[0].start)..span.end.min(tile[0].end) {
                    let owner = &mut self.owners[place(tile, column, row)];
                    if *owner == NOBODY {
                        *owner = number as u32;
                    } else {
                        let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                        overlaps += usize::from(face.placed.weights(at).min_element() > WITHIN);
                    }
                }
            }
        }
        overlaps
    }

    /// Gives texels beside the borders of charts to the nearest triangle.
    pub fn own_margin(&mut self, tile: &[Range<i64>; 2], faces: &[Face], is_border: impl Iterator<Item = bool>) {
        for (number, face) in faces.iter().enumerate().zip(is_border).filter_map(|(face, is)| is.then_some(face)) {
            if self.distances.is_empty() {
                let outside = |owner: &u32| if *owner == NOBODY { MARGIN * MARGIN } else { -1.0 };
                self.distances.extend(self.owners.iter().map(outside));
            }
            let [columns, rows] = within(tile, &face.placed.region(MARGIN));
            for row in rows {
                for column in columns.clone() {
                    let texel = place(tile, column, row);
                    let best = &mut self.distances[texel];
                    if *best >= 0.0 {
                        let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                        let squared = face.placed.distance_squared(at);
                        if squared < *best {
                            (*best, self.owners[texel]) = (squared, number as u32);
                        }
                    }
                }
            }
        }
    }
}

/// The columns and rows of a tile within a region.
pub(super) fn within(tile: &[Range<i64>; 2], region: &[Range<i64>; 2]) -> [Range<i64>; 2] {
    [0, 1].map(|axis| region[axis].start.max(tile[axis].start)..region[axis].end.min(tile[axis].end))
}

/// The place of a texel in its tile.
pub(super) fn place(tile: &[Range<i64>; 2], column: i64, row: i64) -> usize {
    (row - tile[1].start) as usize * TILE as usize + (column - tile[0].start) as usize
}
