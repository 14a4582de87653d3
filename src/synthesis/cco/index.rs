//! Where segments are: a hashed grid for each octave of their size.
//!
//! The size of a segment is its length and twice its bound at its widest. A segment lies in the grid whose cells are
//! just as large or larger, in the cell of its middle, so that it reaches at most half a cell beyond. That finds long
//! and thick vessels as surely as short ones, and every segment is stored once.
//!
//! Cells are known by a hash of 32 bits. Two that share one, which is rare, share their segments: a search meets some
//! that are far away, as it does anyway.

use super::{
    cell_map::CellMap,
    forest::{FLARE, Forest, NONE},
};
use bevy_math::DVec3;

/// Grids. Up to four cells of the coarsest lie along each axis, so the finest has 2¹⁹ along it.
const LEVELS: usize = 18;
/// Bits of a coordinate in a cell's key.
const BITS: u32 = 19;
/// Segments of a grid up to which they are listed, for searches that would meet more cells than segments.
const MOST_LISTED: usize = 1024;
/// Segments of all grids whose levels are looked at in the time in which one cell is.
const LEVELS_PER_CELL: f64 = 16.0;
/// Level of what is in no grid.
const NOWHERE: u8 = u8::MAX;

/// An index over the segments of a [`Forest`].
#[derive(Clone, Debug)]
pub(super) struct SegmentGrid {
    origin: DVec3,
    /// Side of the largest cell: no segment is larger.
    side: f64,
    /// The finest grid in use.
    finest: usize,
    /// Segments of each grid.
    members: [Members; LEVELS],
    /// First segment of each cell.
    cells: CellMap,
    /// Next segment in the cell of each.
    next: Vec<u32>,
    /// Grid of each segment.
    level_of: Vec<u8>,
}

/// The segments of a grid.
#[derive(Clone, Debug, Default)]
struct Members {
    count: usize,
    /// All of them; empty from the time when they were too many until none is left.
    list: Vec<u32>,
    are_too_many: bool,
}

impl Members {
    fn add(&mut self, segment: u32) {
        self.count += 1;
        if self.count > MOST_LISTED {
            (self.are_too_many, self.list) = (true, Vec::new());
        } else if !self.are_too_many {
            self.list.push(segment);
        }
    }

    fn remove(&mut self, segment: u32) {
        self.count -= 1;
        if let Some(place) = self.list.iter().position(|&member| member == segment) {
            self.list.swap_remove(place);
        }
        self.are_too_many &= self.count > 0;
    }
}

impl SegmentGrid {
    /// An index over a box with this lowest corner, for segments up to `side` in size.
    pub(super) fn new(origin: DVec3, side: f64) -> Self {
        Self {
            // One cell of margin for segments that reach beyond the box.
            origin: origin - side,
            side,
            finest: LEVELS - 1,
            members: Default::default(),
            cells: CellMap::default(),
            next: Vec::new(),
            level_of: Vec::new(),
        }
    }

    pub(super) fn reserve(&mut self, segments: usize) {
        self.next.reserve_exact(segments);
        self.level_of.reserve_exact(segments);
    }

    fn cell_side(&self, level: usize) -> f64 {
        self.side / (1u64 << level) as f64
    }

    /// Makes cells for new segments no smaller than this: searches reach so far that they would meet many of them.
    pub(super) fn coarsen(&mut self, side: f64) {
        self.finest = (0..LEVELS - 1).find(|&level| self.cell_side(level + 1) < side).unwrap_or(LEVELS - 1);
    }

    /// The finest grid in use whose cells are as large as a segment.
    fn level(&self, size: f64) -> usize {
        let mut level = 0;
        while level < self.finest && self.cell_side(level + 1) >= size {
            level += 1;
        }
        level
    }

    fn coordinates(&self, level: usize, point: DVec3) -> [i64; 3] {
        ((point - self.origin) / self.cell_side(level)).to_array().map(|value| value.floor() as i64)
    }

