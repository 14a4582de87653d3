//! Rows: openings side by side around a trunk, between the same rings.
//!
//! In: the exits of a trunk's laterals. Out: rows that don't overlap, each with its place along the trunk, its number of
//! sides, and the columns of faces that its openings take.

use super::curve::Curve;
use super::exit::{Exit, HALF_EDGE};
use super::shape::Shape;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Bounds of an opening's width, as shares of its columns' even width.
const NARROWEST: f32 = 0.5;
const WIDEST: f32 = 1.5;
/// The widest opening, as a share of the way round.
const WIDEST_SHARE: f32 = 0.36;
/// Room between two openings of a row, as a share of a column's even width.
const APART: f32 = 0.5;
/// Room between two rows, as a share of half the shorter one.
const GAP: f32 = 0.3;
/// Distance of a row from its wish from which it counts as crowded, in halves of its length.
const FAR: f32 = 0.6;
/// Factor by which crowded rows are made shorter, and the number of rounds.
const SHRINK: f32 = 0.6;
const ROUNDS: usize = 6;
/// Rows are never squeezed into less than this share of their length; a trunk without that room becomes longer.
const LEAST_ROOM: f32 = 0.2;

/// An opening of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opening {
    /// Index of its exit.
    pub exit: u32,
    /// Its first column. Set by [`Columns`](super::columns::Columns).
    pub column: u32,
    /// Number of columns, and of the lateral's sides over 4.
    pub width: u32,
    /// Angle of its middle around the trunk.
    pub angle: f32,
    /// Half its angle.
    pub half: f32,
}

/// Openings between the same rings.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    /// Length of its middle along the trunk.
    pub length: f32,
    /// Half its length.
    pub half: f32,
    /// Number of sides.
    pub sides: u32,
    /// Columns of its widest opening; it has as many belts of faces.
    pub width: u32,
    /// Radius of its widest lateral.
    pub radius: f32,
    /// Its openings, in the order of their angles.
    pub openings: Vec<Opening>,
}

/// All rows of a trunk, from one length to another if there is room.
pub(super) fn rows(curve: &Curve, exits: &[Exit], shape: &Shape, from: f32, to: f32) -> Vec<Row> {
    let mut order: Vec<u32> = (0..exits.len() as u32).collect();
    order.sort_by(|&a, &b| exits[a as usize].length.total_cmp(&exits[b as usize].length));
    let mut rows: Vec<Row> = Vec::new();
    for exit in order {
        let here = &exits[exit as usize];
        let with = rows.last().and_then(|row| row.with(exit, exits, curve, shape));
        match (with, rows.last_mut()) {
            (Some(with), Some(row)) => *row = with,
            _ => {
                let mut row = Row { length: here.length, ..Row::default() };
                row.open([exit].into_iter(), exits, curve, shape);
                rows.push(row);
            }
        }
    }
    place(&mut rows, from, to);
    rows
}

impl Row {
    /// This row with one more exit; `None` if that one has room in a row of its own, or none in this.
    fn with(&self, exit: u32, exits: &[Exit], curve: &Curve, shape: &Shape) -> Option<Self> {
        let here = &exits[exit as usize];
        let room = GAP * self.half.min(here.half);
        let overlaps = here.length - here.half < self.length + self.half + room;
        let is_near = (here.length - self.length).abs() < self.half.max(here.half);
        if !(overlaps && is_near) {
            return None;
        }
        let weight: f32 = self.openings.iter().map(|opening| exits[opening.exit as usize].radius).sum();
        let length = (self.length * weight + here.length * here.radius) / (weight + here.radius);
        let mut with = Self { length, ..Self::default() };
        let all = self.openings.iter().map(|opening| opening.exit).chain([exit]);
        with.open(all, exits, curve, shape);
        with.fits().then_some(with)
    }

