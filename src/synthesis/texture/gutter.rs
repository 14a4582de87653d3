//! Fills the gutters between charts: every texel that belongs to none takes the values of the nearest one that does.
//!
//! Jump flooding (Rong & Tan 2006) finds the nearest texel nearly always, in log n passes. This finds it always, in
//! two: along columns, then along rows as the lower envelope of parabolas (Felzenszwalb & Huttenlocher, "Distance
//! transforms of sampled functions", 2012).

use super::maps::Level;
use crate::synthesis::{pace::Pace, parallel};
use std::ops::Range;

/// A column without any known texel.
const NONE: i16 = i16::MAX;
/// Rows whose gutters are searched at a time.
const ROWS: usize = 64;
/// Fewest rows worth a thread of their own.
const WORTH_SHARING: usize = 4;

/// Fills all maps of a level. `repeats` says whether the texture goes on beyond its right and its lower edge.
pub(super) async fn fill(level: &mut Level, repeats: [bool; 2], pace: &Pace) {
    let size = level.size;
    let is_known = |texel: &u8| *texel != 0;
    if level.coverage.iter().all(is_known) || !level.coverage.iter().any(is_known) {
        return;
    }
    let columns = nearest_in_columns(&level.coverage, size, repeats[1], &pace.part(0.0..0.3)).await;
    for start in (0..size).step_by(ROWS) {
        let rows: Vec<usize> = (start..size.min(start + ROWS)).collect();
        let mut sources: Vec<Vec<(u32, u32)>> = vec![Vec::new(); rows.len()];
        let search = |_: usize, &row: &usize| {
            let known = &level.coverage[row * size..(row + 1) * size];
            nearest_in_row(known, &columns, row, repeats)
        };
        parallel::map_all(&rows, &mut sources, WORTH_SHARING, search);
        for (kind, map) in level.made() {
            let bytes = kind.format().bytes();
            for &(to, from) in sources.iter().flatten() {
                map.copy_within(from as usize * bytes..(from as usize + 1) * bytes, to as usize * bytes);
            }
        }
        pace.part(0.3..1.0).rest((start + ROWS).min(size) as f32 / size as f32).await;
    }
}

/// For each texel, the way down to the nearest known one in its column.
async fn nearest_in_columns(coverage: &[u8], size: usize, repeats: bool, pace: &Pace) -> Vec<i16> {
    let mut ways = vec![NONE; size * size];
    // Twice around if the texture goes on.
    let rounds = if repeats { 2 * size } else { size };
    let mut last = vec![NONE; size];
    // Without branches, so that a loop works on many columns at a time.
    let walk = |row: usize, last: &mut [i16], ways: &mut [i16], sign: i16| {
        let line = row * size..(row + 1) * size;
        for ((last, way), known) in last.iter_mut().zip(&mut ways[line.clone()]).zip(&coverage[line]) {
            let on = if *last < NONE { *last + 1 } else { NONE };
            *last = if *known != 0 { 0 } else { on };
            let other = way.abs();
            *way = if *last < other { sign * *last } else { *way };
        }
    };
    let down = |steps: Range<usize>| steps.for_each(|step| walk(step % size, &mut last, &mut ways, -1));
    pace.part(0.0..0.5).stretches(rounds, ROWS, down).await;
    last.fill(NONE);
    let up = |steps: Range<usize>| steps.for_each(|step| walk((rounds - 1 - step) % size, &mut last, &mut ways, 1));
    pace.part(0.5..1.0).stretches(rounds, ROWS, up).await;
    ways
}

