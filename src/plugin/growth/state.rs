//! The plugin's state of a growing organ: the tissue, the growth, and the work still to do.
//!
//! The inputs of a growth are in [`followed`](super::followed), its steps and their changes in [`steps`](super::steps).

use crate::plugin::{
    growth::{
        budget::Costs,
        followed::{Followed, Need, SourceAssets},
        messages::{GrowthAction, OrganGrowthError},
        preparation::Preparation,
        progress::{GrowthControl, GrowthPhase},
        shared::SharedTissue,
        start::{Start, StartOrder, StartedGrowth},
        successor::Successor,
        tissue::PaintedTissue,
    },
    job::{Job, JobPanic},
    lineage::Lineage,
    organ::{image::OrganImageError, mesh::OrganMeshError},
};
use crate::synthesis::{
    growth::{Growth, GrowthWarning},
    mesh::{IndexedMesh, TriangleMesh},
    preset::Preset,
    tissue::{Tissue, TissuePaint},
    tree::ByKind,
};
use bevy::{asset::AssetId, ecs::component::Component, image::Image, mesh::Mesh};
use std::sync::Arc;

/// The growth of an organ. Read-only: the plugin drives it.
#[derive(Component, Debug, Default)]
pub struct GrowthState {
    /// What must be done next.
    pub(crate) need: Need,
    /// The inputs that the growth follows, or is about to.
    followed: Option<Followed>,
    /// A tissue that is awaited, or a growth being started. Dropping it stops it, so that nothing outdated arrives.
    preparation: Option<Preparation>,
    /// Whether the next growth to start grows unseen, beside vessels that stay meanwhile.
    beside: bool,
    /// Whether growths with other settings grow unseen.
    unseen: bool,
    /// Whether the drawn vessels grew with settings or a seed that are no longer asked for.
    pub(super) other_settings: bool,
    pub(super) tissue: Option<PaintedTissue>,
    /// Lineage of the current or coming tissue. Paint does not change it.
    tissue_lineage: Lineage,
    pub(super) growth: Option<Box<dyn Growth>>,
    /// The growth that will replace this one.
    pub(super) successor: Option<Successor>,
    /// Lineages of the growth's trees.
    pub(super) lineages: ByKind<Lineage>,
    error: Option<OrganGrowthError>,
    /// The panic of a step, until it is reported.
    pub(super) panic: Option<JobPanic>,
    /// Whether steps wait until severed vessels are whole again.
    held: bool,
    /// Frames for which it has waited for something that nobody loads.
    pub(crate) waited: u32,
    /// Warnings already given about the settings.
    warned: Vec<GrowthWarning>,
    /// Steps that the growth had done when its organ was saved, and repeats at once.
    pub(super) steps_to_repeat: u32,
    /// Steps that a paused growth may still do.
    pub(super) granted: u32,
    /// Whether to do all remaining steps at once.
    pub(crate) finish: bool,
    /// Whether steps were done whose radii are not settled yet.
    pub(super) unsettled: bool,
    /// Nodes whose radius changed since the vessels were last published.
    pub(super) changed: ByKind<Vec<u32>>,
    /// Kinds whose vessels must be published again, from the first node on.
    pub(super) rebuild: ByKind<bool>,
    pub(super) costs: Costs,
}

impl GrowthState {
    /// The growth, whose trees are centre lines on the tissue. `None` until the tissue is ready, and after an error.
    pub fn growth(&self) -> Option<&dyn Growth> {
        self.growth.as_deref()
    }

    /// The growth that grows unseen on a repainted tissue, and will replace the [`growth`](Self::growth).
    pub fn successor(&self) -> Option<&dyn Growth> {
        self.successor.as_ref().map(|successor| &*successor.growth)
    }

    /// The tissue that is supplied, with its paint. `None` until it is ready.
    pub fn tissue(&self) -> Option<&dyn Tissue> {
        self.tissue.as_ref().map(|painted| &*painted.tissue)
    }

    /// The organ's mesh as the tissue is made of it, with its texture coordinates. `None` for other tissues, and until it is
    /// ready.
    pub fn mesh(&self) -> Option<&TriangleMesh> {
        self.tissue.as_ref().and_then(PaintedTissue::mesh)
    }

    /// That mesh with an index of its triangles, to find what a ray or a brush touches. The first call makes the index,
    /// in some ten milliseconds, if the tissue needs none itself.
    pub fn canvas(&self) -> Option<&IndexedMesh> {
        self.tissue.as_ref().and_then(PaintedTissue::canvas)
    }

