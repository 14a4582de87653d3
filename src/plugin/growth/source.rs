//! Source: from an organ's [`Vasculature`] and its mesh, or another source of tissue, to a growth that can step.
//!
//! Each frame, commands are carried out; then the vasculature, paint and assets are compared with what the growth
//! follows; then the work that a difference needs is done. A job prepares a new tissue, for all organs that share it.
//! Another one lays paint over it and starts the growth. A start that takes no time is done at once, and reuses the
//! buffers of the growth before. If many growths start together, the budget spreads them over frames.

use crate::plugin::{
    announcer::Announcer,
    growth::{
        budget::{GrowthBudget, GrowthFrame, LastCosts, begin_after},
        followed::{Need, SourceAssets},
        messages::{GrowthCommand, GrowthFailed, GrowthStarted, OrganGrowthError},
        paint::OrganPaint,
        progress::{GrowthControl, GrowthPhase, GrowthProgress, RegrowsUnseen},
        shared::{SharedTissue, SharedTissues},
        start::StartOrder,
        state::GrowthState,
        tissue::{Found, OrganAssets, PaintedTissue, SourceCopy},
        vasculature::Vasculature,
    },
    job::Jobs,
    organ::{image::OrganImage, rest::RestMesh},
};
use crate::synthesis::{
    growth::GrowthWarning,
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
        query::{Has, QueryData},
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
    unseen: Has<RegrowsUnseen>,
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
    mut tissues: ResMut<SharedTissues>,
    mut organs: Query<Organ>,
) {
    let mesh_news: Vec<_> = mesh_events.read().filter_map(news).collect();
    let image_news: Vec<_> = image_events.read().filter_map(news).collect();
    mesh_news.iter().filter(|(_, replaced)| *replaced).for_each(|&(mesh, _)| tissues.forget_mesh(mesh));
    image_news.iter().filter(|(_, replaced)| *replaced).for_each(|&(image, _)| tissues.forget_image(image));
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
    mut assets: OrganAssets,
    mut organs: Query<Organ>,
    mut messages: StartMessages,
    mut account: StartAccount,
    jobs: Jobs,
) {
    let waiting = organs.iter().filter(|organ| organ.state.next_need() != Need::Nothing).map(|organ| organ.entity);
    account.start_in_turn(waiting.collect(), |organ| {
        let Ok(mut organ) = organs.get_mut(organ) else { return };
        let outcome = organ.begin(&mut assets, Some(&jobs));
        organ.report(outcome, &mut messages);
    });
}

/// Starts the growth on tissues that have become ready, and takes over growths that have started.
pub(crate) fn receive(mut organs: Query<Organ>, mut messages: StartMessages, mut account: StartAccount, jobs: Jobs) {
    let ready = organs.iter().filter(|organ| organ.state.is_prepared()).map(|organ| organ.entity);
    account.start_in_turn(ready.collect(), |organ| {
        let Ok(mut organ) = organs.get_mut(organ) else { return };
        if let Some(tissue) = organ.state.poll_tissue() {
            let outcome = tissue.and_then(|tissue| organ.start(tissue, Some(&jobs)));
            organ.report(outcome, &mut messages);
        }
        if let Some(start) = organ.state.poll_start() {
            let outcome =
                start.and_then(|started| organ.state.accept(started)).map(|warnings| organ.enter_growth(warnings));
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
        let assets = SourceAssets::of(self.mesh, self.image);
        self.state.bypass_change_detection().resume(self.progress.step);
        let is_painted = match &self.paint {
            Some(paint) => paint.is_changed(),
            None => !self.state.paint().is_blank(),
        };
        if self.wish.is_changed() || is_painted || self.state.follows_other_assets(assets) {
            let blank = TissuePaint::default();
            let paint = self.paint.as_ref().map_or(&blank, |paint| &paint.0);
            // Blood makes no vessels.
            let settings = Preset { blood: None, ..Preset::from(&*self.wish) };
            self.state.follow((settings, self.wish.seed, self.unseen), paint, assets);
        }
    }

    /// Does what is needed next. Jobs prepare the tissue and start the growth; without jobs it is done synchronously.
    pub(crate) fn begin(&mut self, assets: &mut OrganAssets, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        match self.state.next_need() {
            Need::Nothing => Ok(false),
            Need::Tissue => self.prepare(assets, jobs),
            need => self.grow_on_tissue_at_hand(need, jobs),
        }
    }

    /// Prepares the tissue, or waits with other organs that share it.
    fn prepare(&mut self, assets: &mut OrganAssets, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        self.state.drop_tissue();
        let shared = match assets.find(&self.wish.tissue, self.mesh, self.image, jobs.is_some())? {
            Found::Tissue(shared) => shared,
            Found::New(shared, copy) => {
                self.make(&shared, copy, jobs);
                shared
            }
            Found::NoMeshYet => return self.wait(GrowthPhase::WaitingForMesh),
            Found::NoImageYet => return self.wait(GrowthPhase::WaitingForImage),
        };
        self.enter(GrowthPhase::PreparingTissue);
        self.state.await_tissue(shared);
        if jobs.is_some() {
            return Ok(false);
        }
        self.state.poll_tissue().map_or(Ok(false), |tissue| self.start(tissue?, jobs))
    }

    /// Makes a tissue from the copied part of its assets.
    fn make(&self, shared: &SharedTissue, copy: SourceCopy, jobs: Option<&Jobs>) {
        let source = self.wish.tissue.clone();
        let Some(jobs) = jobs else {
            shared.fill(at_once(copy.prepare(source, Pace::default())));
            return;
        };
        shared.await_job(jobs.start(copy.work(&source), |pace| copy.prepare(source, pace)));
    }

    /// Grows on the current tissue. After a stroke of paint, vessels grow beside the drawn ones.
    fn grow_on_tissue_at_hand(&mut self, need: Need, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        self.state.choose_place(need);
        if self.state.cancel_if_undone() {
            return self.wait(self.state.phase());
        }
        let Some(tissue) = self.state.tissue_at_hand().cloned() else { return Ok(false) };
        self.start(tissue, jobs)
    }

    /// Starts the growth on a tissue, after painting it if its paint is outdated. A light start is done at once.
    pub(crate) fn start(&mut self, tissue: PaintedTissue, jobs: Option<&Jobs>) -> Result<Started, OrganGrowthError> {
        let order = self.state.order(tissue, Preset::from(&*self.wish), self.wish.seed);
        let work = order.work();
        let warnings = match jobs {
            _ if order.has_its_paint() && (jobs.is_none() || work <= StartOrder::LIGHT) => self.state.start_now(order),
            None => at_once(order.carry_out(Pace::default())).and_then(|started| self.state.accept(started)),
            Some(jobs) => {
                let phase = if self.state.is_beside() { GrowthPhase::Regrowing } else { GrowthPhase::PreparingTissue };
                self.enter(phase);
                self.state.await_start(jobs.start(work, |pace| order.carry_out(pace)));
                return Ok(false);
            }
        }?;
        Ok(self.enter_growth(warnings))
    }

    /// Enters the phase of a growth that has started.
    fn enter_growth(&mut self, warnings: Vec<GrowthWarning>) -> Started {
        for warning in warnings {
            warn!("{}: {warning}", self.entity);
        }
        self.enter(self.state.phase_of_steps());
        true
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
