//! Queries of organs with blood and of their vessels.

use crate::plugin::{
    announcer::Announcer,
    circulation::{
        messages::{CirculationError, CirculationFailed},
        perfusion::{BloodLoss, Perfusion},
        state::CirculationState,
    },
    growth::{progress::GrowthProgress, state::GrowthState, vasculature::Vasculature},
    surgery::open_ends::OpenEndEntities,
    vessels::{relations::OrganVessels, tree::Vessels, wounds::VesselWounds},
};
use crate::synthesis::tree::ByKind;
use bevy::{
    ecs::{entity::Entity, query::QueryData, system::Query, world::Ref},
    log::warn,
};

/// A vessel entity, with all that the flow reads.
#[derive(QueryData)]
pub(crate) struct Perfused {
    pub(crate) entity: Entity,
    pub(crate) vessels: &'static Vessels,
    pub(crate) wounds: Option<Ref<'static, VesselWounds>>,
    pub(crate) entities: Option<&'static OpenEndEntities>,
}

/// An organ with blood, and its growth.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct PerfusedOrgan {
    pub(crate) entity: Entity,
    pub(crate) perfusion: Ref<'static, Perfusion>,
    pub(crate) vessels: Option<&'static OrganVessels>,
    pub(crate) wish: Option<&'static Vasculature>,
    pub(crate) growth: Option<&'static GrowthState>,
    pub(crate) progress: Option<&'static GrowthProgress>,
    pub(crate) state: &'static mut CirculationState,
    pub(crate) loss: &'static mut BloodLoss,
}

impl PerfusedOrganItem<'_, '_> {
    /// Its vessel entities.
    pub(crate) fn entities(&self) -> &[Entity] {
        self.vessels.map_or(&[], OrganVessels::entities)
    }

    /// Stops the blood until something changes. The open ends run dry when they would bleed next.
    pub(crate) fn fail(&mut self, error: CirculationError, failed: &mut Announcer<CirculationFailed>) {
        let organ = self.entity;
        warn!("{organ}: its blood does not flow: {error}");
        self.state.job = None;
        self.state.flow = None;
        self.state.error = Some(error.clone());
        *self.loss = BloodLoss { total: self.loss.total, ..BloodLoss::default() };
        failed.announce(CirculationFailed { organ, error });
    }
}

/// The vessel entity of each kind; if several have one kind, the first.
pub(crate) fn each_kind<'a>(
    entities: &'a [Entity],
    vessels: &'a Query<Perfused>,
) -> impl Iterator<Item = PerfusedItem<'a, 'a>> {
    let mut seen = ByKind::<bool>::default();
    vessels.iter_many(entities).filter(move |found| !std::mem::replace(&mut seen[found.vessels.kind()], true))
}
