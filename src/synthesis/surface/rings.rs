//! The rings of a trunk: cross-sections from its base to its tip, close enough that the surface follows the curve.
//!
//! In: a trunk's curve and its rows. Out: rings with the angles of their vertices. Each ring lies in a plane that cuts
//! the vessel. Planes stand across the curve, unless two neighbours would meet inside the vessel, as in a sharp bend:
//! then one of the two rings is left out, or both planes are tilted to stand alike.

use super::columns::Columns;
use super::curve::Curve;
use super::direction::unit;
use super::rows::Row;
use super::shape::Shape;
use super::spline::Station;
use bevy_math::Vec3;

/// The longest distance between rings, in radii.
const LONGEST: f32 = 12.0;
/// The most by which the curve turns between two rings, in radians.
const MOST_TURN: f32 = 0.4;
/// The most rings between two rows; a vessel of a thousand radii without a branch has fewer.
const MOST_RINGS: f32 = 100_000.0;
/// Cosine of the most by which a plane is tilted against its curve.
const MOST_TILT: f32 = 0.35;
/// The least share of their distance by which two rings are apart everywhere.
const LEAST_APART: f32 = 0.1;
/// Distance from which rings are not looked at, in radii.
const FAR: f32 = 3.0;
/// The most by which a ring is moved or widened for the surface's sake, in radii.
const MOST_SWELL: f32 = 0.25;
/// Length over which a bend is sharp, in radii, and the cosine of its angle: 100°.
const BEND: f32 = 7.0;
const SHARP: f32 = -0.17;
/// Passes in which rings are left out or tilted.
const PASSES: usize = 6;
/// Directions in which the distance of two rings is checked.
const DIRECTIONS: [[f32; 2]; 8] = {
    const H: f32 = std::f32::consts::FRAC_1_SQRT_2;
    [[1.0, 0.0], [H, H], [0.0, 1.0], [-H, H], [-1.0, 0.0], [-H, -H], [0.0, -1.0], [H, -H]]
};

/// A cross-section.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    pub station: Station,
    pub length: f32,
    pub sides: u32,
    /// Normal of its plane.
    pub normal: Vec3,
    /// Radius of the ring, so that the surface has the station's radius.
    pub radius: f32,
    /// Its first angle in the list.
    pub first_angle: u32,
    /// Whether faces beside it may meet others: a neighbour met it before it was tilted, or it lies in a sharp bend.
    pub is_doubtful: bool,
    /// Rings of one row have one number, and a common plane. Others may be left out.
    row: Option<u32>,
}

impl Ring {
    /// The point of its plane at a direction across the curve.
    pub fn point(&self, [cosine, sine]: [f32; 2], radius: f32) -> Vec3 {
        let Station { ahead, right, .. } = self.station;
        let out = (right * cosine + ahead.cross(right) * sine) * radius;
        self.station.center + out - ahead * (self.normal.dot(out) / self.normal.dot(ahead))
    }
}

/// How a trunk begins.
#[derive(Clone, Debug)]
pub(super) struct Start {
    /// Length along the trunk of its first ring.
    pub length: f32,
    /// Normal of the first ring's plane; that of the curve if zero.
    pub normal: Vec3,
    /// Columns of the first ring.
    pub columns: Columns,
    pub sides: u32,
}

impl Station {
    /// How far the surface at a ring here lies to the inner side of a bend between the middles of its neighbours.
    pub fn cut_between(&self, before: Vec3, after: Vec3) -> Vec3 {
        let cut = (self.center - before + self.center - after) / 6.0;
        (cut - self.ahead * self.ahead.dot(cut)).clamp_length_max(MOST_SWELL * self.radius)
    }
}

/// All rings of a trunk.
#[derive(Debug, Default)]
pub(super) struct Rings {
    pub rings: Vec<Ring>,
    pub angles: Vec<f32>,
    /// For each row, its first ring.
    pub of_rows: Vec<u32>,
}

impl Rings {
    /// Lays the rings of a trunk, the last one with a vertex in a direction if one is given. Sets the columns of its rows'
    /// openings.
    pub fn lay(&mut self, curve: &Curve, start: &Start, rows: &mut [Row], shape: &Shape, spoke: Option<Vec3>) {
        self.rings.clear();
        self.angles.clear();
        self.push(curve, start.length, start.sides, None);
        if start.normal != Vec3::ZERO {
            self.rings[0].normal = start.normal;
        }
        start.columns.sample(start.sides, &mut self.angles);
        let (mut columns, mut before) = (start.columns.clone(), start.length);
        for (number, row) in (0u32..).zip(rows) {
            let station = curve.at(row.length);
            let first = row.length - row.half;
            let radii = (first - before).max(0.0) / station.radius;
            let next = columns.with_openings(row.sides, &mut row.openings, radii);
            self.fill(curve, [before, first], [&columns, &next], row.sides, shape);
            for line in 0..=row.width {
                let length = first + 2.0 * row.half * line as f32 / row.width as f32;
                self.push(curve, length, row.sides, Some(number));
                if let Some(ring) = self.rings.last_mut() {
                    ring.normal = station.ahead;
                    ring.station.radius = ring.station.radius.max(station.radius);
                    ring.radius = ring.station.radius;
                }
                next.sample(row.sides, &mut self.angles);
            }
            (columns, before) = (next, row.length + row.half);
        }
        self.end(curve, before, &columns, shape, spoke);
        self.settle();
    }

