//! What the plugin keeps about an organ while it grows: the tissue, the growth, and what is still to be done.

use crate::plugin::{
    growth::{
        budget::{LastCosts, StepCost},
        messages::{GrowthAction, OrganGrowthError},
        progress::GrowthControl,
        vasculature::Vasculature,
    },
    job::Job,
    organ::mesh::OrganMeshError,
    vessels::lineage::Lineage,
};
use crate::synthesis::{
    growth::{GrownTree, Growth, GrowthWarning, TreeUpdate},
    tissue::Tissue,
    tree::{ByKind, VesselKind},
};
use bevy::{asset::AssetId, ecs::component::Component, mesh::Mesh};
use std::{sync::Arc, time::Duration};

/// A tissue, or why there is none.
pub(crate) type Prepared = Result<Arc<dyn Tissue>, OrganGrowthError>;

/// What must be done before an organ can grow on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    /// Nothing.
    #[default]
    Nothing,
    /// To start the growth again, on the same tissue.
    Growth,
    /// To prepare the tissue, then to start the growth.
    Tissue,
}

/// The growth of an organ under way. For reading: the plugin drives it.
#[derive(Component, Debug, Default)]
pub struct GrowthState {
    /// What must be done next.
    pub(crate) need: Need,
    /// The wishes and the mesh that the growth follows, or is about to.
    followed: Option<(Vasculature, Option<AssetId<Mesh>>)>,
    /// A tissue being prepared. To let go of the job stops it, so that no outdated tissue ever arrives.
    preparation: Option<Job<Prepared>>,
    tissue: Option<Arc<dyn Tissue>>,
    /// Which tissue it is, or will be when it is ready.
    tissue_lineage: Lineage,
    growth: Option<Box<dyn Growth>>,
    /// Which trees are those of the growth.
    lineages: ByKind<Lineage>,
    error: Option<OrganGrowthError>,
    /// Warnings that have been given for the settings.
    warned: Vec<GrowthWarning>,
    /// Steps that the growth had done when its organ was saved, and does again at once.
    arrears: u32,
    /// Steps that a paused growth may still do.
    granted: u32,
    /// Whether all remaining steps are to be done at once.
    pub(crate) finish: bool,
    /// Whether steps were done whose radii are not known yet.
    unsettled: bool,
    /// Nodes whose radius changed since the vessels were last published.
    changed: ByKind<Vec<u32>>,
    /// Which vessels are to be published anew, from the first node on.
    rebuild: ByKind<bool>,
    costs: Costs,
}

/// What steps have cost.
#[derive(Debug, Default)]
struct Costs {
    steps: LastCosts,
    /// Settling and publishing, for each step that was published.
    publishing: LastCosts,
    /// Settling, since the vessels were last published.
    settling: Duration,
    /// Steps that haven't been published.
    unpublished: u32,
}

impl GrowthState {
    /// The growth: its trees are the centre lines on the tissue. `None` until the tissue is ready, and after an error.
    pub fn growth(&self) -> Option<&dyn Growth> {
        self.growth.as_deref()
    }

    /// The tissue that is supplied. `None` until it is ready.
    pub fn tissue(&self) -> Option<&dyn Tissue> {
        self.tissue.as_deref()
    }

    /// Why the growth failed, if it did.
    pub fn error(&self) -> Option<&OrganGrowthError> {
        self.error.as_ref()
    }

