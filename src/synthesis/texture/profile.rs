//! The closed forms of a blurred vessel.
//!
//! A vessel of radius r at the distance d from its axis, seen through a blur with the standard deviation σ, covers
//! Φ((r − d)/σ) − Φ((−r − d)/σ): the convolution of its round profile with a Gaussian, across. Near a tip the rounded
//! end is convolved along the axis as well.

use super::gauss::{SEEN, gauss};

/// Nodes and weights of Gauss–Legendre integration with eight points on [−1, 1] (Abramowitz & Stegun, table 25.4).
const LEGENDRE: [(f32, f32); 4] = [
    (0.183_434_64, 0.362_683_78),
    (0.525_532_4, 0.313_706_65),
    (0.796_666_5, 0.222_381_03),
    (0.960_289_86, 0.101_228_54),
];

/// How much of a blurred vessel is seen at a point, and how that changes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Coverage {
    /// From 0 to 1.
    pub value: f32,
    /// Its derivative by the distance from the axis.
    pub by_distance: f32,
    /// Its derivative by the radius.
    pub by_radius: f32,
    /// Its derivative by the blur.
    pub by_sigma: f32,
}

/// The coverage across a vessel of radius `r`, at the distance `d ≥ 0` from its axis, with a blur of `sigma > 0`.
#[inline(always)]
pub(super) fn across(d: f32, r: f32, sigma: f32) -> Coverage {
    let inverse = 1.0 / sigma;
    let (near, far) = ((r - d) * inverse, (-r - d) * inverse);
    let ([a, slope_a], [b, slope_b]) = (gauss(near), gauss(far));
    Coverage {
        value: a - b,
        by_distance: (slope_b - slope_a) * inverse,
        by_radius: (slope_a + slope_b) * inverse,
        by_sigma: (far * slope_b - near * slope_a) * inverse,
    }
}

/// The part of the coverage that the end of a vessel takes away, at the distance `y` from its axis and `x` beyond the
/// end along it: the vessel without an end, less the half before the end, less the rounded end itself.
pub(super) fn beyond_end((x, y): (f32, f32), r: f32, sigma: f32) -> f32 {
    if x < -(SEEN + 1.0) * sigma {
        return 0.0;
    }
    let below = |x: f32| gauss(x)[0];
    let strip = |half_width: f32| below((half_width - y) / sigma) - below((-half_width - y) / sigma);
    let (from, to) = ((x - (SEEN + 1.0) * sigma).max(0.0), (x + (SEEN + 1.0) * sigma).min(r));
    let mut rounded = 0.0;
    if from < to {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        for (node, weight) in LEGENDRE {
            for at in [middle - half * node, middle + half * node] {
                let density = gauss((x - at) / sigma)[1] / sigma;
                rounded += weight * density * strip((r * r - at * at).max(0.0).sqrt());
            }
        }
        rounded *= half;
    }
    (below(x / sigma) * strip(r) - rounded).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::exponential::exp;

    /// A capsule from −∞ to 0 along x, convolved with a Gaussian by brute force.
    fn convolved(x: f64, y: f64, r: f64, sigma: f64) -> f64 {
        const STEPS: i32 = 400;
        let step = 10.0 * sigma / f64::from(STEPS);
        let mut sum = 0.0;
        for i in -STEPS / 2..STEPS / 2 {
            for j in -STEPS / 2..STEPS / 2 {
                let (dx, dy) = ((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
                let (at, across) = (x + dx, y + dy);
                let is_inside = if at < 0.0 { across.abs() < r } else { at * at + across * across < r * r };
                if is_inside {
                    sum += exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma));
                }
            }
        }
        sum * step * step / (2.0 * std::f64::consts::PI * sigma * sigma)
    }

    #[test]
    fn a_blurred_capsule_is_the_convolution() {
        for sigma in [0.05, 0.2, 0.5, 1.0, 2.5] {
            for x in [-3.0, -1.0, -0.2, 0.0, 0.4, 0.9, 1.3, 2.5] {
                for y in [0.0f32, 0.5, 0.95, 1.4] {
                    let seen = across(y, 1.0, sigma).value - beyond_end((x, y), 1.0, sigma);
                    let exact = convolved(x.into(), y.into(), 1.0, sigma.into()) as f32;
                    assert!((seen - exact).abs() < 0.01, "σ {sigma} at {x}, {y}: {seen} for {exact}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let step = 0.02;
        for (d, r, sigma) in [(0.3, 1.0, 0.5), (1.1, 1.0, 0.4), (0.6, 0.5, 1.5)] {
            let at = |d: f32, r: f32, sigma: f32| across(d, r, sigma).value;
            let slopes = across(d, r, sigma);
            for (slope, up, down) in [
                (slopes.by_distance, at(d + step, r, sigma), at(d - step, r, sigma)),
                (slopes.by_radius, at(d, r + step, sigma), at(d, r - step, sigma)),
                (slopes.by_sigma, at(d, r, sigma + step), at(d, r, sigma - step)),
            ] {
                let exact = (up - down) / (2.0 * step);
                assert!((slope - exact).abs() < 2e-3, "{slope} for {exact} at {d}, {r}, {sigma}");
            }
        }
    }
}
