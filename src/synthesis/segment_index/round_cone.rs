//! A segment's shape: the round cone that it is drawn as, with its queries.
//!
//! A round cone is the union of all balls whose centre moves from one end of the segment to the other while their
//! radius changes from one end's to the other's. Everything here is computed in f64, from the tree's f32.

use crate::synthesis::tree::{NO_PARENT, VesselTree};
use bevy_math::{DVec3, Vec3};

/// Largest ratio of a segment's radius at its start to its own radius.
///
/// A segment begins with its parent's radius, so that a vessel tapers without steps, but never with more than this
/// multiple of its own: otherwise a thin side branch of a trunk would begin as a thorn as wide as the trunk. Both
/// daughters of a symmetric bifurcation are thinner than their parent by 2^(1/κ), 1.26 at κ = 3 and 1.31 at κ = 2.55,
/// so they still flare nearly all the way.
pub const MAX_FLARE: f32 = 1.3;

/// The radius with which the segment of a node begins at its parent, in tissue lengths: 0 for a root.
///
/// # Panics
/// If the node is not in the tree.
pub fn start_radius(tree: &VesselTree, node: usize) -> f32 {
    match tree.parents()[node] {
        NO_PARENT => 0.0,
        parent => tree.radii()[parent as usize].min(MAX_FLARE * tree.radii()[node]),
    }
}

/// The balls between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoundCone {
    /// Centre at the end towards the root.
    pub start: DVec3,
    /// Centre at the node.
    pub end: DVec3,
    /// Radius at `start`.
    pub start_radius: f64,
    /// Radius at `end`.
    pub end_radius: f64,
}

impl RoundCone {
    /// The segment that ends in a node; `None` for a root.
    pub fn of(tree: &VesselTree, node: u32) -> Option<Self> {
        let node = node as usize;
        let parent = tree.parents()[node];
        if parent == NO_PARENT {
            return None;
        }
        Some(Self {
            start: tree.positions()[parent as usize].as_dvec3(),
            end: tree.positions()[node].as_dvec3(),
            start_radius: start_radius(tree, node).into(),
            end_radius: tree.radii()[node].into(),
        })
    }

    /// Share of the centre line at which it is nearest to a point, and the squared distance.
    pub fn nearest(&self, point: DVec3) -> (f64, f64) {
        let (along, to_point) = (self.end - self.start, point - self.start);
        let (share, length_squared) = (along.dot(to_point), along.length_squared());
        // The ends are used exactly, so that segments that share one are equally far.
        if share <= 0.0 || length_squared == 0.0 {
            (0.0, to_point.length_squared())
        } else if share >= length_squared {
            (1.0, point.distance_squared(self.end))
        } else {
            let share = share / length_squared;
            (share, (to_point - along * share).length_squared())
        }
    }

    /// Distance along a ray of unit direction to its first point in the cone, 0 from inside, and the share of the
    /// centre line of the ball that is hit there.
    ///
    /// A point q is inside if the least f(s) = |q − start − s·v|² − (r + s·k)² over 0 ≤ s ≤ 1 is at most 0, with v from
    /// end to end and k the difference of radii. Between the ends the least is at f'(s) = 0, which gives a quadratic
    /// equation for the distance along the ray; at the ends it is that of a ball.
    pub fn hit(&self, from: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let (v, k) = (self.end - self.start, self.end_radius - self.start_radius);
        let to_from = from - self.start;
        let h = v.length_squared() - k * k;
        let ends = [(0.0, to_from, self.start_radius), (1.0, from - self.end, self.end_radius)];
        if !(h > 0.0) {
            // One ball holds all the others.
            let (share, to_from, radius) = ends[usize::from(k >= 0.0)];
            return hit_ball(to_from, direction, radius).map(|distance| (distance, share));
        }
        let (s0, s1) = ((v.dot(to_from) + k * self.start_radius) / h, v.dot(direction) / h);
        let nearest = s0.clamp(0.0, 1.0);
        let radius = self.start_radius + nearest * k;
        if (to_from - v * nearest).length_squared() <= radius * radius {
            return Some((0.0, nearest));
        }
        let a = 1.0 - s1 * s1 * h;
        let b = to_from.dot(direction) - s0 * s1 * h;
        let c = to_from.length_squared() - self.start_radius * self.start_radius - s0 * s0 * h;
        let side = roots(a, b, c).map(|distance| (distance, s0 + s1 * distance));
        let side = side.into_iter().filter(|(_, share)| (0.0..=1.0).contains(share));
        let balls = ends.into_iter().filter_map(|(share, to_from, radius)| {
            hit_ball(to_from, direction, radius).map(|distance| (distance, share))
        });
        side.chain(balls).filter(|(distance, _)| *distance >= 0.0).min_by(|x, y| x.0.total_cmp(&y.0))
    }