    fn end(&mut self, curve: &Curve, before: f32, columns: &Columns, shape: &Shape, spoke: Option<Vec3>) {
        let radius = curve.radius_at(curve.length());
        // A root without a segment is a ball: both ends on one ring.
        if self.rings.len() == 1 && self.rings[0].length == 0.0 && curve.length() < LEAST_APART * radius {
            return;
        }
        let tip = curve.length().max(before + 0.3 * radius);
        let sides = shape.sides_of(radius);
        let even = match spoke {
            Some(spoke) => columns.evened_to(sides, curve.at(tip).angle_of(spoke)),
            None => columns.evened(sides),
        };
        self.fill(curve, [before, tip], [columns, &even], sides, shape);
        let last = self.rings.len() - 1;
        let sides = sides.clamp(self.rings[last].sides / 2, self.rings[last].sides * 2).max(4);
        self.push(curve, tip, sides, None);
        even.sample(sides, &mut self.angles);
    }

    fn push(&mut self, curve: &Curve, length: f32, sides: u32, row: Option<u32>) {
        let station = curve.at(length);
        let first_angle = self.angles.len() as u32;
        self.rings.push(Ring {
            station,
            length,
            sides,
            normal: station.ahead,
            radius: station.radius,
            first_angle,
            is_doubtful: false,
            row,
        });
    }

    /// Rings between two lengths, the ends excluded. Sides change by a factor of 2 from ring to ring.
    fn fill(&mut self, curve: &Curve, [from, to]: [f32; 2], [first, second]: [&Columns; 2], sides: u32, shape: &Shape) {
        let mut last = self.rings[self.rings.len() - 1].sides;
        let factors = last.max(sides).ilog2() - last.min(sides).ilog2();
        // Effort of a stretch: the number of belts that its length and its turn need.
        let radius = curve.radius_at(0.5 * (from + to));
        let rates = [1.0 / (LONGEST * radius), 1.0 / MOST_TURN];
        let effort = (to - from) * rates[0] + (curve.turned_at(to) - curve.turned_at(from)) * rates[1];
        let belts = effort.min(MOST_RINGS).ceil().max(factors as f32).max(1.0) as u32;
        let mut length = from;
        for belt in 1..belts {
            length = curve.after(length, effort / belts as f32, rates).min(to);
            let left = (belts - belt).min(5);
            let least = (last / 2).max(sides >> left);
            let most = (last * 2).min(sides << left);
            last = shape.sides_of(curve.radius_at(length)).clamp(least, most.max(least));
            self.push(curve, length, last, None);
            first.blend(second, (length - from) / (to - from), last, &mut self.angles);
        }
    }

    /// Leaves out or tilts rings that meet their neighbours.
    fn settle(&mut self) {
        for ring in &mut self.rings {
            ring.normal = within_tilt(ring.normal, ring.station.ahead);
        }
        self.doubt_bends();
        for _ in 0..PASSES {
            if !self.settle_once() {
                break;
            }
        }
        self.level_bumps();
        self.swell();
        self.of_rows.clear();
        for (index, ring) in (0u32..).zip(&self.rings) {
            if ring.row == Some(self.of_rows.len() as u32) {
                self.of_rows.push(index);
            }
        }
    }

    /// One pass from base to tip. Rings that stay are moved up.
    fn settle_once(&mut self) -> bool {
        let (mut has_changed, mut kept) = (false, 0);
        for index in 1..self.rings.len() {
            let mut stays = true;
            while meet(&self.rings[kept], &self.rings[index]) {
                has_changed = true;
                if self.may_go(kept, index, index + 1) {
                    stays = false;
                } else if kept > 0 && self.may_go(kept - 1, kept, index) {
                    kept -= 1;
                    continue;
                } else {
                    self.align(kept, index);
                    self.rings[kept].is_doubtful = true;
                    self.rings[index].is_doubtful = true;
                }
                break;
            }
            if stays {
                kept += 1;
                self.rings[kept] = self.rings[index];
            }
        }
        self.rings.truncate(kept + 1);
        has_changed
    }

