//! Steps of an organ's growth, with their costs and changes.

use crate::plugin::{
    growth::{progress::GrowthControl, state::GrowthState, successor::Successor},
    job::catch_panic,
    lineage::Lineage,
};
use crate::synthesis::{
    growth::{GrownTree, Growth, TreeUpdate},
    tree::{ByKind, VesselKind},
};
use std::time::Duration;

impl GrowthState {
    /// Whether there are steps to repeat at once.
    pub(crate) fn must_repeat_steps(&self) -> bool {
        self.steps_to_repeat > 0 && self.growth.is_some()
    }

    /// The growth that does the steps: the drawn one, or its successor.
    pub(crate) fn active(&self) -> Option<&dyn Growth> {
        self.successor().or(self.growth())
    }

    fn active_mut(&mut self) -> Option<&mut Box<dyn Growth>> {
        self.successor.as_mut().map(|successor| &mut successor.growth).or(self.growth.as_mut())
    }

    /// Whether there are steps left to do.
    pub(crate) fn is_growing(&self) -> bool {
        let is_under_way = self.active().is_some_and(|growth| !growth.is_finished());
        is_under_way && self.error().is_none() && !self.has_panicked() && !self.awaits_others()
    }

    /// Whether all steps are done and their result is drawn.
    pub(crate) fn is_done(&self) -> bool {
        let is_grown = self.successor.is_none() && self.growth().is_some_and(|growth| growth.is_finished());
        is_grown && self.error().is_none() && !self.awaits_others()
    }

    /// Whether a step may be done now.
    pub(crate) fn may_step(&self, control: GrowthControl) -> bool {
        let willing = control == GrowthControl::Running || self.granted > 0 || self.finish;
        willing && self.is_growing() && !self.rests()
    }

    /// Whether wounds of the drawn vessels let them rest. Their successors, which have no wounds, grow on.
    pub(crate) fn rests(&self) -> bool {
        self.is_held() && self.successor.is_none()
    }

    /// Does one step, whose radii must be [settled](Self::settle) later. Does nothing without a growth or at its end.
    pub(crate) fn step(&mut self) {
        self.attempt(|state| {
            let Some(growth) = state.active_mut().filter(|growth| !growth.is_finished()) else { return };
            growth.advance();
            state.granted = state.granted.saturating_sub(1);
            state.unsettled = true;
        });
    }

    /// Does work on the growth. A generator outside this crate may panic: that ends its growth, and not the app.
    fn attempt(&mut self, work: impl FnOnce(&mut Self)) {
        if let Err(panic) = catch_panic(|| work(self)) {
            self.panic = Some(panic);
            self.unsettled = false;
        }
    }

    /// Whether there are steps whose radii are to be settled.
    pub(crate) fn is_unsettled(&self) -> bool {
        self.unsettled
    }

    /// Computes the radii after a frame's last step, and records what the steps changed. Once is enough, since many
    /// steps change the same radii, those of the trunks. A growth that is not drawn can wait.
    pub(crate) fn settle(&mut self) {
        self.attempt(Self::settle_growth);
    }

    fn settle_growth(&mut self) {
        self.unsettled = false;
        if self.successor.is_some() {
            self.succeed();
            return;
        }
        let Some(growth) = self.growth.as_mut() else { return };
        growth.settle();
        self.take_updates();
    }

    /// Replaces the drawn growth by a successor that has caught up with it.
    pub(super) fn succeed(&mut self) {
        let Some(Successor { tissue, mut growth, .. }) = self.successor.take_if(|successor| successor.has_caught_up())
        else {
            return;
        };
        growth.settle();
        (self.tissue, self.growth) = (Some(tissue), Some(growth));
        self.other_settings = self.awaits_settings();
        self.begin_trees();
    }

    /// Records what the last settling changed.
    fn take_updates(&mut self) {
        let Some(growth) = &self.growth else { return };
        for kind in VesselKind::ALL {
            match growth.update(kind) {
                TreeUpdate::Grown { .. } if self.rebuild[kind] => {}
                TreeUpdate::Grown { changed } => self.changed[kind].extend_from_slice(changed),
                TreeUpdate::Replaced => {
                    self.lineages[kind] = Lineage::new_one();
                    self.rebuild[kind] = true;
                }
            }
        }
    }

    /// Repeats the steps that were done before the organ was saved.
    pub(crate) fn catch_up(&mut self) {
        self.attempt(|state| {
            for _ in 0..std::mem::take(&mut state.steps_to_repeat) {
                let Some(growth) = state.growth.as_mut().filter(|growth| !growth.is_finished()) else { break };
                growth.advance();
            }
            state.settle_growth();
        });
    }

    /// Does all remaining steps.
    pub(crate) fn run(&mut self) {
        // After so many steps, publishing everything is cheaper than recording every change.
        self.rebuild = ByKind::from_fn(|_| true);
        self.finish = false;
        self.attempt(|state| {
            if let Some(growth) = state.active_mut() {
                growth.run();
            }
            state.succeed();
            state.take_updates();
        });
    }

    /// Whether there is something to publish.
    pub(crate) fn has_changes(&self) -> bool {
        self.rebuild.values().any(|&rebuild| rebuild) || self.changed.values().any(|changed| !changed.is_empty())
    }

    /// A kind's tree and its changed nodes, `None` for all of them.
    pub(crate) fn news(&self, kind: VesselKind) -> (Option<GrownTree<'_>>, Option<&[u32]>) {
        let changed = (!self.rebuild[kind]).then_some(self.changed[kind].as_slice());
        (self.growth.as_ref().and_then(|growth| growth.trees()[kind]), changed)
    }

    /// Lineage of a kind's tree: a new one after each start, and when the generator replaced the tree.
    pub(crate) fn lineage(&self, kind: VesselKind) -> Lineage {
        self.lineages[kind]
    }

    /// Clears the published changes, and records the cost of publishing.
    pub(crate) fn clear_changes(&mut self, cost: Duration) {
        self.costs.note_publishing(cost);
        self.rebuild = ByKind::default();
        self.changed.values_mut().for_each(Vec::clear);
    }
}
