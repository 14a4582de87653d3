//! Where new terminals may be: places that are far enough from all others.
//!
//! OpenCCO draws blindly, keeps a draw that is farther from all terminals than a threshold, and multiplies the
//! threshold by 0.9 after so many draws in vain (section 3.3.2, algorithms 2 and 3). In a tissue that fills, nearly all
//! draws are in vain. Here they come from cells without a terminal. A cell's diagonal is the threshold, so one with a
//! terminal has no room for another, and one that is fully covered is dropped. The threshold only ever falls, by the
//! same factor.
//!
//! With each fall, all cells are divided anew, which takes as long as thousands of terminals. So the next division is
//! prepared while the present one is in use, a little with each draw.
//!
//! Where the tissue's density ρ is below 1, terminals keep more distance: ρ^(−1/d) times the threshold in d dimensions,
//! so that their number is in proportion to ρ.

use super::{cell_map::CellMap, domain::Domain, dwindling::DwindlingList};
use crate::synthesis::random::VesselRng;
use bevy_math::{DVec3, Vec3};
use rand::RngExt;

/// Factor of the threshold after draws in vain: α of the paper.
const FALL: f64 = 0.9;
/// Draws in vain in a row after which the threshold falls.
const TRIES: u32 = 100;
/// Neighbours of a cell along an axis, the nearest first, as far as terminals keep apart.
const OFFSETS: [i64; 19] = [0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6, -6, 7, -7, 8, -8, 9, -9];
/// Largest distance between terminals, in thresholds: places with less density than belongs to it have no terminals.
const MOST_APART: f64 = 5.0;
/// Share of draws that count even where there is no density, so that their number is bounded.
const LEAST_DENSITY: f64 = 0.004;
/// Cells along the longest side of the tissue in which the mean density is measured.
const MEAN_CELLS: f64 = 24.0;
/// The threshold falls no lower than this share of a terminal's own size, far below what terminals need that are drawn
/// at random: there is no room if none is found by then.
const LEAST_SHARE: f64 = 0.3;
/// Terminals for which memory is taken in advance: there may be no room for as many as are asked for.
const MOST_RESERVED: usize = 1 << 20;
/// The next division is prepared within so small a share of the terminals that are there: the threshold falls when there
/// are a third more.
const AHEAD: f64 = 0.2;

/// The places for terminals of one kind.
#[derive(Clone, Debug)]
pub(super) struct Vacancy {
    least: f64,
    cells: Cells,
    /// Those of the next threshold, as far as they are prepared.
    next: Option<Cells>,
    terminals: Vec<Vec3>,
    /// Places in vain in a row.
    failed: u32,
}

/// The cells of one threshold.
#[derive(Clone, Debug, Default)]
struct Cells {
    threshold: f64,
    side: f64,
    /// Cells along each axis of the domain.
    size: [u64; 3],
    /// Cells in which there may be room.
    vacant: DwindlingList,
    /// Terminals by their cells.
    taken: CellMap,
    /// Number of terminals that have been entered, and of cells that have been looked at.
    entered: usize,
    seen: u64,
    /// Whether terminals are equally dense everywhere.
    is_uniform: bool,
}

impl Vacancy {
    /// Room for so many terminals in an empty domain.
    pub(super) fn new(domain: &Domain, terminals: u32) -> Self {
        let mut vacancy = Self {
            least: LEAST_SHARE * size_of_share(domain, f64::from(terminals)),
            cells: Cells::new(domain, size_of_share(domain, 1.0)),
            next: None,
            terminals: Vec::new(),
            failed: 0,
        };
        if !domain.is_uniform() {
            let scale = size_of_share(domain, mean_density(domain).recip()) / size_of_share(domain, 1.0);
            vacancy.least *= scale;
        }
        vacancy.terminals.reserve_exact((terminals as usize).min(MOST_RESERVED));
        vacancy.cells.finish(domain, &vacancy.terminals);
        vacancy
    }

    /// Takes the places of terminals that are there before all others.
    pub(super) fn start_with(&mut self, domain: &Domain, places: &[DVec3]) {
        self.terminals.extend(places.iter().map(|place| place.as_vec3()));
        let threshold = size_of_share(domain, places.len() as f64).min(self.cells.threshold);
        (self.cells, self.next) = (Cells::new(domain, threshold), None);
        self.cells.finish(domain, &self.terminals);
    }

    /// Whether a place with terminals keeps its distance from others.
    pub(super) fn are_apart(&self, domain: &Domain, place: DVec3, others: &[DVec3]) -> bool {
        let reach = self.cells.reach(domain, place).unwrap_or(f64::INFINITY);
        others.iter().all(|other| other.distance(place) >= reach)
    }