    /// Doubts rings within sharp bends: the faces on the inner side may meet.
    fn doubt_bends(&mut self) {
        let mut first = 0;
        for last in 1..self.rings.len() {
            let Ring { station, length, .. } = self.rings[last];
            while length - self.rings[first].length > BEND * station.radius {
                first += 1;
            }
            if (first..last).any(|ring| self.rings[ring].station.ahead.dot(station.ahead) < SHARP) {
                self.rings[first..=last].iter_mut().for_each(|ring| ring.is_doubtful = true);
            }
        }
    }

    /// Moves and widens rings so that the surface follows the curve.
    ///
    /// In the limit, the surface at a ring is a mean of that ring, four times, and of its neighbours: it cuts corners and
    /// flattens bulges. The rings are moved by as much to the other side.
    fn swell(&mut self) {
        let mut before = self.rings[0].station.center;
        for index in 1..self.rings.len().saturating_sub(1) {
            let [a, b, c] = [index - 1, index, index + 1].map(|ring| self.rings[ring]);
            let (from, here, to) = (before, b.station.center, c.station.center);
            before = here;
            let (most, aside) = (MOST_SWELL * b.station.radius, b.station.cut_between(from, to));
            let span = c.length - a.length;
            let moved = (a.length - 2.0 * b.length + c.length) / 6.0;
            let slope = if span > 0.0 { (c.station.radius - a.station.radius) / span } else { 0.0 };
            let flattened = (2.0 * b.station.radius - a.station.radius - c.station.radius) / 6.0 + slope * moved;
            let ring = &mut self.rings[index];
            ring.station.center += aside;
            ring.radius += flattened.clamp(-most, most);
        }
    }

    /// Halves the sides of a ring between two coarser ones: each second of its vertices would have only two edges.
    fn level_bumps(&mut self) {
        for index in 1..self.rings.len().saturating_sub(1) {
            let [before, here, after] = [index - 1, index, index + 1].map(|ring| self.rings[ring].sides);
            if here > before && here > after {
                let first = self.rings[index].first_angle as usize;
                for side in 0..here as usize / 2 {
                    self.angles[first + side] = self.angles[first + 2 * side];
                }
                self.rings[index].sides = here / 2;
            }
        }
    }

    /// Whether a ring between two others may be left out.
    fn may_go(&self, before: usize, ring: usize, after: usize) -> bool {
        let Some(after) = self.rings.get(after) else { return false };
        let (a, b) = (self.rings[before].sides, after.sides);
        self.rings[ring].row.is_none() && a.max(b) <= 2 * a.min(b)
    }

    /// Gives two neighbours, and the other rings of their rows, planes that stand alike.
    fn align(&mut self, before: usize, after: usize) {
        let [a, b] = [before, after].map(|ring| self.rings[ring].normal);
        let Some(mean) = unit(a + b) else { return };
        let row = |ring: usize| self.rings[ring].row;
        let mut first = before;
        while first > 0 && row(before).is_some() && row(first - 1) == row(before) {
            first -= 1;
        }
        let mut last = after;
        while row(after).is_some() && last + 1 < self.rings.len() && row(last + 1) == row(after) {
            last += 1;
        }
        let tilted =
            |ring: &mut Ring| ring.normal = within_tilt(unit(ring.normal + mean).unwrap_or(mean), ring.station.ahead);
        self.rings[first..=before].iter_mut().for_each(tilted);
        self.rings[after..=last].iter_mut().for_each(tilted);
    }
}

/// Whether two neighbours come too close somewhere, or in the wrong order.
fn meet(before: &Ring, after: &Ring) -> bool {
    let (a, b) = (&before.station, &after.station);
    let way = b.center - a.center;
    let radius = a.radius.max(b.radius);
    // Rings that are far from each other only meet if the vessel itself turns back.
    if way.length_squared() > FAR * FAR * radius * radius {
        return false;
    }
    // Planes that are nearly alike, for their distance.
    let turned = (before.normal - after.normal).length() + (a.ahead - b.ahead).length();
    let ahead = way.dot(before.normal + after.normal);
    if ahead > 0.0 && radius * turned < 0.4 * ahead {
        return false;
    }
    let least = LEAST_APART * way.length();
    DIRECTIONS.into_iter().any(|direction| {
        let apart = after.point(direction, b.radius) - before.point(direction, a.radius);
        apart.dot(before.normal) < least || apart.dot(after.normal) < least
    })
}

/// A normal, or the nearest to it that is not tilted too far against the curve.
fn within_tilt(normal: Vec3, ahead: Vec3) -> Vec3 {
    let cosine = normal.dot(ahead);
    if cosine >= MOST_TILT {
        return normal;
    }
    let out = unit(normal - ahead * cosine).unwrap_or(Vec3::ZERO);
    (ahead * MOST_TILT + out * (1.0 - MOST_TILT * MOST_TILT).sqrt()).normalize()
}