    /// Does what a command says, and gives whether the growth goes on by itself from now on.
    pub(crate) fn obey(&mut self, action: GrowthAction, control: GrowthControl) -> GrowthControl {
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
                self.arrears = 0;
                self.granted = 0;
                self.finish = false;
                self.demand(Need::Growth);
            }
            GrowthAction::Finish => self.finish = true,
        }
        control
    }

    /// Compares what is wished for with what the growth follows, and demands what the difference needs.
    pub(crate) fn follow(&mut self, vasculature: &Vasculature, mesh: Option<AssetId<Mesh>>) {
        let need = difference(self.followed.as_ref(), vasculature, mesh);
        if need != Need::Nothing {
            if self.followed.as_ref().is_some_and(|(before, _)| before != vasculature) {
                self.arrears = 0;
            }
            self.followed = Some((vasculature.clone(), mesh));
            self.demand(need);
        }
    }

    /// Takes note of how far the growth of an organ was that comes from a scene or is a clone.
    pub(crate) fn resume(&mut self, steps: u32) {
        if self.followed.is_none() {
            self.arrears = steps;
        }
    }

    /// Whether there are steps to be done again at once.
    pub(crate) fn is_in_arrears(&self) -> bool {
        self.arrears > 0 && self.growth.is_some()
    }

    /// Whether the growth follows another mesh asset than this one.
    pub(crate) fn follows_other_mesh(&self, mesh: Option<AssetId<Mesh>>) -> bool {
        self.followed.as_ref().is_none_or(|(_, followed)| *followed != mesh)
    }

    /// Takes note that a mesh asset has new content (`replaced`), or has been loaded at last.
    pub(crate) fn notice_mesh(&mut self, mesh: AssetId<Mesh>, replaced: bool) {
        let was_missing = matches!(self.error, Some(OrganGrowthError::Mesh(OrganMeshError::NotLoaded { .. })));
        if (replaced || was_missing) && !self.follows_other_mesh(Some(mesh)) {
            self.demand(Need::Tissue);
        }
    }

    fn demand(&mut self, need: Need) {
        self.need = self.need.max(need);
    }

    /// Wants all steps done as soon as can be, and no preparation under way: what it prepares is needed now.
    pub(crate) fn hasten(&mut self) {
        self.finish = true;
        if self.preparation.take().is_some() {
            self.demand(Need::Tissue);
        }
    }

    /// What there is to do now. A growth without a tissue needs one first, unless it is on its way.
    pub(crate) fn next_need(&self) -> Need {
        match self.need {
            Need::Growth if self.tissue.is_none() && self.preparation.is_some() => Need::Nothing,
            Need::Growth if self.tissue.is_none() => Need::Tissue,
            need => need,
        }
    }

    /// Lets go of tissue and growth, and of a preparation under way, because they no longer belong to the organ.
    pub(crate) fn drop_tissue(&mut self) {
        self.preparation = None;
        self.tissue = None;
        self.tissue_lineage = Lineage::new_one();
        self.error = None;
        if self.growth.take().is_some() {
            self.begin_trees();
        }
    }

    /// Waits for a tissue from now on.
    pub(crate) fn await_tissue(&mut self, preparation: Job<Prepared>) {
        self.preparation = Some(preparation);
        self.need = Need::Nothing;
    }

    /// Whether a tissue has been prepared and waits to be grown on.
    pub(crate) fn is_tissue_ready(&self) -> bool {
        self.preparation.as_ref().is_some_and(Job::is_done)
    }

    /// Share of the preparation under way that is done, if there is one.
    pub(crate) fn preparation_progress(&self) -> Option<f32> {
        self.preparation.as_ref().map(Job::progress)
    }

    /// The result of the preparation, once it is there.
    pub(crate) fn poll_preparation(&mut self) -> Option<Prepared> {
        Job::poll(&mut self.preparation)
    }

    /// Starts the growth on a new tissue, or on the one at hand, where its buffers are used again.
    ///
    /// Gives the warnings about the settings that have not been given before.
    pub(crate) fn start(
        &mut self,
        new_tissue: Option<Arc<dyn Tissue>>,
        wish: &Vasculature,
    ) -> Result<Vec<GrowthWarning>, OrganGrowthError> {
        if let Some(tissue) = new_tissue {
            self.growth = None;
            self.tissue = Some(tissue);
        }
        self.need = Need::Nothing;
        self.error = None;
        self.begin_trees();
        self.costs = Costs::default();
        let Some(tissue) = self.tissue.clone() else { return Ok(Vec::new()) };
        let mut generator = wish.generator.clone();
        if wish.fit {
            generator = generator.fit(tissue.extent());
        }
        let roots = wish.roots.clone().into();
        let growth = match self.growth.take() {
            Some(growth) => generator.restart(growth, tissue, &roots, wish.seed),
            None => generator.start(tissue, &roots, wish.seed),
        }?;
        let warnings = growth.warnings();
        self.growth = Some(growth);
        Ok(self.unheard(warnings))
    }

    /// The trees from now on are other ones than before.
    fn begin_trees(&mut self) {
        self.lineages = ByKind::from_fn(|_| Lineage::new_one());
        self.rebuild = ByKind::from_fn(|_| true);
    }

    fn unheard(&mut self, warnings: Vec<GrowthWarning>) -> Vec<GrowthWarning> {
        let unheard = warnings.iter().filter(|warning| !self.warned.contains(warning)).cloned().collect();
        self.warned = warnings;
        unheard
    }

    /// Ends what is under way because of an error. Vessels of an earlier growth go, too: they are not what is wished for.
    pub(crate) fn fail(&mut self, error: OrganGrowthError) {
        self.need = Need::Nothing;
        self.preparation = None;
        self.growth = None;
        self.begin_trees();
        self.finish = false;
        self.error = Some(error);
    }

    /// Whether a step may be done now.
    pub(crate) fn may_step(&self, control: GrowthControl) -> bool {
        let willing = control == GrowthControl::Running || self.granted > 0 || self.finish;
        willing && self.growth().is_some_and(|growth| !growth.is_finished())
    }

    /// Does one step, whose radii are to be [settled](Self::settle). Without a growth, or at its end, nothing is done.
    pub(crate) fn step(&mut self) {
        let Some(growth) = self.growth.as_mut().filter(|growth| !growth.is_finished()) else { return };
        growth.advance();
        self.granted = self.granted.saturating_sub(1);
        self.unsettled = true;
    }

    /// Whether there are steps whose radii are to be settled.
    pub(crate) fn is_unsettled(&self) -> bool {
        self.unsettled
    }

    /// Renews the radii after a frame's last step, and remembers what the steps changed. Many steps change the same radii,
    /// those of the trunks: once is enough.
    pub(crate) fn settle(&mut self) {
        self.unsettled = false;
        let Some(growth) = self.growth.as_mut() else { return };
        growth.settle();
        self.take_updates();
    }

    /// Remembers what the last settling changed.
    fn take_updates(&mut self) {
        let Some(growth) = &self.growth else { return };
        for kind in VesselKind::ALL {
            match growth.update(kind) {
                TreeUpdate::Grown { .. } if self.rebuild[kind] => {}
                TreeUpdate::Grown { changed } => self.changed[kind].extend_from_slice(changed),
                TreeUpdate::Replaced => {
                    self.lineages[kind] = Lineage::new_one();
                    self.rebuild[kind] = true;
                }
            }
        }
    }

    /// Takes note of what settling cost.
    pub(crate) fn note_settling(&mut self, cost: Duration) {
        self.costs.settling += cost;
    }

    /// Takes note of what a step cost.
    pub(crate) fn note_step(&mut self, cost: Duration) {
        self.costs.steps.add(cost);
        self.costs.unpublished += 1;
    }

    /// What the next step is expected to cost.
    pub(crate) fn expected_cost(&self) -> StepCost {
        StepCost { step: self.costs.steps.expected(), publish: self.costs.publishing.expected() }
    }

    /// Does the steps again that were done before the organ was saved.
    pub(crate) fn catch_up(&mut self) {
        for _ in 0..std::mem::take(&mut self.arrears) {
            let Some(growth) = self.growth.as_mut().filter(|growth| !growth.is_finished()) else { break };
            growth.advance();
        }
        self.settle();
    }

    /// Does all remaining steps.
    pub(crate) fn run(&mut self) {
        // With so many steps, taking everything anew is cheaper than to remember every change.
        self.rebuild = ByKind::from_fn(|_| true);
        self.finish = false;
        if let Some(growth) = self.growth.as_mut() {
            growth.run();
        }
        self.take_updates();
    }

    /// Whether there is something to publish.
    pub(crate) fn has_news(&self) -> bool {
        self.rebuild.values().any(|&rebuild| rebuild) || self.changed.values().any(|changed| !changed.is_empty())
    }

    /// What is to be published of a kind: its tree and the nodes that changed, `None` for all of them.
    pub(crate) fn news(&self, kind: VesselKind) -> (Option<GrownTree<'_>>, Option<&[u32]>) {
        let changed = (!self.rebuild[kind]).then_some(self.changed[kind].as_slice());
        (self.growth.as_ref().and_then(|growth| growth.trees()[kind]), changed)
    }

    /// Which tree that of a kind is: another one after each start, and where the generator replaced it.
    pub(crate) fn lineage(&self, kind: VesselKind) -> Lineage {
        self.lineages[kind]
    }

    /// Which tissue it grows on: another one after each preparation.
    pub(crate) fn tissue_lineage(&self) -> Lineage {
        self.tissue_lineage
    }

    /// Forgets what has been published, at this cost.
    pub(crate) fn clear_news(&mut self, cost: Duration) {
        let cost = cost + std::mem::take(&mut self.costs.settling);
        if let Some(each) = cost.checked_div(std::mem::take(&mut self.costs.unpublished)) {
            self.costs.publishing.add(each);
        }
        self.rebuild = ByKind::default();
        self.changed.values_mut().for_each(Vec::clear);
    }
}