    /// A place at least the threshold from all terminals, deeper in the domain than `radius`; `None` if the threshold
    /// would become too small.
    pub(super) fn draw(&mut self, domain: &Domain, radius: f64, rng: &mut VesselRng) -> Option<DVec3> {
        self.look_ahead(domain);
        loop {
            while self.failed < TRIES && !self.cells.vacant.is_empty() {
                let slot = rng.random_range(0..self.cells.vacant.len());
                let cell = u64::from(self.cells.vacant.get(slot));
                let within = DVec3::new(rng.random(), rng.random(), rng.random());
                // Rounded, as it will be kept.
                let point = self.cells.at(domain, cell, within).as_vec3().as_dvec3();
                // As often as terminals are dense, so that all parts fill at the same pace.
                if !self.cells.is_uniform && rng.random::<f64>() >= domain.density(point).max(LEAST_DENSITY) {
                    continue;
                }
                let reach = self.cells.reach(domain, point);
                let nearest = reach.map(|reach| self.cells.nearest(domain, &self.terminals, point, reach));
                match nearest {
                    Some(Some(nearest)) => {
                        if self.cells.covers(domain, nearest, cell) {
                            self.cells.vacant.swap_remove(slot);
                        }
                        self.failed += 1;
                    }
                    Some(None) if domain.holds_point(point, radius) => return Some(point),
                    _ => self.failed += 1,
                }
            }
            self.failed = 0;
            let mut next = self.next.take().unwrap_or_else(|| self.cells.next(domain));
            // More cells than can be counted are hundreds for each terminal, even in a thin organ.
            if next.threshold < self.least || next.count() > u32::MAX.into() {
                // It stays fallen, as far as others are told.
                self.cells.threshold = next.threshold;
                return None;
            }
            next.finish(domain, &self.terminals);
            self.cells = next;
        }
    }

    /// Prepares the next division a little.
    fn look_ahead(&mut self, domain: &Domain) {
        let next = self.next.get_or_insert_with(|| self.cells.next(domain));
        if next.threshold >= self.least && next.count() <= u32::MAX.into() {
            let terminals = AHEAD * self.terminals.len().max(1) as f64;
            next.prepare(domain, &self.terminals, (next.count() as f64 / terminals) as u64 + 1);
        }
    }

    /// Takes a place for a terminal.
    pub(super) fn take(&mut self, domain: &Domain, place: DVec3) {
        self.terminals.push(place.as_vec3());
        let cell = self.cells.cell(domain, place);
        self.cells.taken.get_or_insert(cell as u32, self.terminals.len() as u32 - 1);
        self.failed = 0;
    }

    /// Counts a place that could not be used.
    pub(super) fn refuse(&mut self) {
        self.failed += 1;
    }

    /// The distance that terminals keep from each other now.
    pub(super) fn threshold(&self) -> f64 {
        self.cells.threshold
    }

    /// Gives back all memory, when no more places are needed. The threshold stays.
    pub(super) fn close(&mut self) {
        let threshold = self.cells.threshold;
        (self.cells, self.next) = (Cells { threshold, ..Cells::default() }, None);
        self.terminals = Vec::new();
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        let cells = |cells: &Cells| cells.taken.bytes() + cells.vacant.bytes();
        cells(&self.cells) + self.next.as_ref().map_or(0, cells) + 12 * self.terminals.capacity()
    }
}

/// The mean density of terminals in the domain, at the centres of cells.
fn mean_density(domain: &Domain) -> f64 {
    let cells = Cells::new(domain, domain.sides.max_element() / MEAN_CELLS);
    let centers = (0..cells.count()).map(|cell| cells.at(domain, cell, DVec3::splat(0.5)));
    let densities = centers.filter(|&center| domain.may_be_within(center, 0.0)).map(|at| domain.density(at));
    let (sum, count) = densities.fold((0.0, 0u32), |(sum, count), density| (sum + density, count + 1));
    (sum / f64::from(count.max(1))).max(1.0e-6)
}

impl Cells {
    /// Cells of a threshold, none of which has been looked at.
    fn new(domain: &Domain, threshold: f64) -> Self {
        let side = threshold / f64::from(domain.dimension).sqrt();
        let size = domain.sides.to_array().map(|length| (length / side).ceil().max(1.0) as u64);
        Self { threshold, side, size, is_uniform: domain.is_uniform(), ..Self::default() }
    }

    /// Those of the next threshold.
    fn next(&self, domain: &Domain) -> Self {
        Self::new(domain, FALL * self.threshold)
    }

    /// Their number.
    fn count(&self) -> u64 {
        self.size.iter().fold(1, |cells, &count| cells.saturating_mul(count))
    }

    /// Enters terminals and looks at cells, about so many.
    fn prepare(&mut self, domain: &Domain, terminals: &[Vec3], cells: u64) {
        let entered = terminals.len().min(self.entered.saturating_add(cells as usize));
        for (number, terminal) in terminals.iter().enumerate().take(entered).skip(self.entered) {
            let cell = self.cell(domain, terminal.as_dvec3());
            self.taken.get_or_insert(cell as u32, number as u32);
            if cell < self.seen {
                self.vacant.strike(cell as u32);
            }
        }
        self.entered = entered;
        let seen = self.count().min(self.seen.saturating_add(cells));
        for cell in self.seen..seen {
            if self.is_vacant(domain, cell) {
                self.vacant.push(cell as u32);
            }
        }
        self.seen = seen;
    }

