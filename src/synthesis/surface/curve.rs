//! The centre line of a trunk: a smooth curve through its nodes, with its radius and with frames that hardly turn.
//!
//! In: a trunk's nodes. Out: [`Station`]s at any length along it. Nodes closer than a radius to the one before are left
//! out: vessels that grow while branches leave them zigzag within their own width. Between the nodes that stay, the
//! curve is a cubic Hermite spline with unit speed at the nodes; the radius is that of the round cones.

use super::direction::{across, turn, unit};
use super::spline::{Knot, Station, between, hermite};
use crate::synthesis::{
    segment_index::start_radius,
    tree::{NO_PARENT, VesselTree},
};
use bevy_math::Vec3;

/// Distance between kept nodes, in radii.
const SPACING: f32 = 1.0;
/// Angle that counts as much as a bulge of a radius.
const WIDENING: f32 = 4.0;
/// Length at both ends of a long segment over which the curve turns, in radii.
const EASE: f32 = 3.0;
/// Distance of knots up to which bulges count, in radii.
const NEAR: f32 = 6.0;
/// Steps towards the foot of a point: each adds about two digits where the curve is no tighter than a vessel can be.
const FOOT_STEPS: usize = 3;
/// Segments shorter than this share of the radius have no direction of their own.
const POINT: f32 = 1e-3;

/// A node's place on the curve and its radius.
#[derive(Clone, Copy, Debug)]
struct Mark {
    /// Length from the base along the chords.
    chords: f32,
    /// Length from the base along the curve.
    length: f32,
    /// Radius of the segment that ends here.
    end_radius: f32,
    /// Radius with which the segment that ends here begins.
    start_radius: f32,
}

/// A shift of the curve's beginning that dies away.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lean {
    pub shift: Vec3,
    pub from: f32,
    pub to: f32,
}

/// The centre line of a trunk.
#[derive(Clone, Debug, Default)]
pub(super) struct Curve {
    knots: Vec<Knot>,
    marks: Vec<Mark>,
    lean: Lean,
}

impl Curve {
    /// The curve of a trunk. `origin` is subtracted from positions.
    ///
    /// `is_lateral`: the first node is another trunk's, and has that one's radius. `goes_on`: its base,
    /// and its tip, lie within a segment whose other half ends there, too.
    pub fn of(tree: &VesselTree, nodes: &[u32], is_lateral: bool, goes_on: [bool; 2], origin: Vec3) -> Self {
        let mut curve = Self::default();
        curve.set_marks(tree, nodes, is_lateral);
        curve.keep_nodes(tree, nodes, origin);
        curve.ease_long_segments();
        curve.set_directions();
        curve.set_ends(tree, nodes, goes_on);
        curve.set_lengths();
        curve.set_mark_lengths();
        curve
    }

    /// Lengths of the nodes along the chords, and radii.
    fn set_marks(&mut self, tree: &VesselTree, nodes: &[u32], is_lateral: bool) {
        let mut length = 0.0;
        for (place, &node) in nodes.iter().enumerate() {
            let radius = tree.radii()[node as usize];
            let before = place.checked_sub(1).map(|before| nodes[before] as usize);
            let (mut end_radius, mut from_radius) = (radius, radius);
            if let Some(before) = before {
                length += tree.positions()[node as usize].distance(tree.positions()[before]);
                // A trunk through a root runs against the tree's order up to the root.
                let runs_back = tree.parents()[before] == node;
                let child = if runs_back { before } else { node as usize };
                let (thin, flared) = (tree.radii()[child], start_radius(tree, child));
                (from_radius, end_radius) = if runs_back { (thin, flared) } else { (flared, thin) };
            }
            self.marks.push(Mark { chords: length, length: 0.0, end_radius, start_radius: from_radius });
        }
        // A vessel begins as its first segment does.
        let begins = is_lateral || tree.parents()[nodes[0] as usize] == NO_PARENT;
        if begins && let [first, second, ..] = &mut self.marks[..] {
            first.end_radius = second.start_radius;
            first.start_radius = second.start_radius;
        }
    }

    /// The first node, the last, and those in between that are a radius away from others.
    fn keep_nodes(&mut self, tree: &VesselTree, nodes: &[u32], origin: Vec3) {
        let knot = |place: usize| Knot {
            center: tree.positions()[nodes[place] as usize] - origin,
            ahead: Vec3::ZERO,
            right: Vec3::ZERO,
            length: 0.0,
            turned: 0.0,
            place: place as u32,
            is_between: false,
        };
        self.knots.push(knot(0));
        let last = nodes.len() - 1;
        for place in 1..last {
            let here = knot(place);
            let room = SPACING * self.marks[place].end_radius;
            let distance = |other: &Knot| other.center.distance(here.center);
            if self.knots.last().is_some_and(|before| distance(before) > room) && distance(&knot(last)) > room {
                self.knots.push(here);
            }
        }
        let least = POINT * self.marks[last].end_radius;
        if last > 0 && self.knots[self.knots.len() - 1].center.distance(knot(last).center) > least {
            self.knots.push(knot(last));
        }
    }

