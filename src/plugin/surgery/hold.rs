//! Growths rest while their vessels are severed.
//!
//! In: the ledgers in [`VesselWounds`], and [`Cuttable::growth`]. Out: growths that are held, or go on.

use crate::plugin::{
    growth::{GrowthPhase, GrowthProgress, GrowthState},
    surgery::cuttable::{Cuttable, WoundedGrowth},
    vessels::{relations::OrganVessels, wounds::VesselWounds},
};
use bevy::ecs::{query::QueryData, system::Query};

/// An organ that grows.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct GrowingOrgan {
    state: &'static mut GrowthState,
    progress: &'static mut GrowthProgress,
    cuttable: Option<&'static Cuttable>,
    vessels: Option<&'static OrganVessels>,
}

/// Cut: holds the growths of organs with lasting wounds, and releases the others.
pub(crate) fn hold_growths(mut organs: Query<GrowingOrgan>, wounds: Query<&VesselWounds>) {
    for mut organ in &mut organs {
        let is_held = organ.rests_when_wounded()
            && wounds
                .iter_many(organ.vessels.map_or(&[][..], OrganVessels::entities))
                .any(|wounds| wounds.are_lasting());
        if organ.state.is_held() != is_held {
            organ.state.hold(is_held);
        }
        let phase = organ.progress.phase;
        let held_phase = match phase {
            GrowthPhase::Growing if is_held => GrowthPhase::Held,
            GrowthPhase::Held if !is_held => GrowthPhase::Growing,
            _ => continue,
        };
        organ.progress.phase = held_phase;
    }
}

impl GrowingOrganItem<'_, '_> {
    fn rests_when_wounded(&self) -> bool {
        self.cuttable.is_some_and(|cuttable| cuttable.growth == WoundedGrowth::Rests)
    }
}
