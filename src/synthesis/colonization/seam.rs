//! A colonization as a [`Growth`] like any other.

use super::Colonization;
use crate::synthesis::{
    growth::{GrownTree, Growth, GrowthWarning, StepCount, TreeUpdate},
    tree::{BedLink, ByKind, VesselKind},
};

impl Growth for Colonization {
    fn advance(&mut self) {
        self.advance();
    }

    fn settle(&mut self) {
        self.settle();
    }

    fn run(&mut self) {
        self.run();
    }

    fn is_finished(&self) -> bool {
        self.is_finished()
    }

    fn progress(&self) -> StepCount {
        StepCount { done: self.steps_done(), all: self.settings().steps }
    }

    fn trees(&self) -> ByKind<Option<GrownTree<'_>>> {
        ByKind::from_fn(|kind| Self::KINDS.contains(&kind).then(|| self.grown(kind)))
    }

    fn update(&self, kind: VesselKind) -> TreeUpdate<'_> {
        TreeUpdate::Grown { changed: self.changed_radii(kind) }
    }

    fn bed_links(&self) -> &[BedLink] {
        self.bed_links()
    }

    fn warnings(&self) -> Vec<GrowthWarning> {
        let warnings = self.settings().validate().unwrap_or_default();
        warnings.iter().map(GrowthWarning::new).collect()
    }
}

impl Colonization {
    /// The tree of a kind, with all data for drawing and writing it.
    pub fn grown(&self, kind: VesselKind) -> GrownTree<'_> {
        GrownTree {
            tree: self.tree(kind),
            birth_steps: self.birth_steps(kind),
            lift: if self.settings().stand_off { self.normals(kind) } else { &[] },
            waiting: self.drains_left(kind),
            reach: self.settings().system(kind).map_or(0.0, |own| own.node_birth_distance) * self.length_scale(kind),
        }
    }
}
