//! Source: from an organ's [`Vasculature`] and its mesh, or another source of tissue, to a growth that can step.
//!
//! Each frame, commands are carried out; then the vasculature, paint and assets are compared with what the growth
//! follows; then the work that a difference needs is done. A job prepares a new tissue, and another one lays new paint
//! over it. A growth on the same tissue starts at once and reuses its buffers. If many growths start together, the
//! budget spreads them over frames.

use crate::plugin::{
    announcer::Announcer,
    growth::{
        budget::{GrowthBudget, GrowthFrame, LastCosts, begin_after},
        followed::{Need, SourceAssets},
        messages::{GrowthCommand, GrowthFailed, GrowthStarted, OrganGrowthError},
        paint::OrganPaint,
        progress::{GrowthControl, GrowthPhase, GrowthProgress},
        state::GrowthState,
        tissue::{Copied, OrganAssets, Painted, PaintedTissue},
        vasculature::Vasculature,
    },
    job::Jobs,
    organ::{image::OrganImage, rest::RestMesh},
};
use crate::synthesis::{
    pace::{Pace, at_once},
    preset::Preset,
    tissue::TissuePaint,
};
use bevy::{
    asset::{Asset, AssetEvent, AssetId, Assets},
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Ref, Res, ResMut},
        entity::Entity,
        message::MessageReader,
        query::QueryData,
        system::{Local, Query, SystemParam},
    },
    image::Image,
    log::warn,
    mesh::{Mesh, Mesh3d},
    platform::time::Instant,
};
use std::time::Duration;

/// An organ, with all that these systems touch.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Organ {
    pub(crate) entity: Entity,
    pub(crate) wish: Ref<'static, Vasculature>,
    paint: Option<Ref<'static, OrganPaint>>,
    pub(crate) mesh: Option<&'static Mesh3d>,
    image: Option<&'static OrganImage>,
    pub(crate) state: &'static mut GrowthState,
    pub(crate) progress: &'static mut GrowthProgress,
    rest: Option<&'static RestMesh>,
}

/// The messages of a growth that starts, or fails to.
#[derive(SystemParam)]
pub(crate) struct StartMessages<'w, 's> {
    started: Announcer<'w, 's, GrowthStarted>,
    failed: Announcer<'w, 's, GrowthFailed>,
}

/// Carries out the commands of this frame.
pub(crate) fn apply_commands(
    mut commands: MessageReader<GrowthCommand>,
    mut organs: Query<(&mut GrowthControl, &mut GrowthState)>,
) {
    for command in commands.read() {
        if let Ok((mut control, mut state)) = organs.get_mut(command.organ) {
            let obeyed = state.apply(command.action, *control);
            control.set_if_neq(obeyed);
        }
    }
}

/// Compares the vasculature, paint and assets with what each growth follows.
///
/// New vertex positions are no change if the vessels follow the mesh, unless it could not be an organ before.
pub(crate) fn notice_changes(
    mut mesh_events: MessageReader<AssetEvent<Mesh>>,
    mut image_events: MessageReader<AssetEvent<Image>>,
    meshes: Res<Assets<Mesh>>,
    mut organs: Query<Organ>,
) {
    let mesh_news: Vec<_> = mesh_events.read().filter_map(news).collect();
    let image_news: Vec<_> = image_events.read().filter_map(news).collect();
    for mut organ in &mut organs {
        organ.follow();
        for &(image, replaced) in &image_news {
            organ.state.notice_image(image, replaced);
        }
        for &(mesh, replaced) in &mesh_news {
            let is_deformed =
                || organ.state.has_good_mesh() && organ.rest.is_some_and(|rest| rest.is_of(meshes.get(mesh)));
            if organ.mesh.is_some_and(|organ_mesh| organ_mesh.id() == mesh) && !is_deformed() {
                organ.state.notice_mesh(mesh, replaced);
            }
        }
    }
}

/// Begins the work that is needed: preparing a tissue, painting it, or a growth on the current tissue.
pub(crate) fn begin(
    assets: OrganAssets,
    mut organs: Query<Organ>,
    mut messages: StartMessages,
    mut account: StartAccount,
    jobs: Jobs,
) {
    let waiting = organs.iter().filter(|organ| organ.state.need != Need::Nothing).map(|organ| organ.entity);
    account.start_in_turn(waiting.collect(), |organ| {
        let Ok(mut organ) = organs.get_mut(organ) else { return };
        let outcome = organ.begin(&assets, Some(&jobs));
        organ.report(outcome, &mut messages);
    });
}

/// Starts the growth on tissues that have become ready.
pub(crate) fn receive_tissues(mut organs: Query<Organ>, mut messages: StartMessages, mut account: StartAccount) {
    let ready = organs.iter().filter(|organ| organ.state.is_tissue_ready()).map(|organ| organ.entity);
    account.start_in_turn(ready.collect(), |organ| {
        let Ok(mut organ) = organs.get_mut(organ) else { return };
        if let Some(prepared) = organ.state.poll_preparation() {
            let outcome = prepared.and_then(|tissue| organ.start(tissue));
            organ.report(outcome, &mut messages);
        }
    });
}

/// Writes the progress of tissue preparations.
pub(crate) fn show_preparations(mut organs: Query<(&GrowthState, &mut GrowthProgress)>) {
    for (state, mut progress) in &mut organs {
        if let Some(prepared) = state.preparation_progress().filter(|&prepared| prepared != progress.prepared) {
            progress.prepared = prepared;
        }
    }
}

