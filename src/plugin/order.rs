//! The order in which things happen to vessels in a frame, defined only here.

use bevy::{
    app::App,
    asset::Assets,
    ecs::{
        intern::Interned,
        schedule::{IntoScheduleConfigs, ScheduleLabel, SystemSet, common_conditions::resource_exists},
    },
    mesh::Mesh,
};

/// The systems that run on vessels in a frame, in this order.
///
/// Each set reads what the sets before it wrote, so that nothing has to be done twice.
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
    /// [`VesselCommand`](crate::plugin::VesselCommand)s ask. Requests made before this set are carried out in the same
    /// frame.
    Cut,
    /// Blood flows, and is lost.
    Circulate,
    /// Closed surfaces are made of vessels that have grown or were cut, and follow them.
    Surface,
    /// Vessels that have grown are painted into the textures of their organs.
    Texture,
}

/// Puts the sets of a schedule in their order. The plugin of every room calls this; repeated calls change nothing.
///
/// No commands are applied between the sets, or between the systems of a room, but where a room says so with
/// `ApplyDeferred`, and only in frames in which there may be some. Each application holds up all threads.
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
            VesselSystems::Surface,
            VesselSystems::Texture,
        )
            .chain_ignore_deferred(),
    );
}
