//! A bifurcation, and the place where it costs least.
//!
//! Source: Kamiya & Togawa, "Optimal branching structure of the vascular tree" (1972), as OpenCCO uses it (section 3.2,
//! Eq. 9 to 13). Its Eq. 13 says that at the best place the three ends pull equally: `Σ r_i²·(p_i − x)/l_i = 0`, where
//! `r_i²` is the volume per length of a segment whose radius stays. But radii change with lengths, along the whole path
//! to the root. Here the pull of an end is the exact derivative `c_i` of the whole tree's volume by the length of its
//! segment, so that the solution is a minimum of the volume itself.

use super::{
    power::Exponent,
    sums::{Below, Slope, Sums, below_slope},
};
use bevy_math::{DMat3, DVec3};

/// Places that a search has looked at before its last step, at most. Newton's method takes three to five steps, nearly
/// all of them whole. Where the flows or radii are so different that rounding hides what a step gains, it may take any
/// number.
const MOST_LOOKS: usize = 256;
/// Length of a segment, as a share of the longest, below which the best place may be its end itself, where the volume
/// has a cusp that steps approach slowly.
const NEAR_END: f64 = 0.15;
/// The same below which a joint counts as at an end.
const AT_END: f64 = 2.0e-3;
/// Steps at an end after which the search is over.
const STEPS_AT_END: usize = 10;
/// Share of the pull of an end that leaves no doubt: pulls change with lengths, so there may be a better place beside
/// it.
const CLEARLY: f64 = 0.95;
/// Halvings of a step that does not lower the volume.
const HALVINGS: usize = 12;
/// Least length of a segment, as a share of the joint's size: a pull has no direction at its end.
const LEAST_LENGTH: f64 = 1.0e-6;

/// A bifurcation of which all but the place is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    /// Its three ends: the parent's, and those of both children.
    pub ends: [DVec3; 3],
    /// Flows to both children.
    pub flows: [f64; 2],
    /// What is below the children's ends.
    pub below: [Below; 2],
    /// γ.
    pub exponent: Exponent,
}

/// The sums of the three segments of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointSums {
    /// From the parent's end to the joint.
    pub trunk: Sums,
    /// From the joint to the children's ends.
    pub children: [Sums; 2],
    /// What is below the joint.
    pub below: Below,
    /// Lengths, the trunk's first.
    pub lengths: [f64; 3],
}

impl Joint {
    /// The mean of the ends, weighted by their flows: where the search begins.
    pub(super) fn start(&self) -> DVec3 {
        let [a, b] = self.flows;
        (self.ends[0] * (a + b) + self.ends[1] * a + self.ends[2] * b) / (2.0 * (a + b))
    }

    /// The sums with the joint at a place.
    pub(super) fn sums(&self, place: DVec3) -> JointSums {
        let least = LEAST_LENGTH * (self.ends[0] - self.ends[2]).length();
        let lengths = self.ends.map(|end| (end - place).length().max(least));
        let child = |c: usize| Sums::of(self.flows[c], lengths[c + 1], &self.below[c], self.exponent);
        let children = [child(0), child(1)];
        let below = Below::join(&children[0], &children[1], self.exponent);
        let trunk = Sums::of(self.flows[0] + self.flows[1], lengths[0], &below, self.exponent);
        JointSums { trunk, children, below, lengths }
    }

    /// Derivatives of the tree's volume by the three lengths, where it depends on the trunk's sums as `slope` says.
    fn pulls(&self, at: &JointSums, slope: &Slope) -> [f64; 3] {
        let JointSums { trunk, children, below, lengths } = at;
        let flow = self.flows[0] + self.flows[1];
        let own = |sums: &Sums, flow: f64| sums.load.sqrt() + 0.5 * flow * sums.volume / sums.load;
        let by_below = slope.load + slope.volume * below_slope(below, trunk);
        let by_volume = slope.volume * (trunk.load / below.load).sqrt();
        let child = |c: usize| {
            let sums = &children[c];
            let load = below.load / below.power * sums.power / sums.load;
            debug_assert!(lengths[c + 1] > 0.0);
            by_below * load * self.flows[c] + by_volume * own(sums, self.flows[c])
        };
        [slope.load * flow + slope.volume * own(trunk, flow), child(0), child(1)]
    }

    /// The place of least volume, found from `start`.
    ///
    /// The volume depends on the trunk's sums as `slope` says, to first order. Each step is Newton's, or else one
    /// against the gradient, and is halved while it does not lower the volume: the result is never worse than the
    /// start. The search ends when a step would gain less than `tolerance` times what the second child's segment costs.
    pub(super) fn settle(&self, start: DVec3, at_start: &JointSums, slope: &Slope, tolerance: f64) -> DVec3 {
        self.descend(start, at_start, slope, tolerance).0
    }

