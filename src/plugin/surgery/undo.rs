//! The undo history: one entry for each action, or for each stroke of an instrument.
//!
//! A ledger undoes its actions in reverse order. Actions that are undone together must therefore be the last on each
//! ledger that they changed: if a stroke goes on after other actions on its vessels, their entries are joined.

use crate::plugin::surgery::messages::StrokeId;
use bevy::ecs::entity::Entity;

/// Everything that can be undone, in the order of beginning.
#[derive(Debug, Default)]
pub(crate) struct UndoHistory {
    entries: Vec<Entry>,
}

/// Actions that are undone together.
#[derive(Debug, Default)]
struct Entry {
    /// Empty for an action by itself; several if strokes were joined.
    strokes: Vec<StrokeId>,
    /// Vessel entities, each once, with the number of their ledger's actions in this entry.
    changed: Vec<(Entity, usize)>,
}

impl Entry {
    fn has(&self, vessels: Entity) -> bool {
        self.changed.iter().any(|&(entity, _)| entity == vessels)
    }

    fn add(&mut self, vessels: Entity, actions: usize) {
        match self.changed.iter_mut().find(|(entity, _)| *entity == vessels) {
            Some((_, count)) => *count += actions,
            None => self.changed.push((vessels, actions)),
        }
    }
}

impl UndoHistory {
    /// Enters an action that changed the ledgers of some vessel entities.
    pub(crate) fn note(&mut self, stroke: Option<StrokeId>, changed: impl Iterator<Item = Entity> + Clone) {
        let begun = stroke.and_then(|stroke| self.entries.iter().rposition(|entry| entry.strokes.contains(&stroke)));
        let at = begun.unwrap_or_else(|| {
            self.entries.push(Entry { strokes: stroke.into_iter().collect(), ..Entry::default() });
            self.entries.len() - 1
        });
        if self.entries[at + 1..].iter().any(|later| changed.clone().any(|vessels| later.has(vessels))) {
            self.join_from(at);
        }
        changed.for_each(|vessels| self.entries[at].add(vessels, 1));
    }

    /// Joins all entries from an index on.
    fn join_from(&mut self, at: usize) {
        for later in self.entries.split_off(at + 1) {
            self.entries[at].strokes.extend(later.strokes);
            later.changed.into_iter().for_each(|(vessels, actions)| self.entries[at].add(vessels, actions));
        }
    }

    /// Takes the part of the last entry that concerns some of these vessel entities: the number of actions to undo on
    /// each.
    pub(crate) fn take_last(&mut self, is_meant: impl Fn(Entity) -> bool) -> Option<Vec<(Entity, usize)>> {
        let at = self.entries.iter().rposition(|entry| entry.changed.iter().any(|&(vessels, _)| is_meant(vessels)))?;
        let (taken, left) = std::mem::take(&mut self.entries[at].changed)
            .into_iter()
            .partition::<Vec<_>, _>(|&(vessels, _)| is_meant(vessels));
        self.entries[at].changed = left;
        if self.entries[at].changed.is_empty() {
            self.entries.remove(at);
        }
        Some(taken)
    }

    /// Takes the first entries, until as many as `most` are left: the number of actions of each on each vessel entity.
    pub(crate) fn take_oldest(&mut self, most: usize) -> Vec<(Entity, usize)> {
        let surplus = self.entries.len().saturating_sub(most);
        self.entries.drain(..surplus).flat_map(|entry| entry.changed).collect()
    }

    /// Removes vessel entities from the history.
    pub(crate) fn forget(&mut self, is_meant: impl Fn(Entity) -> bool) {
        self.entries.iter_mut().for_each(|entry| entry.changed.retain(|&(vessels, _)| !is_meant(vessels)));
        self.entries.retain(|entry| !entry.changed.is_empty());
    }

    /// Number of entries.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::surgery::undo::*;

    fn vessels(indices: &[u32]) -> impl Iterator<Item = Entity> + Clone {
        indices.iter().filter_map(|&index| Entity::from_raw_u32(index))
    }

    fn taken(history: &mut UndoHistory) -> Vec<(u32, usize)> {
        let taken = history.take_last(|_| true).unwrap_or_default();
        taken.into_iter().map(|(vessels, actions)| (vessels.index_u32(), actions)).collect()
    }

    #[test]
    fn a_stroke_is_one_entry_wherever_it_goes() {
        let (mut history, stroke) = (UndoHistory::default(), Some(StrokeId::begin()));
        history.note(None, vessels(&[1]));
        for changed in [&[1, 2][..], &[2], &[1]] {
            history.note(stroke, vessels(changed));
        }
        assert_eq!(history.len(), 2);
        assert_eq!(taken(&mut history), [(1, 2), (2, 2)]);
        assert_eq!(taken(&mut history), [(1, 1)]);
    }

    #[test]
    fn strokes_on_other_vessels_stay_apart_and_those_on_the_same_are_joined() {
        let (mut history, [left, right]) = (UndoHistory::default(), [(); 2].map(|()| Some(StrokeId::begin())));
        for _ in 0..3 {
            history.note(left, vessels(&[1]));
            history.note(right, vessels(&[2]));
        }
        assert_eq!(history.len(), 2);
        history.note(None, vessels(&[1]));
        history.note(left, vessels(&[1]));
        assert_eq!(history.len(), 1, "the left stroke cannot be taken back without what was done to its vessels since");
        history.note(right, vessels(&[3]));
        assert_eq!(taken(&mut history), [(1, 5), (2, 3), (3, 1)]);
        assert_eq!(taken(&mut history), []);
    }

    #[test]
    fn the_oldest_entries_go_first() {
        let (mut history, stroke) = (UndoHistory::default(), Some(StrokeId::begin()));
        (0..2).for_each(|_| history.note(stroke, vessels(&[1, 2])));
        history.note(None, vessels(&[3]));
        assert!(history.take_oldest(2).is_empty());
        let oldest = history.take_oldest(1).into_iter().map(|(vessels, actions)| (vessels.index_u32(), actions));
        assert_eq!(oldest.collect::<Vec<_>>(), [(1, 2), (2, 2)]);
        assert_eq!(taken(&mut history), [(3, 1)]);
    }

    #[test]
    fn what_is_meant_for_some_leaves_the_others() {
        let (mut history, stroke) = (UndoHistory::default(), Some(StrokeId::begin()));
        (0..2).for_each(|_| history.note(stroke, vessels(&[1, 2])));
        history.note(None, vessels(&[3]));
        let first = history.take_last(|vessels| vessels.index_u32() == 2).unwrap_or_default();
        assert_eq!((first.len(), history.len()), (1, 2));
        history.forget(|vessels| vessels.index_u32() == 3);
        assert_eq!(taken(&mut history), [(1, 2)]);
    }
}
