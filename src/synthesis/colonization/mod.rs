//! Vessel growth by space colonization: drains pull, nodes follow, Murray's law sets radii and angles.
//!
//! In: a [`Tissue`], [`ColonizationSettings`], [`Roots`] and a seed. Out: two [`VesselTree`]s, arterial and venous, a
//! little larger after each [`Colonization::step`]. Source: Rauch & Harders, "Interactive Synthesis of 3D Geometries of Blood
//! Vessels", Eurographics 2021 (short papers), section 3.
//!
//! A step samples the tissue for new oxygen drains, grows the arteries towards them, hands the supplied drains to the
//! venous system as carbon-dioxide sources, grows the veins towards those, and lets the tissue grow.
//!
//! A step depends on the settings and the seed alone, not on time, frames or the number of threads.

mod candidates;
mod company;
mod direction;
mod drains;
mod forest;
mod lengths;
mod perception;
mod powers;
mod report;
pub mod seam;
mod settings;
mod step;
mod system_growth;
#[cfg(test)]
mod tests;
mod vacancy;
mod validity;

pub use report::{StepReport, SystemReport};
pub use settings::{AngleSpread, ColonizationSettings, SettingsError, SettingsWarning, SystemSettings};

use crate::synthesis::parallel;
use crate::synthesis::roots::{RootError, Roots};
use crate::synthesis::tissue::{Derived, Tissue, TissuePoint};
use crate::synthesis::tree::{BedLink, ByKind, NodeId, VesselKind, VesselTree};
use bevy_math::Vec3;
use candidates::{Candidates, Draws};
use company::{Company, Veins};
use std::sync::Arc;
use step::Step;
use system_growth::SystemGrowth;
use vacancy::Vacancy;

/// The reason why growth could not start.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ColonizationError {
    /// A setting outside its limits.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Roots that do not fit the tissue.
    #[error(transparent)]
    Roots(#[from] RootError),
    /// The arteries have no root, and the veins follow the arteries.
    #[error("the arterial system has no root; place at least one, or give it a tree to grow from")]
    NoArterialRoot,
    /// A given tree with a radius that no vessel with the settings' terminals can have.
    #[error(
        "node {node} of the given {} tree has a radius of {radius}, and terminals have {terminal}; it must be \
        1e-6 to 1e6 times that: scale the tree or the terminal radius", kind.name()
    )]
    GivenRadius {
        /// The kind of the tree.
        kind: VesselKind,
        /// The first such node.
        node: usize,
        /// Its radius.
        radius: f32,
        /// The terminal radius of the settings.
        terminal: f32,
    },
}

/// A colonization under way.
///
/// Make one with [`new`](Self::new), call [`step`](Self::step) until [`is_finished`](Self::is_finished), or
/// [`run`](Self::run), and read [`tree`](Self::tree) or [`vessels`](Self::vessels) at any time between.
#[derive(Debug)]
pub struct Colonization {
    tissue: Arc<dyn Tissue>,
    settings: ColonizationSettings,
    systems: [SystemGrowth; 2],
    step: u32,
    /// Number of last steps in a row without growth.
    idle: u32,
    draws: Draws,
    candidates: Candidates,
    vacancy: Vacancy,
    links: Vec<BedLink>,
    /// What was derived from the tissue, if it keeps nothing itself.
    derived: Derived,
}

impl Colonization {
    /// The kinds of vessels that colonization grows, in the order in which a step grows them.
    pub const KINDS: [VesselKind; 2] = [VesselKind::Artery, VesselKind::Vein];

    /// Prepares a growth. Lengths in the settings are the tissue's: see [`ColonizationSettings::fit`].
    ///
    /// # Errors
    /// A setting outside its limits, roots that are not finite or too far from the tissue, or no arterial root.
    pub fn new(
        tissue: Arc<dyn Tissue>,
        settings: ColonizationSettings,
        roots: &Roots,
        seed: u64,
    ) -> Result<Self, ColonizationError> {
        settings.validate()?;
        let derived = Derived::default();
        let placed = Self::placed((tissue.as_ref(), &derived), &settings, roots, seed)?;
        let bounds = tissue.bounds();
        let systems = settings.systems().map(|(_, settings)| SystemGrowth::new(settings, &bounds));
        let mut growth = Self {
            tissue,
            settings,
            systems,
            step: 0,
            idle: 0,
            draws: Draws::new(seed),
            candidates: Candidates::default(),
            vacancy: Vacancy::default(),
            links: Vec::new(),
            derived,
        };
        growth.reset_vacancy();
        growth.plant(&placed, roots);
        Ok(growth)
    }