    /// The same with the number of places that were looked at.
    fn descend(&self, start: DVec3, at_start: &JointSums, slope: &Slope, tolerance: f64) -> (DVec3, usize) {
        let cost = |sums: &JointSums| slope.load * sums.trunk.load + slope.volume * sums.trunk.volume;
        let (mut place, mut sums) = (start, *at_start);
        let (mut least, mut steps_at_end, mut looks) = (cost(&sums), 0, 0);
        // A segment without load pulls without limit at its end, which tells nothing.
        let mut is_told = [false, self.below[0].load == 0.0, self.below[1].load == 0.0];
        while looks < MOST_LOOKS {
            let Some(Step { way, plain, gain, scale }) = self.step(place, &sums, slope) else { break };
            if gain <= tolerance * scale {
                break;
            }
            let shares = || std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(HALVINGS);
            let tries = shares().map(|share| way * share).chain(shares().map(|share| plain * share));
            let look = |step: DVec3| {
                looks += 1;
                (place + step, self.sums(place + step))
            };
            let found = tries.map(look).find(|(_, there)| cost(there) < least);
            let Some((next, there)) = found else { break };
            (place, sums, least) = (next, there, cost(&there));
            let longest = sums.lengths.into_iter().fold(0.0, f64::max);
            let is_near = |end: &usize| sums.lengths[*end] < NEAR_END * longest;
            let Some(end) = (0..3).find(is_near) else { continue };
            if !std::mem::replace(&mut is_told[end], true) && self.rests_at(end, slope) {
                return (self.ends[end], looks);
            }
            steps_at_end += usize::from(sums.lengths[end] < AT_END * longest);
            if steps_at_end > STEPS_AT_END {
                break;
            }
        }
        (place, looks)
    }

    /// Whether the joint would stay at an end: the others pull clearly less than that end does.
    fn rests_at(&self, end: usize, slope: &Slope) -> bool {
        let place = self.ends[end];
        let sums = self.sums(place);
        let pulls = self.pulls(&sums, slope);
        let others = (0..3).filter(|&other| other != end);
        let pull: DVec3 = others.map(|other| (self.ends[other] - place) * (pulls[other] / sums.lengths[other])).sum();
        pull.length() <= CLEARLY * pulls[end]
    }

    /// What the first step of a search would gain.
    pub(super) fn promise(&self, start: DVec3, at_start: &JointSums, slope: &Slope) -> f64 {
        self.step(start, at_start, slope).map_or(f64::INFINITY, |step| step.gain)
    }

    /// Newton's step; a step against the gradient where that leads nowhere.
    fn step(&self, place: DVec3, sums: &JointSums, slope: &Slope) -> Option<Step> {
        let pulls = self.pulls(sums, slope);
        let stretches = self.stretches(sums, slope);
        let (mut gradient, mut curvature, mut weight) = (DVec3::ZERO, DMat3::ZERO, 0.0);
        for end in 0..3 {
            let length = sums.lengths[end];
            let towards = (self.ends[end] - place) / length;
            let stiffness = pulls[end].max(0.0) / length;
            gradient -= towards * pulls[end];
            // Across the segment the pull turns, along it it changes: c/l·(1 − u·uᵀ) + c′·u·uᵀ.
            curvature += DMat3::from_diagonal(DVec3::splat(stiffness));
            let along = towards * (stretches[end].max(0.0) - stiffness);
            curvature += DMat3::from_cols(along * towards.x, along * towards.y, along * towards.z);
            weight += stiffness;
        }
        // Positive along a straight line, too.
        curvature += DMat3::from_diagonal(DVec3::splat(1.0e-6 * weight));
        let newton = -(curvature.inverse() * gradient);
        let is_descent = newton.is_finite() && newton.dot(gradient) < 0.0;
        let plain = -gradient / weight;
        let way = if is_descent { newton } else { plain };
        let step = Step { way, plain, gain: -0.5 * way.dot(gradient), scale: pulls[2] * sums.lengths[2] };
        way.is_finite().then_some(step)
    }

    /// Derivatives of the pulls by their own lengths, as far as they come from the segments themselves.
    fn stretches(&self, at: &JointSums, slope: &Slope) -> [f64; 3] {
        let by_volume = slope.volume * (at.trunk.load / at.below.load).sqrt();
        let own = |sums: &Sums, flow: f64| {
            let root = sums.load.sqrt();
            flow / root - 0.25 * flow * flow * sums.volume / (sums.load * sums.load)
        };
        [
            slope.volume * own(&at.trunk, self.flows[0] + self.flows[1]),
            by_volume * own(&at.children[0], self.flows[0]),
            by_volume * own(&at.children[1], self.flows[1]),
        ]
    }
}

/// A step of the search.
struct Step {
    /// Newton's step, if that goes down.
    way: DVec3,
    /// A step against the gradient.
    plain: DVec3,
    /// What it would gain.
    gain: f64,
    /// Cost of the second child's segment.
    scale: f64,
}

#[cfg(test)]
mod tests;
