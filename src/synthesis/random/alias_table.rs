//! Drawing from a list in proportion to weights, in constant time (Vose, "A linear algorithm for generating random numbers
//! with a given distribution", 1991).

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
    /// The table of some weights, which are not below 0. It is empty if none is above 0.
    pub fn new(weights: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let mut table = Self::default();
        table.rebuild(weights);
        (table.shares, table.small, table.large) = Default::default();
        table
    }

    /// Rebuilds the table for other weights, keeping its memory.
    pub fn rebuild(&mut self, weights: impl ExactSizeIterator<Item = f64> + Clone) {
        let Self { picks, shares, small, large } = self;
        picks.clear();
        shares.clear();
        let total: f64 = weights.clone().sum();
        if total <= 0.0 {
            return;
        }
        let even = weights.len() as f64 / total;
        shares.extend(weights.map(|weight| weight * even));
        small.clear();
        large.clear();
        for (slot, &share) in shares.iter().enumerate() {
            if share < 1.0 { small.push(slot as u32) } else { large.push(slot as u32) }
        }
        // Initially a slot keeps itself, and a slot without weight gives the heaviest one.
        let heaviest = (0..shares.len()).fold(0, |best, slot| if shares[slot] > shares[best] { slot } else { best });
        let keep = |share: &f64| f32::from(u8::from(*share > 0.0));
        picks.extend(shares.iter().map(|share| Pick { keep: keep(share), other: heaviest as u32 }));
        while let (Some(under), Some(&over)) = (small.pop(), large.last()) {
            picks[under as usize] = Pick { keep: shares[under as usize] as f32, other: over };
            shares[over as usize] -= 1.0 - shares[under as usize];
            if shares[over as usize] < 1.0 {
                large.pop();
                small.push(over);
            }
        }
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

    #[test]
    fn every_weight_gets_its_share() {
        let weights = [0.0, 3.0, 0.0, 1.0, 0.5, 7.5, 1e-12];
        let table = AliasTable::new(weights.into_iter());
        let mut shares = [0.0; 7];
        for (index, pick) in table.picks.iter().enumerate() {
            shares[index] += f64::from(pick.keep) / 7.0;
            shares[pick.other as usize] += f64::from(1.0 - pick.keep) / 7.0;
        }
        for (share, weight) in shares.iter().zip(weights) {
            assert!((share - weight / 12.0).abs() < 1e-6, "{shares:?}");
        }
        assert_eq!(AliasTable::new([0.0, 0.0].into_iter()).len(), 0);
        assert_eq!(AliasTable::new(std::iter::empty::<f64>().collect::<Vec<_>>().into_iter()).len(), 0);
    }
}