    /// The key of a cell. The finest grids have 2¹⁹ cells along an axis, so coordinates need 19 bits.
    fn key(level: usize, cell: [i64; 3]) -> u32 {
        let limit = (1i64 << BITS) - 1;
        let [x, y, z] = cell.map(|value| value.clamp(0, limit) as u64);
        let number = (((level as u64) << BITS | x) << BITS | y) << BITS | z;
        // Fibonacci hashing.
        ((number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as u32).min(u32::MAX - 1)
    }

    /// The cell of the middle of a segment.
    fn key_of(&self, forest: &Forest, segment: u32, level: usize) -> u32 {
        let middle = 0.5 * (forest.place(segment) + forest.place(forest.node(segment).parent));
        Self::key(level, self.coordinates(level, middle))
    }

    fn size(forest: &Forest, segment: u32) -> f64 {
        let node = forest.node(segment);
        forest.length(segment) + 2.0 * FLARE * f64::from(node.bound)
    }

    /// Adds a segment, which must not be in the index.
    pub(super) fn insert(&mut self, forest: &Forest, segment: u32) {
        let slot = segment as usize;
        if self.next.len() <= slot {
            self.next.resize(slot + 1, NONE);
            self.level_of.resize(slot + 1, NOWHERE);
        }
        let level = self.level(Self::size(forest, segment));
        let key = self.key_of(forest, segment, level);
        let head = self.cells.get_or_insert(key, NONE);
        self.next[slot] = std::mem::replace(head, segment);
        self.level_of[slot] = level as u8;
        self.members[level].add(segment);
    }

    /// Takes a segment out, whose ends are where they were when it was added.
    pub(super) fn remove(&mut self, forest: &Forest, segment: u32) {
        let slot = segment as usize;
        let level = usize::from(std::mem::replace(&mut self.level_of[slot], NOWHERE));
        let key = self.key_of(forest, segment, level);
        let (head, after) = (self.cells.get_or_insert(key, NONE), self.next[slot]);
        if *head == segment {
            *head = after;
        } else {
            let mut at = *head as usize;
            while self.next[at] != segment {
                at = self.next[at] as usize;
            }
            self.next[at] = after;
        }
        self.members[level].remove(segment);
    }

    /// Puts a segment into another grid if its bound has outgrown its cell.
    pub(super) fn refit(&mut self, forest: &Forest, segment: u32) {
        if Self::size(forest, segment) > self.cell_side(self.level_of[segment as usize].into()) {
            self.remove(forest, segment);
            self.insert(forest, segment);
        }
    }

    /// Visits every segment that may come within `reach` of the line between two points, some of them twice, until
    /// `visit` returns false.
    pub(super) fn near(&self, from: DVec3, to: DVec3, reach: f64, mut visit: impl FnMut(u32) -> bool) {
        for level in (0..LEVELS).filter(|&level| self.members[level].count > 0) {
            if !self.near_in(level, [from, to], reach, &mut visit) {
                return;
            }
        }
    }

    fn near_in(&self, level: usize, [from, to]: [DVec3; 2], reach: f64, visit: &mut impl FnMut(u32) -> bool) -> bool {
        let (way, side) = (to - from, self.cell_side(level));
        let margin = reach + 0.5 * side;
        // Along a line that is longer than a cell, piece by piece: its box would have too many cells.
        let pieces = (way.length() / (2.0 * side).max(reach)).ceil().max(1.0);
        let cells = |piece: f64| {
            let [start, end] = [piece, piece + 1.0].map(|piece| from + way * (piece / pieces));
            let first = self.coordinates(level, start.min(end) - margin);
            (first, self.coordinates(level, start.max(end) + margin))
        };
        let (first, last) = cells(0.0);
        let number = (0..3).map(|axis| (last[axis] - first[axis] + 1) as f64).product::<f64>() * pieces;
        let members = &self.members[level];
        if !members.are_too_many && number > 2.0 * members.count as f64 {
            return members.list.iter().all(|&segment| visit(segment));
        }
        if number * LEVELS_PER_CELL > self.level_of.len() as f64 && number > 2.0 * members.count as f64 {
            let levels = (0..).zip(&self.level_of);
            return levels.filter(|&(_, &own)| usize::from(own) == level).all(|(segment, _)| visit(segment));
        }
        for piece in 0..pieces as u64 {
            let (first, last) = cells(piece as f64);
            for x in first[0]..=last[0] {
                for y in first[1]..=last[1] {
                    for z in first[2]..=last[2] {
                        if !self.visit_cell(Self::key(level, [x, y, z]), visit) {
                            return false;
                        }
                    }
                }
            }
        }
        true
    }

    fn visit_cell(&self, key: u32, visit: &mut impl FnMut(u32) -> bool) -> bool {
        let mut segment = self.cells.get(key).unwrap_or(NONE);
        while segment != NONE {
            if !visit(segment) {
                return false;
            }
            segment = self.next[segment as usize];
        }
        true
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        let lists = self.members.iter().map(|members| members.list.capacity()).sum::<usize>();
        self.cells.bytes() + 4 * (self.next.capacity() + lists) + self.level_of.capacity()
    }
}
