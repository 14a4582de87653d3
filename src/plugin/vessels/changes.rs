//! A set of segments that changed, 64 to a word.

use std::ops::Range;

/// The segments that changed since a reader last read. Each is identified by its end node.
///
/// A tree may also have become shorter: then every segment counts as changed, and those from
/// [`VesselTree::len`](crate::synthesis::tree::VesselTree::len) on are gone.
///
/// It is independent of the log: a reader may work on it over several frames, and add segments that it wants to process
/// again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// One bit per node; the last word has a bit set.
    nodes: Vec<u64>,
    /// Whether every segment counts as changed, however many there are.
    all: bool,
}

impl Changes {
    /// Every segment, however many there are.
    pub(super) const ALL: Self = Self { nodes: Vec::new(), all: true };

    /// The nodes whose bits are set. The last word must have one.
    pub(super) fn of_words(nodes: Vec<u64>) -> Self {
        debug_assert!(nodes.last() != Some(&0), "whether there are changes is told by the number of words");
        Self { nodes, all: false }
    }

    /// Adds the segment that ends in a node.
    pub fn add(&mut self, node: usize) {
        let word = node / 64;
        if word >= self.nodes.len() {
            self.nodes.resize(word + 1, 0);
        }
        self.nodes[word] |= 1 << (node % 64);
    }

    /// Adds every segment, however many there are.
    pub fn add_all(&mut self) {
        self.all = true;
    }

    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        !self.all && self.nodes.is_empty()
    }

    /// Whether every segment counts as changed.
    pub fn is_all(&self) -> bool {
        self.all
    }

    /// Whether the segment that ends in a node counts as changed.
    pub fn contains(&self, node: usize) -> bool {
        self.word(node / 64) >> (node % 64) & 1 == 1
    }

    /// Number of changed nodes of a tree of `len` nodes.
    pub fn count(&self, len: usize) -> usize {
        if self.all {
            return len;
        }
        let whole = len / 64;
        let words = self.nodes.iter().take(whole).map(|word| word.count_ones() as usize);
        words.sum::<usize>() + self.dirty_nodes(whole * 64..len).count()
    }

    /// The changed nodes of a range, in rising order: faster than [`dirty_ranges`](Self::dirty_ranges) where they are
    /// scattered.
    pub fn dirty_nodes(&self, nodes: Range<usize>) -> impl Iterator<Item = usize> + '_ {
        let words = nodes.start / 64..nodes.end.div_ceil(64);
        words.flat_map(move |word| {
            let mut bits = self.word(word);
            if word == nodes.start / 64 {
                bits &= u64::MAX << (nodes.start % 64);
            }
            if word == nodes.end / 64 {
                bits &= (1 << (nodes.end % 64)) - 1;
            }
            std::iter::from_fn(move || {
                let node = (bits != 0).then(|| word * 64 + bits.trailing_zeros() as usize)?;
                bits &= bits - 1;
                Some(node)
            })
        })
    }

    /// The bits of 64 nodes.
    fn word(&self, word: usize) -> u64 {
        if self.all { u64::MAX } else { self.nodes.get(word).copied().unwrap_or(0) }
    }

    /// Ranges of changed nodes of a tree of `len` nodes: neighbours joined, in rising order.
    ///
    /// The cost is one check for every 64 nodes, plus the ranges.
    pub fn dirty_ranges(&self, len: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut node = 0;
        std::iter::from_fn(move || {
            let first = self.next(node, len, true)?;
            node = self.next(first, len, false).unwrap_or(len);
            Some(first..node)
        })
    }

    /// The first node from `from` on, below `len`, that has changed or has not.
    fn next(&self, from: usize, len: usize, changed: bool) -> Option<usize> {
        if self.all {
            return (changed && from < len).then_some(from);
        }
        let mut word = from / 64;
        let mut mask = u64::MAX << (from % 64);
        while word * 64 < len {
            let bits = self.nodes.get(word).copied().unwrap_or(0);
            let wanted = mask & if changed { bits } else { !bits };
            if wanted != 0 {
                let node = word * 64 + wanted.trailing_zeros() as usize;
                return (node < len).then_some(node);
            }
            if changed && word >= self.nodes.len() {
                return None;
            }
            (word, mask) = (word + 1, u64::MAX);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::vessels::changes::*;

    fn of(nodes: impl IntoIterator<Item = usize>) -> Changes {
        let mut changes = Changes::default();
        nodes.into_iter().for_each(|node| changes.add(node));
        changes
    }

    fn ranges(changes: &Changes, len: usize) -> Vec<Range<usize>> {
        changes.dirty_ranges(len).collect()
    }

    #[test]
    fn neighbours_join_over_words_and_the_last_is_cut_to_length() {
        let changes = of([3, 62, 63, 64, 65, 128, 300]);
        assert_eq!(ranges(&changes, 301), [3..4, 62..66, 128..129, 300..301]);
        assert_eq!(ranges(&changes, 64), [3..4, 62..64]);
        assert_eq!(ranges(&changes, 100_000), ranges(&changes, 301));
        assert!(ranges(&changes, 0).is_empty());
    }

    #[test]
    fn whole_words_make_one_range() {
        let changes = of(64..64 * 9);
        assert_eq!(ranges(&changes, 10_000), [64..64 * 9]);
        assert_eq!(ranges(&changes, 200), [64..200]);
    }

    #[test]
    fn all_covers_every_length() {
        let mut changes = Changes::default();
        assert!(changes.is_empty() && ranges(&changes, 1000).is_empty());
        changes.add_all();
        assert_eq!(ranges(&changes, 1000), [0..1000]);
        assert!(!changes.is_empty() && changes.is_all());
        assert_eq!(changes, Changes::ALL);
    }

    #[test]
    fn nodes_are_those_of_the_ranges_in_any_part() {
        let some = of((0..900).filter(|node| node * node % 7 == 1 || (128..256).contains(node)));
        let mut all = some.clone();
        all.add_all();
        for changes in [Changes::default(), some, all] {
            for part in [0..0, 0..1, 0..64, 5..900, 64..128, 63..65, 130..131, 700..4000] {
                let expected: Vec<usize> =
                    changes.dirty_ranges(part.end).flatten().filter(|&node| node >= part.start).collect();
                assert_eq!(changes.dirty_nodes(part.clone()).collect::<Vec<_>>(), expected, "{part:?}");
                assert!(part.clone().all(|node| changes.contains(node) == expected.contains(&node)), "{part:?}");
                assert_eq!(changes.count(part.end), changes.dirty_nodes(0..part.end).count(), "{part:?}");
            }
        }
    }

    #[test]
    fn ranges_hold_the_added_nodes_and_no_other() {
        let added: Vec<usize> = (0..400).map(|i| i * i * 37 % 20_000).collect();
        let found = ranges(&of(added.iter().copied()), 20_000);
        assert!(found.windows(2).all(|pair| pair[0].end < pair[1].start), "neighbours are joined, in rising order");
        let mut expected = added;
        expected.sort_unstable();
        expected.dedup();
        assert_eq!(found.into_iter().flatten().collect::<Vec<_>>(), expected);
    }
}