/// For each unknown texel of a row, itself and the nearest known one.
fn nearest_in_row(known: &[u8], columns: &[i16], row: usize, repeats: [bool; 2]) -> Vec<(u32, u32)> {
    let (mut sources, mut from) = (Vec::new(), 0);
    while let Some(start) = known[from..].iter().position(|texel| *texel == 0).map(|more| from + more) {
        let length = known[start..].iter().position(|texel| *texel != 0).unwrap_or(known.len() - start);
        // A known texel at the end of a gap is no farther away than the gap is long.
        let reach = if length < known.len() { length as i64 } else { 0 };
        from = start + length;
        nearest_in_gap(start..from, reach, columns, row, (known.len(), repeats[0]), &mut sources);
    }
    sources
}

/// The same for one gap, from columns within a reach of it; 0 for all of them.
fn nearest_in_gap(
    gap: Range<usize>,
    reach: i64,
    columns: &[i16],
    row: usize,
    (size, repeats): (usize, bool),
    sources: &mut Vec<(u32, u32)>,
) {
    let way = |column: i64| columns[row * size + column.rem_euclid(size as i64) as usize];
    let half = if repeats { (size / 2) as i64 } else { 0 };
    let (first, end) = (-half, size as i64 + half);
    let near = match reach {
        0 => first..end,
        reach => first.max(gap.start as i64 - reach)..end.min(gap.end as i64 + reach),
    };
    // The parabolas that are lowest somewhere, and where each begins to be.
    let mut lowest: Vec<(i64, i64, f64)> = Vec::new();
    for column in near {
        let down = i64::from(way(column));
        if down == i64::from(NONE) {
            continue;
        }
        let value = column * column + down * down;
        let mut from = f64::NEG_INFINITY;
        while let Some(&(other, other_value, start)) = lowest.last() {
            from = (value - other_value) as f64 / (2 * (column - other)) as f64;
            if from > start {
                break;
            }
            lowest.pop();
            from = f64::NEG_INFINITY;
        }
        lowest.push((column, value, from));
    }
    let mut at = 0;
    for column in gap {
        while lowest.get(at + 1).is_some_and(|next| next.2 <= column as f64) {
            at += 1;
        }
        // A chart may be too small for any texel.
        let Some(&(from, ..)) = lowest.get(at) else { return };
        let source_row = (row as i64 + i64::from(way(from))).rem_euclid(size as i64);
        let source = source_row * size as i64 + from.rem_euclid(size as i64);
        sources.push(((row * size + column) as u32, source as u32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::pace::at_once;
    use crate::synthesis::random::Stream;
    use crate::synthesis::texture::settings::MapKind;
    use rand::RngExt;

    #[test]
    fn every_gutter_has_the_values_of_a_nearest_texel() {
        let mut rng = Stream::Statistics.rng(5);
        for repeats in [[false, false], [true, false], [false, true], [true, true]] {
            let size = 32usize;
            let mut level = Level { size, coverage: vec![0; size * size], ..Level::default() };
            for _ in 0..12 {
                level.coverage[rng.random_range(0..size * size)] = 255;
            }
            let ids: Vec<u8> = (0..(size * size) as u32).flat_map(u32::to_le_bytes).collect();
            level.maps[MapKind::Id as usize] = Some(ids);
            at_once(fill(&mut level, repeats, &Pace::default()));
            let ids = level.maps[MapKind::Id as usize].as_deref().expect("a map");
            let distance = |a: usize, b: usize| {
                let along = |a: usize, b: usize, axis: usize| {
                    let apart = a.abs_diff(b);
                    if repeats[axis] { apart.min(size - apart) } else { apart }
                };
                let [x, y] = [along(a % size, b % size, 0), along(a / size, b / size, 1)];
                x * x + y * y
            };
            for texel in 0..size * size {
                let source = u32::from_le_bytes(std::array::from_fn(|k| ids[4 * texel + k])) as usize;
                let known = (0..size * size).filter(|&other| level.coverage[other] != 0);
                let least = known.map(|other| distance(texel, other)).min().expect("a chart");
                assert_ne!(level.coverage[source], 0);
                assert_eq!(distance(texel, source), least, "{texel} has {source}, {repeats:?}");
            }
        }
    }
}
