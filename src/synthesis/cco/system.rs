//! The trees of one kind of vessels, one new terminal at a time.

use super::{
    candidates::{Attempt, Candidates},
    domain::Domain,
    error::CcoError,
    report::CcoReport,
    settings::{CcoSettings, VesselFlow},
    space::Space,
    vacancy::Vacancy,
};
use crate::synthesis::{
    parallel::Help,
    random::VesselRng,
    tree::{VesselKind, VesselTree},
};
use bevy_math::{DVec3, Vec3};
use rand::RngExt;
use std::{f64::consts::PI, mem::take};

/// Places from which the end of the first vessel is chosen.
const FIRST_PLACES: usize = 64;
/// Room for growth that the first segments get, as a share of their radii. Vessels that touch early are in the way of
/// all later terminals, since trunks become wider with each.
const RESERVE: f64 = 0.1;
/// Flows of terminals are multiples of this share of the mean, so that their sums are exact.
const FLOW_UNIT: f64 = 1.0 / 1_048_576.0;
/// Places refused in a row after which a kind has no room for more.
const MOST_REFUSED: u32 = 500;

/// Refused terminals after which a segment that no move gave room is looked at again.
const PATIENCE: u64 = 40;
/// Terminals that are ranked at a time, as a share of those that are there: the trees then hardly change meanwhile.
const BATCH_SHARE: u32 = 32;
/// Most of them: growth may have to end within a frame.
const MOST_IN_BATCH: u32 = 16;

/// A terminal to be connected.
#[derive(Clone, Debug, Default)]
struct Plan {
    place: DVec3,
    candidates: Candidates,
}

impl Plan {
    fn rank(&mut self, space: &Space, trees: &[u32], range: [usize; 2], tolerance: f64) {
        self.candidates.rank(space, self.place, range, tolerance, |tree| trees.contains(&tree));
    }
}

/// The trees of one kind.
#[derive(Clone, Debug)]
pub(super) struct System {
    pub kind: VesselKind,
    /// Numbers of its trees.
    pub trees: Vec<u32>,
    pub terminals: u32,
    pub rejected: u64,
    /// Places refused in a row.
    pub refused: u32,
    pub is_stuck: bool,
    vacancy: Vacancy,
    /// The next terminals, the last of them first, and their number.
    plans: Vec<Plan>,
    planned: usize,
    /// Places of the terminals that were ranked last, and those for the terminals after them.
    places: Vec<DVec3>,
    /// Number of terminals that were ranked last.
    batch: usize,
    help: Help,
    /// Excess of the next terminal's flow over the mean, if that is decided, in units.
    excess: Option<f64>,
    /// Segments that no move gave room, and the number of refused terminals then.
    stuck: Vec<(u32, u64)>,
    /// 8µQ/(πk·ΔP·s³): the unit of a radius's fourth power once the domain has its full size.
    unit: f64,
}

impl System {
    pub(super) fn new(kind: VesselKind, domain: &Domain, settings: &CcoSettings) -> Self {
        let scale = domain.millimetres(settings);
        let VesselFlow { rate, viscosity, root_pressure, terminal_pressure } = settings.flow[kind];
        let drop = root_pressure.pascals() - terminal_pressure.pascals();
        // Flow in mm³/s.
        let flow = rate.cubic_metres_per_second() * 1.0e9 / f64::from(settings.terminals);
        let unit = 8.0 * viscosity.pascal_seconds() * flow / (PI * drop * scale * scale * scale);
        Self {
            kind,
            trees: Vec::new(),
            terminals: 0,
            rejected: 0,
            refused: 0,
            is_stuck: false,
            vacancy: Vacancy::new(domain, settings.terminals),
            plans: Vec::new(),
            planned: 0,
            places: Vec::new(),
            batch: 0,
            help: Help::default(),
            excess: None,
            stuck: Vec::new(),
            unit,
        }
    }

    /// The unit when the domain has grown for so many terminals: its measure is then n/k of the full one (Eq. 14).
    fn unit_at(&self, domain: &Domain, terminals: u32, settings: &CcoSettings) -> f64 {
        let share = f64::from(terminals.max(1)) / f64::from(settings.terminals);
        // (n/k)^(−3/d)
        let growth = if domain.dimension == 2 { (share * share * share).sqrt() } else { share };
        self.unit / growth
    }

    /// Sets the unit for so many terminals.
    fn set_unit(&self, space: &mut Space, terminals: u32, settings: &CcoSettings) {
        let unit = self.unit_at(&space.domain, terminals, settings);
        for &tree in &self.trees {
            space.unit[tree as usize] = unit;
        }
    }

