//! Source: from an organ's mesh and wishes to a growth that can step.
//!
//! Each frame: commands are obeyed, then wishes and meshes are compared with what the growth follows, then what the
//! difference needs is done. A new tissue is prepared in a job, a growth on the same tissue starts at once and uses its
//! buffers again. Where many growths start at once, the budget spreads them over frames.

use crate::plugin::{
    announcer::Announcer,
    growth::{
        budget::{GrowthBudget, GrowthFrame, LastCosts, begin_after},
        messages::{GrowthCommand, GrowthFailed, GrowthStarted, OrganGrowthError},
        progress::{GrowthControl, GrowthPhase, GrowthProgress},
        state::{GrowthState, Need, Prepared},
        vasculature::Vasculature,
    },
    job::Jobs,
    organ::{
        mesh::{MeshCopy, OrganMeshError, copy_mesh},
        rest::RestMesh,
    },
};
use crate::synthesis::{
    mesh::TriangleMesh,
    pace::{Pace, at_once},
    tissue::{Tissue, TissueSettings},
};
use bevy::{
    asset::{AssetEvent, AssetId, AssetServer, Assets, LoadState},
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Ref, Res, ResMut},
        entity::Entity,
        message::MessageReader,
        query::QueryData,
        system::{Local, Query, SystemParam},
    },
    log::warn,
    mesh::{Mesh, Mesh3d},
    platform::time::Instant,
};
use std::{sync::Arc, time::Duration};

/// An organ, with all that its source touches.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Organ {
    pub(crate) entity: Entity,
    pub(crate) wish: Ref<'static, Vasculature>,
    pub(crate) mesh: Option<&'static Mesh3d>,
    pub(crate) state: &'static mut GrowthState,
    pub(crate) progress: &'static mut GrowthProgress,
    rest: Option<&'static RestMesh>,
}

/// Where meshes come from.
#[derive(SystemParam)]
pub(crate) struct OrganMeshes<'w> {
    meshes: Res<'w, Assets<Mesh>>,
    server: Option<Res<'w, AssetServer>>,
}

/// Where a growth reports how it starts.
#[derive(SystemParam)]
pub(crate) struct StartMessages<'w, 's> {
    started: Announcer<'w, 's, GrowthStarted>,
    failed: Announcer<'w, 's, GrowthFailed>,
}

/// Does what the commands of this frame say.
pub(crate) fn obey_commands(
    mut commands: MessageReader<GrowthCommand>,
    mut organs: Query<(&mut GrowthControl, &mut GrowthState)>,
) {
    for command in commands.read() {
        if let Ok((mut control, mut state)) = organs.get_mut(command.organ) {
            let obeyed = state.obey(command.action, *control);
            control.set_if_neq(obeyed);
        }
    }
}

/// Compares wishes and meshes with what each growth follows.
///
/// A mesh that vessels follow may have other positions than before: that is no change.
pub(crate) fn notice_changes(
    mut events: MessageReader<AssetEvent<Mesh>>,
    meshes: Res<Assets<Mesh>>,
    mut organs: Query<Organ>,
) {
    let news: Vec<_> = events.read().filter_map(mesh_news).collect();
    for mut organ in &mut organs {
        organ.follow();
        for &(mesh, replaced) in &news {
            let is_deformed = || organ.rest.is_some_and(|rest| rest.is_of(meshes.get(mesh)));
            if organ.mesh.is_some_and(|organ_mesh| organ_mesh.id() == mesh) && !is_deformed() {
                organ.state.notice_mesh(mesh, replaced);
            }
        }
    }
}

/// Begins what is needed: a tissue's preparation, or a growth on the tissue at hand.
pub(crate) fn begin(
    meshes: OrganMeshes,
    mut organs: Query<Organ>,
    mut messages: StartMessages,
    mut account: StartAccount,
    jobs: Jobs,
) {
    let waiting = organs.iter().filter(|organ| organ.state.need != Need::Nothing).map(|organ| organ.entity);
    account.start_in_turn(waiting.collect(), |organ| {
        let Ok(mut organ) = organs.get_mut(organ) else { return };
        let outcome = organ.begin(&meshes, Some(&jobs));
        organ.report(outcome, &mut messages);
    });
}

/// Starts the growth of organs whose tissue has become ready.
pub(crate) fn receive_tissues(mut organs: Query<Organ>, mut messages: StartMessages, mut account: StartAccount) {
    let ready = organs.iter().filter(|organ| organ.state.is_tissue_ready()).map(|organ| organ.entity);
    account.start_in_turn(ready.collect(), |organ| {
        let Ok(mut organ) = organs.get_mut(organ) else { return };
        if let Some(prepared) = organ.state.poll_preparation() {
            let outcome = organ.start(Some(prepared));
            organ.report(outcome, &mut messages);
        }
    });
}

/// Shows how far the preparations of tissues are.
pub(crate) fn show_preparations(mut organs: Query<(&GrowthState, &mut GrowthProgress)>) {
    for (state, mut progress) in &mut organs {
        if let Some(prepared) = state.preparation_progress().filter(|&prepared| prepared != progress.prepared) {
            progress.prepared = prepared;
        }
    }
}