    /// Sets the openings of some exits, and with them all but the length.
    fn open(&mut self, all: impl Iterator<Item = u32>, exits: &[Exit], curve: &Curve, shape: &Shape) {
        let station = curve.at(self.length);
        self.openings.extend(all.map(|exit| {
            let here = &exits[exit as usize];
            let width = shape.sides_of(here.radius) / 4;
            Opening { exit, column: 0, width, angle: here.angle(&station), half: 0.0 }
        }));
        self.width = self.openings.iter().map(|opening| opening.width).max().unwrap_or(1);
        // One opening may take its side of a square, with no room beside it.
        let needed = if self.openings.len() == 1 { 4 * self.width } else { self.columns().next_power_of_two() };
        self.sides = shape.sides_of(station.radius).max(needed).min(shape.most());
        let even = TAU / self.sides as f32;
        for opening in &mut self.openings {
            let here = &exits[opening.exit as usize];
            let columns = opening.width as f32 * even;
            let least = 0.5 * NARROWEST * columns;
            let most = (0.5 * WIDEST * columns).min(0.5 * WIDEST_SHARE * TAU).min(FRAC_PI_2);
            opening.half = (HALF_EDGE * here.radius / station.radius).clamp(least, most.max(least));
            let height = here.half.max(least * station.radius);
            self.half = self.half.max(height);
            self.radius = self.radius.max(here.radius);
        }
        self.openings.sort_by(|a, b| a.angle.total_cmp(&b.angle).then(a.exit.cmp(&b.exit)));
    }

    /// Columns that the openings take, with one between each two.
    fn columns(&self) -> u32 {
        self.openings.iter().map(|opening| opening.width + 1).sum()
    }

    /// Whether all openings have room beside each other.
    fn fits(&self) -> bool {
        let (even, count) = (TAU / self.sides as f32, self.openings.len());
        let is_apart = |first: usize| {
            let (a, b) = (self.openings[first], self.openings[(first + 1) % count]);
            let wrap = if first + 1 == count { TAU } else { 0.0 };
            b.angle + wrap - a.angle >= a.half + b.half + APART * even
        };
        self.columns() <= self.sides && (0..count).all(is_apart)
    }
}

/// Moves rows so that they don't overlap, between two lengths.
///
/// Rows that would be moved far are made shorter first, since an opening far from its lateral is worse than a narrow one.
fn place(rows: &mut [Row], from: f32, to: f32) {
    let wishes: Vec<f32> = rows.iter().map(|row| row.length).collect();
    for round in 0..ROUNDS {
        let pools = pooled(rows, &wishes, from, to);
        let mut first = 0;
        let mut is_crowded = false;
        for count in pools {
            let pool = first..first + count;
            let is_far = |index: usize| (rows[index].length - wishes[index]).abs() > FAR * rows[index].half;
            if count > 1 && pool.clone().any(is_far) {
                is_crowded = true;
                if round + 1 < ROUNDS {
                    rows[pool].iter_mut().for_each(|row| row.half *= SHRINK);
                }
            }
            first += count;
        }
        if !is_crowded {
            break;
        }
    }
}

/// Moves rows by the least squares, weighted with their radii. Returns the numbers of rows that stand side by side.
///
/// Without the bounds that is an isotonic regression: rows that would overlap are pooled, each pool at the mean of its
/// rows' wishes. If all rows together are longer than the room, all are made shorter.
fn pooled(rows: &mut [Row], wishes: &[f32], from: f32, to: f32) -> Vec<usize> {
    let gap = |a: &Row, b: &Row| GAP * a.half.min(b.half);
    let halves: f32 = rows.iter().map(|row| 2.0 * row.half).sum();
    let needed = halves + rows.windows(2).map(|pair| gap(&pair[0], &pair[1])).sum::<f32>();
    let room = (to - from).max(LEAST_ROOM * halves);
    if needed > room {
        rows.iter_mut().for_each(|row| row.half *= room / needed);
    }
    // Distance from the first row's middle at which each stands if all stand as close as they can.
    let mut closest = 0.0;
    let mut pools: Vec<(f32, f32, usize)> = Vec::with_capacity(rows.len());
    let mut places = Vec::with_capacity(rows.len());
    for index in 0..rows.len() {
        if index > 0 {
            let (a, b) = (&rows[index - 1], &rows[index]);
            closest += a.half + b.half + gap(a, b);
        }
        places.push(closest);
        let mut pool = (wishes[index] - closest, rows[index].radius, 1);
        while let Some(&(wish, weight, count)) = pools.last()
            && wish > pool.0
        {
            pools.pop();
            pool = ((wish * weight + pool.0 * pool.1) / (weight + pool.1), weight + pool.1, count + pool.2);
        }
        pools.push(pool);
    }
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Vec::new() };
    let least = from + first.half;
    let most = (to - last.half - closest).max(least);
    let mut index = 0;
    for &(wish, _, count) in &pools {
        for _ in 0..count {
            rows[index].length = wish.clamp(least, most) + places[index];
            index += 1;
        }
    }
    pools.into_iter().map(|(.., count)| count).collect()
}