    /// Flow of the next terminal, in that of a mean one.
    ///
    /// What one terminal has more, the next has less, so all of them have the flow that was asked for.
    fn share(&mut self, settings: &CcoSettings, rng: &mut VesselRng) -> f64 {
        if settings.flow_spread == 0.0 {
            return 1.0;
        }
        let excess = match self.excess {
            Some(excess) => excess,
            None if self.terminals % 2 == 1 => 0.0,
            // The last one of an odd number has nobody to make up for it.
            None if self.terminals + 1 == settings.terminals => 0.0,
            None => f64::from(settings.flow_spread) * (2.0 * rng.random::<f64>() - 1.0),
        };
        self.excess = Some(excess);
        1.0 + (excess / FLOW_UNIT).round() * FLOW_UNIT
    }

    /// Counts a terminal at a place, whose flow was [`share`](Self::share).
    fn count(&mut self, domain: &Domain, place: DVec3) {
        self.vacancy.take(domain, place);
        self.count_flow();
    }

    fn count_flow(&mut self) {
        self.terminals += 1;
        self.excess = self.excess.filter(|_| self.terminals % 2 == 1).map(|excess| -excess);
    }

    /// Takes over a tree from which growth continues.
    pub(super) fn adopt(
        &mut self,
        space: &mut Space,
        given: &VesselTree,
        settings: &CcoSettings,
        rng: &mut VesselRng,
    ) -> Result<(), CcoError> {
        let tips = given.tips().len() as u32;
        let unit = self.unit_at(&space.domain, tips, settings);
        let kind = self.kind;
        let (trees, terminals) = space.adopt(kind, given, unit, || {
            let share = self.share(settings, rng);
            self.count_flow();
            share
        })?;
        self.trees.extend(trees);
        let places: Vec<DVec3> = terminals.into_iter().map(|node| space.forest.place(node)).collect();
        self.vacancy.start_with(&space.domain, &places);
        Ok(())
    }

    /// Grows the first vessel of a root, to the deepest of some places to which one fits.
    pub(super) fn plant(
        &mut self,
        space: &mut Space,
        root: Vec3,
        settings: &CcoSettings,
        rng: &mut VesselRng,
    ) -> Result<(), CcoError> {
        let unit = self.unit_at(&space.domain, self.terminals + 1, settings);
        space.share = self.share(settings, rng);
        let root = root.as_dvec3();
        let mut places: Vec<(f64, DVec3)> = Vec::with_capacity(FIRST_PLACES);
        for _ in 0..FIRST_PLACES {
            let Some(place) = self.vacancy.draw(&space.domain, 0.0, rng) else { break };
            places.push((space.domain.depth(place), place));
        }
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut radius = 0.0;
        for (_, place) in places {
            space.begin();
            let [_, segment] = space.plant(root, place, unit);
            radius = space.radius(segment);
            if space.is_long_enough(segment, f64::INFINITY) && space.has_room(&[segment]) {
                self.trees.push(space.forest.node(segment).tree);
                self.count(&space.domain, place);
                self.set_unit(space, self.terminals, settings);
                return Ok(());
            }
            space.uproot();
        }
        Err(CcoError::NoFirstVessel { kind: self.kind, position: root.as_vec3(), radius: radius as f32 })
    }

    /// Whether nothing is left to do.
    pub(super) fn is_done(&self, settings: &CcoSettings) -> bool {
        self.is_stuck || self.terminals >= settings.terminals
    }

    /// Connects the next terminal, if that is possible. Returns whether it was.
    pub(super) fn advance(&mut self, space: &mut Space, settings: &CcoSettings, rng: &mut VesselRng) -> bool {
        if self.planned == 0 && !self.plan(space, settings, rng) {
            self.set_unit(space, self.terminals, settings);
            self.is_stuck = true;
            return false;
        }
        self.planned -= 1;
        let mut plan = take(&mut self.plans[self.planned]);
        self.prepare(space, settings, rng);
        let is_joined = self.join(space, &mut plan, settings);
        if is_joined {
            self.count(&space.domain, plan.place);
            self.refused = 0;
            if self.is_done(settings) {
                self.vacancy.close();
                self.plans = Vec::new();
                return true;
            }
        } else {
            self.set_unit(space, self.terminals, settings);
            self.relieve(space);
            self.vacancy.refuse();
            self.rejected += 1;
            self.refused += 1;
            self.is_stuck = self.refused >= MOST_REFUSED;
        }
        self.plans[self.planned] = plan;
        is_joined
    }

