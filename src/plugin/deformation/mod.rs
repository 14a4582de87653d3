//! Deformation: vessels follow an organ that changes its shape.

use crate::plugin::{
    growth::source,
    order::{self, VesselSystems},
    organ::rest::RestMesh,
    vessels::{Vessels, VesselsPlugin},
};
use bevy::{
    app::{App, Plugin, Update},
    ecs::{
        intern::Interned,
        query::{With, Without},
        schedule::{
            ApplyDeferred, IntoScheduleConfigs, ScheduleLabel,
            common_conditions::{any_match_filter, any_with_component},
        },
    },
};

mod bound;
pub(crate) mod follow;

use bound::VesselBinding;
pub use follow::{FollowsMesh, FollowsTetrahedra};

/// Lets vessels follow organs with [`FollowsMesh`] or [`FollowsTetrahedra`].
#[derive(Clone, Debug)]
pub struct DeformationPlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl DeformationPlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }
}

impl Default for DeformationPlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for DeformationPlugin {
    fn build(&self, app: &mut App) {
        VesselsPlugin::ensure(app, self.schedule);
        order::configure(app, self.schedule);
        app.add_observer(follow::release_vessels::<FollowsMesh, FollowsTetrahedra>)
            .add_observer(follow::release_vessels::<FollowsTetrahedra, FollowsMesh>);
        let follow = (
            (follow::attach_bindings, ApplyDeferred)
                .chain_ignore_deferred()
                .run_if(any_with_component::<RestMesh>)
                .run_if(any_match_filter::<(With<Vessels>, Without<VesselBinding>)>),
            (
                follow::follow_meshes.run_if(any_with_component::<FollowsMesh>),
                follow::follow_tetrahedra.run_if(any_with_component::<FollowsTetrahedra>),
            )
                .chain_ignore_deferred(),
        );
        app.add_systems(
            self.schedule,
            (
                // The rest shape is taken when the tissue is prepared.
                follow::take_rest
                    .in_set(VesselSystems::Source)
                    .after_ignore_deferred(source::begin)
                    .run_if(any_with_component::<RestMesh>),
                follow.chain_ignore_deferred().in_set(VesselSystems::Follow),
            ),
        );
    }
}