    /// Starts again on the same tissue with other settings, roots or seed, keeping all memory.
    ///
    /// # Errors
    /// As [`new`](Self::new); the growth is unchanged then.
    pub fn restart(
        &mut self,
        settings: ColonizationSettings,
        roots: &Roots,
        seed: u64,
    ) -> Result<(), ColonizationError> {
        settings.validate()?;
        let placed = Self::placed((self.tissue.as_ref(), &self.derived), &settings, roots, seed)?;
        let bounds = self.tissue.bounds();
        for (system, (_, settings)) in self.systems.iter_mut().zip(settings.systems()) {
            system.restart(settings, &bounds);
        }
        self.settings = settings;
        self.draws.restart(seed);
        (self.step, self.idle) = (0, 0);
        self.links.clear();
        self.reset_vacancy();
        self.plant(&placed, roots);
        Ok(())
    }

    fn placed(
        (tissue, derived): (&dyn Tissue, &Derived),
        settings: &ColonizationSettings,
        roots: &Roots,
        seed: u64,
    ) -> Result<ByKind<Vec<TissuePoint>>, ColonizationError> {
        let placed = roots.resolve_with(tissue, &settings.root_spacing(), seed, derived)?;
        for (kind, system) in settings.systems() {
            check_radii(kind, system, roots.given[kind].as_ref())?;
        }
        let given = roots.given.artery.as_ref().is_some_and(|tree| !tree.is_empty());
        if placed.artery.is_empty() && !given { Err(ColonizationError::NoArterialRoot) } else { Ok(placed) }
    }

    fn reset_vacancy(&mut self) {
        let arterial = &self.settings.arterial;
        let samples = u64::from(self.settings.steps) * u64::from(self.settings.samples);
        self.vacancy.reset([arterial.node_birth_distance, arterial.drain_birth_distance], samples);
    }

    fn plant(&mut self, placed: &ByKind<Vec<TissuePoint>>, roots: &Roots) {
        let step = Step { tissue: self.tissue.as_ref(), settings: &self.settings, number: 1 };
        for (kind, system) in Self::KINDS.into_iter().zip(&mut self.systems) {
            system.plant(&placed[kind], roots.given[kind].as_ref(), step.ground());
        }
    }

    /// Grows all vessels by one step. Does nothing once growth is finished.
    pub fn step(&mut self) -> StepReport {
        let report = self.advance();
        self.settle();
        report
    }

    /// As [`step`](Self::step), but does not update the radii until the next [`settle`](Self::settle): for several
    /// steps in a row whose trees are not read in between. New nodes have the radius of a tip until then.
    pub fn advance(&mut self) -> StepReport {
        if self.is_finished() {
            return StepReport { step: self.step, ..StepReport::default() };
        }
        self.step += 1;
        let step = Step { tissue: self.tissue.as_ref(), settings: &self.settings, number: self.step };
        let [arteries, veins] = &mut self.systems;
        step.choose_candidates((&mut self.draws, None), &mut self.candidates, &mut self.vacancy, arteries);
        let (born, arterial) = step.grow_arteries(arteries, &self.candidates, &mut self.vacancy);
        let venous = step.grow_veins(veins, arteries.supplied(), &mut self.links);
        let acted = born > 0 || arterial.new_nodes > 0 || venous.new_nodes > 0;
        self.idle = step.idle_after(self.idle, acted);
        StepReport { step: step.number, sampled: self.settings.samples, born, arterial, venous }
    }

    /// Computes by Murray's law all radii that the steps since the last settling changed.
    pub fn settle(&mut self) {
        self.systems.iter_mut().for_each(|system| system.forest.settle());
    }

    /// Does all remaining steps.
    ///
    /// Arteries don't depend on veins. So another thread, if there is one, grows the veins behind them, and draws candidates
    /// ahead of them. Where it doesn't come to that, since other programs keep it busy, this thread does so.
    pub fn run(&mut self) {
        parallel::within_pool(|| self.run_in_company());
        self.settle();
    }

    fn run_in_company(&mut self) {
        let Self { settings, draws, candidates, vacancy, systems: [arteries, own], .. } = self;
        let veins = Veins::new(std::mem::take(own), std::mem::take(&mut self.links));
        let company = Company::new(Arc::clone(&self.tissue), settings.clone(), draws, veins);
        while !is_over(self.step, self.idle, settings) {
            let step = Step { tissue: &*self.tissue, settings, number: self.step + 1 };
            step.choose_candidates((draws, Some(company.ahead())), candidates, vacancy, arteries);
            let (born, report) = step.grow_arteries(arteries, candidates, vacancy);
            company.hand(step.number, arteries.supplied());
            company.call();
            self.step = step.number;
            // If nothing has happened, whether growth goes on depends on the veins.
            let acted = born > 0 || report.new_nodes > 0 || company.catch_up(|veins| veins.grew);
            self.idle = step.idle_after(self.idle, acted);
        }
        let veins = company.end();
        (*own, self.links) = (veins.growth, veins.links);
    }

