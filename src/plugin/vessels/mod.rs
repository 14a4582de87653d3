//! Vessel entities: the tree of one kind of vessels, with its changes, its wounds and its appearance.

use crate::plugin::{
    job,
    order::{self, VesselSystems},
};
use bevy::{
    app::{App, Plugin, Update},
    ecs::{
        intern::Interned,
        query::{Added, Changed, Or},
        schedule::{IntoScheduleConfigs, ScheduleLabel, common_conditions::any_match_filter},
    },
};

pub(crate) mod appearance;
pub(crate) mod change_log;
pub(crate) mod changes;
pub(crate) mod index;
pub(crate) mod pick;
pub(crate) mod relations;
mod saved;
pub(crate) mod tree;
pub(crate) mod wounds;

pub use appearance::{SegmentColoring, VesselAppearance};
pub use change_log::{ChangeCursor, ChangeLog};
pub use changes::Changes;
pub use index::VesselIndex;
pub use pick::{VesselPicker, VesselPlace};
pub use relations::{OrganVessels, VesselsOf};
pub use tree::Vessels;
pub use wounds::VesselWounds;

/// The common base of all rooms: vessel entities are shown or hidden, and indexed, and work that takes longer than a
/// frame is done as [`JobSettings`](crate::plugin::JobSettings) say.
///
/// The other vessel plugins add it themselves.
#[derive(Clone, Debug)]
pub struct VesselsPlugin {
    schedule: Interned<dyn ScheduleLabel>,
}

impl VesselsPlugin {
    /// Runs in another schedule than `Update`.
    #[must_use]
    pub fn in_schedule(schedule: impl ScheduleLabel) -> Self {
        Self { schedule: schedule.intern() }
    }

    /// Adds the plugin, unless the app has it.
    pub(crate) fn ensure(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
        if !app.is_plugin_added::<Self>() {
            app.add_plugins(Self { schedule });
        }
    }
}

impl Default for VesselsPlugin {
    fn default() -> Self {
        Self::in_schedule(Update)
    }
}

impl Plugin for VesselsPlugin {
    fn build(&self, app: &mut App) {
        order::configure(app, self.schedule);
        job::register(app, self.schedule);
        app.register_required_components::<Vessels, VesselIndex>();
        app.add_systems(
            self.schedule,
            (
                relations::mend_relations
                    .before_ignore_deferred(VesselSystems::Source)
                    .run_if(any_match_filter::<Or<(Added<VesselsOf>, Added<OrganVessels>)>>),
                appearance::show_kinds
                    .in_set(VesselSystems::Publish)
                    .run_if(any_match_filter::<Changed<VesselAppearance>>),
                tree::mark_replaced.in_set(VesselSystems::Publish).run_if(any_match_filter::<Changed<Vessels>>),
                index::index_vessels.after(VesselSystems::Follow).before(VesselSystems::Cut),
            ),
        );
    }
}
