//! Which triangles each tile of the texture has.

use super::atlas::Atlas;
use super::canvas::Canvas;
use super::texels::{MARGIN, Placed, TILE};
use crate::synthesis::pace::Pace;
use std::ops::Range;

/// The placements of every tile, in the order of the atlas.
#[derive(Debug)]
pub(super) struct Bins {
    starts: Vec<u32>,
    placements: Vec<u32>,
    /// Tiles along the side of the texture.
    across: usize,
}

impl Bins {
    pub async fn of(canvas: &Canvas, atlas: &Atlas, size: u32, pace: &Pace) -> Self {
        let across = size.div_ceil(TILE) as usize;
        let tiles = |number: usize| -> [Range<usize>; 2] {
            let placement = &atlas.placements[number];
            let margin = if placement.is_border { MARGIN } else { 0.0 };
            Placed::of(canvas, placement, size).region(margin).map(|range| {
                let tile = |texel: i64| texel.clamp(0, i64::from(size)) as usize;
                tile(range.start) / TILE as usize..tile(range.end).div_ceil(TILE as usize)
            })
        };
        let mut starts = vec![0u32; across * across + 1];
        let count = |number: usize| {
            let [columns, rows] = tiles(number);
            for row in rows {
                columns.clone().for_each(|column| starts[row * across + column + 1] += 1);
            }
        };
        pace.part(0.0..0.5).each(atlas.placements.len(), count).await;
        (0..across * across).for_each(|tile| starts[tile + 1] += starts[tile]);
        let (mut placements, mut next) = (vec![0u32; starts[across * across] as usize], starts.clone());
        let enter = |number: usize| {
            let [columns, rows] = tiles(number);
            for row in rows {
                for column in columns.clone() {
                    let place = &mut next[row * across + column];
                    placements[*place as usize] = number as u32;
                    *place += 1;
                }
            }
        };
        pace.part(0.5..1.0).each(atlas.placements.len(), enter).await;
        Self { starts, placements, across }
    }

    /// Tiles along the side of the texture.
    pub fn across(&self) -> usize {
        self.across
    }

    /// The placements of a tile.
    pub fn of_tile(&self, column: usize, row: usize) -> &[u32] {
        let tile = row * self.across + column;
        &self.placements[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}
