//! Constrained constructive optimisation: trees of least volume, one terminal at a time.
//!
//! In: a tissue with a border, flat or solid, roots, [`CcoSettings`] and a seed. Out: a [`VesselTree`] for each kind of
//! vessels that has a root. Source: Schreiner and Buxbaum 1993, Karch et al. 1999, in the form of OpenCCO (Kerautret et
//! al., IPOL 2023).
//!
//! Every terminal has the same flow and pressure, so radii follow from the tree: they are those at which blood reaches
//! all terminals with one loss of pressure, and obey Murray's law. To add a terminal,
//!
//! 1. a place far from all other terminals is drawn from vacant cells (`vacancy`),
//! 2. each of the nearest segments is split at the place of least volume of the whole tree (`joint`, `candidates`),
//! 3. the cheapest of them that has room is taken (`clearance`, `domain`).
//!
//! At the end, and whenever the number of terminals has doubled, all bifurcations are moved to the best place under the
//! present flows (`polish`). In contrast to OpenCCO, no two segments of any trees overlap at any time, unless they
//! share a node, and every segment keeps its whole width inside the tissue and out of no-go regions, except where a
//! vessel enters at its root.
//!
//! Blood flows in segments as in cylinders, as in OpenCCO. But a segment has room for the round cone that it is drawn
//! and meshed as, which begins up to [`MAX_FLARE`] times as wide as it ends. So vessels that are drawn don't overlap
//! either.
//!
//! A no-go region is avoided exactly. A function and painted vertices are asked along a segment, at least every 512th
//! of the tissue's diagonal: what is narrower may be crossed.
//!
//! [`MAX_FLARE`]: crate::synthesis::segment_index::MAX_FLARE
//!
//! The domain grows with the number of terminals, as in section 3.3.1. Only radii depend on its size, by one common
//! factor, so its growth moves nothing.

mod candidates;
mod cell_map;
mod clearance;
mod depths;
mod distance;
mod domain;
mod dwindling;
mod error;
mod forest;
mod given;
mod grown;
mod index;
mod joint;
mod links;
mod paths;
mod polish;
mod power;
mod relief;
mod report;
mod seam;
mod settings;
mod space;
mod sums;
mod system;
#[cfg(test)]
mod tests;
mod vacancy;

pub use error::{CcoError, CcoSettingsError, GivenTreeError};
pub use report::CcoReport;
pub use settings::{CcoSettings, VesselFlow};

use crate::synthesis::{
    growth::StepCount,
    parallel::{self, Help},
    random::{Stream, VesselRng},
    roots::Roots,
    tissue::{Tissue, TissuePoint},
    tree::{BedLink, ByKind, VesselKind, VesselTree},
};
use domain::Domain;
use forest::Forest;
use grown::Grown;
use power::Exponent;
use space::Space;
use std::sync::Arc;
use system::System;

/// Nodes that a step of polishing looks at.
const POLISHED: u32 = 128;
/// Number of nodes after which all bifurcations are polished for the first time. That is done again whenever the
/// number has doubled, since later terminals join better trees then.
const FIRST_SWEEP: usize = 64;
/// Nodes for which memory is taken in advance: there may be no room for as many terminals as are asked for.
const MOST_RESERVED: usize = 1 << 21;
/// Places that a step draws at most.
const DRAWS: u32 = 8;

/// A constrained constructive optimisation under way.
///
/// Make one with [`new`](Self::new), call [`advance`](Self::advance) until [`is_finished`](Self::is_finished), or
/// [`run`](Self::run), and read the [`tree`](Self::tree) of a kind after [`settle`](Self::settle).
///
/// ```
/// use bevy_vessels::synthesis::{
///     cco::{Cco, CcoSettings},
///     roots::{RootPlacement, RootPlacements},
///     tissue::Disc,
///     tree::VesselKind,
/// };
/// use bevy_math::Vec3;
/// use std::sync::Arc;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let artery = RootPlacement::Nearest(vec![Vec3::Y * 50.0]);
/// let roots = RootPlacements { artery, vein: RootPlacement::None, ..RootPlacements::default() };
/// let settings = CcoSettings { terminals: 100, ..CcoSettings::default() };
/// let mut growth = Cco::new(Arc::new(Disc::flat(50.0)?), settings, &roots.into(), 7)?;
/// growth.run()?;
/// assert_eq!(growth.tree(VesselKind::Artery).len(), 200);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Cco {
    settings: CcoSettings,
    space: Space,
    systems: Vec<System>,
    rng: VesselRng,
    /// Terminals placed, and steps of polishing done.
    steps: u32,
    /// Node at which polishing goes on, and sweeps done at the end.
    polished: [u32; 2],
    /// Number of nodes from which on a sweep is due while the trees grow.
    due: usize,
    help: Help,
    grown: ByKind<Option<Grown>>,
    /// Links between the terminals of arteries and veins, once all are placed.
    links: Vec<BedLink>,
}

