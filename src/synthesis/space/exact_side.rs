//! The side of a plane, or of a line in the plane, on which a point lies, exact despite rounding.
//!
//! In: four points in f32, or three in the plane. Out: the determinant of Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast
//! Robust Geometric Predicates" (1997), whose sign is always right and is zero only for points in one plane. The plain
//! f64 value is used if his error bound (section 4.3) allows it; otherwise the sum is computed as an expansion, without
//! rounding. Since the points are f32, each product of two coordinates is exact in f64 and each product of three is the
//! sum of two f64, so one stage of expansion suffices, whereas his f64 points need three.

use bevy_math::{DVec3, Vec2, Vec3};

/// Bound of the rounding error of the plain determinant, as a multiple of its permanent: (7 + 56 ε) ε, ε = 2⁻⁵³.
const ERROR: f64 = (7.0 + 56.0 * HALF_ULP) * HALF_ULP;
/// The same for three points in the plane: (3 + 16 ε) ε.
const FLAT_ERROR: f64 = (3.0 + 16.0 * HALF_ULP) * HALF_ULP;
const HALF_ULP: f64 = f64::EPSILON / 2.0;
/// Ratio to its error bound from which the plain value is used. It then has 26 bits, two more than a stored share of a
/// segment.
const TRUSTED: f64 = (1u64 << 26) as f64;
/// Terms of the exact sum: two parts of each of the 24 products.
const TERMS: usize = 48;

/// Six times the signed volume of the tetrahedron of four points: positive if `d` lies below the plane of a, b, c,
/// which run anticlockwise seen from above; zero exactly if all four lie in one plane.
///
/// The sign is exact for all finite points; the value has a relative error below 2⁻²⁶.
pub(crate) fn orientation(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> f64 {
    let d64 = d.as_dvec3();
    let (ad, bd, cd) = (a.as_dvec3() - d64, b.as_dvec3() - d64, c.as_dvec3() - d64);
    let determinant = ad.dot(bd.cross(cd));
    let permanent = |u: DVec3, v: DVec3| {
        let (u, v) = (u.abs(), v.abs());
        DVec3::new(u.y * v.z + u.z * v.y, u.z * v.x + u.x * v.z, u.x * v.y + u.y * v.x)
    };
    let bound = ERROR * TRUSTED * ad.abs().dot(permanent(bd, cd));
    if determinant.abs() > bound { determinant } else { exact(a, b, c, d) }
}

/// Twice the signed area of the triangle of three points: positive if they run anticlockwise; zero exactly if all three
/// lie on one line.
///
/// The sign is exact for all finite points; the value has a relative error below 2⁻²⁶.
pub(crate) fn orientation_2d(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec2());
    let (ac, bc) = (a - c, b - c);
    let (left, right) = (ac.x * bc.y, ac.y * bc.x);
    let determinant = left - right;
    if determinant.abs() > FLAT_ERROR * TRUSTED * (left.abs() + right.abs()) {
        return determinant;
    }
    let mut sum = Expansion { parts: [0.0; TERMS], len: 0 };
    // Each product is exact in f64.
    for (u, v) in [(a, b), (b, c), (c, a)] {
        sum.add(u.x * v.y);
        sum.add(-u.y * v.x);
    }
    sum.value()
}

/// The determinant of four points, rounded only in the last step.
fn exact(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> f64 {
    let mut sum = Expansion { parts: [0.0; TERMS], len: 0 };
    // det(a−d, b−d, c−d) = [abc] − [bcd] + [cda] − [dab]
    for (sign, [u, v, w]) in [(1.0, [a, b, c]), (-1.0, [b, c, d]), (1.0, [c, d, a]), (-1.0, [d, a, b])] {
        let [u, v, w] = [u, v, w].map(|point| point.as_dvec3());
        for (x, y, z) in [(u.x, v.y, w.z), (u.y, v.z, w.x), (u.z, v.x, w.y)] {
            sum.add_product(sign * x * y, z);
        }
        for (x, y, z) in [(u.z, v.y, w.x), (u.y, v.x, w.z), (u.x, v.z, w.y)] {
            sum.add_product(-sign * x * y, z);
        }
    }
    sum.value()
}

/// A number as a sum of f64 whose bits don't overlap, the smallest first.
struct Expansion {
    parts: [f64; TERMS],
    len: usize,
}

impl Expansion {
    /// Adds a product of two f64 in full.
    fn add_product(&mut self, x: f64, y: f64) {
        let high = x * y;
        self.add(x.mul_add(y, -high));
        self.add(high);
    }

    /// Adds a number (Shewchuk's GROW-EXPANSION), leaving out parts that are zero.
    fn add(&mut self, number: f64) {
        let mut rest = number;
        let mut kept = 0;
        for at in 0..self.len {
            let (sum, error) = two_sum(rest, self.parts[at]);
            rest = sum;
            if error != 0.0 {
                self.parts[kept] = error;
                kept += 1;
            }
        }
        if rest != 0.0 {
            self.parts[kept] = rest;
            kept += 1;
        }
        self.len = kept;
    }

    /// The number rounded to f64. The largest part decides its sign.
    fn value(&self) -> f64 {
        self.parts[..self.len].iter().sum()
    }
}

/// Sum and its rounding error (Knuth's TWO-SUM).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    let of_a = sum - of_b;
    (sum, (a - of_a) + (b - of_b))
}

