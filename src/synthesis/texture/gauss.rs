//! Integrals of the normal distribution, by table.

use crate::synthesis::exponential::exp;
use std::sync::LazyLock;

/// Standard deviations at the end of the table: 1 − Φ is below 3.2e-5 there.
const REACH: f32 = 4.0;
/// Standard deviations beyond which an edge is not seen: 1 − Φ is below 1.4e-3 there, a tenth of a level of 8 bits for a
/// vessel with a quarter of the contrast.
pub(super) const SEEN: f32 = 3.0;
/// Entries for one standard deviation.
const PER_UNIT: usize = 128;
/// Entries from −[`REACH`] to [`REACH`].
const ENTRIES: usize = 2 * REACH as usize * PER_UNIT;

/// Φ and its derivative φ. Between the entries of the table Φ is off by less than 2e-6, beyond [`REACH`] by 3.2e-5.
pub(super) struct Gauss {
    /// Φ and φ at each entry, with one more at the end.
    table: Vec<[f32; 2]>,
}

impl Gauss {
    /// The table, made once.
    pub fn table() -> &'static Self {
        static TABLE: LazyLock<Gauss> = LazyLock::new(Gauss::new);
        &TABLE
    }

    fn new() -> Self {
        let density = |x: f64| exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
        let step = 1.0 / PER_UNIT as f64;
        let mut table = Vec::with_capacity(ENTRIES + 2);
        // Φ from the middle, by Simpson's rule over each entry; the lower half follows by symmetry.
        let mut upper = vec![0.5];
        for entry in 0..ENTRIES / 2 {
            let x = entry as f64 * step;
            let area = (density(x) + 4.0 * density(x + 0.5 * step) + density(x + step)) * step / 6.0;
            upper.push(upper[entry] + area);
        }
        for entry in 0..=ENTRIES {
            let from_middle = entry.abs_diff(ENTRIES / 2);
            let above = upper[from_middle];
            let cumulative = if entry < ENTRIES / 2 { 1.0 - above } else { above };
            table.push([cumulative as f32, density(from_middle as f64 * step) as f32]);
        }
        table.push(table[ENTRIES]);
        Self { table }
    }

    /// Φ(x) and φ(x).
    pub fn both(&self, x: f32) -> [f32; 2] {
        if !(x > -REACH) {
            return [0.0; 2];
        }
        if x >= REACH {
            return [1.0, 0.0];
        }
        let at = (x + REACH) * PER_UNIT as f32;
        let entry = at as usize;
        let share = at - entry as f32;
        let ([a, b], [c, d]) = (self.table[entry], self.table[entry + 1]);
        [a + (c - a) * share, b + (d - b) * share]
    }

    /// Φ(x): the share of the distribution below `x`.
    pub fn below(&self, x: f32) -> f32 {
        self.both(x)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_published_tables() {
        let gauss = Gauss::table();
        // Abramowitz & Stegun, "Handbook of Mathematical Functions" (1964), table 26.1.
        for (x, cumulative, density) in [
            (0.0, 0.5, 0.398_942_3),
            (0.5, 0.691_462_46, 0.352_065_33),
            (1.0, 0.841_344_8, 0.241_970_72),
            (1.96, 0.975_002_1, 0.058_440_94),
            (3.0, 0.998_650_1, 0.004_431_848),
        ] {
            let ([up, slope], [down, same]) = (gauss.both(x), gauss.both(-x));
            assert!((up - cumulative).abs() < 3e-6 && (down - (1.0 - cumulative)).abs() < 3e-6, "at {x}: {up}, {down}");
            assert!((slope - density).abs() < 1e-5 && (same - density).abs() < 1e-5, "at {x}: {slope}, {same}");
        }
        assert_eq!([gauss.both(-9.0), gauss.both(9.0)], [[0.0; 2], [1.0, 0.0]]);
        assert_eq!(gauss.both(f32::NAN), [0.0; 2]);
    }
}