    /// Why the growth failed, if it did.
    pub fn error(&self) -> Option<&OrganGrowthError> {
        self.error.as_ref()
    }

    /// Carries out a command, and returns whether the growth runs from now on.
    pub(crate) fn apply(&mut self, action: GrowthAction, control: GrowthControl) -> GrowthControl {
        match action {
            GrowthAction::Pause => {
                self.granted = 0;
                return GrowthControl::Paused;
            }
            GrowthAction::Resume => return GrowthControl::Running,
            GrowthAction::Step(steps) => {
                self.granted = self.granted.saturating_add(steps);
                return GrowthControl::Paused;
            }
            GrowthAction::Restart => {
                self.steps_to_repeat = 0;
                self.granted = 0;
                self.finish = false;
                self.demand(Need::Growth);
            }
            GrowthAction::Finish => {
                self.finish = true;
                self.skip_outdated();
            }
        }
        control
    }

    /// Compares the inputs with those that the growth follows, and demands the work that a difference needs.
    ///
    /// Growths with other settings or another seed grow unseen if `unseen`.
    pub(crate) fn follow(
        &mut self,
        (settings, seed, unseen): (Preset, u64, bool),
        paint: &TissuePaint,
        assets: SourceAssets,
    ) {
        self.unseen = unseen;
        let Some(followed) = &mut self.followed else {
            self.followed = Some(Followed { settings, seed, paint: Arc::new(paint.clone()), assets });
            self.demand(Need::Tissue);
            return;
        };
        let need = followed.need(&settings, seed, paint, assets);
        followed.assets = assets;
        if followed.settings != settings || followed.seed != seed {
            (followed.settings, followed.seed) = (settings, seed);
            self.steps_to_repeat = 0;
            self.other_settings = true;
        }
        if *followed.paint != *paint {
            followed.paint = Arc::new(paint.clone());
        }
        self.demand(need);
    }

    /// Notes how many steps an organ from a scene, or a clone, had done.
    pub(crate) fn resume(&mut self, steps: u32) {
        if self.followed.is_none() {
            self.steps_to_repeat = steps;
        }
    }

    /// Whether the growth follows assets other than these.
    pub(crate) fn follows_other_assets(&self, assets: SourceAssets) -> bool {
        self.followed.as_ref().is_none_or(|followed| followed.assets != assets)
    }

    /// The paint on the tissue, or the paint about to be laid.
    pub(crate) fn paint(&self) -> Arc<TissuePaint> {
        self.followed.as_ref().map(|followed| Arc::clone(&followed.paint)).unwrap_or_default()
    }

    /// Notes that a mesh asset has new content (`replaced`), or has been loaded at last.
    pub(crate) fn notice_mesh(&mut self, mesh: AssetId<Mesh>, replaced: bool) {
        let was_missing = matches!(self.error, Some(OrganGrowthError::Mesh(OrganMeshError::NotLoaded { .. })));
        if (replaced || was_missing) && self.followed.as_ref().is_some_and(|followed| followed.is_of_mesh(mesh)) {
            self.demand(Need::Tissue);
        }
    }

    /// Notes that an image asset has new content (`replaced`), or has been loaded at last.
    pub(crate) fn notice_image(&mut self, image: AssetId<Image>, replaced: bool) {
        let was_missing = matches!(self.error, Some(OrganGrowthError::Image(OrganImageError::NotLoaded { .. })));
        if (replaced || was_missing) && self.followed.as_ref().is_some_and(|followed| followed.is_of_image(image)) {
            self.demand(Need::Tissue);
        }
    }

    /// Whether the mesh that was read last could be an organ. If not, new vertex positions may mend it.
    pub(crate) fn has_good_mesh(&self) -> bool {
        !matches!(self.error, Some(OrganGrowthError::Mesh(_)))
    }

    fn demand(&mut self, need: Need) {
        self.need = self.need.max(need);
    }

    /// Demands that all steps are done as soon as possible. Drops a preparation under way, since its result is needed
    /// now.
    pub(crate) fn request_finish(&mut self) {
        self.finish = true;
        self.skip_outdated();
        if self.preparation.take().is_some() {
            self.demand(if self.tissue.is_none() {
                Need::Tissue
            } else if self.beside {
                Need::Paint
            } else {
                Need::Growth
            });
        }
    }

    /// Drops a successor whose settings are no longer asked for.
    fn skip_outdated(&mut self) {
        if self.awaits_settings() {
            self.successor = None;
            self.preparation.take_if(|_| self.beside);
        }
    }

