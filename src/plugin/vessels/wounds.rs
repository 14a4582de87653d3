//! The ledger of what was done to the vessels of a vessel entity.

use crate::{
    plugin::{
        lineage::Lineage,
        vessels::{change_log::ChangeLog, tree::Vessels},
    },
    synthesis::{
        tree::Place,
        wound::{ClampId, WoundReport, Wounds},
    },
};
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, ReflectDeserialize, ReflectSerialize, std_traits::ReflectDefault},
};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::{collections::BTreeSet, ops::Deref};

/// All that was done to the vessels of a vessel entity. For reading, as a [`Wounds`]: operate through
/// [`CuttableVessels`](crate::plugin::CuttableVessels).
///
/// Changed only in frames in which something was done. The segments that an action changed are marked in the entity's
/// [`ChangeLog`].
///
/// Scenes and clones of the entity keep it, but for the history of undo. There it is empty until the vessels are there, too;
/// and it stays empty, with a warning, where these are others than those that it was saved with.
#[derive(Component, Debug, Default, Reflect)]
#[reflect(opaque, Component, Default, Clone, Debug, Serialize, Deserialize)]
pub struct VesselWounds {
    wounds: Wounds,
    lineage: Lineage,
    clamps: BTreeSet<ClampId>,
    /// What was done to the vessels that are still to grow again.
    saved: Option<Box<Wounds>>,
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
        self.saved = None;
    }

    /// What was done to the vessels that the ledger was saved with, while it waits for them.
    pub(crate) fn saved(&self) -> Option<&Wounds> {
        self.saved.as_deref()
    }

    /// Takes up what was done to the vessels before they were saved, now that they are there again.
    pub(crate) fn resume(&mut self, vessels: &Vessels) {
        let Some(mut saved) = self.saved.take() else { return };
        // Those of the ledger at hand are within their limits: they follow the organ's settings.
        saved.set_retraction(self.wounds.retraction()).ok();
        self.lineage = vessels.lineage();
        self.clamps = saved.clamps().collect();
        self.wounds = *saved;
    }

    /// What a file keeps.
    fn kept(&self) -> Wounds {
        self.saved.as_deref().unwrap_or(&self.wounds).without_history()
    }

    fn waiting(kept: Wounds) -> Self {
        Self { saved: (!kept.is_empty()).then(|| Box::new(kept)), ..Self::default() }
    }
}

impl Deref for VesselWounds {
    type Target = Wounds;

    fn deref(&self) -> &Wounds {
        &self.wounds
    }
}

/// A clone waits for the vessels of its own entity, and has no history.
impl Clone for VesselWounds {
    fn clone(&self) -> Self {
        Self::waiting(self.kept())
    }
}

impl Serialize for VesselWounds {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.kept().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for VesselWounds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Wounds::deserialize(deserializer).map(Self::waiting)
    }
}