    /// Keeps long segments straight but near their ends: a spline from node to node would bow out of them.
    fn ease_long_segments(&mut self) {
        let mut eased = Vec::with_capacity(self.knots.len());
        for pair in self.knots.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let chord = b.center - a.center;
            let reach = EASE * self.marks[b.place as usize].end_radius;
            let length = chord.length();
            eased.push(a);
            if length > 3.0 * reach {
                let share = reach / length;
                let between = |share: f32| Knot { center: a.center + chord * share, is_between: true, ..a };
                eased.extend([between(share), between(1.0 - share)]);
            }
        }
        eased.extend(self.knots.last());
        self.knots = eased;
    }

    /// Tangents, weighted so that they are those of a circle through three knots; frames by the least rotation.
    fn set_directions(&mut self) {
        let count = self.knots.len();
        let chord = |knots: &[Knot], to: usize| {
            let vector = knots[to].center - knots[to - 1].center;
            (unit(vector).unwrap_or(Vec3::Z), vector.length())
        };
        let mut before = None;
        for knot in 0..count {
            let after = (knot + 1 < count).then(|| chord(&self.knots, knot + 1));
            self.knots[knot].ahead = match (before, after) {
                (Some((a, length_a)), Some((b, length_b))) => {
                    let weighted: Vec3 = a * length_b + b * length_a;
                    unit(weighted).filter(|ahead| ahead.dot(a) > 0.1).unwrap_or(a)
                }
                (Some((direction, _)), None) | (None, Some((direction, _))) => direction,
                (None, None) => Vec3::Z,
            };
            before = after;
        }
        let first = self.knots[0].ahead.any_orthonormal_vector();
        self.set_frames(first);
    }

    /// Sets the directions of ends that go on: those of their segments.
    fn set_ends(&mut self, tree: &VesselTree, nodes: &[u32], goes_on: [bool; 2]) {
        let ([first, second, ..], [.., before, last]) = (nodes, nodes) else { return };
        let tip = self.knots.len() - 1;
        for (is_set, knot, [from, to]) in [(goes_on[0], 0, [first, second]), (goes_on[1], tip, [before, last])] {
            if is_set && let Some(ahead) = unit(tree.positions()[*to as usize] - tree.positions()[*from as usize]) {
                self.knots[knot].ahead = ahead;
                self.set_frames(self.knots[0].right);
            }
        }
    }

    /// Sets the frames from that of the base.
    fn set_frames(&mut self, first: Vec3) {
        let mut right = across(first, self.knots[0].ahead);
        let mut ahead = self.knots[0].ahead;
        for knot in &mut self.knots {
            right = across(turn(ahead, knot.ahead) * right, knot.ahead);
            ahead = knot.ahead;
            knot.right = right;
        }
    }

    /// Turns all frames so that angles at a length count from a direction.
    pub fn set_right(&mut self, length: f32, right: Vec3) {
        let here = self.at(length);
        let right = across(right, here.ahead);
        let (sine, cosine) = (right.dot(here.up()), right.dot(here.right));
        for knot in &mut self.knots {
            let up = knot.ahead.cross(knot.right);
            knot.right = across(knot.right * cosine + up * sine, knot.ahead);
        }
    }

    /// Shifts the beginning of the curve.
    pub fn set_lean(&mut self, lean: Lean) {
        self.lean = lean;
    }

    /// Lengths of the curve, and how far it has turned, at the knots.
    fn set_lengths(&mut self) {
        let (mut length, mut turned) = (0.0, 0.0);
        for knot in 1..self.knots.len() {
            let [a, b] = [self.knots[knot - 1], self.knots[knot]];
            let chord = a.center.distance(b.center);
            let middle = hermite(&a, &b, chord, 0.5).0;
            // Simpson's rule for the two halves' chords: exact to fourth order.
            let halves = a.center.distance(middle) + middle.distance(b.center);
            length += halves + (halves - chord) / 3.0;
            turned += a.ahead.angle_between(unit(b.center - a.center).unwrap_or(a.ahead));
            turned += b.ahead.angle_between(unit(b.center - a.center).unwrap_or(b.ahead));
            turned += WIDENING * self.unevenness(knot, a.center.distance(b.center));
            self.knots[knot].length = length;
            self.knots[knot].turned = turned;
        }
    }

    /// Lengths of the curve at the nodes.
    fn set_mark_lengths(&mut self) {
        let mut before: Option<&Knot> = None;
        for knot in self.knots.iter().filter(|knot| !knot.is_between) {
            if let Some(before) = before {
                let places = before.place as usize..=knot.place as usize;
                spread(&mut self.marks[places], before.length, knot.length);
            }
            before = Some(knot);
        }
        // A tip that coincides with the knot before it.
        let beyond = self.knots.last().map_or(0, |knot| knot.place as usize);
        let length = self.length();
        self.marks[beyond..].iter_mut().for_each(|mark| mark.length = length);
    }

    /// How far the radius at a knot is from the mean of its neighbours', as a share. Only knots near each other count:
    /// farther apart, a radius that changes along a segment is a cone as the segment is.
    fn unevenness(&self, knot: usize, chord: f32) -> f32 {
        let radius = |knot: usize| self.marks[self.knots[knot].place as usize].end_radius;
        let here = radius(knot);
        if knot + 1 == self.knots.len() || chord > NEAR * here {
            return 0.0;
        }
        (here - 0.5 * (radius(knot - 1) + radius(knot + 1))).abs() / here
    }

    /// Length of the whole curve.
    pub fn length(&self) -> f32 {
        self.knots.last().map_or(0.0, |knot| knot.length)
    }

    /// Length from the base to a node, by its place in the trunk.
    pub fn length_of(&self, place: usize) -> f32 {
        self.marks[place].length
    }

    /// Place of the node whose segment holds a length.
    pub fn place_at(&self, length: f32) -> usize {
        self.marks.partition_point(|mark| mark.length < length).min(self.marks.len() - 1)
    }

    /// Radius at a length; beyond the ends, that at the end.
    pub fn radius_at(&self, length: f32) -> f32 {
        let place = self.place_at(length);
        let mark = self.marks[place];
        let Some(before) = place.checked_sub(1).map(|before| self.marks[before]) else { return mark.end_radius };
        let span = mark.length - before.length;
        if !(span > 0.0) {
            return mark.end_radius;
        }
        let share = ((length - before.length) / span).clamp(0.0, 1.0);
        mark.start_radius + share * (mark.end_radius - mark.start_radius)
    }

    /// How far the curve has turned from the base to a length, in radians, with bulges of its radius.
    pub fn turned_at(&self, length: f32) -> f32 {
        let Some((first, second)) = self.span(length) else { return 0.0 };
        let [a, b] = [first, second].map(|knot| self.knots[knot]);
        let share = ((length - a.length) / (b.length - a.length)).clamp(0.0, 1.0);
        a.turned + share * (b.turned - a.turned)
    }

    /// The length after another one by an effort, which counts length and turn at two rates.
    pub fn after(&self, length: f32, effort: f32, rates: [f32; 2]) -> f32 {
        let Some((_, mut next)) = self.span(length) else { return length + effort / rates[0] };
        let (mut at, mut turned, mut left) = (length, self.turned_at(length), effort);
        loop {
            let knot = &self.knots[next];
            let needed = (knot.length - at) * rates[0] + (knot.turned - turned) * rates[1];
            if needed >= left && needed > 0.0 {
                return at + (knot.length - at) * (left / needed);
            }
            if next + 1 == self.knots.len() {
                return knot.length.max(at) + (left - needed.max(0.0)) / rates[0];
            }
            (at, turned, left) = (knot.length.max(at), knot.turned, left - needed.max(0.0));
            next += 1;
        }
    }

    /// The knots on both sides of a length, `None` for a curve without length.
    fn span(&self, length: f32) -> Option<(usize, usize)> {
        let count = self.knots.len();
        let second = self.knots.partition_point(|knot| knot.length < length).clamp(1, count.max(2) - 1);
        (count > 1).then_some((second - 1, second))
    }

    /// The length at the foot of a point, from one near it.
    pub fn foot(&self, point: Vec3, mut length: f32) -> f32 {
        for _ in 0..FOOT_STEPS {
            let here = self.at(length);
            length = (length + (point - here.center).dot(here.ahead)).clamp(0.0, self.length());
        }
        length
    }

    /// The station at a length; beyond the ends the curve goes straight on.
    pub fn at(&self, length: f32) -> Station {
        let radius = self.radius_at(length);
        let mut station = match self.span(length) {
            None => self.knots[0].straight_on(length, radius),
            Some((first, second)) => between(&self.knots[first], &self.knots[second], length, radius),
        };
        let Lean { shift, from, to } = self.lean;
        if length < to {
            let share = ((to - length) / (to - from)).clamp(0.0, 1.0);
            station.center += shift * (share * share * (3.0 - 2.0 * share));
        }
        station
    }
}

/// Lengths of marks between two knots, in proportion to those along the chords.
fn spread(marks: &mut [Mark], from: f32, to: f32) {
    let [first, .., last] = marks else { return };
    let (start, span) = (first.chords, last.chords - first.chords);
    let count = marks.len() - 1;
    for (number, mark) in marks.iter_mut().enumerate() {
        let share = if span > 0.0 { (mark.chords - start) / span } else { number as f32 / count as f32 };
        mark.length = from + share * (to - from);
    }
}