    /// The work to do now. If it needs a tissue, that comes first, unless one is on its way.
    pub(crate) fn next_need(&self) -> Need {
        match self.need {
            Need::Growth | Need::Settings | Need::Paint if self.tissue.is_none() => {
                if self.preparation.is_some() {
                    Need::Nothing
                } else {
                    Need::Tissue
                }
            }
            // A slider that moves on lets each successor arrive, so that there is something to see.
            Need::Settings if self.unseen && self.beside && self.preparation.is_some() => Need::Nothing,
            Need::Settings if self.unseen && self.successor.is_some() => Need::Nothing,
            need => need,
        }
    }

    /// Whether settings have changed that no growth follows yet.
    pub(super) fn awaits_settings(&self) -> bool {
        self.need >= Need::Settings
    }

    /// Drops the tissue, the growth and a preparation under way, because they no longer belong to the organ.
    pub(crate) fn drop_tissue(&mut self) {
        self.preparation = None;
        self.tissue = None;
        self.tissue_lineage = Lineage::new_one();
        self.error = None;
        self.beside = false;
        self.successor = None;
        if self.growth.take().is_some() {
            self.begin_trees();
        }
    }

    /// Decides whether a growth that is about to start on other paint, or unseen, grows beside drawn vessels. It does if
    /// there are any.
    pub(crate) fn choose_place(&mut self, need: Need) {
        let has_grown = |growth: &dyn Growth| growth.is_finished() || growth.progress().done > 0;
        let may_be_beside = need == Need::Paint || (need == Need::Settings && self.unseen);
        self.beside = may_be_beside && self.growth().is_some_and(has_grown);
    }

    /// Whether the next growth to start grows unseen, beside vessels that stay meanwhile.
    pub(crate) fn is_beside(&self) -> bool {
        self.beside
    }

    /// Whether other vessels will replace the present ones but have not started: a tissue or paint is being prepared,
    /// or the start waits for its turn. Until then the present ones pause, since their steps would be useless.
    pub(crate) fn awaits_others(&self) -> bool {
        self.next_need() != Need::Nothing || self.preparation.is_some() || (self.beside && self.successor.is_none())
    }

    /// Drops the successors if the drawn vessels grew on the present paint and with the present settings, because a
    /// stroke was taken back.
    pub(crate) fn cancel_if_undone(&mut self) -> bool {
        let is_drawn = self.tissue.as_ref().is_some_and(|tissue| *tissue.paint == *self.paint());
        let is_undone = self.beside && is_drawn && !self.other_settings;
        if is_undone {
            (self.successor, self.preparation, self.error) = (None, None, None);
            self.need = Need::Nothing;
            self.beside = false;
        }
        is_undone
    }

    /// The current tissue, with the present paint if that has been laid already.
    pub(crate) fn tissue_at_hand(&self) -> Option<&PaintedTissue> {
        let paint = self.paint();
        let painted = self.successor.as_ref().map(|successor| &successor.tissue).into_iter().chain(&self.tissue);
        painted.clone().find(|tissue| *tissue.paint == *paint).or(self.tissue.as_ref())
    }

    /// Begins to wait for a tissue.
    pub(crate) fn await_tissue(&mut self, tissue: Arc<SharedTissue>) {
        self.wait_for(Preparation::Tissue(tissue));
    }

    /// Begins to wait for the start of a growth.
    pub(crate) fn await_start(&mut self, start: Job<Start>) {
        self.wait_for(Preparation::Start(start));
    }

    fn wait_for(&mut self, preparation: Preparation) {
        self.preparation = Some(preparation);
        self.successor = None;
        self.need = Need::Nothing;
    }

    /// Whether what is awaited is ready.
    pub(crate) fn is_prepared(&self) -> bool {
        self.preparation.as_ref().is_some_and(Preparation::is_ready)
    }

    /// Share of the preparation that is done, if one is under way.
    pub(crate) fn preparation_progress(&self) -> Option<f32> {
        self.preparation.as_ref().map(Preparation::progress)
    }

    /// Takes over an awaited tissue, once it is ready. A growth is to start on it then. `None` if the request has
    /// changed meanwhile, or something else is awaited.
    pub(crate) fn poll_tissue(&mut self) -> Option<Result<PaintedTissue, OrganGrowthError>> {
        let tissue = Preparation::poll_tissue(&mut self.preparation)?;
        (self.need != Need::Tissue).then_some(tissue)
    }

