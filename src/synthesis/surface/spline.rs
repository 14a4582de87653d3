//! A cubic Hermite spline between the knots of a curve, and what a cross-section needs of it.

use super::direction::{across, turn, unit};
use bevy_math::{Vec3, ops};

/// A point of a curve with all that a cross-section needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    pub center: Vec3,
    /// Unit tangent, from base to tip.
    pub ahead: Vec3,
    /// Unit vector across, the zero of angles.
    pub right: Vec3,
    /// Radius of the vessel.
    pub radius: f32,
}

impl Station {
    /// Unit vector across, a quarter turn from [`right`](Self::right).
    pub fn up(&self) -> Vec3 {
        self.ahead.cross(self.right)
    }

    /// The angle of a direction around the curve, from [`right`](Self::right) to [`up`](Self::up).
    pub fn angle_of(&self, direction: Vec3) -> f32 {
        ops::atan2(direction.dot(self.up()), direction.dot(self.right))
    }
}

/// A kept node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    pub center: Vec3,
    pub ahead: Vec3,
    pub right: Vec3,
    /// Length from the base.
    pub length: f32,
    /// Angle by which the curve has turned since the base, with bulges of its radius.
    pub turned: f32,
    /// Place among the trunk's nodes; for a point on a segment, that of the node before it.
    pub place: u32,
    /// Whether it is a point on a segment.
    pub is_between: bool,
}

impl Knot {
    /// The station on the straight line through the knot.
    pub fn straight_on(&self, length: f32, radius: f32) -> Station {
        let Self { center, ahead, right, .. } = *self;
        Station { center: center + ahead * (length - self.length), ahead, right, radius }
    }
}

/// The station between two knots, or straight on beyond them.
pub(super) fn between(a: &Knot, b: &Knot, length: f32, radius: f32) -> Station {
    if length <= a.length {
        return a.straight_on(length, radius);
    }
    if length >= b.length {
        return b.straight_on(length, radius);
    }
    let share = (length - a.length) / (b.length - a.length);
    let chord = a.center.distance(b.center);
    let (center, velocity) = hermite(a, b, chord, share);
    let ahead = unit(velocity).unwrap_or(a.ahead);
    let right = across(turn(a.ahead, ahead) * a.right, ahead);
    Station { center, ahead, right, radius }
}

/// Position and velocity on the spline between two knots.
pub(super) fn hermite(a: &Knot, b: &Knot, chord: f32, share: f32) -> (Vec3, Vec3) {
    let (t, t2, t3) = (share, share * share, share * share * share);
    let [va, vb] = [a.ahead * chord, b.ahead * chord];
    let center = a.center * (2.0 * t3 - 3.0 * t2 + 1.0)
        + va * (t3 - 2.0 * t2 + t)
        + b.center * (3.0 * t2 - 2.0 * t3)
        + vb * (t3 - t2);
    let velocity =
        (b.center - a.center) * (6.0 * t - 6.0 * t2) + va * (3.0 * t2 - 4.0 * t + 1.0) + vb * (3.0 * t2 - 2.0 * t);
    (center, velocity)
}