    /// Sets up the space for the next terminal.
    fn prepare(&mut self, space: &mut Space, settings: &CcoSettings, rng: &mut VesselRng) {
        self.set_unit(space, self.terminals + 1, settings);
        space.share = self.share(settings, rng);
        space.blocked = None;
        let share = f64::from(self.terminals) / f64::from(settings.terminals);
        space.reserve = 1.0 + RESERVE * (1.0 - share);
    }

    /// Ranks the candidates of some terminals, on all threads, while places for those after them are drawn. Their
    /// number depends on that of the terminals alone, so the result is the same on any number of threads. `false` if
    /// there is no place.
    fn plan(&mut self, space: &mut Space, settings: &CcoSettings, rng: &mut VesselRng) -> bool {
        self.prepare(space, settings, rng);
        self.places.drain(..self.batch);
        if self.places.is_empty() {
            self.draw(&space.domain, settings, rng);
        }
        self.batch = self.places.len();
        self.planned = self.batch;
        self.plans.resize_with(self.planned.max(self.plans.len()), Plan::default);
        for (plan, &place) in self.plans.iter_mut().zip(self.places.iter().rev()) {
            plan.place = place;
        }
        space.index.coarsen(self.vacancy.threshold());
        let (mut plans, mut help, trees) = (take(&mut self.plans), take(&mut self.help), take(&mut self.trees));
        let space = &*space;
        let rank = |_: usize, plan: &mut Plan| {
            plan.rank(space, &trees, [0, settings.candidates as usize], settings.tolerance.into());
        };
        help.for_each(&mut plans[..self.planned], rank, || self.draw(&space.domain, settings, rng));
        (self.plans, self.help, self.trees) = (plans, help, trees);
        self.planned > 0
    }

    /// Draws places for the terminals after those that are there or planned: as far from each other as from all that
    /// are there. There may be fewer than are wanted, or none.
    fn draw(&mut self, domain: &Domain, settings: &CcoSettings, rng: &mut VesselRng) {
        let there = self.terminals + self.places.len() as u32;
        // Flows that differ are decided one by one.
        let most = if settings.flow_spread > 0.0 { 1 } else { (there / BATCH_SHARE).clamp(1, MOST_IN_BATCH) };
        for _ in 0..most.min(settings.terminals.saturating_sub(there)) {
            let Some(place) = self.vacancy.draw(domain, 0.0, rng) else { break };
            if self.vacancy.are_apart(domain, place, &self.places) {
                self.places.push(place);
            }
        }
    }

    /// Makes room around the segment that was in the way of the last terminal, unless that was in vain lately.
    fn relieve(&mut self, space: &mut Space) {
        let Some(blocked) = space.blocked else { return };
        let rejected = self.rejected;
        self.stuck.retain(|&(_, then)| rejected < then + PATIENCE);
        let is_in_vain = self.stuck.iter().any(|&(segment, _)| segment == blocked[0]);
        if !is_in_vain && !space.relieve(blocked) {
            self.stuck.push((blocked[0], rejected));
        }
    }

    fn join(&mut self, space: &mut Space, plan: &mut Plan, settings: &CcoSettings) -> bool {
        let (mut known, mut count, mut doublings) = (0, settings.candidates as usize, 0);
        let tolerance = settings.tolerance.into();
        loop {
            match plan.candidates.connect(space, plan.place, tolerance) {
                Attempt::Connected => return true,
                Attempt::Hopeless => return false,
                Attempt::Outdated => {}
                Attempt::Failed if doublings == CcoSettings::MOST_DOUBLINGS => return false,
                Attempt::Failed => {
                    (known, count) = (count, 2 * count);
                    doublings += 1;
                }
            }
            plan.rank(space, &self.trees, [known, count], tolerance);
        }
    }

    pub(super) fn report(&self, space: &Space, settings: &CcoSettings) -> CcoReport {
        let mut report = CcoReport {
            kind: self.kind,
            terminals: self.terminals,
            wanted: settings.terminals,
            rejected: self.rejected,
            volume: 0.0,
            root_radius: 0.0,
            is_stuck: self.is_stuck,
        };
        for &tree in &self.trees {
            let root = space.root_segment(tree);
            report.volume += PI * space.unit[tree as usize].sqrt() * space.forest.node(root).volume;
            report.root_radius = report.root_radius.max(space.radius(root));
        }
        report
    }

    /// The distance that terminals keep from each other now.
    pub(super) fn spacing(&self) -> f64 {
        self.vacancy.threshold()
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        self.vacancy.bytes()
    }
}
