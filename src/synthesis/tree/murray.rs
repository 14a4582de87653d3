//! Murray's law: the relation of radii and angles at a bifurcation.
//!
//! Radii follow r_p^κ = r_l^κ + r_r^κ; the angles are those of least vessel volume (Rauch & Harders 2021, Eq. 1, after
//! Murray 1926). In a tree that grows by many small additions, it is cheaper and more exact to keep the *sum* r^κ of a
//! segment, in units of the terminal radius, instead of its radius: sums of children simply add up.

use bevy_math::ops;

/// Radius of the parent of two segments, in the lengths of its arguments.
///
/// Source: r_p^κ = r_l^κ + r_r^κ. Inputs are radii ≥ 0 and the exponent κ > 0.
pub fn parent_radius(left: f32, right: f32, exponent: f32) -> f32 {
    let larger = left.max(right);
    if larger <= 0.0 {
        return 0.0;
    }
    // Relative to the larger child, so that no power over- or underflows.
    let sum = ops::powf(left / larger, exponent) + ops::powf(right / larger, exponent);
    larger * ops::powf(sum, exponent.recip())
}

/// Angles that two daughters make with their parent's direction, in radians: `(left, right)`.
///
/// Source: Eq. 1, with the cosines clamped to [−1, 1]. For κ = 3 and equal daughters both are 37.5°.
pub fn bifurcation_angles(left: f32, right: f32, exponent: f32) -> (f32, f32) {
    let parent = parent_radius(left, right, exponent);
    (daughter_angle(parent, left, right), daughter_angle(parent, right, left))
}

/// Angle of one daughter of radius `own`, with a sister of radius `other`.
fn daughter_angle(parent: f32, own: f32, other: f32) -> f32 {
    let square = |radius: f32| (radius / parent) * (radius / parent);
    let (own, other) = (square(own), square(other));
    let cos = (1.0 + own * own - other * other) / (2.0 * own);
    ops::acos(cos.clamp(-1.0, 1.0))
}

/// Half the angle between the daughters of a symmetric bifurcation, in radians: cos α = 2^(2/κ − 1).
pub fn symmetric_half_angle(exponent: f32) -> f32 {
    ops::acos(ops::exp2(2.0 / exponent - 1.0).clamp(-1.0, 1.0))
}

/// Cosine of the angle of a terminal branch beside a child. Radii of the child and of their parent are in units of the
/// terminal one.
///
/// This is [`bifurcation_angles`] in terms of the radii that a growing tree knows.
pub(crate) fn sprout_cos(child: f32, parent: f32) -> f32 {
    let (parent, child) = (parent * parent, child * child);
    ((parent * parent - child * child + 1.0) / (2.0 * parent)).clamp(-1.0, 1.0)
}

#[cfg(test)]
mod tests {
    use crate::synthesis::tree::murray::*;

    /// Exponent, r_daughter / r_parent, angle between daughters in degrees: published values for equal daughters.
    const SYMMETRIC: [(f32, f32, f32); 6] = [
        (2.0, std::f32::consts::FRAC_1_SQRT_2, 0.0),
        (2.35, 0.7446, 51.2),
        (2.59, 0.7652, 62.7),
        (2.7, 0.7736, 66.7),
        (3.0, 0.7937, 74.9),
        (4.0, 0.8409, 90.0),
    ];

    #[test]
    fn symmetric_bifurcations_match_the_published_table() {
        for (exponent, ratio, degrees) in SYMMETRIC {
            assert!((1.0 / parent_radius(1.0, 1.0, exponent) - ratio).abs() < 1e-4);
            let (left, right) = bifurcation_angles(1.0, 1.0, exponent);
            // acos is steep at 1: at κ = 2 one rounding error of the cosine is 0.03°.
            assert!(
                ((left + right).to_degrees() - degrees).abs() < 0.1,
                "κ {exponent}: {}",
                (left + right).to_degrees()
            );
            assert!((2.0 * symmetric_half_angle(exponent).to_degrees() - degrees).abs() < 0.1);
        }
    }

    #[test]
    fn asymmetric_bifurcations_match_the_published_table() {
        for (ratio, large, small) in [(0.4, 8.7, 70.4), (0.76, 26.0, 49.4)] {
            let (a, b) = bifurcation_angles(1.0, ratio, 3.0);
            assert!((a.to_degrees() - large).abs() < 0.1, "{}", a.to_degrees());
            assert!((b.to_degrees() - small).abs() < 0.1, "{}", b.to_degrees());
        }
    }

    #[test]
    fn the_sprout_angle_is_the_bifurcation_angle_in_other_terms() {
        for exponent in [2.1, 2.55, 3.0, 3.9] {
            for sum in [1.0_f32, 2.0, 17.0, 600.0] {
                let child = sum.powf(1.0 / exponent);
                let (_, expected) = bifurcation_angles(child, 1.0, exponent);
                let angle = sprout_cos(child, (1.0 + sum).powf(1.0 / exponent)).acos();
                assert!((angle - expected).abs() < 2e-3, "κ {exponent}, sum {sum}: {angle} against {expected}");
            }
        }
    }

    #[test]
    fn extreme_radii_stay_finite() {
        assert!(parent_radius(1e-20, 1e-20, 3.9).is_normal());
        assert_eq!(parent_radius(0.0, 0.0, 3.0), 0.0);
        assert!(sprout_cos(1e3, 1e3).is_finite());
    }
}
