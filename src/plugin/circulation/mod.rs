//! Circulation: blood flows through an organ's vessels, leaves through open ends, and supplies the tissue.

use crate::plugin::{
    order::{self, VesselSystems},
    surgery::SurgeryPlugin,
    vessels::Vessels,
};
use bevy::{
    app::{App, Plugin, Update},
    ecs::{
        intern::Interned,
        query::{Added, Or, With, Without},
        schedule::{
            ApplyDeferred, IntoScheduleConfigs, ScheduleLabel,
            common_conditions::{any_match_filter, any_with_component},
        },
    },
};

pub(crate) mod bleeding;
pub(crate) mod flow;
mod gauge;
pub(crate) mod messages;
mod organ_flow;
pub(crate) mod patient;
mod perfused;
pub(crate) mod perfusion;
mod state;
mod supply;

pub use messages::{BleedingStarted, BleedingStopped, CirculationError, CirculationFailed};
pub use patient::Patient;
pub use perfusion::{BloodLoss, OrganSupply, Perfusion, SegmentSupply};
pub use state::CirculationState;

/// Lets blood flow through the vessels of organs with a [`Perfusion`]. Adds the [`SurgeryPlugin`], which opens vessels.
#[derive(Clone, Debug)]
pub struct CirculationPlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl CirculationPlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for CirculationPlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for CirculationPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<SurgeryPlugin>() {
            app.add_plugins(SurgeryPlugin::in_schedule(self.schedule));
        }
        order::configure(app, self.schedule);
        app.add_message::<BleedingStarted>()
            .add_message::<BleedingStopped>()
            .add_message::<CirculationFailed>()
            .add_observer(flow::remove_circulation)
            .add_observer(flow::stop_bleeding)
            .add_observer(flow::lay_again);
        let circulate = (
            flow::prepare_organs,
            ApplyDeferred.run_if(any_match_filter::<Or<(Added<Perfusion>, (With<Vessels>, Without<SegmentSupply>))>>),
            flow::make_flow,
            bleeding::bleed,
            supply::measure_supply,
        );
        app.add_systems(
            self.schedule,
            circulate.chain_ignore_deferred().in_set(VesselSystems::Circulate).run_if(any_with_component::<Perfusion>),
        );
    }
}
