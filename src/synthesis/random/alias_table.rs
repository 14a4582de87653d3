//! Drawing from a list in proportion to weights, in constant time (Vose, "A linear algorithm for generating random numbers
//! with a given distribution", 1991).

use crate::synthesis::pace::{Pace, Stretch, at_once};

/// A table over a list of weights.
///
/// To draw, choose a slot uniformly. [`pick`](Self::pick) then stays with it or takes the slot's alternative.
#[derive(Clone, Debug, Default)]
pub(crate) struct AliasTable {
    picks: Vec<Pick>,
    shares: Vec<f64>,
    small: Vec<u32>,
    large: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Pick {
    /// Probability of keeping this slot.
    keep: f32,
    /// The slot to take otherwise.
    other: u32,
}

impl AliasTable {
    /// The table of `count` weights, which are not below 0, with rests. It is empty if none is above 0.
    pub async fn new_paced(count: usize, weight: impl Fn(usize) -> f64, pace: &Pace) -> Self {
        let mut table = Self::default();
        table.rebuild_paced(count, weight, pace).await;
        (table.shares, table.small, table.large) = Default::default();
        table
    }

    /// Rebuilds the table for other weights, keeping its memory.
    pub fn rebuild(&mut self, count: usize, weight: impl Fn(usize) -> f64) {
        at_once(self.rebuild_paced(count, weight, &Pace::default()));
    }

    async fn rebuild_paced(&mut self, count: usize, weight: impl Fn(usize) -> f64, pace: &Pace) {
        let Self { picks, shares, small, large } = self;
        picks.clear();
        shares.clear();
        let total = pace.part(0.0..0.2).sum(count, &weight).await;
        if total <= 0.0 {
            pace.rest(1.0).await;
            return;
        }
        let even = count as f64 / total;
        pace.part(0.2..0.4).each(count, |slot| shares.push(weight(slot) * even)).await;
        small.clear();
        large.clear();
        let mut heaviest = 0;
        let sort = |slot: usize| {
            if shares[slot] < 1.0 {
                small.push(slot as u32);
            } else {
                large.push(slot as u32);
            }
            heaviest = if shares[slot] > shares[heaviest] { slot } else { heaviest };
        };
        pace.part(0.4..0.5).each(count, sort).await;
        // Initially a slot keeps itself, and a slot without weight gives the heaviest one.
        let keep = |share: f64| f32::from(u8::from(share > 0.0));
        let fill = |slot: usize| picks.push(Pick { keep: keep(shares[slot]), other: heaviest as u32 });
        pace.part(0.5..0.7).each(count, fill).await;
        let (pace, mut stretch, mut settled) = (pace.part(0.7..1.0), Stretch::default(), 0);
        while let (Some(under), Some(&over)) = (small.pop(), large.last()) {
            picks[under as usize] = Pick { keep: shares[under as usize] as f32, other: over };
            shares[over as usize] -= 1.0 - shares[under as usize];
            if shares[over as usize] < 1.0 {
                large.pop();
                small.push(over);
            }
            settled += 1;
            if stretch.ends_after(1) {
                pace.rest(settled as f32 / count as f32).await;
            }
        }
        pace.rest(1.0).await;
    }

    /// Number of slots.
    pub fn len(&self) -> usize {
        self.picks.len()
    }

    /// The result for a slot and a uniform number from 0 to below 1.
    #[inline]
    pub fn pick(&self, slot: u32, even: f32) -> u32 {
        let pick = self.picks[slot as usize];
        if even < pick.keep { slot } else { pick.other }
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::random::alias_table::*;

    fn of(weights: &[f64]) -> AliasTable {
        at_once(AliasTable::new_paced(weights.len(), |slot| weights[slot], &Pace::default()))
    }

    #[test]
    fn every_weight_gets_its_share() {
        let weights = [0.0, 3.0, 0.0, 1.0, 0.5, 7.5, 1e-12];
        let table = of(&weights);
        let mut shares = [0.0; 7];
        for (index, pick) in table.picks.iter().enumerate() {
            shares[index] += f64::from(pick.keep) / 7.0;
            shares[pick.other as usize] += f64::from(1.0 - pick.keep) / 7.0;
        }
        for (share, weight) in shares.iter().zip(weights) {
            assert!((share - weight / 12.0).abs() < 1e-6, "{shares:?}");
        }
        assert_eq!([&[0.0, 0.0][..], &[]].map(|weights| of(weights).len()), [0, 0]);
    }
}
