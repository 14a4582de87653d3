//! A constrained constructive optimisation as a [`Growth`] like any other.
//!
//! An insertion splits a segment: the new bifurcation comes before an old node. Trees are in the order from their
//! roots, so the nodes after it get other numbers, and each [`settle`](Growth::settle) replaces the tree.

use super::Cco;
use crate::synthesis::{
    growth::{GrownTree, Growth, GrowthWarning, StepCount, TreeUpdate},
    tree::{BedLink, ByKind, VesselKind},
};

impl Growth for Cco {
    fn advance(&mut self) {
        self.advance();
    }

    fn run(&mut self) {
        // Whatever had no room is told by the warnings.
        drop(self.run());
    }

    fn settle(&mut self) {
        self.settle();
    }

    fn is_finished(&self) -> bool {
        self.is_finished()
    }

    fn progress(&self) -> StepCount {
        self.steps()
    }

    fn trees(&self) -> ByKind<Option<GrownTree<'_>>> {
        ByKind::from_fn(|kind| {
            let grown = self.grown[kind].as_ref()?;
            let system = self.systems.iter().find(|system| system.kind == kind)?;
            Some(GrownTree {
                tree: &grown.tree,
                birth_steps: &grown.birth_steps,
                lift: &[],
                waiting: (self.settings.terminals - system.terminals) as usize,
                reach: system.spacing() as f32,
            })
        })
    }

    fn update(&self, _: VesselKind) -> TreeUpdate<'_> {
        TreeUpdate::Replaced
    }

    fn bed_links(&self) -> &[BedLink] {
        self.bed_links()
    }

    fn warnings(&self) -> Vec<GrowthWarning> {
        let stuck = self.outcome().err().map(GrowthWarning::new);
        self.settings.validate().unwrap_or_default().into_iter().chain(stuck).collect()
    }
}