    /// The growth that was being started, once it is ready. `None` if the request has changed meanwhile: its tissue is
    /// kept, unless it is made from something else now; an error may be outdated.
    pub(crate) fn poll_start(&mut self) -> Option<Start> {
        let start = Preparation::poll_start(&mut self.preparation)?;
        let is_outdated = match (&start, self.need) {
            (_, Need::Tissue) => return None,
            (Ok(started), Need::Nothing | Need::Paint) => *started.tissue.paint != *self.paint(),
            (Ok(started), Need::Settings) if self.unseen && self.beside => *started.tissue.paint != *self.paint(),
            (Ok(_), Need::Settings | Need::Growth) => true,
            (Err(_), need) => need != Need::Nothing,
        };
        if !is_outdated {
            return Some(start);
        }
        if let Ok(started) = start {
            self.tissue.get_or_insert(started.tissue);
        }
        None
    }

    /// The order to start the growth that is asked for.
    pub(crate) fn order(&self, tissue: PaintedTissue, settings: Preset, seed: u64) -> StartOrder {
        StartOrder { tissue, paint: self.paint(), settings, seed }
    }

    /// Starts a growth now, on a tissue with its paint. Memory is reused if it is the current one.
    ///
    /// Returns the warnings about the settings that have not been given before.
    pub(crate) fn start_now(&mut self, order: StartOrder) -> Result<Vec<GrowthWarning>, OrganGrowthError> {
        let before = if self.beside { None } else { self.growth.take() };
        self.need = Need::Nothing;
        self.accept(order.carry_out_now(before))
    }

    /// Takes over a growth that has been started.
    ///
    /// Returns the warnings about the settings that have not been given before.
    pub(crate) fn accept(&mut self, started: StartedGrowth) -> Result<Vec<GrowthWarning>, OrganGrowthError> {
        // Settings that have changed since wait for this growth.
        self.need = if self.need == Need::Settings { Need::Settings } else { Need::Nothing };
        self.preparation = None;
        self.successor = None;
        self.error = None;
        let StartedGrowth { tissue, growth } = started;
        let warnings = if let (true, Some(drawn)) = (self.beside, &self.growth) {
            let growth = growth?;
            let warnings = growth.warnings();
            self.successor = Some(Successor::of(&**drawn, tissue, growth));
            // A generator may do everything at its start. No step follows then.
            self.succeed();
            warnings
        } else {
            self.begin_trees();
            self.other_settings = false;
            self.costs = Costs::default();
            self.tissue = Some(tissue);
            self.growth.insert(growth?).warnings()
        };
        self.beside = false;
        Ok(self.new_warnings(warnings))
    }

    /// Gives the trees new lineages.
    pub(super) fn begin_trees(&mut self) {
        self.lineages = ByKind::from_fn(|_| Lineage::new_one());
        self.rebuild = ByKind::from_fn(|_| true);
    }

    fn new_warnings(&mut self, warnings: Vec<GrowthWarning>) -> Vec<GrowthWarning> {
        let new = warnings.iter().filter(|warning| !self.warned.contains(warning)).cloned().collect();
        self.warned = warnings;
        new
    }

    /// Lets steps wait, or go on.
    pub(crate) fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Whether steps wait until severed vessels are whole again.
    pub(crate) fn is_held(&self) -> bool {
        self.held
    }

    /// Whether a step has panicked.
    pub(crate) fn has_panicked(&self) -> bool {
        self.panic.is_some()
    }

    /// Takes the panic of a step, as an error that ends the growth. If that was to replace drawn vessels, these stay.
    pub(crate) fn take_panic(&mut self) -> Option<OrganGrowthError> {
        let panic = self.panic.take()?;
        self.beside = self.successor.is_some();
        Some(panic.into())
    }

    /// Ends the work under way because of an error. Vessels of an earlier growth are dropped, too, since they are
    /// outdated. Vessels that wait for successors stay.
    pub(crate) fn fail(&mut self, error: OrganGrowthError) {
        self.need = Need::Nothing;
        self.preparation = None;
        self.successor = None;
        if !std::mem::take(&mut self.beside) {
            self.growth = None;
            self.begin_trees();
        }
        self.finish = false;
        self.error = Some(error);
    }

    /// The phase of a growth that has not failed.
    pub(crate) fn phase(&self) -> GrowthPhase {
        match self.growth() {
            Some(growth) if self.successor.is_none() && growth.is_finished() => GrowthPhase::Finished,
            _ => self.phase_of_steps(),
        }
    }

    /// The phase of a growth that starts, or that has just done a step.
    pub(crate) fn phase_of_steps(&self) -> GrowthPhase {
        match &self.successor {
            Some(_) => GrowthPhase::Regrowing,
            None if self.held => GrowthPhase::Held,
            None => GrowthPhase::Growing,
        }
    }

