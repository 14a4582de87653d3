//! Columns: the angles of a ring's vertices around a trunk.
//!
//! Columns are moved so that each opening of a row lies in the middle of its lateral and is as wide, as far as that takes
//! no more than a part of a column; the others share the rest of the way round evenly. Between two rows the angles change
//! evenly, so that openings never twist the trunk.

use super::rows::Opening;
use std::f32::consts::TAU;

/// The most by which columns turn over a radius of length, in radians.
const MOST_TWIST: f32 = 0.6;

/// Angles of the lines between columns, rising by less than a full turn; the first line's follows a turn later.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Columns {
    angles: Vec<f32>,
}

impl Columns {
    /// So many even columns, the first line at an angle.
    pub fn even(sides: u32, first: f32) -> Self {
        Self { angles: (0..sides).map(|line| first + TAU * line as f32 / sides as f32).collect() }
    }

    /// Even columns that turn least from these.
    pub fn evened(&self, sides: u32) -> Self {
        let count = self.angles.len() as f32;
        let offset = |(line, angle): (usize, &f32)| angle - TAU * line as f32 / count;
        Self::even(sides, self.angles.iter().enumerate().map(offset).sum::<f32>() / count)
    }

    /// Even columns with a line at an angle that turn least from these.
    pub fn evened_to(&self, sides: u32, angle: f32) -> Self {
        let (even, step) = (self.evened(sides), TAU / sides as f32);
        let steps = ((even.angles[0] - angle) / step).round();
        Self::even(sides, angle + steps * step)
    }

    /// The angle at a share of the way round, in columns: from 0 to 1, or a turn more for each whole number.
    pub fn at(&self, share: f32) -> f32 {
        let (turns, count) = (share.floor(), self.angles.len());
        let line = (share - turns) * count as f32;
        let first = (line as usize).min(count - 1);
        let next = if first + 1 == count { self.angles[0] + TAU } else { self.angles[first + 1] };
        self.angles[first] + (line - first as f32) * (next - self.angles[first]) + turns * TAU
    }

    /// The share of the way round at an angle: the inverse of [`at`](Self::at).
    fn share_of(&self, angle: f32) -> f32 {
        let count = self.angles.len();
        let turns = ((angle - self.angles[0]) / TAU).floor();
        let angle = angle - turns * TAU;
        let first = self.angles.partition_point(|&line| line <= angle).clamp(1, count) - 1;
        let next = if first + 1 == count { self.angles[0] + TAU } else { self.angles[first + 1] };
        let part = ((angle - self.angles[first]) / (next - self.angles[first])).clamp(0.0, 1.0);
        (first as f32 + part) / count as f32 + turns
    }

    /// Columns for the openings of a row, so many radii of length after these. Sets the openings' first columns.
    pub fn with_openings(&self, sides: u32, openings: &mut [Opening], radii: f32) -> Self {
        let lines = self.lines(sides, openings);
        let count = openings.len();
        let mut angles = vec![0.0; sides as usize];
        for (index, opening) in openings.iter().enumerate() {
            let (line, width) = (lines[index], opening.width as i32);
            // The angle that belongs to the line's turn.
            let middle = self.at((line as f32 + 0.5 * width as f32) / sides as f32);
            let angle = opening.angle + TAU * ((middle - opening.angle) / TAU).round();
            let next = openings[(index + 1) % count];
            let next_line = if index + 1 < count { lines[index + 1] } else { lines[0] + sides as i32 };
            let next_middle = self.at((next_line as f32 + 0.5 * next.width as f32) / sides as f32);
            let next_angle = next.angle + TAU * ((next_middle - next.angle) / TAU).round() - next.half;
            let end = angle + opening.half;
            let gap = next_line - line - width;
            for step in 0..width + gap {
                let angle = if step <= width {
                    angle - opening.half + 2.0 * opening.half * step as f32 / width as f32
                } else {
                    end + (next_angle - end) * (step - width) as f32 / gap as f32
                };
                let (slot, turns) = ((line + step).rem_euclid(sides as i32), (line + step).div_euclid(sides as i32));
                angles[slot as usize] = angle - TAU * turns as f32;
            }
        }
        for (opening, line) in openings.iter_mut().zip(lines) {
            opening.column = line.rem_euclid(sides as i32) as u32;
        }
        self.turned_towards(angles, radii)
    }

    /// The first line of each opening: the nearest to its wish, with a column between each two.
    fn lines(&self, sides: u32, openings: &mut [Opening]) -> Vec<i32> {
        let wish = |opening: &Opening| {
            let middle = self.share_of(opening.angle) * sides as f32;
            (middle - 0.5 * opening.width as f32).round() as i32
        };
        let turn = sides as i32;
        openings.sort_by_key(|opening| (wish(opening).rem_euclid(turn), opening.exit));
        let mut lines: Vec<i32> = openings.iter().map(|opening| wish(opening).rem_euclid(turn)).collect();
        let count = lines.len();
        if count < 2 {
            return lines;
        }
        for index in 1..count {
            lines[index] = lines[index].max(lines[index - 1] + openings[index - 1].width as i32 + 1);
        }
        // What was pushed beyond the first opening's next turn is pushed back.
        let mut limit = lines[0] + turn;
        for index in (0..count).rev() {
            lines[index] = lines[index].min(limit - openings[index].width as i32 - 1);
            limit = lines[index];
        }
        lines
    }

    /// These angles, or as much of the way to them as the length allows.
    fn turned_towards(&self, mut angles: Vec<f32>, radii: f32) -> Self {
        let sides = angles.len() as f32;
        let from = |line: usize| self.at(line as f32 / sides);
        let most = angles.iter().enumerate().map(|(line, angle)| (angle - from(line)).abs()).fold(0.0, f32::max);
        let share = MOST_TWIST * radii / most;
        if share < 1.0 {
            for (line, angle) in angles.iter_mut().enumerate() {
                let from = from(line);
                *angle = from + share * (*angle - from);
            }
        }
        Self { angles }
    }

    /// Adds the angles of a ring with so many sides to a list.
    pub fn sample(&self, sides: u32, angles: &mut Vec<f32>) {
        angles.extend((0..sides).map(|line| self.at(line as f32 / sides as f32)));
    }

    /// Adds the angles of a ring with so many sides to a list, at a share of the way from these columns to others.
    pub fn blend(&self, other: &Self, share: f32, sides: u32, angles: &mut Vec<f32>) {
        angles.extend((0..sides).map(|line| {
            let part = line as f32 / sides as f32;
            let (a, b) = (self.at(part), other.at(part));
            a + share * (b - a)
        }));
    }
}
