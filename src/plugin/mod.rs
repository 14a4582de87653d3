//! ECS glue: vessels grow on organ entities, frame by frame. No drawing.
//!
//! In: an entity with a `Mesh3d` and a [`Vasculature`]. Out: a vessel entity per system, child of the organ, with the
//! tree in [`Vessels`] and what changed in [`SegmentChanges`]; the state of things in [`GrowthProgress`] and messages.
//!
//! What goes beyond growth is asked for by components on the organ: [`Cuttable`] for surgery through [`CuttableVessels`],
//! [`Perfusion`] for blood, [`FollowsMesh`] or [`FollowsTetrahedra`] for soft bodies. An organ without them pays nothing
//! for them.
//!
//! ```text
//! Source      commands, wishes, mesh assets ─► tissue (in the task pool) ─► growth, started
//! Grow        steps, one organ after the other, within the GrowthBudget
//! Cut         CuttableVessels, VesselCommand ─► VesselWounds, OpenEnd entities
//! Circulate   VesselWounds ─► flow, bleeding, supply of the tissue
//! Publish     new and changed nodes ─► Vessels, SegmentChanges, Aabb; diagnostics
//! ```

mod bleeding;
mod bound_vessels;
mod circulation;
mod commands;
mod components;
mod cutting;
mod deformation;
pub mod diagnostics;
mod growth;
mod growth_state;
mod journal;
mod messages;
mod open_ends;
mod operations;
mod organ_flow;
mod organ_mesh;
mod perfusion;
mod probe;
mod procedural;
mod publish;
mod segment_changes;
mod supply;
mod theatre;
mod tissue_source;
mod vessel_index;
mod vessels;
mod wounds;

pub use circulation::CirculationState;
pub use commands::EntityCommandsExt;
pub use components::{
    GrowthControl, GrowthPhase, GrowthProgress, OrganVessels, SegmentColoring, Vasculature, VesselAppearance,
    VesselSystem, VesselsOf,
};
pub use cutting::{CuttableVessels, Stroke};
pub use deformation::{FollowsMesh, FollowsTetrahedra, RestMesh};
pub use growth::{GrowthBudget, GrowthFrame};
pub use growth_state::GrowthState;
pub use messages::{GrowthAction, GrowthCommand, GrowthFailed, GrowthFinished, GrowthStarted, OrganError};
pub use open_ends::{OpenEnd, OpenEndEntities};
pub use operations::{
    OperationError, OperationKind, StrokeId, VesselAction, VesselCommand, VesselOperation, VesselOperationFailed,
    VesselSite,
};
pub use organ_mesh::{OrganMeshError, read_mesh};
pub use perfusion::{
    BleedingStarted, BleedingStopped, BloodLoss, CirculationFailed, OrganSupply, Patient, Perfusion, SegmentSupply,
};
pub use probe::{VesselPlace, VesselProbe};
pub use segment_changes::SegmentChanges;
pub use vessel_index::VesselIndex;
pub use vessels::Vessels;
pub use wounds::{Cuttable, VesselWounds};

use bevy::{
    app::{App, Plugin, Update},
    asset::Assets,
    ecs::{
        intern::Interned,
        schedule::{IntoScheduleConfigs, ScheduleLabel, SystemSet, common_conditions::resource_exists},
    },
    log::warn,
    mesh::Mesh,
};

/// Grows vessels on every entity with a [`Vasculature`]. Needs no window and no renderer, only mesh assets:
/// `DefaultPlugins`, or `AssetPlugin` and `MeshPlugin`.
///
/// [`VesselPlugin`](crate::VesselPlugin) adds this, and drawing.
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

    /// Starts with another budget than [`GrowthBudget::default`]. It is a resource, and may be changed later.
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
        app.insert_resource(self.budget).init_resource::<GrowthFrame>().init_resource::<CuttableVessels>();
        add_messages(app);
        add_observers(app);
        diagnostics::register(app);
        app.configure_sets(
            self.schedule,
            (
                VesselSystems::Source.run_if(resource_exists::<Assets<Mesh>>),
                VesselSystems::Grow,
                VesselSystems::Cut,
                VesselSystems::Circulate,
                VesselSystems::Publish,
            )
                .chain(),
        );
        add_growth_systems(app, self.schedule);
        add_surgery_systems(app, self.schedule);
        add_publish_systems(app, self.schedule);
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Assets<Mesh>>() {
            warn!("no vessels will grow: there are no mesh assets; add DefaultPlugins, or AssetPlugin and MeshPlugin");
        }
    }
}

fn add_messages(app: &mut App) {
    app.add_message::<GrowthCommand>()
        .add_message::<GrowthStarted>()
        .add_message::<GrowthFinished>()
        .add_message::<GrowthFailed>()
        .add_message::<VesselCommand>()
        .add_message::<VesselOperation>()
        .add_message::<VesselOperationFailed>()
        .add_message::<BleedingStarted>()
        .add_message::<BleedingStopped>()
        .add_message::<CirculationFailed>();
}

fn add_observers(app: &mut App) {
    app.add_observer(publish::remove_vessels)
        .add_observer(wounds::remove_wounds)
        .add_observer(wounds::forget_ledger)
        .add_observer(circulation::remove_circulation)
        .add_observer(deformation::release_vessels::<FollowsMesh, FollowsTetrahedra>)
        .add_observer(deformation::release_vessels::<FollowsTetrahedra, FollowsMesh>);
}

fn add_growth_systems(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    let source = (
        tissue_source::obey_commands,
        tissue_source::notice_changes,
        tissue_source::begin,
        deformation::take_rest,
        tissue_source::receive_tissues,
    );
    let grow = (growth::grow, growth::end_growths);
    app.add_systems(
        schedule,
        (
            growth::begin_frame.before(VesselSystems::Source),
            source.chain().in_set(VesselSystems::Source),
            grow.chain().in_set(VesselSystems::Grow),
        ),
    );
}

fn add_surgery_systems(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    let cut = (
        wounds::attach_wounds,
        wounds::clear_outdated,
        wounds::follow_settings,
        vessel_index::index_vessels,
        cutting::carry_out,
        open_ends::spawn_open_ends,
    );
    let circulate = (circulation::prepare_organs, circulation::make_flow, bleeding::bleed, supply::measure_supply);
    app.add_systems(
        schedule,
        (cut.chain().in_set(VesselSystems::Cut), circulate.chain().in_set(VesselSystems::Circulate)),
    );
}

fn add_publish_systems(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    let publish = (
        publish::publish_vessels,
        // Whoever looks after this frame sees no wounds of vessels that are gone.
        wounds::clear_outdated,
        open_ends::spawn_open_ends,
        deformation::attach_bindings,
        (deformation::follow_meshes, deformation::follow_tetrahedra).chain(),
        open_ends::move_open_ends,
        publish::show_systems,
        diagnostics::measure,
    );
    app.add_systems(schedule, publish.chain().in_set(VesselSystems::Publish));
}

/// What happens to vessels in a frame, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VesselSystems {
    /// Changed meshes and wishes become tissues; growths start.
    Source,
    /// Growths step.
    Grow,
    /// Vessels are cut, clamped, sealed and healed, as [`CuttableVessels`] and [`VesselCommand`]s ask, where they were
    /// published last. Ask before this, and what you ask for is done in the same frame.
    Cut,
    /// Blood flows, and is lost.
    Circulate,
    /// Vessel entities are brought up to date, and follow meshes that were deformed before this.
    Publish,
}
