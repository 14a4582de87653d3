//! A bifurcation, and the place where it costs least.
//!
//! Source: Kamiya & Togawa, "Optimal branching structure of the vascular tree" (1972), as OpenCCO uses it (section 3.2,
//! Eq. 9 to 13). Its Eq. 13 says that at the best place the three ends pull equally: Σ r_i²·(p_i − x)/l_i = 0, where r_i²
//! is the volume per length of a segment whose radius stays. But radii change with lengths, along the whole path to
//! the root. Here the pull of an end is the exact derivative c_i of the whole tree's volume by the length of its
//! segment, so that the solution is a minimum of the volume itself.

use super::{
    power::Exponent,
    sums::{Below, Slope, Sums, below_slope},
};
use bevy_math::{DMat3, DVec3};

/// Most steps of the search. Newton's method takes three to five.
const MOST_STEPS: usize = 40;
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

    /// The place of least volume, to a relative `tolerance` of the tree's volume, found from `start`.
    ///
    /// The volume depends on the trunk's sums as `slope` says, to first order. Each step is Newton's for constant
    /// pulls. A step that does not lower the volume is halved, so the result is never worse than the start.
    pub(super) fn settle(&self, start: DVec3, slope: &Slope, tolerance: f64) -> DVec3 {
        let cost = |sums: &JointSums| slope.load * sums.trunk.load + slope.volume * sums.trunk.volume;
        let (mut place, mut sums) = (start, self.sums(start));
        let mut least = cost(&sums);
        for _ in 0..MOST_STEPS {
            let Some(step) = self.step(place, &sums, slope) else { break };
            let before = least;
            let mut share = 1.0;
            for _ in 0..HALVINGS {
                let next = place + step * share;
                let there = self.sums(next);
                let value = cost(&there);
                if value < least {
                    (place, sums, least) = (next, there, value);
                    break;
                }
                share *= 0.5;
            }
            if !(before - least > tolerance * least.abs()) {
                break;
            }
        }
        place
    }

    /// Newton's step for constant pulls; a step against the gradient where that leads nowhere.
    fn step(&self, place: DVec3, sums: &JointSums, slope: &Slope) -> Option<DVec3> {
        let pulls = self.pulls(sums, slope);
        let (mut gradient, mut curvature, mut weight) = (DVec3::ZERO, DMat3::ZERO, 0.0);
        for ((end, pull), length) in self.ends.iter().zip(pulls).zip(sums.lengths) {
            let towards = (end - place) / length;
            let stiffness = pull.max(0.0) / length;
            gradient -= towards * pull;
            // Σ c/l·(1 − u·uᵀ)
            curvature += DMat3::from_diagonal(DVec3::splat(stiffness));
            curvature -= DMat3::from_cols(towards * towards.x, towards * towards.y, towards * towards.z) * stiffness;
            weight += stiffness;
        }
        // Positive along a straight line, too.
        curvature += DMat3::from_diagonal(DVec3::splat(1.0e-3 * weight));
        let newton = -(curvature.inverse() * gradient);
        let plain = -gradient / weight;
        let step = if newton.is_finite() && newton.dot(gradient) < 0.0 { newton } else { plain };
        step.is_finite().then_some(step)
    }
}

#[cfg(test)]
mod tests;
