//! The ledger of what was done to the vessels of a vessel entity.

use crate::{
    plugin::vessels::{
        change_log::ChangeLog,
        lineage::Lineage,
        tree::Vessels,
    },
    synthesis::{
        tree::Place,
        wound::{ClampId, WoundReport, Wounds},
    },
};
use bevy::ecs::component::Component;
use std::{collections::BTreeSet, ops::Deref};

/// All that was done to the vessels of a vessel entity. For reading, as a [`Wounds`]: operate through
/// [`CuttableVessels`](crate::plugin::CuttableVessels).
///
/// Changed only in frames in which something was done. The segments that an action changed are marked in the entity's
/// [`ChangeLog`].
#[derive(Component, Debug, Default)]
pub struct VesselWounds {
    wounds: Wounds,
    lineage: Lineage,
    clamps: BTreeSet<ClampId>,
}

impl VesselWounds {
    /// The ledger.
    pub fn ledger(&self) -> &Wounds {
        &self.wounds
    }

    /// The clamps that are on, in the order in which they were put on, and where.
    pub fn clamps(&self) -> impl Iterator<Item = (ClampId, Place)> + '_ {
        self.clamps.iter().filter_map(|&clamp| Some((clamp, self.wounds.clamp_place(clamp)?)))
    }

    pub(crate) fn ledger_mut(&mut self) -> &mut Wounds {
        &mut self.wounds
    }

    /// Takes note of what an action changed.
    pub(crate) fn note(&mut self, report: &WoundReport, changes: &mut ChangeLog) {
        self.clamps.extend(&report.clamped);
        for clamp in &report.unclamped {
            self.clamps.remove(clamp);
        }
        changes.mark(report.changed.iter().map(|node| node.index()));
    }

    /// Whether the ledger is that of these vessels.
    pub(crate) fn is_of(&self, vessels: &Vessels) -> bool {
        self.lineage == vessels.lineage()
    }

    /// Forgets the wounds of an earlier growth.
    pub(crate) fn begin_anew(&mut self, vessels: &Vessels) {
        self.lineage = vessels.lineage();
        self.wounds.clear();
        self.clamps.clear();
    }
}

impl Deref for VesselWounds {
    type Target = Wounds;

    fn deref(&self) -> &Wounds {
        &self.wounds
    }
}
