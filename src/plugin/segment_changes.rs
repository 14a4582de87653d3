//! Which segments of a vessel tree changed since someone last looked, in whole chunks.

use bevy::ecs::component::Component;
use std::ops::Range;

/// Segments that changed since the last [`clear`](Self::clear), for those who keep a copy of them, such as a buffer on
/// the graphics card.
///
/// A segment has changed when either of its ends moved or changed its radius. Changes are kept per chunk of
/// [`CHUNK`](Self::CHUNK) segments: a bit each, and uploads in few, long ranges.
///
/// On a vessel entity, whoever draws the segments clears this after reading. There, a tree may also have become shorter:
/// segments from [`VesselTree::len`](crate::synthesis::tree::VesselTree::len) on are gone.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq)]
pub struct SegmentChanges {
    /// One bit per chunk.
    chunks: Vec<u64>,
    /// Whether every chunk counts as changed, however many there are.
    all: bool,
}

impl SegmentChanges {
    /// Segments per chunk.
    pub const CHUNK: usize = 256;

    /// Marks the segment that ends in a node.
    pub fn mark_node(&mut self, node: usize) {
        let chunk = node / Self::CHUNK;
        let word = chunk / 64;
        if word >= self.chunks.len() {
            self.chunks.resize(word + 1, 0);
        }
        self.chunks[word] |= 1 << (chunk % 64);
    }

    /// Marks every segment that there is, and those that will come until the next [`clear`](Self::clear).
    pub fn mark_all(&mut self) {
        self.all = true;
    }

    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        !self.all && self.chunks.iter().all(|&word| word == 0)
    }

    /// Forgets all changes and keeps the memory.
    pub fn clear(&mut self) {
        self.chunks.fill(0);
        self.all = false;
    }

    /// Ranges of changed nodes of a tree of `len` nodes: runs of chunks, neighbours joined, in rising order.
    pub fn dirty_ranges(&self, len: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let count = len.div_ceil(Self::CHUNK);
        let mut chunk = 0;
        std::iter::from_fn(move || {
            let first = (chunk..count).find(|&chunk| self.has(chunk))?;
            chunk = (first..count).find(|&chunk| !self.has(chunk)).unwrap_or(count);
            Some(first * Self::CHUNK..(chunk * Self::CHUNK).min(len))
        })
    }

    fn has(&self, chunk: usize) -> bool {
        self.all || self.chunks.get(chunk / 64).is_some_and(|word| word >> (chunk % 64) & 1 == 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHUNK: usize = SegmentChanges::CHUNK;

    fn ranges(changes: &SegmentChanges, len: usize) -> Vec<Range<usize>> {
        changes.dirty_ranges(len).collect()
    }

    #[test]
    fn neighbouring_chunks_join_and_the_last_is_cut_to_length() {
        let mut changes = SegmentChanges::default();
        for node in [3, CHUNK, 5 * CHUNK - 1, 70 * CHUNK + 1] {
            changes.mark_node(node);
        }
        let len = 70 * CHUNK + 9;
        assert_eq!(ranges(&changes, len), [0..2 * CHUNK, 4 * CHUNK..5 * CHUNK, 70 * CHUNK..len]);
        assert_eq!(ranges(&changes, 10), [0..10]);
        assert!(ranges(&changes, 0).is_empty());
    }

    #[test]
    fn marking_all_covers_every_length_until_cleared() {
        let mut changes = SegmentChanges::default();
        assert!(changes.is_empty());
        changes.mark_all();
        assert_eq!(ranges(&changes, 1000), [0..1000]);
        assert!(!changes.is_empty());
        changes.clear();
        assert!(changes.is_empty());
        assert!(ranges(&changes, 1000).is_empty());
    }

    #[test]
    fn every_marked_node_is_in_a_range_and_no_other_chunk_is() {
        let mut changes = SegmentChanges::default();
        let marked: Vec<usize> = (0..40).map(|i| i * i * 37 % 20_000).collect();
        marked.iter().for_each(|&node| changes.mark_node(node));
        let covered = ranges(&changes, 20_000);
        for node in 0..20_000 {
            let expected = marked.iter().any(|&other| other / CHUNK == node / CHUNK);
            assert_eq!(covered.iter().any(|range| range.contains(&node)), expected, "node {node}");
        }
    }
}
