//! Surgery: vessels are cut, clamped, tied, sealed, and healed again.

use crate::plugin::{
    growth::GrowthState,
    order::{self, VesselSystems},
    vessels::{OrganVessels, VesselWounds, Vessels, VesselsPlugin},
};
use bevy::{
    app::{App, Plugin, Update},
    ecs::{
        intern::Interned,
        query::{Added, Changed, Or, With, Without},
        schedule::{
            ApplyDeferred, IntoScheduleConfigs, ScheduleLabel,
            common_conditions::{any_match_filter, any_with_component},
        },
    },
};

pub(crate) mod cuttable;
mod cuttable_vessels;
mod hold;
mod ledgers;
pub(crate) mod messages;
pub(crate) mod open_ends;
mod operate;
mod undo;

pub use cuttable::{Cuttable, WoundedGrowth};
pub use cuttable_vessels::{CuttableVessels, Stroke};
pub use messages::{
    OperationError, OperationKind, StrokeId, VesselAction, VesselCommand, VesselOperation, VesselOperationFailed,
    VesselSite,
};
pub use open_ends::{OpenEnd, OpenEndEntities};

/// Lets the vessels of organs with a [`Cuttable`] be cut, through [`CuttableVessels`] or [`VesselCommand`]s.
#[derive(Clone, Debug)]
pub struct SurgeryPlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl SurgeryPlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for SurgeryPlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for SurgeryPlugin {
    fn build(&self, app: &mut App) {
        VesselsPlugin::ensure(app, self.schedule);
        order::configure(app, self.schedule);
        app.init_resource::<CuttableVessels>()
            .add_message::<VesselCommand>()
            .add_message::<VesselOperation>()
            .add_message::<VesselOperationFailed>()
            .add_observer(ledgers::remove_wounds)
            .add_observer(ledgers::forget_ledger);
        let cut = (
            open_ends::despawn_strays.run_if(any_match_filter::<Added<OpenEnd>>),
            (ledgers::attach_wounds, ApplyDeferred)
                .chain_ignore_deferred()
                .run_if(any_match_filter::<(With<Vessels>, Or<(Without<VesselWounds>, Without<OpenEndEntities>)>)>),
            ledgers::clear_outdated.run_if(any_with_component::<VesselWounds>),
            ledgers::follow_settings.run_if(any_match_filter::<Or<(Changed<Cuttable>, Changed<OrganVessels>)>>),
            cuttable_vessels::carry_out,
            hold::hold_growths.run_if(any_with_component::<GrowthState>),
            (open_ends::spawn_open_ends, ApplyDeferred)
                .chain_ignore_deferred()
                .run_if(any_match_filter::<Changed<VesselWounds>>),
            open_ends::move_open_ends.run_if(any_with_component::<OpenEnd>),
            cuttable_vessels::tell_operations.run_if(CuttableVessels::has_news),
        );
        app.add_systems(self.schedule, cut.chain_ignore_deferred().in_set(VesselSystems::Cut));
    }
}
