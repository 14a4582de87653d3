//! How deep two round cones are in each other.

use super::round_cone::RoundCone;
use bevy_math::DVec3;

/// Sections of the search, each by the golden ratio: to 3 · 10⁻¹³ of a segment's length.
const SEARCH_STEPS: usize = 60;
/// Share of an interval at which golden sections cut it: (√5 − 1) / 2.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl RoundCone {
    /// The larger one of both radii.
    pub fn widest(&self) -> f64 {
        self.start_radius.max(self.end_radius)
    }

    /// How deep this cone is in another one: the greatest r(a) + r(b) − |a − b| over both axes, negative if they are
    /// apart. The search ends as soon as it finds more than `enough`.
    ///
    /// The depth at which their balls overlap is a concave function of the places on both axes. So the deepest place of
    /// one, for the ball at each place of the other, leaves a concave function of one place, for golden sections.
    pub fn depth_in(&self, other: &Self, enough: f64) -> f64 {
        let depth = |share: f64| {
            let ball = self.start.lerp(self.end, share);
            self.start_radius + share * (self.end_radius - self.start_radius) - other.clearance(ball)
        };
        let [mut low, mut high] = [0.0, 1.0];
        let at = |low: f64, high: f64| [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        let mut most = depth(low).max(depth(high));
        let [mut first, mut second] = at(low, high).map(depth);
        for _ in 0..SEARCH_STEPS {
            most = most.max(first).max(second);
            if most > enough {
                break;
            }
            if first >= second {
                high = at(low, high)[1];
                (first, second) = (depth(at(low, high)[0]), first);
            } else {
                low = at(low, high)[0];
                (first, second) = (second, depth(at(low, high)[1]));
            }
        }
        most
    }

    /// Distance from a point to the surface, negative inside: the least |point − c| − r over the balls of the cone.
    fn clearance(&self, point: DVec3) -> f64 {
        let (axis, rise) = (self.end - self.start, self.end_radius - self.start_radius);
        let length = axis.length();
        let share = if length <= rise.abs() {
            // One ball holds all the others.
            if rise >= 0.0 { 1.0 } else { 0.0 }
        } else {
            let to_point = point - self.start;
            let along = to_point.dot(axis) / length;
            let aside = (to_point - axis * (along / length)).length();
            // The nearest ball is ahead of the point's foot where the cone widens: its slope is that of the surface.
            let slope = rise / length;
            ((along + aside * slope / (1.0 - slope * slope).sqrt()) / length).clamp(0.0, 1.0)
        };
        point.distance(self.start.lerp(self.end, share)) - (self.start_radius + share * rise)
    }
}
