//! A set of voxels, or of other numbers, with ranks: a list and its inverse in little more than one bit for each.

use crate::synthesis::pace::{Pace, STRETCH};

/// One bit per voxel, and the number of bits set before each.
#[derive(Clone, Debug, Default)]
pub(crate) struct BitGrid {
    words: Vec<u64>,
    ranks: Vec<u32>,
}

impl BitGrid {
    /// A grid with the voxels that `set` returns for each of so many candidates.
    pub async fn new(len: usize, candidates: usize, set: impl Fn(usize) -> Option<usize>, pace: &Pace) -> Self {
        let mut words = vec![0u64; len / 64 + 1];
        let add = |candidate: usize| {
            if let Some(voxel) = set(candidate) {
                words[voxel / 64] |= 1 << (voxel % 64);
            }
        };
        pace.part(0.0..0.9).each(candidates, add).await;
        let (mut before, mut ranks) = (0, Vec::with_capacity(words.len()));
        let rank = |word: usize| {
            ranks.push(before);
            before += words[word].count_ones();
        };
        pace.part(0.9..1.0).each(words.len(), rank).await;
        Self { words, ranks }
    }

    /// Whether a voxel is set.
    pub fn contains(&self, voxel: usize) -> bool {
        self.words[voxel / 64] >> (voxel % 64) & 1 == 1
    }

    /// Number of set voxels before this one, which may be the one after the last.
    pub fn rank(&self, voxel: usize) -> usize {
        let below = self.words[voxel / 64] & ((1u64 << (voxel % 64)) - 1);
        self.ranks[voxel / 64] as usize + below.count_ones() as usize
    }

    /// A list of the set voxels, in order.
    pub async fn list(&self, pace: &Pace) -> Vec<u32> {
        // Full capacity, since growing a list copies it without a rest.
        let count = self.words.last().zip(self.ranks.last()).map_or(0, |(word, before)| before + word.count_ones());
        let mut list = Vec::with_capacity(count as usize);
        let mut left = self.iter().map(|voxel| voxel as u32).peekable();
        while let Some(&next) = left.peek() {
            list.extend(left.by_ref().take(STRETCH));
            pace.rest(next as f32 / (64 * self.words.len()) as f32).await;
        }
        list
    }

    /// The set voxels, in order.
    pub fn iter(&self) -> impl Iterator<Item = usize> {
        self.words.iter().enumerate().flat_map(|(index, &word)| {
            let mut left = word;
            std::iter::from_fn(move || {
                let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
                left &= left - 1;
                Some(index * 64 + bit)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::pace::at_once;

    #[test]
    fn bits_are_counted_and_listed() {
        let set = [0usize, 1, 63, 64, 70, 129];
        let bits = at_once(BitGrid::new(130, set.len(), |index| Some(set[index]), &Pace::default()));
        assert_eq!(bits.iter().collect::<Vec<_>>(), set);
        for (rank, voxel) in set.into_iter().enumerate() {
            assert!(bits.contains(voxel));
            assert_eq!(bits.rank(voxel), rank);
        }
        assert!(!bits.contains(2) && !bits.contains(128));
        assert_eq!((bits.rank(128), bits.rank(130)), (5, 6));
        let full = at_once(BitGrid::new(64, 64, Some, &Pace::default()));
        assert_eq!((full.rank(64), full.iter().count()), (64, 64));
    }
}
