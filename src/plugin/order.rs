//! In which order things happen to vessels in a frame: once, here.

use bevy::{
    app::App,
    asset::Assets,
    ecs::{
        intern::Interned,
        schedule::{IntoScheduleConfigs, ScheduleLabel, SystemSet, common_conditions::resource_exists},
    },
    mesh::Mesh,
};

/// What happens to vessels in a frame, in this order.
///
/// Each room reads what the rooms before it wrote, so that nothing has to be done twice.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VesselSystems {
    /// Changed meshes and settings become tissues; growths start.
    Source,
    /// Growths step.
    Grow,
    /// Vessel entities are brought up to date with the growths.
    Publish,
    /// Vessels follow organs that were deformed before this.
    Follow,
    /// Vessels are cut, clamped, sealed and healed, as [`CuttableVessels`](crate::plugin::CuttableVessels) and
    /// [`VesselCommand`](crate::plugin::VesselCommand)s ask. Ask before this, and what you ask for is done in the same frame.
    Cut,
    /// Blood flows, and is lost.
    Circulate,
}

/// Puts the sets of a schedule in their order. Every plugin of a room calls this; once is as good as often.
pub(crate) fn configure(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.configure_sets(
        schedule,
        (
            VesselSystems::Source.run_if(resource_exists::<Assets<Mesh>>),
            VesselSystems::Grow,
            VesselSystems::Publish,
            VesselSystems::Follow,
            VesselSystems::Cut,
            VesselSystems::Circulate,
        )
            .chain(),
    );
}
