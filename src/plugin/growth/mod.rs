//! Growth: from an organ's mesh and settings to its vessels, some steps in each frame.

use crate::plugin::{
    order::{self, VesselSystems},
    vessels::VesselsPlugin,
};
use bevy::{
    app::{App, Plugin, Update},
    asset::{AssetEvent, Assets},
    ecs::{
        intern::Interned,
        schedule::{ApplyDeferred, IntoScheduleConfigs, ScheduleLabel, common_conditions::any_with_component},
    },
    image::Image,
    log::warn,
    mesh::Mesh,
};

pub(crate) mod budget;
pub(crate) mod commands;
pub mod diagnostics;
pub(crate) mod followed;
pub(crate) mod grow;
pub(crate) mod messages;
pub(crate) mod paint;
pub(crate) mod preparation;
pub(crate) mod progress;
pub(crate) mod publish;
pub(crate) mod shared;
pub(crate) mod source;
pub(crate) mod start;
pub(crate) mod state;
pub(crate) mod steps;
pub(crate) mod successor;
pub(crate) mod tissue;
pub(crate) mod vasculature;
mod waiting;

pub use budget::{GrowthBudget, GrowthFrame};
pub use commands::EntityCommandsExt;
pub use messages::{GrowthAction, GrowthCommand, GrowthFailed, GrowthFinished, GrowthStarted, OrganGrowthError};
pub use paint::OrganPaint;
pub use progress::{GrowthControl, GrowthPhase, GrowthProgress, RegrowsUnseen};
pub use state::GrowthState;
pub use vasculature::Vasculature;

use shared::SharedTissues;

/// Grows vessels on every entity with a [`Vasculature`]. Needs no window and no renderer, only mesh assets:
/// `DefaultPlugins`, or `AssetPlugin` and `MeshPlugin`.
///
/// [`VesselPlugin`](crate::VesselPlugin) adds this and all other vessel plugins.
#[derive(Clone, Debug)]
pub struct GrowthPlugin {
    schedule: Interned<dyn ScheduleLabel>,
    budget: GrowthBudget,
}

impl GrowthPlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(mut self, schedule: impl ScheduleLabel) -> Self {
        self.schedule = schedule.intern();
        self
    }

    /// Starts with a budget other than [`GrowthBudget::default`]. The budget is a resource, and may be changed later.
    #[must_use]
    pub fn with_budget(mut self, budget: GrowthBudget) -> Self {
        self.budget = budget;
        self
    }
}

impl Default for GrowthPlugin {
    fn default() -> Self {
        Self { schedule: Update.intern(), budget: GrowthBudget::default() }
    }
}

impl Plugin for GrowthPlugin {
    fn build(&self, app: &mut App) {
        VesselsPlugin::ensure(app, self.schedule);
        order::configure(app, self.schedule);
        app.insert_resource(self.budget)
            .init_resource::<GrowthFrame>()
            .init_resource::<SharedTissues>()
            .add_message::<GrowthCommand>()
            .add_message::<GrowthStarted>()
            .add_message::<GrowthFinished>()
            .add_message::<GrowthFailed>()
            .add_message::<AssetEvent<Image>>()
            .add_observer(publish::remove_vessels);
        diagnostics::register(app);
        let source = (
            source::apply_commands,
            source::notice_changes,
            source::begin,
            source::receive,
            source::show_preparations,
            waiting::warn_of_waiting,
        );
        // The rooms that follow find the vessels of this frame.
        let publish = (publish::publish_vessels, grow::end_growths, ApplyDeferred);
        app.add_systems(
            self.schedule,
            (
                budget::begin_frame.before(VesselSystems::Source),
                source.chain_ignore_deferred().in_set(VesselSystems::Source).run_if(any_with_component::<GrowthState>),
                (grow::grow, grow::end_panicked)
                    .chain_ignore_deferred()
                    .in_set(VesselSystems::Grow)
                    .run_if(any_with_component::<GrowthState>),
                publish
                    .chain_ignore_deferred()
                    .in_set(VesselSystems::Publish)
                    .run_if(any_with_component::<GrowthState>),
                diagnostics::measure.in_set(VesselSystems::Publish).after(grow::end_growths),
            ),
        );
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Assets<Mesh>>() {
            warn!("no vessels will grow: there are no mesh assets; add DefaultPlugins, or AssetPlugin and MeshPlugin");
        }
    }
}
