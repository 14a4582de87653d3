//! The plugin's state of a growing organ: the tissue, the growth, and the work still to do.
//!
//! The inputs of a growth are in [`followed`](super::followed), its steps and their changes in [`steps`](super::steps).

use crate::plugin::{
    growth::{
        budget::Costs,
        followed::{Followed, Need, SourceAssets},
        messages::{GrowthAction, OrganGrowthError},
        progress::{GrowthControl, GrowthPhase},
        successor::Successor,
        tissue::{Painted, PaintedTissue},
    },
    job::Job,
    lineage::Lineage,
    organ::{image::OrganImageError, mesh::OrganMeshError},
};
use crate::synthesis::{
    growth::{Growth, GrowthWarning},
    mesh::TriangleMesh,
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
    /// A tissue being prepared or painted. Dropping the job stops it, so no outdated tissue ever arrives.
    preparation: Option<Job<Painted>>,
    /// Whether the next growth to start grows unseen, beside vessels that stay meanwhile.
    beside: bool,
    pub(super) tissue: Option<PaintedTissue>,
    /// Lineage of the current or coming tissue. Paint does not change it.
    tissue_lineage: Lineage,
    pub(super) growth: Option<Box<dyn Growth>>,
    /// The growth that will replace this one.
    pub(super) successor: Option<Successor>,
    /// Lineages of the growth's trees.
    pub(super) lineages: ByKind<Lineage>,
    error: Option<OrganGrowthError>,
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
            GrowthAction::Finish => self.finish = true,
        }
        control
    }

    /// Compares the inputs with those that the growth follows, and demands the work that a difference needs.
    pub(crate) fn follow(&mut self, settings: Preset, seed: u64, paint: &TissuePaint, assets: SourceAssets) {
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

    /// The work to do now. If it needs a tissue, that comes first, unless one is on its way.
    pub(crate) fn next_need(&self) -> Need {
        match self.need {
            Need::Growth | Need::Paint if self.tissue.is_none() && self.preparation.is_some() => Need::Nothing,
            Need::Growth | Need::Paint if self.tissue.is_none() => Need::Tissue,
            need => need,
        }
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

    /// Decides whether a growth that is about to start on other paint grows beside drawn vessels. It does if there are
    /// any.
    pub(crate) fn choose_place(&mut self, need: Need) {
        let has_grown = |growth: &dyn Growth| growth.is_finished() || growth.progress().done > 0;
        self.beside = need == Need::Paint && self.growth().is_some_and(has_grown);
    }

    /// Whether the next growth to start grows unseen, beside vessels that stay meanwhile.
    pub(crate) fn is_beside(&self) -> bool {
        self.beside
    }

    /// Whether other vessels will replace the present ones but have not started: a tissue or paint is being prepared,
    /// or the start waits for its turn. Until then the present ones pause, since their steps would be useless.
    pub(crate) fn awaits_others(&self) -> bool {
        self.need != Need::Nothing || self.preparation.is_some() || (self.beside && self.successor.is_none())
    }

    /// Drops the successors if the drawn vessels grew on the present paint, because a stroke was taken back.
    pub(crate) fn cancel_if_undone(&mut self) -> bool {
        let is_drawn = self.tissue.as_ref().is_some_and(|tissue| *tissue.paint == *self.paint());
        let is_undone = self.beside && is_drawn;
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
    pub(crate) fn await_tissue(&mut self, preparation: Job<Painted>) {
        self.preparation = Some(preparation);
        self.successor = None;
        self.need = Need::Nothing;
    }

    /// Whether a tissue has been prepared and its growth has not started.
    pub(crate) fn is_tissue_ready(&self) -> bool {
        self.preparation.as_ref().is_some_and(Job::is_done)
    }

    /// Share of the preparation that is done, if one is under way.
    pub(crate) fn preparation_progress(&self) -> Option<f32> {
        self.preparation.as_ref().map(Job::progress)
    }

    /// The result of the preparation, once it is ready. `None` if the request has changed meanwhile: a tissue is kept,
    /// to be painted again, unless it is made from something else now; an error may be outdated.
    pub(crate) fn poll_preparation(&mut self) -> Option<Painted> {
        match Job::poll(&mut self.preparation)?.unwrap_or_else(|panic| Err(panic.into())) {
            _ if self.need == Need::Tissue => None,
            Ok(tissue) if *tissue.paint != *self.paint() => {
                self.tissue.get_or_insert(tissue);
                None
            }
            Err(_) if self.need != Need::Nothing => None,
            result => Some(result),
        }
    }

    /// Starts the growth on a tissue. Buffers are reused if it is the current one.
    ///
    /// Returns the warnings about the settings that have not been given before.
    pub(crate) fn start(
        &mut self,
        painted: PaintedTissue,
        settings: Preset,
        seed: u64,
    ) -> Result<Vec<GrowthWarning>, OrganGrowthError> {
        self.need = Need::Nothing;
        self.preparation = None;
        self.successor = None;
        self.error = None;
        let tissue = Arc::clone(&painted.tissue);
        let Preset { mut generator, roots, fit, .. } = settings;
        if fit {
            generator = generator.fit(tissue.extent());
        }
        let roots = roots.into();
        let warnings = if let (true, Some(drawn)) = (self.beside, &self.growth) {
            let growth = generator.start(tissue, &roots, seed)?;
            let warnings = growth.warnings();
            self.successor = Some(Successor::of(&**drawn, painted, growth));
            // A generator may do everything at its start. No step follows then.
            self.succeed();
            warnings
        } else {
            self.begin_trees();
            self.costs = Costs::default();
            self.tissue = Some(painted);
            let growth = match self.growth.take() {
                Some(growth) => generator.restart(growth, tissue, &roots, seed),
                None => generator.start(tissue, &roots, seed),
            }?;
            self.growth.insert(growth).warnings()
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
        if self.successor.is_some() { GrowthPhase::Regrowing } else { GrowthPhase::Growing }
    }

    /// Lineage of the tissue that it grows on. Each preparation changes it; paint does not.
    pub(crate) fn tissue_lineage(&self) -> Lineage {
        self.tissue_lineage
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::{
        growth::{state::*, tissue::SourceCopy},
        job::{self, Jobs},
    };
    use crate::synthesis::{
        pace::Pace,
        preset::PresetName,
        tissue::{TissueError, TissueShape},
    };
    use bevy::{
        app::{App, Update},
        ecs::{schedule::ScheduleLabel, system::SystemState},
    };

    /// A growth that waits for a preparation, which is done.
    fn prepared<W: Future<Output = Painted> + Send + 'static>(preparation: impl FnOnce(Pace) -> W) -> GrowthState {
        let mut state = GrowthState::default();
        await_done(&mut state, preparation);
        state
    }

    /// Lets a growth wait for a preparation, which is done.
    fn await_done<W: Future<Output = Painted> + Send + 'static>(
        state: &mut GrowthState,
        preparation: impl FnOnce(Pace) -> W,
    ) {
        let mut app = App::new();
        job::register(&mut app, Update.intern());
        let mut jobs = SystemState::<Jobs>::new(app.world_mut());
        state.await_tissue(jobs.get(app.world()).expect("jobs are registered").start(0, preparation));
        assert!(state.is_tissue_ready());
    }

    #[test]
    fn a_preparation_that_panics_is_an_error_and_can_be_tried_again() {
        let mut state = prepared(async |_| panic!("a vertex of {} edges", 1));
        let Some(Err(error)) = state.poll_preparation() else { panic!("an error") };
        assert!(matches!(&error, OrganGrowthError::Panicked(_)) && error.to_string().contains("a vertex of 1 edges"));
        state.fail(error);
        assert!(state.error().is_some() && !state.is_tissue_ready());
        state.apply(GrowthAction::Restart, GrowthControl::Running);
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn what_was_wrong_does_not_count_once_something_else_is_asked_for() {
        let mut state = prepared(async |_| Err(TissueError::NoMesh.into()));
        state.apply(GrowthAction::Restart, GrowthControl::Running);
        assert!(state.poll_preparation().is_none());
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn a_tissue_is_outdated_once_the_organ_is_made_from_something_else() {
        let mut state = GrowthState::default();
        let mut wish = Preset { tissue: TissueShape::ball(1.0).into(), ..PresetName::Paper.load() };
        state.follow(wish.clone(), 0, &TissuePaint::default(), SourceAssets::default());
        let ball = wish.tissue.clone();
        await_done(&mut state, |pace| SourceCopy::Nothing.prepare(ball, Arc::default(), pace));
        wish.tissue = TissueShape::ball(2.0).into();
        state.follow(wish, 0, &TissuePaint::default(), SourceAssets::default());
        assert!(state.poll_preparation().is_none());
        assert_eq!(state.next_need(), Need::Tissue);
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