    /// Lineage of the tissue that it grows on. Each preparation changes it; paint does not.
    pub(crate) fn tissue_lineage(&self) -> Lineage {
        self.tissue_lineage
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::{
        growth::{shared::SharedTissues, state::*},
        job::{self, Jobs},
    };
    use crate::synthesis::{
        pace::Pace,
        preset::PresetName,
        tissue::{SourceData, TissueError, TissueShape},
    };
    use bevy::{
        app::{App, Update},
        ecs::{schedule::ScheduleLabel, system::SystemState},
    };

    /// Lets a growth wait for a start, which is done.
    fn await_done<W: Future<Output = Start> + Send + 'static>(state: &mut GrowthState, start: impl FnOnce(Pace) -> W) {
        let mut app = App::new();
        job::register(&mut app, Update.intern());
        let mut jobs = SystemState::<Jobs>::new(app.world_mut());
        state.await_start(jobs.get(app.world()).expect("jobs are registered").start(0, start));
        assert!(state.is_prepared());
    }

    /// A growth that waits for a start, which is done.
    fn prepared<W: Future<Output = Start> + Send + 'static>(start: impl FnOnce(Pace) -> W) -> GrowthState {
        let mut state = GrowthState::default();
        await_done(&mut state, start);
        state
    }

    /// A growth that follows settings and waits for the tissue of a ball, which is there.
    fn with_ball() -> (GrowthState, Preset) {
        let mut state = GrowthState::default();
        let wish = Preset { tissue: TissueShape::ball(1.0).into(), ..PresetName::Paper.load() };
        state.follow((wish.clone(), 0, false), &TissuePaint::default(), SourceAssets::default());
        let shared = SharedTissues::default().get(&wish.tissue, SourceAssets::default());
        shared.fill(wish.tissue.prepare(&SourceData::default()).map_err(Into::into));
        state.await_tissue(shared);
        (state, wish)
    }

    #[test]
    fn a_start_that_panics_is_an_error_and_can_be_tried_again() {
        let mut state = prepared(async |_| panic!("a vertex of {} edges", 1));
        let Some(Err(error)) = state.poll_start() else { panic!("an error") };
        assert!(matches!(&error, OrganGrowthError::Panicked(_)) && error.to_string().contains("a vertex of 1 edges"));
        state.fail(error);
        assert!(state.error().is_some() && !state.is_prepared());
        state.apply(GrowthAction::Restart, GrowthControl::Running);
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn what_was_wrong_does_not_count_once_something_else_is_asked_for() {
        let mut state = prepared(async |_| Err(TissueError::NoMesh.into()));
        state.apply(GrowthAction::Restart, GrowthControl::Running);
        assert!(state.poll_start().is_none());
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn a_tissue_is_outdated_once_the_organ_is_made_from_something_else() {
        let (mut state, mut wish) = with_ball();
        assert!(state.is_prepared());
        wish.tissue = TissueShape::ball(2.0).into();
        state.follow((wish, 0, false), &TissuePaint::default(), SourceAssets::default());
        assert!(state.poll_tissue().is_none());
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn a_start_with_another_seed_leaves_its_tissue() {
        let (mut state, wish) = with_ball();
        let tissue = state.poll_tissue().expect("it is there").expect("a ball");
        let order = state.order(tissue, wish.clone(), 0);
        await_done(&mut state, |pace| order.carry_out(pace));
        state.follow((wish, 1, false), &TissuePaint::default(), SourceAssets::default());
        assert_eq!(state.next_need(), Need::Nothing, "it waits for the tissue");
        assert!(state.poll_start().is_none());
        assert_eq!(state.next_need(), Need::Settings, "on the tissue at hand");
        assert!(state.tissue().is_some() && state.growth().is_none());
    }

    #[test]
    fn a_restart_without_tissue_prepares_it() {
        let mut state = GrowthState::default();
        state.apply(GrowthAction::Restart, GrowthControl::Running);
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn commands_grant_steps_to_a_paused_growth() {
        let mut state = GrowthState::default();
        assert_eq!(state.apply(GrowthAction::Step(2), GrowthControl::Running), GrowthControl::Paused);
        assert_eq!(state.granted, 2);
        assert_eq!(state.apply(GrowthAction::Pause, GrowthControl::Paused), GrowthControl::Paused);
        assert_eq!(state.granted, 0);
        assert_eq!(state.apply(GrowthAction::Resume, GrowthControl::Paused), GrowthControl::Running);
        assert_eq!(state.apply(GrowthAction::Finish, GrowthControl::Paused), GrowthControl::Paused);
        assert!(state.finish);
    }
}