impl Cco {
    /// Prepares a growth with given trees and the first vessel of each root. Lengths in the settings are the tissue's:
    /// see [`CcoSettings::fit`].
    ///
    /// # Errors
    /// A setting outside its limits; a tissue that is neither flat nor solid, or too far from the origin; roots that
    /// cannot be placed as requested, that have no room for a vessel, or of which there are none; a given tree that is
    /// no binary one, or overlaps.
    pub fn new(tissue: Arc<dyn Tissue>, settings: CcoSettings, roots: &Roots, seed: u64) -> Result<Self, CcoError> {
        settings.validate()?;
        Self::on(Domain::new(tissue)?, settings, roots, seed)
    }

    /// Starts again on the same tissue with other settings, roots or seed. What is known of its border stays.
    ///
    /// # Errors
    /// As [`new`](Self::new); the growth is unchanged then.
    pub fn restart(&mut self, settings: CcoSettings, roots: &Roots, seed: u64) -> Result<(), CcoError> {
        settings.validate()?;
        *self = Self::on(self.space.domain.clone(), settings, roots, seed)?;
        Ok(())
    }

    fn on(mut domain: Domain, settings: CcoSettings, roots: &Roots, seed: u64) -> Result<Self, CcoError> {
        domain.border = settings.border_distance.into();
        let tissue = domain.tissue();
        let placed = roots.resolve_with(&**tissue, &settings.root_spacing(tissue.extent()), seed, &domain.derived)?;
        let exponent = Exponent::new(settings.bifurcation_exponent.into());
        let mut growth = Self {
            space: Space::new(domain, Forest::new(exponent)),
            systems: Vec::new(),
            rng: Stream::Terminals.rng(seed),
            steps: 0,
            polished: [0; 2],
            due: FIRST_SWEEP,
            help: Help::default(),
            grown: ByKind::default(),
            links: Vec::new(),
            settings,
        };
        for (kind, placed) in placed.iter() {
            let given = roots.given[kind].as_ref().filter(|tree| !tree.is_empty());
            let needed = placed.len() + given.map_or(0, |tree| tree.tips().len());
            let terminals = growth.settings.terminals;
            if needed > terminals as usize {
                return Err(CcoError::TooFewTerminals { kind, terminals, needed });
            }
            if needed > 0 {
                growth.systems.push(System::new(kind, &growth.space.domain, &growth.settings));
            }
        }
        if growth.systems.is_empty() {
            return Err(CcoError::NoRoot);
        }
        growth.plant(&placed, roots)?;
        growth.settle();
        Ok(growth)
    }

    /// Takes over the given trees of all kinds, then plants all roots.
    fn plant(&mut self, placed: &ByKind<Vec<TissuePoint>>, roots: &Roots) -> Result<(), CcoError> {
        let Self { space, systems, settings, rng, .. } = self;
        let given = |kind| roots.given[kind].as_ref().filter(|tree| !tree.is_empty());
        let nodes = systems.iter().map(|system| given(system.kind).map_or(0, VesselTree::len)).sum::<usize>()
            + 2 * settings.terminals as usize * systems.len();
        let nodes = nodes.min(MOST_RESERVED);
        space.forest.nodes.reserve_exact(nodes);
        space.index.reserve(nodes);
        for system in systems.iter_mut() {
            if let Some(tree) = given(system.kind) {
                system.adopt(space, tree, settings, rng)?;
            }
        }
        for system in systems.iter_mut() {
            for root in &placed[system.kind] {
                system.plant(space, root.position, settings, rng)?;
                self.steps += 1;
            }
        }
        self.due = FIRST_SWEEP.max(2 * space.forest.nodes.len());
        Ok(())
    }

    /// Does one step: connects the next terminal, of the kind that has fewest, or looks at some bifurcations once all
    /// terminals are placed. Does nothing once growth is finished.
    pub fn advance(&mut self) {
        let is_growing = self.systems.iter().any(|system| !system.is_done(&self.settings));
        if !is_growing || self.space.forest.nodes.len() >= self.due && self.settings.polish_sweeps > 0 {
            return self.polish(is_growing);
        }
        for _ in 0..DRAWS {
            let open = self.systems.iter_mut().filter(|system| !system.is_done(&self.settings));
            let Some(system) = open.min_by_key(|system| system.terminals) else { return };
            if system.advance(&mut self.space, &self.settings, &mut self.rng) {
                self.steps += 1;
                return;
            }
        }
    }