    /// The same for a piece between two shares of the centre line: round at the segment's ends, and flat at cuts.
    ///
    /// Both the cone and the space between the cuts are convex, so the ray is in each from one distance to another.
    pub fn hit_piece(&self, from: DVec3, direction: DVec3, [first, last]: [f64; 2]) -> Option<(f64, f64)> {
        let v = self.end - self.start;
        let radius = |share: f64| self.start_radius + share * (self.end_radius - self.start_radius);
        let at = |share: f64| self.start + share * v;
        let piece = Self { start: at(first), end: at(last), start_radius: radius(first), end_radius: radius(last) };
        let [mut enter, mut leave] = piece.passage(from, direction)?;
        let (mut cut, rate) = (None, v.dot(direction));
        for (share, ahead) in [(first, 1.0), (last, -1.0)].into_iter().filter(|(share, _)| *share > 0.0 && *share < 1.0)
        {
            let (depth, rate) = (ahead * v.dot(from - at(share)), ahead * rate);
            let crossed = -depth / rate;
            if rate > 0.0 && crossed > enter {
                (enter, cut) = (crossed, Some(share));
            } else if rate < 0.0 {
                leave = leave.min(crossed);
            } else if rate == 0.0 && depth < 0.0 {
                return None;
            }
        }
        if enter < 0.0 {
            (enter, cut) = (0.0, None);
        }
        let nearest = || first + (last - first) * piece.nearest(from + direction * enter).0;
        (enter <= leave).then(|| (enter, cut.unwrap_or_else(nearest)))
    }

    /// The interval in which a line of unit direction is in the cone; negative before its origin.
    ///
    /// The cone is the hull of its two end balls: of the points where the line meets these or the side, the first and
    /// the last bound the interval. See [`hit`](Self::hit).
    fn passage(&self, from: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let (v, k) = (self.end - self.start, self.end_radius - self.start_radius);
        let to_from = from - self.start;
        let h = v.length_squared() - k * k;
        let ball = |to_from: DVec3, radius: f64| {
            roots(1.0, to_from.dot(direction), to_from.length_squared() - radius * radius)
        };
        let ends = [ball(to_from, self.start_radius), ball(from - self.end, self.end_radius)];
        let mut side = [f64::NAN; 2];
        if h > 0.0 {
            let (s0, s1) = ((v.dot(to_from) + k * self.start_radius) / h, v.dot(direction) / h);
            let a = 1.0 - s1 * s1 * h;
            let b = to_from.dot(direction) - s0 * s1 * h;
            let c = to_from.length_squared() - self.start_radius * self.start_radius - s0 * s0 * h;
            side = roots(a, b, c).map(|t| if (0.0..=1.0).contains(&(s0 + s1 * t)) { t } else { f64::NAN });
        }
        let met = side.into_iter().chain(ends.into_iter().flatten()).filter(|t| t.is_finite());
        let (enter, leave) = met.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
        (enter <= leave).then_some([enter, leave])
    }

    /// A ball that holds the whole segment: its centre and radius.
    pub fn ball_around(&self) -> (DVec3, f64) {
        let center = self.start.midpoint(self.end);
        (center, 0.5 * self.start.distance(self.end) + self.start_radius.max(self.end_radius))
    }
}

/// Distance along a ray of unit direction to a ball, 0 from inside.
fn hit_ball(to_from: DVec3, direction: DVec3, radius: f64) -> Option<f64> {
    let c = to_from.length_squared() - radius * radius;
    if c <= 0.0 {
        return Some(0.0);
    }
    let b = to_from.dot(direction);
    // From outside, the first of the two roots is the nearer one, and positive if the ray comes closer.
    roots(1.0, b, c).into_iter().filter(|distance| *distance >= 0.0).min_by(f64::total_cmp)
}

/// The solutions of a·t² + 2·b·t + c = 0; NaN or infinite if there is none, or only one.
fn roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    // The terms of this sum have one sign, so that neither solution is a difference of nearly equal numbers.
    let sum = -(b + (b * b - a * c).sqrt().copysign(b));
    [sum / a, c / sum]
}

/// The box around a segment, as wide as any parent's radius can make it; `None` for a root.
///
/// It depends on the node's own radius and on both ends' positions, so a changed radius affects only one box.
pub(super) fn box_around(tree: &VesselTree, node: u32) -> Option<(Vec3, Vec3)> {
    let node = node as usize;
    let parent = tree.parents()[node];
    if parent == NO_PARENT {
        return None;
    }
    let (start, end) = (tree.positions()[parent as usize], tree.positions()[node]);
    let radius = tree.radii()[node];
    let wide = MAX_FLARE * radius;
    // Rounded outwards, so that the box holds every point of the segment.
    let min = (start - wide).min(end - radius);
    let max = (start + wide).max(end + radius);
    Some((min.to_array().map(f32::next_down).into(), max.to_array().map(f32::next_up).into()))
}