    /// Whether all steps are done, or [`idle_steps`](ColonizationSettings::idle_steps) in a row without growth.
    pub fn is_finished(&self) -> bool {
        is_over(self.step, self.idle, &self.settings)
    }

    /// Number of steps done.
    pub fn steps_done(&self) -> u32 {
        self.step
    }

    /// The settings in force.
    pub fn settings(&self) -> &ColonizationSettings {
        &self.settings
    }

    /// The tissue of the growth.
    pub fn tissue(&self) -> &Arc<dyn Tissue> {
        &self.tissue
    }

    /// Centre lines of a kind, on the tissue: an empty tree for kinds that colonization doesn't grow.
    pub fn tree(&self, kind: VesselKind) -> &VesselTree {
        static NONE: VesselTree = VesselTree::new();
        self.system(kind).map_or(&NONE, |system| &system.forest.tree)
    }

    /// Normal of the tissue's surface at every node, zero in a volume.
    pub fn normals(&self, kind: VesselKind) -> &[Vec3] {
        self.system(kind).map_or(&[], |system| &system.forest.normals)
    }

    /// The step in which each node was born, 0 for initial nodes.
    pub fn birth_steps(&self, kind: VesselKind) -> &[u32] {
        self.system(kind).map_or(&[], |system| &system.forest.birth_steps)
    }

    /// Nodes whose radius changed in the last step, or at the last [`settle`](Self::settle), new ones included, from the tips
    /// to the roots.
    pub fn changed_radii(&self, kind: VesselKind) -> &[u32] {
        self.system(kind).map_or(&[], |system| system.forest.changed())
    }

    /// Drains of a kind that wait to be supplied.
    pub fn drains(&self, kind: VesselKind) -> impl Iterator<Item = Vec3> + '_ {
        self.system(kind).into_iter().flat_map(|system| system.drains.living()).map(|(_, position)| position)
    }

    /// Number of drains of a kind that wait to be supplied.
    pub fn drains_left(&self, kind: VesselKind) -> usize {
        self.system(kind).map_or(0, |system| system.drains.len())
    }

    /// λ_t of a kind: the factor of its lengths at the present size of the tissue.
    pub fn length_scale(&self, kind: VesselKind) -> f32 {
        self.system(kind).map_or(1.0, SystemGrowth::length_scale)
    }

    /// Links through which blood flows from the arteries to the veins: for each drain that both have supplied, the two
    /// nodes that did. They join the two trees to one circulation
    /// ([`Circulation`](crate::synthesis::haemodynamics::Circulation)).
    pub fn bed_links(&self) -> &[BedLink] {
        &self.links
    }

    /// The position at which a node is drawn: lifted off the surface by its radius if the settings say so.
    ///
    /// # Panics
    /// If the node is not in this kind's tree.
    pub fn lifted_position(&self, kind: VesselKind, node: NodeId) -> Vec3 {
        self.grown(kind).lifted_position(node)
    }

    /// The vessels as drawn and written: [`tree`](Self::tree) with every node at its
    /// [`lifted_position`](Self::lifted_position).
    pub fn vessels(&self, kind: VesselKind) -> VesselTree {
        self.grown(kind).vessels()
    }

    fn system(&self, kind: VesselKind) -> Option<&SystemGrowth> {
        Self::KINDS.iter().position(|&grown| grown == kind).map(|index| &self.systems[index])
    }
}

/// Most that a given radius may differ from that of a terminal, as a factor: powers of it stay within f32.
const MOST_RADII: f32 = 1e6;

fn check_radii(kind: VesselKind, system: &SystemSettings, given: Option<&VesselTree>) -> Result<(), ColonizationError> {
    let terminal = system.terminal_radius;
    let fits = |radius: f32| (MOST_RADII.recip()..=MOST_RADII).contains(&(radius / terminal));
    let radii = given.map_or(&[][..], VesselTree::radii);
    match radii.iter().position(|&radius| !fits(radius)) {
        Some(node) => Err(ColonizationError::GivenRadius { kind, node, radius: radii[node], terminal }),
        None => Ok(()),
    }
}

fn is_over(step: u32, idle: u32, settings: &ColonizationSettings) -> bool {
    step >= settings.steps || (settings.idle_steps > 0 && idle >= settings.idle_steps)
}
