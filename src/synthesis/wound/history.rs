//! The history of a ledger: how actions begin and end, and their undo.

use crate::synthesis::{
    tree::{NodeId, VesselTree},
    wound::{
        ClampId, WoundReport, Wounds,
        injury::{Injury, NO_INJURY},
        ledger::Action,
    },
};

impl Wounds {
    /// Undoes the last action that changed anything; `None` if there is none.
    pub fn undo(&mut self, tree: &VesselTree) -> Option<WoundReport> {
        (!self.history.is_empty()).then(|| self.undo_last(1, tree))
    }

    /// Undoes the last actions that changed anything, or all if there are fewer, and reports the combined changes.
    pub fn undo_last(&mut self, actions: usize, tree: &VesselTree) -> WoundReport {
        let mut report = WoundReport::default();
        let left = self.history.len().saturating_sub(actions);
        let Some(&first) = self.history.get(left) else { return report };
        let mut touched = self.before.split_off(first.before);
        // If several actions changed a segment, its first previous state is used: the sort is stable.
        touched.sort_by_key(|&(node, _)| node);
        touched.dedup_by_key(|&mut (node, _)| node);
        for (node, before) in touched {
            let now = self.injuries.remove(&node).unwrap_or_default();
            self.compare(tree, node, &now, &before, &mut report);
            if !before.is_empty() {
                self.injuries.insert(node, before);
            }
        }
        self.history.truncate(left);
        self.ends.truncate(first.ends);
        self.clamps.truncate(first.clamps);
        report
    }

    /// Makes the oldest actions permanent, or all if there are fewer: [`undo`](Self::undo) no longer reverts them, and
    /// their previous states are forgotten. [`undo_all`](Self::undo_all) still heals them.
    pub fn make_permanent(&mut self, actions: usize) {
        let actions = actions.min(self.history.len());
        let first = self.history.get(actions).map_or(self.before.len(), |action| action.before);
        self.history.drain(..actions);
        self.before.drain(..first);
        self.history.iter_mut().for_each(|action| action.before -= first);
    }

    /// Undoes all actions, and reports the combined changes.
    pub fn undo_all(&mut self, tree: &VesselTree) -> WoundReport {
        let mut report = WoundReport::default();
        for (&node, injury) in &self.injuries {
            self.compare(tree, node, injury, &NO_INJURY, &mut report);
        }
        self.clear();
        report
    }

    /// Clears everything, for another tree. The settings stay.
    pub fn clear(&mut self) {
        self.injuries.clear();
        self.ends.clear();
        self.clamps.clear();
        self.history.clear();
        self.before.clear();
    }

    pub(super) fn begin(&self) -> Action {
        Action { ends: self.ends.len(), clamps: self.clamps.len(), before: self.before.len() }
    }

    /// Changes one segment. Like `change`, returns whether anything changed.
    pub(super) fn change(&mut self, node: u32, change: impl FnOnce(&mut Injury) -> bool) -> bool {
        let before = self.injuries.remove(&node).unwrap_or_default();
        let mut injury = before.clone();
        let changed = change(&mut injury);
        if !injury.is_empty() {
            self.injuries.insert(node, injury);
        }
        if changed {
            self.before.push((node, before));
        }
        changed
    }

    /// Ends an action, which counts if it changed anything.
    pub(super) fn finish(&mut self, action: Action, tree: &VesselTree) -> WoundReport {
        let mut report = WoundReport::default();
        if self.before.len() == action.before {
            return report;
        }
        self.generation += 1;
        self.history.push(action);
        for (node, before) in &self.before[action.before..] {
            let now = self.injuries.get(node).unwrap_or(&NO_INJURY);
            self.compare(tree, *node, before, now, &mut report);
        }
        report
    }

    /// Adds the changes of one segment to a report.
    fn compare(&self, tree: &VesselTree, node: u32, before: &Injury, now: &Injury, report: &mut WoundReport) {
        let [was_open, stays_open] = [before, now].map(|injury| {
            let mut open: Vec<u32> = injury.ends().filter(|end| end.is_open).map(|end| end.index).collect();
            open.sort_unstable();
            open
        });
        let opened = now.ends().filter(|end| end.is_open && was_open.binary_search(&end.index).is_err());
        report.opened.extend(opened.filter_map(|end| self.locate(tree, node, end)));
        let closed = before.ends().filter(|end| end.is_open && stays_open.binary_search(&end.index).is_err());
        report.closed.extend(closed.map(|end| self.end_id(end.index)));
        let clamp_id = |index: u32| ClampId { index, generation: self.clamps[index as usize].generation };
        let lacking = |here: &Injury, there: &Injury| -> Vec<ClampId> {
            here.clamps().filter(|&clamp| there.clamps().all(|other| other != clamp)).map(clamp_id).collect()
        };
        report.clamped.extend(lacking(now, before));
        report.unclamped.extend(lacking(before, now));
        report.changed.push(NodeId(node));
    }
}