/// The cost of starts, and the organ that had the last turn.
#[derive(SystemParam)]
pub(crate) struct StartAccount<'w, 's> {
    budget: Res<'w, GrowthBudget>,
    frame: ResMut<'w, GrowthFrame>,
    costs: Local<'s, LastCosts>,
    last: Local<'s, Option<Entity>>,
}

impl StartAccount<'_, '_> {
    /// Starts organs in turn while the budget allows, and at least one.
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

/// An asset with new content (`true`), or one that has just come (`false`).
fn news<A: Asset>(event: &AssetEvent<A>) -> Option<(AssetId<A>, bool)> {
    match *event {
        AssetEvent::Modified { id } => Some((id, true)),
        AssetEvent::Added { id } => Some((id, false)),
        _ => None,
    }
}

/// Whether a growth has started.
type Started = bool;

impl OrganItem<'_, '_> {
    /// Compares the organ with what its growth follows.
    pub(crate) fn follow(&mut self) {
        let assets = SourceAssets { mesh: self.mesh.map(|mesh| mesh.id()), image: self.image.map(|image| image.id()) };
        self.state.bypass_change_detection().resume(self.progress.step);
        let is_painted = match &self.paint {
            Some(paint) => paint.is_changed(),
            None => !self.state.paint().is_blank(),
        };
        if self.wish.is_changed() || is_painted || self.state.follows_other_assets(assets) {
            let blank = TissuePaint::default();
            let paint = self.paint.as_ref().map_or(&blank, |paint| &paint.0);
            self.state.follow(Preset::from(&*self.wish), self.wish.seed, paint, assets);
        }
    }

    /// Does what is needed next. Jobs prepare and paint the tissue; without jobs it is done synchronously.
    pub(crate) fn begin(&mut self, assets: &OrganAssets, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        match self.state.next_need() {
            Need::Nothing => Ok(false),
            Need::Tissue => self.prepare(assets, jobs),
            need => self.grow_on_tissue_at_hand(need, jobs),
        }
    }

    /// Prepares and paints the tissue.
    fn prepare(&mut self, assets: &OrganAssets, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        self.state.drop_tissue();
        let copy = match assets.copy(&self.wish.tissue, self.mesh, self.image)? {
            Copied::Source(copy) => copy,
            Copied::NoMeshYet => return self.wait(GrowthPhase::WaitingForMesh),
            Copied::NoImageYet => return self.wait(GrowthPhase::WaitingForImage),
        };
        self.enter(GrowthPhase::PreparingTissue);
        let (source, paint) = (self.wish.tissue.clone(), self.state.paint());
        self.run(copy.work(&source).saturating_add(paint.work()), jobs, |pace| copy.prepare(source, paint, pace))
    }

    /// Grows on the current tissue, after painting it if its paint is outdated. After a stroke, vessels grow beside the
    /// drawn ones.
    fn grow_on_tissue_at_hand(&mut self, need: Need, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        self.state.choose_place(need);
        if self.state.cancel_if_undone() {
            return self.wait(self.state.phase());
        }
        let (paint, tissue) = (self.state.paint(), self.state.tissue_at_hand().cloned());
        let Some(tissue) = tissue else { return Ok(false) };
        if *tissue.paint == *paint {
            return self.start(tissue);
        }
        let phase = if self.state.is_beside() { GrowthPhase::Regrowing } else { GrowthPhase::PreparingTissue };
        self.enter(phase);
        self.run(tissue.work(&paint), jobs, |pace| tissue.repainted(paint, pace))
    }

    /// Makes a tissue in a job, without waiting for it. Without jobs, makes it now and starts the growth on it.
    fn run<W>(
        &mut self,
        items: usize,
        jobs: Option<&Jobs>,
        work: impl FnOnce(Pace) -> W,
    ) -> Result<Started, OrganGrowthError>
    where
        W: Future<Output = Painted> + Send + 'static,
    {
        let Some(jobs) = jobs else { return self.start(at_once(work(Pace::default()))?) };
        self.state.await_tissue(jobs.start(items, work));
        Ok(false)
    }

    /// Starts the growth on a tissue.
    pub(crate) fn start(&mut self, tissue: PaintedTissue) -> Result<Started, OrganGrowthError> {
        for warning in self.state.start(tissue, Preset::from(&*self.wish), self.wish.seed)? {
            warn!("{}: {warning}", self.entity);
        }
        self.enter(self.state.phase_of_steps());
        Ok(true)
    }

    /// Reports that the growth has started, or why it hasn't.
    pub(crate) fn report(&mut self, outcome: Result<Started, OrganGrowthError>, messages: &mut StartMessages) {
        let organ = self.entity;
        match outcome {
            Ok(true) => messages.started.announce(GrowthStarted { organ }),
            Ok(false) => {}
            Err(error) => {
                self.state.fail(error.clone());
                let stay =
                    if self.state.growth().is_some() { "its vessels stay as they are" } else { "no vessels grow here" };
                warn!("{organ}: {stay}: {error}");
                self.enter(GrowthPhase::Failed);
                messages.failed.announce(GrowthFailed { organ, error });
            }
        }
    }

    /// Enters a phase in which nothing starts.
    fn wait(&mut self, phase: GrowthPhase) -> Result<Started, OrganGrowthError> {
        self.enter(phase);
        Ok(false)
    }

    fn enter(&mut self, phase: GrowthPhase) {
        let growth = if phase == GrowthPhase::Regrowing { self.state.successor() } else { self.state.growth() };
        let progress = GrowthProgress::of(phase, growth, Duration::ZERO);
        self.progress.set_if_neq(progress);
    }
}