#[cfg(test)]
mod tests {
    use crate::synthesis::random::Stream;
    use crate::synthesis::space::exact_side::*;
    use bevy_math::{I64Vec2, I64Vec3, vec2, vec3};
    use rand::RngExt;

    /// The determinant in whole numbers.
    fn in_whole_numbers([a, b, c, d]: [I64Vec3; 4]) -> i128 {
        let [a, b, c] = [a - d, b - d, c - d].map(|v| v.to_array().map(i128::from));
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    }

    #[test]
    fn equals_the_determinant_in_whole_numbers() {
        let mut rng = Stream::Statistics.rng(1);
        let mut flat = 0;
        for round in 0..60_000 {
            // Small numbers give many points in one plane; large ones use all bits of an f32.
            let limit = [2, 40, (1 << 24) - 1][round % 3];
            let mut points: [I64Vec3; 4] =
                std::array::from_fn(|_| I64Vec3::from_array(std::array::from_fn(|_| rng.random_range(-limit..=limit))));
            if round % 5 == 0 {
                // The last in the plane of the others, or one step off it: what rounding gets wrong.
                points[3] = points[0] + (points[1] - points[2]) + I64Vec3::new(0, 0, rng.random_range(-1..=1));
            }
            if points[3].abs().max_element() >= 1 << 24 {
                continue;
            }
            let expected = in_whole_numbers(points);
            let [a, b, c, d] = points.map(|point| point.as_vec3());
            let found = orientation(a, b, c, d);
            flat += u32::from(expected == 0);
            assert_eq!(found == 0.0, expected == 0, "{points:?}");
            let error = (found - expected as f64).abs();
            assert!(error <= 2f64.powi(-26) * (expected as f64).abs(), "{points:?}: {found}, not {expected}");
        }
        assert!(flat > 1_000, "only {flat} flat cases");
    }

    #[test]
    fn area_in_the_plane_equals_that_in_whole_numbers() {
        let mut rng = Stream::Statistics.rng(2);
        let mut flat = 0;
        for round in 0..60_000 {
            let limit = [2, 40, (1 << 22) - 1][round % 3];
            let mut points: [I64Vec2; 3] =
                std::array::from_fn(|_| I64Vec2::from_array(std::array::from_fn(|_| rng.random_range(-limit..=limit))));
            if round % 5 == 0 {
                points[2] = 2 * points[1] - points[0] + I64Vec2::new(0, rng.random_range(-1..=1));
            }
            let [ac, bc] = [points[0] - points[2], points[1] - points[2]].map(|v| v.to_array().map(i128::from));
            let expected = ac[0] * bc[1] - ac[1] * bc[0];
            let [a, b, c] = points.map(|point| point.as_vec2());
            let found = orientation_2d(a, b, c);
            flat += u32::from(expected == 0);
            assert_eq!(found == 0.0, expected == 0, "{points:?}");
            let error = (found - expected as f64).abs();
            assert!(error <= 2f64.powi(-26) * (expected as f64).abs(), "{points:?}: {found}, not {expected}");
        }
        assert!(flat > 1_000, "only {flat} flat cases");
        // One unit in the last place off a line, with coordinates of very different size.
        let [a, b] = [vec2(0.0, 0.0), vec2(1e30, 3e-30)];
        assert_eq!(orientation_2d(a, b, b / 2.0), 0.0);
        assert!(orientation_2d(a, b, vec2(b.x / 2.0, (b.y / 2.0).next_up())) > 0.0);
        assert!(orientation_2d(a, b, vec2(b.x / 2.0, (b.y / 2.0).next_down())) < 0.0);
    }

    #[test]
    fn tiny_and_huge_coordinates_keep_their_sign() {
        let points = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.25, 0.25, -1.0)];
        for scale in [1e-36, 1.0, 1e30] {
            let [a, b, c, d] = points.map(|point| point * scale);
            assert!(orientation(a, b, c, d) > 0.0 && orientation(b, a, c, d) < 0.0, "scale {scale}");
            assert_eq!(orientation(a, b, c, c), 0.0);
        }
        // One unit in the last place off a plane that passes far from the origin.
        let base = 16_777_215.0;
        let [a, b, c] = [vec3(base, 0.0, 1.0), vec3(0.0, base, 1.0), vec3(base, base, 1.0)];
        assert!(orientation(a, b, c, vec3(3.0, 5.0, 1.0_f32.next_down())) != 0.0);
        assert_eq!(orientation(a, b, c, vec3(3.0, 5.0, 1.0)), 0.0);
    }
}
