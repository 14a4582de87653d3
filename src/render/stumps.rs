//! The remaining pieces of cut vessels, which need more slots than their segments have.
//!
//! In: the [`Wounds`] of a tree and the nodes whose segments changed. Out: the segments that are drawn instead.
//!
//! As during growth, slot `i` of the buffer belongs to node `i`. A severed segment shows its first piece there; its
//! further pieces have slots behind those of all nodes, in chunks of their own, with their own boxes. A segment whose
//! round end would hide the gap of another is drawn with a flat end. A cut or its undo writes only the slots of its
//! segments and of neighbours whose look changes.

use super::levels::FEWEST_SLOTS;
use crate::{
    plugin::{Changes, Vessels},
    synthesis::{
        instances::{FlatEnds, SegmentColors, SegmentInstance, write_stumps_of},
        tree::NodeId,
        wound::Wounds,
    },
};
use bevy::prelude::*;
use std::{collections::BTreeMap, ops::Range};

/// The severed segments of one vessel entity, as drawn.
#[derive(Debug, Default)]
pub(super) struct Stumps {
    /// The flat ends of segments, derived from wounds and tree.
    flat: FlatEnds,
    /// By node.
    severed: BTreeMap<u32, Severed>,
    /// The further pieces, by their slots behind those of the nodes.
    pub(super) slots: Vec<SegmentInstance>,
    /// Free slots, all hidden.
    free: Vec<u32>,
    /// Slots that are not on the GPU yet, possibly with repeats.
    pub(super) changed: Vec<u32>,
    /// First slot in the buffer, as last written.
    pub(super) first: usize,
    /// Chunk entities, in the order of the slots.
    pub(super) chunks: Vec<Entity>,
}

/// One severed segment.
#[derive(Debug)]
struct Severed {
    /// The piece in its own slot.
    own: SegmentInstance,
    /// Slots of its further pieces.
    further: Vec<u32>,
}

impl Stumps {
    /// The entities that draw.
    pub(super) fn chunks(&self) -> &[Entity] {
        &self.chunks
    }

    /// Number of slots that the buffer needs, in whole chunks. There is always room for the first cuts.
    pub(super) fn room(&self) -> usize {
        self.slots.len().next_power_of_two().max(FEWEST_SLOTS)
    }

    /// Reads the changed segments, and adds those whose look changes because of them.
    ///
    /// If only wounds changed, the cost is that of the changed segments; if the tree changed (`of_tree`), that of all
    /// wounds.
    pub(super) fn note(&mut self, wounds: Option<&Wounds>, vessels: &Vessels, of_tree: bool, changes: &mut Changes) {
        let Some(wounds) = wounds else {
            // All segments count as changed after the ledger is removed.
            self.flat = FlatEnds::default();
            return;
        };
        let (tree, flat) = (vessels.tree(), &mut self.flat);
        let children = |node: NodeId| vessels.children(node.index()).map(|child| NodeId(child as u32));
        let others = if of_tree || changes.is_all() {
            flat.rebuild(wounds, tree, children)
        } else {
            let changed = changes.dirty_nodes(0..tree.len()).map(|node| NodeId(node as u32));
            flat.update(wounds, tree, children, changed)
        };
        others.into_iter().for_each(|node| changes.add(node.index()));
    }

    /// Updates the changed segments, and drops those of nodes from `len` on.
    ///
    /// The cost is that of the severed segments, however many others have changed.
    pub(super) fn update(
        &mut self,
        wounds: Option<&Wounds>,
        vessels: &Vessels,
        colors: &SegmentColors,
        changes: &Changes,
        len: usize,
    ) {
        let is_redrawn = |node: NodeId| wounds.is_some_and(|wounds| self.flat.is_redrawn(wounds, node));
        let is_healed = |node: NodeId| changes.contains(node.index()) && !is_redrawn(node);
        let known = self.severed.keys().map(|&node| NodeId(node));
        let gone: Vec<NodeId> = known.filter(|&node| node.index() >= len || is_healed(node)).collect();
        for node in gone {
            self.remove(node);
        }
        let Some(wounds) = wounds else { return };
        let mut pieces = Vec::new();
        let redrawn = self.flat.redrawn_within(wounds, 0..len).filter(|node| changes.contains(node.index()));
        for node in redrawn.collect::<Vec<_>>() {
            pieces.clear();
            write_stumps_of(wounds, &self.flat, node, vessels.tree(), vessels.birth_steps(), colors, &mut pieces);
            self.insert(node, &pieces);
        }
    }

    fn insert(&mut self, node: NodeId, pieces: &[SegmentInstance]) {
        let (own, further) =
            pieces.split_first().map_or((SegmentInstance::HIDDEN, &[][..]), |(own, rest)| (*own, rest));
        let mut slots = self.severed.remove(&node.0).map_or_else(Vec::new, |severed| severed.further);
        while slots.len() > further.len() {
            slots.pop().into_iter().for_each(|slot| self.release(slot));
        }
        while slots.len() < further.len() {
            slots.push(self.claim());
        }
        for (&slot, piece) in slots.iter().zip(further) {
            self.write(slot, *piece);
        }
        self.severed.insert(node.0, Severed { own, further: slots });
    }

    fn remove(&mut self, node: NodeId) {
        for slot in self.severed.remove(&node.0).into_iter().flat_map(|severed| severed.further) {
            self.release(slot);
        }
    }

    fn claim(&mut self) -> u32 {
        self.free.pop().unwrap_or_else(|| {
            let slot = self.slots.len() as u32;
            self.slots.push(SegmentInstance::HIDDEN);
            self.changed.push(slot);
            slot
        })
    }

    fn release(&mut self, slot: u32) {
        self.write(slot, SegmentInstance::HIDDEN);
        self.free.push(slot);
    }

    fn write(&mut self, slot: u32, segment: SegmentInstance) {
        let current = &mut self.slots[slot as usize];
        if *current != segment {
            *current = segment;
            self.changed.push(slot);
        }
    }

    /// Puts the first pieces in place of the segments in `out`, which are those of `nodes` in rising order.
    pub(super) fn replace(&self, nodes: &[u32], out: &mut [SegmentInstance]) {
        let (Some(first), Some(last)) = (nodes.first(), nodes.last()) else { return };
        for (node, severed) in self.severed.range(first..=last) {
            if let Ok(at) = nodes.binary_search(node) {
                out[at] = severed.own;
            }
        }
    }

    /// Takes the changed slots, as rising runs to be written.
    pub(super) fn take_changed(&mut self) -> Vec<Range<usize>> {
        let mut changed = std::mem::take(&mut self.changed);
        changed.sort_unstable();
        changed.dedup();
        changed.chunk_by(|a, b| a + 1 == *b).map(|run| run[0] as usize..run[run.len() - 1] as usize + 1).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::synthesis::instances::{END_DOME, LUMEN_DEPTH, START_DOME};

    #[test]
    fn the_shader_draws_ends_as_stumps_reckon_with_them() {
        let shader = include_str!("segments.wgsl");
        for (name, value) in [("START_DOME", START_DOME), ("LUMEN_DEPTH", LUMEN_DEPTH)] {
            let line = format!("const {name}: f32 = {value:?};");
            assert!(shader.contains(&line), "segments.wgsl has no `{line}`");
        }
        let dome = format!("let dome = select({END_DOME:?}, START_DOME, ");
        assert!(shader.contains(&dome), "segments.wgsl has no `{dome}`");
    }
}