    /// Enters all terminals, and looks at all cells.
    fn finish(&mut self, domain: &Domain, terminals: &[Vec3]) {
        self.prepare(domain, terminals, u64::MAX);
        self.vacant.count();
    }

    /// Whether there may be room in a cell.
    fn is_vacant(&self, domain: &Domain, cell: u64) -> bool {
        let center = self.at(domain, cell, DVec3::splat(0.5));
        let is_free = self.taken.get(cell as u32).is_none() && domain.may_be_within(center, 0.5 * self.threshold);
        is_free && (self.is_uniform || self.may_hold(domain, cell, center))
    }

    /// Distance that a terminal at a point keeps from others; `None` where there are none.
    fn reach(&self, domain: &Domain, point: DVec3) -> Option<f64> {
        if self.is_uniform {
            return Some(self.threshold);
        }
        let density = domain.density(point);
        let apart = if density > 0.0 { size_of(domain, density.recip()) } else { f64::INFINITY };
        (apart <= MOST_APART).then_some(apart * self.threshold)
    }

    /// Whether terminals have a density above 0 at the centre or a corner of a cell.
    fn may_hold(&self, domain: &Domain, cell: u64, center: DVec3) -> bool {
        let may = |point| self.reach(domain, point).is_some();
        may(center) || corners(domain).any(|corner| may(self.at(domain, cell, corner)))
    }

    /// A point of a cell, from 0 to 1 along each axis.
    fn at(&self, domain: &Domain, cell: u64, within: DVec3) -> DVec3 {
        let [x, y, _] = self.size;
        let first = DVec3::new((cell % x) as f64, (cell / x % y) as f64, (cell / (x * y)) as f64);
        let mut local = (first + within) * self.side;
        if domain.dimension == 2 {
            local.z = 0.0;
        }
        domain.corner + domain.axes[0] * local.x + domain.axes[1] * local.y + domain.axes[2] * local.z
    }

    fn coordinates(&self, domain: &Domain, point: DVec3) -> [i64; 3] {
        let offset = point - domain.corner;
        let local = domain.axes.map(|axis| (axis.dot(offset) / self.side).floor() as i64);
        [0, 1, 2].map(|axis| local[axis].clamp(0, self.size[axis] as i64 - 1))
    }

    fn number(&self, cell: [i64; 3]) -> u64 {
        let [x, y, z] = cell.map(|value| value as u64);
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn cell(&self, domain: &Domain, point: DVec3) -> u64 {
        self.number(self.coordinates(domain, point))
    }

    /// A terminal nearer to a point than `reach`.
    fn nearest(&self, domain: &Domain, terminals: &[Vec3], point: DVec3, reach: f64) -> Option<DVec3> {
        let center = self.coordinates(domain, point);
        let square = reach * reach;
        let last = self.size.map(|count| count as i64 - 1);
        let cells = (reach / self.side).ceil() as usize;
        // A cell's own terminal first, which is near in most cases.
        let offsets = &OFFSETS[..OFFSETS.len().min(2 * cells + 1)];
        let layers = if domain.dimension == 2 { &OFFSETS[..1] } else { offsets };
        for &dz in layers {
            for &dy in offsets {
                for &dx in offsets {
                    let cell = [center[0] + dx, center[1] + dy, center[2] + dz];
                    if (0..3).any(|axis| cell[axis] < 0 || cell[axis] > last[axis]) {
                        continue;
                    }
                    let Some(number) = self.taken.get(self.number(cell) as u32) else { continue };
                    let terminal = terminals[number as usize].as_dvec3();
                    if terminal.distance_squared(point) < square {
                        return Some(terminal);
                    }
                }
            }
        }
        None
    }

    /// Whether a terminal leaves no room in a cell.
    fn covers(&self, domain: &Domain, terminal: DVec3, cell: u64) -> bool {
        corners(domain).all(|corner| {
            let at = self.at(domain, cell, corner);
            self.reach(domain, at).is_none_or(|reach| at.distance_squared(terminal) < reach * reach)
        })
    }
}

/// The corners of a cell, from 0 to 1 along each axis.
fn corners(domain: &Domain) -> impl Iterator<Item = DVec3> {
    let corner = |bit: usize, axis: usize| f64::from((bit >> axis & 1) as u32);
    (0..1 << domain.dimension).map(move |bit: usize| DVec3::new(corner(bit, 0), corner(bit, 1), corner(bit, 2)))
}

/// Side of the square or cube that is a share of the domain: `δ_max` of Eq. 15.
fn size_of_share(domain: &Domain, shares: f64) -> f64 {
    size_of(domain, domain.measure / shares)
}

/// Side of a square or a cube of this area or volume.
fn size_of(domain: &Domain, measure: f64) -> f64 {
    if domain.dimension == 2 { measure.sqrt() } else { super::power::cube_root(measure) }
}
