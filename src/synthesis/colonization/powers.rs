//! Radii of sums: s^(1/κ), kept for whole sums.
//!
//! With terminals of one radius, every sum is the number of tips behind a node. Most of them are small, and come again and
//! again, whereas a power takes longer than the rest of what is done with it.

use bevy_math::ops;

/// Sums below this are kept.
const KEPT: usize = 4096;

/// Radii in units of the terminal radius. A kept value is what would be computed, so it makes no difference which are.
#[derive(Debug, Default)]
pub(crate) struct Powers {
    exponent: f32,
    /// By sum; 0 for those not met yet.
    kept: Vec<f32>,
}

impl Powers {
    /// Takes another exponent κ.
    pub fn set_exponent(&mut self, exponent: f32) {
        if exponent != self.exponent {
            self.exponent = exponent;
            self.kept.clear();
        }
    }

    /// Meets a sum: its radius, and that of one more, will be asked for.
    #[inline]
    pub fn meet(&mut self, sum: f32) {
        let Some(whole) = whole(sum) else { return };
        if let Some([own, next]) = self.kept.get(whole..whole + 2)
            && *own > 0.0
            && *next > 0.0
        {
            return;
        }
        if whole + 1 >= self.kept.len() {
            self.kept.resize((whole + 2).next_power_of_two(), 0.0);
        }
        for own in [whole, whole + 1] {
            if self.kept[own] == 0.0 {
                self.kept[own] = ops::powf(own as f32, self.exponent.recip());
            }
        }
    }

    /// s^(1/κ).
    #[inline]
    pub fn root(&self, sum: f32) -> f32 {
        match whole(sum).and_then(|whole| self.kept.get(whole)) {
            Some(&kept) if kept > 0.0 => kept,
            _ => ops::powf(sum, self.exponent.recip()),
        }
    }
}

/// A sum that is kept, as an index.
#[inline]
fn whole(sum: f32) -> Option<usize> {
    // The cast saturates.
    let whole = sum as usize;
    (whole < KEPT && whole as f32 == sum).then_some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_what_is_computed() {
        let mut powers = Powers::default();
        for exponent in [2.1, 2.55, 3.0] {
            powers.set_exponent(exponent);
            let sums = [1.0, 2.0, 0.3, 7.0, 4095.0, 4096.0, 1e9, 1.5, 700.0];
            let fresh = sums.map(|sum| powers.root(sum));
            sums.into_iter().for_each(|sum| powers.meet(sum));
            assert_eq!(sums.map(|sum| powers.root(sum)), fresh);
            assert_eq!(fresh[0], 1.0);
            assert_eq!(powers.root(8.0), ops::powf(8.0, 1.0 / exponent));
        }
    }
}