/// What the difference between the followed wishes and the present ones needs.
fn difference(
    followed: Option<&(Vasculature, Option<AssetId<Mesh>>)>,
    wish: &Vasculature,
    mesh: Option<AssetId<Mesh>>,
) -> Need {
    match followed {
        Some((old, old_mesh)) if old.tissue == wish.tissue && *old_mesh == mesh => {
            if old == wish {
                Need::Nothing
            } else {
                Need::Growth
            }
        }
        _ => Need::Tissue,
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::growth::state::*;

    #[test]
    fn only_mesh_and_tissue_need_a_new_tissue() {
        let old = Vasculature::default();
        let mesh = Some(AssetId::default());
        let followed = (old.clone(), mesh);
        assert_eq!(difference(None, &old, mesh), Need::Tissue);
        assert_eq!(difference(Some(&followed), &old, mesh), Need::Nothing);
        assert_eq!(difference(Some(&followed), &old, None), Need::Tissue);
        assert_eq!(difference(Some(&followed), &old.clone().with_seed(1), mesh), Need::Growth);
        let unfitted = Vasculature { fit: false, ..old };
        assert_eq!(difference(Some(&followed), &unfitted, mesh), Need::Growth);
    }

    #[test]
    fn a_restart_without_tissue_prepares_it() {
        let mut state = GrowthState::default();
        state.obey(GrowthAction::Restart, GrowthControl::Running);
        assert_eq!(state.next_need(), Need::Tissue);
    }

    #[test]
    fn commands_grant_steps_to_a_paused_growth() {
        let mut state = GrowthState::default();
        assert_eq!(state.obey(GrowthAction::Step(2), GrowthControl::Running), GrowthControl::Paused);
        assert_eq!(state.granted, 2);
        assert_eq!(state.obey(GrowthAction::Pause, GrowthControl::Paused), GrowthControl::Paused);
        assert_eq!(state.granted, 0);
        assert_eq!(state.obey(GrowthAction::Resume, GrowthControl::Paused), GrowthControl::Running);
        assert_eq!(state.obey(GrowthAction::Finish, GrowthControl::Paused), GrowthControl::Paused);
        assert!(state.finish);
    }
}
