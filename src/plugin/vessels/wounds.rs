//! The ledger of a vessel entity's wounds.

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

/// Everything that was done to the vessels of a vessel entity. Read-only, as a [`Wounds`]: operate through
/// [`CuttableVessels`](crate::plugin::CuttableVessels).
///
/// It changes only in frames with an action. The segments that an action changed are marked in the entity's
/// [`ChangeLog`].
///
/// Scenes and clones of the entity keep it, except for the undo history. There it is empty until the vessels have grown
/// again. It stays empty, with a warning, if these differ from those that it was saved with.
#[derive(Component, Debug, Default, Reflect)]
#[reflect(opaque, Component, Default, Clone, Debug, Serialize, Deserialize)]
pub struct VesselWounds {
    wounds: Wounds,
    lineage: Lineage,
    clamps: BTreeSet<ClampId>,
    /// The wounds of vessels that have still to grow again.
    saved: Option<Box<Wounds>>,
}

impl VesselWounds {
    /// The ledger.
    pub fn ledger(&self) -> &Wounds {
        &self.wounds
    }

    /// The clamps that are on and their places, in the order in which they were put on.
    pub fn clamps(&self) -> impl Iterator<Item = (ClampId, Place)> + '_ {
        self.clamps.iter().filter_map(|&clamp| Some((clamp, self.wounds.clamp_place(clamp)?)))
    }

    pub(crate) fn ledger_mut(&mut self) -> &mut Wounds {
        &mut self.wounds
    }

    /// Marks the changes of an action.
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

    /// The wounds of the vessels that the ledger was saved with, while it waits for them.
    pub(crate) fn saved(&self) -> Option<&Wounds> {
        self.saved.as_deref()
    }

    /// Restores the wounds of vessels that were saved and have grown again.
    pub(crate) fn resume(&mut self, vessels: &Vessels) {
        let Some(mut saved) = self.saved.take() else { return };
        // The present ledger's retraction is within its limits: it follows the organ's settings.
        saved.set_retraction(self.wounds.retraction()).ok();
        self.lineage = vessels.lineage();
        self.clamps = saved.clamps().collect();
        self.wounds = *saved;
    }

    /// The wounds that a file keeps.
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