    fn polish(&mut self, is_growing: bool) {
        if self.is_finished() {
            return;
        }
        if !is_growing {
            self.space.reserve = 1.0;
        }
        let nodes = self.space.forest.nodes.len();
        let [node, sweeps] = &mut self.polished;
        let end = (nodes as u32).min(*node + POLISHED);
        self.space.polish(*node..end, self.settings.tolerance.into(), &mut self.help);
        *node = end;
        if end as usize == nodes {
            *node = 0;
            if is_growing {
                self.due = 2 * nodes;
            } else {
                *sweeps += 1;
            }
        }
        self.steps += 1;
    }

    /// Does all remaining steps, and settles.
    ///
    /// # Errors
    /// [`CcoError::NoRoom`] if there was no room for all terminals. The trees with those that were placed stay.
    pub fn run(&mut self) -> Result<(), CcoError> {
        parallel::within_pool(|| {
            while !self.is_finished() {
                self.advance();
            }
        });
        self.settle();
        self.outcome()
    }

    /// Whether all terminals are placed and all sweeps done, or no place for a terminal is left.
    pub fn is_finished(&self) -> bool {
        self.systems.iter().all(|system| system.is_done(&self.settings))
            && self.polished[1] >= self.settings.polish_sweeps
    }

    /// Whether all has had room so far.
    ///
    /// # Errors
    /// [`CcoError::NoRoom`] for the first kind that has no room for all its terminals.
    pub fn outcome(&self) -> Result<(), CcoError> {
        match self.systems.iter().find(|system| system.is_stuck) {
            None => Ok(()),
            Some(system) => Err(CcoError::NoRoom {
                kind: system.kind,
                reached: system.terminals,
                wanted: self.settings.terminals,
                refused: system.refused,
            }),
        }
    }

    /// Makes the [trees](Self::tree) of all that has grown. It takes time in proportion to the number of nodes, since a
    /// new bifurcation comes between old nodes, and a tree is in the order from its root.
    pub fn settle(&mut self) {
        for system in &self.systems {
            self.grown[system.kind].get_or_insert_default().settle(&self.space, &system.trees);
        }
        self.links.clear();
        if self.is_finished() {
            self.links = links::links(self.tree(VesselKind::Artery), self.tree(VesselKind::Vein));
        }
    }

    /// Links through which blood flows from the arteries to the veins, at the end of growth: from each terminal to the
    /// nearest one of the other tree. They join the two trees to one circulation
    /// ([`Circulation`](crate::synthesis::haemodynamics::Circulation)).
    pub fn bed_links(&self) -> &[BedLink] {
        &self.links
    }

    /// The steps done, and all of them: one for each terminal, and those of polishing.
    pub fn steps(&self) -> StepCount {
        let wanted = u64::from(self.settings.terminals) * self.systems.len() as u64;
        // The sweeps while the trees grow look at about twice as many nodes as the last one.
        let sweeps = match self.settings.polish_sweeps {
            0 => 0,
            sweeps => u64::from(sweeps) + 2,
        };
        let polishing = (2 * wanted).div_ceil(POLISHED.into()) * sweeps;
        let all = u32::try_from(wanted + polishing).unwrap_or(u32::MAX);
        StepCount { done: if self.is_finished() { all } else { self.steps.min(all) }, all }
    }

    /// Centre lines of a kind when it was [settled](Self::settle) last: an empty tree for kinds without a root.
    ///
    /// Radii are in tissue lengths: those of cylinders through which blood flows as the settings say. Drawn segments
    /// begin wider, and have room for that. A root node has the radius of its segment.
    pub fn tree(&self, kind: VesselKind) -> &VesselTree {
        static EMPTY: VesselTree = VesselTree::new();
        self.grown[kind].as_ref().map_or(&EMPTY, |grown| &grown.tree)
    }

    /// What each kind has reached.
    pub fn reports(&self) -> impl Iterator<Item = CcoReport> + '_ {
        self.systems.iter().map(|system| system.report(&self.space, &self.settings))
    }

    /// Millimetres of a tissue length, once the domain has its full size.
    pub fn millimetres(&self) -> f64 {
        self.space.domain.millimetres(&self.settings)
    }

    /// Number of pairs of segments, of the same tree or of two, that overlap as the round cones that they are drawn as,
    /// though they share no node. It is 0: a check of all that is promised.
    pub fn overlaps(&self) -> usize {
        self.space.overlaps()
    }

    /// The settings in force.
    pub fn settings(&self) -> &CcoSettings {
        &self.settings
    }

    /// The tissue of the growth.
    pub fn tissue(&self) -> &Arc<dyn Tissue> {
        self.space.domain.tissue()
    }

    /// Bytes of memory that grow with the number of terminals, without the settled trees.
    pub fn bytes(&self) -> usize {
        let nodes = self.space.forest.nodes.capacity() * size_of::<forest::Node>();
        nodes + self.space.index.bytes() + self.systems.iter().map(System::bytes).sum::<usize>()
    }
}