/// What starts cost, and who had a turn last.
#[derive(SystemParam)]
pub(crate) struct StartAccount<'w, 's> {
    budget: Res<'w, GrowthBudget>,
    frame: ResMut<'w, GrowthFrame>,
    costs: Local<'s, LastCosts>,
    last: Local<'s, Option<Entity>>,
}

impl StartAccount<'_, '_> {
    /// Starts organs in turn as long as the budget allows; one at least.
    fn start_in_turn(&mut self, organs: Vec<Entity>, mut start: impl FnMut(Entity)) {
        let mut round: Vec<_> = organs.into_iter().map(|organ| (organ, ())).collect();
        round.sort_unstable();
        begin_after(&mut round, *self.last);
        for (starts, (organ, ())) in (0..).zip(round) {
            let expected = self.frame.start_time + self.costs.expected();
            if !self.budget.allows_start(starts, || expected) {
                break;
            }
            let clock = Instant::now();
            start(organ);
            let cost = clock.elapsed();
            self.costs.add(cost);
            self.frame.start_time += cost;
            *self.last = Some(organ);
        }
    }
}

/// A mesh asset with new content (`true`), or one that has just come (`false`).
fn mesh_news(event: &AssetEvent<Mesh>) -> Option<(AssetId<Mesh>, bool)> {
    match *event {
        AssetEvent::Modified { id } => Some((id, true)),
        AssetEvent::Added { id } => Some((id, false)),
        _ => None,
    }
}

/// The slow part of the preparation, as a pure function of what was copied from the mesh.
async fn prepare(copy: MeshCopy, settings: TissueSettings, pace: Pace) -> Prepared {
    let mesh = TriangleMesh::new(copy.positions, copy.triangles, None).map_err(OrganMeshError::from)?;
    Ok(settings.build_paced(&mesh, &pace).await?)
}

impl OrganMeshes<'_> {
    /// A copy of an organ's mesh, `None` while it is on its way.
    fn copy(&self, mesh: Option<&Mesh3d>) -> Result<Option<MeshCopy>, OrganMeshError> {
        let Some(mesh) = mesh else { return Ok(None) };
        if let Some(mesh) = self.meshes.get(mesh.id()) {
            return copy_mesh(mesh).map(Some);
        }
        match self.server.as_ref().map(|server| server.load_state(mesh.id())) {
            Some(LoadState::Failed(error)) => Err(OrganMeshError::NotLoaded { reason: error.to_string() }),
            _ => Ok(None),
        }
    }
}

/// Whether a growth has started.
type Started = bool;

impl OrganItem<'_, '_> {
    /// Takes note of changed wishes.
    pub(crate) fn follow(&mut self) {
        let mesh = self.mesh.map(|mesh| mesh.id());
        self.state.bypass_change_detection().resume(self.progress.step);
        if self.wish.is_changed() || self.state.follows_other_mesh(mesh) {
            self.state.follow(&self.wish, mesh);
        }
    }

    /// Does what is needed next. A tissue is prepared in a job; without jobs, here and now.
    pub(crate) fn begin(&mut self, meshes: &OrganMeshes, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        match self.state.next_need() {
            Need::Nothing => Ok(false),
            Need::Growth => self.start(None),
            Need::Tissue => {
                self.state.drop_tissue();
                let Some(copy) = meshes.copy(self.mesh)? else {
                    self.enter(GrowthPhase::WaitingForMesh);
                    return Ok(false);
                };
                self.enter(GrowthPhase::PreparingTissue);
                let settings = self.wish.tissue.clone();
                let Some(jobs) = jobs else {
                    return self.start(Some(at_once(prepare(copy, settings, Pace::default()))));
                };
                let work = settings.work(copy.triangles.len());
                self.state.await_tissue(jobs.start(work, |pace| prepare(copy, settings, pace)));
                Ok(false)
            }
        }
    }

    /// Starts the growth, on a tissue that has just been prepared or on the one at hand.
    pub(crate) fn start(&mut self, prepared: Option<Prepared>) -> Result<Started, OrganGrowthError> {
        let tissue: Option<Arc<dyn Tissue>> = prepared.transpose()?;
        for warning in self.state.start(tissue, &self.wish)? {
            warn!("{}: {warning}", self.entity);
        }
        self.enter(GrowthPhase::Growing);
        Ok(true)
    }

    /// Says that the growth has started, or why it hasn't.
    pub(crate) fn report(&mut self, outcome: Result<Started, OrganGrowthError>, messages: &mut StartMessages) {
        let organ = self.entity;
        match outcome {
            Ok(true) => messages.started.announce(GrowthStarted { organ }),
            Ok(false) => {}
            Err(error) => {
                warn!("{organ}: no vessels grow here: {error}");
                self.state.fail(error.clone());
                self.enter(GrowthPhase::Failed);
                messages.failed.announce(GrowthFailed { organ, error });
            }
        }
    }

    fn enter(&mut self, phase: GrowthPhase) {
        let progress = GrowthProgress::of(phase, self.state.growth(), Duration::ZERO);
        self.progress.set_if_neq(progress);
    }
}
