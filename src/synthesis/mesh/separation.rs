//! Planes between two triangles, as a quick proof that they don't intersect.
//!
//! Any direction may be tried for a plane's normal. A bound of the rounding error decides whether the plane proves
//! something, so the direction itself may be rounded. A proof is never wrong; that none is found says nothing.

use bevy_math::{Mat3A, Vec3A};

const HALF_ULP: f32 = f32::EPSILON / 2.0;
/// Far above the error of a product that is too small for an f32.
const TINY: f32 = f32::MIN_POSITIVE;

/// Whether there is a plane that is proven to lie between two triangles without a common vertex. It is sought across
/// their normals, and across directions in their planes that are perpendicular to an edge.
pub(super) fn are_apart(first: [Vec3A; 3], second: [Vec3A; 3]) -> bool {
    let origin = first[0];
    let (first, second) = (relative(first, origin), relative(second, origin));
    let size = size(first) + size(second);
    let (rows, other_rows) = (rows(first), rows(second));
    let is_proof = |direction: Vec3A| {
        let (along, other_along) = (rows * direction, other_rows * direction);
        let gap =
            (along.min_element() - other_along.max_element()).max(other_along.min_element() - along.max_element());
        gap > dot_error(direction, size)
    };
    let (edges, other_edges) = (edges(first), edges(second));
    let normal = edges[0].cross(edges[1]);
    if is_proof(normal) {
        return true;
    }
    let other_normal = other_edges[0].cross(other_edges[1]);
    is_proof(other_normal)
        || edges.iter().any(|edge| is_proof(normal.cross(*edge)))
        || other_edges.iter().any(|edge| is_proof(other_normal.cross(*edge)))
}

/// Whether there is a plane through the first corner, which two triangles share, that is proven to lie between their
/// other corners. The direction between their middles is tried.
pub(super) fn open_from(first: [Vec3A; 3], second: [Vec3A; 3]) -> bool {
    let ([_, a, b], [_, c, d]) = (relative(first, first[0]), relative(second, first[0]));
    let middle = |u: Vec3A, v: Vec3A| (u * v.length() + v * u.length()).normalize();
    let direction = middle(a, b) - middle(c, d);
    let error = dot_error(direction, size([a, b, c, d]));
    // Corners on one line may give NaN, which proves nothing.
    direction.dot(a) > error && direction.dot(b) > error && direction.dot(c) < -error && direction.dot(d) < -error
}

/// Whether two triangles with a common edge, that of their first two corners, are proven to extend to different sides.
pub(super) fn are_spread(first: [Vec3A; 3], second: [Vec3A; 3]) -> bool {
    let [_, edge, c] = relative(first, first[0]);
    let d = second[2] - first[0];
    // A component of the cross products is wrong by 8 ε of its bound at most, ε = 2⁻²⁴, and their dot product by 132 ε.
    let [of_c, of_d] = [c, d].map(|side| size([edge]) * size([side]) + TINY);
    edge.cross(c).dot(edge.cross(d)) < -HALF_ULP * (512.0 * (of_c * of_d)) - TINY
}

/// Bound of the rounding error of the difference of two dot products of a direction with points of some size. It is
/// infinite if one of them may be.
fn dot_error(direction: Vec3A, size: f32) -> f32 {
    // Each has one rounding of the coordinates, one of the products and two of the sum; so 8 ε are enough, ε = 2⁻²⁴.
    HALF_ULP * (16.0 * (direction.abs().element_sum() * size)) + TINY
}

/// Corners relative to an origin.
fn relative([a, b, c]: [Vec3A; 3], origin: Vec3A) -> [Vec3A; 3] {
    [a - origin, b - origin, c - origin]
}

fn edges([a, b, c]: [Vec3A; 3]) -> [Vec3A; 3] {
    [b - a, c - b, a - c]
}

/// The matrix whose product with a direction are the corners' dot products with it.
fn rows([a, b, c]: [Vec3A; 3]) -> Mat3A {
    Mat3A::from_cols(a, b, c).transpose()
}

/// The greatest absolute coordinate.
fn size<const N: usize>(points: [Vec3A; N]) -> f32 {
    let mut size = Vec3A::ZERO;
    for point in points {
        size = size.max(point.abs());
    }
    size.max_element()
}

#[cfg(test)]
mod tests {
    use crate::synthesis::{
        mesh::{
            separation::*,
            triangle_pair::{has_area, is_folded, meet},
        },
        random::Stream,
    };
    use bevy_math::{Quat, Vec3, vec3};
    use rand::RngExt;

    #[test]
    fn a_proof_is_never_wrong() {
        // The quick tests give way to the exact ones, but must not contradict them, however close the call.
        let mut rng = Stream::Statistics.rng(6);
        let mut proofs = [0; 3];
        for round in 0..60_000 {
            // From where products vanish to where they overflow.
            let scale = [1e-20, 1e-10, 1.0, 3e9, 1e30][round % 5];
            let flat = [1.0, 1e-3, 1e-6, 0.0][round / 5 % 4];
            let turn = Quat::from_rotation_x(rng.random_range(0.0..6.0)) * Quat::from_rotation_z(1.0);
            let mut point = || {
                let [x, y, z] = std::array::from_fn(|_| rng.random_range(-1.0f32..1.0));
                turn * vec3(x, y, z * flat) * scale
            };
            let mut second = [point(), point(), point()];
            let first: [Vec3A; 3] = [point(), point(), point()].map(Vec3A::from);
            if round % 3 == 0 {
                // One corner on an edge, as far as rounding allows.
                second[2] = first[1].lerp(first[2], rng.random_range(0.0..1.0)).into();
            }
            let mut second = second.map(Vec3A::from);
            if !has_area(first.map(Vec3::from)) || !has_area(second.map(Vec3::from)) {
                continue;
            }
            let apart = are_apart(first, second);
            assert!(!(apart && meet(first, second, 0)), "apart: {first:?}, {second:?}");
            second[0] = first[0];
            let open = has_area(second.map(Vec3::from)) && open_from(first, second);
            assert!(!(open && meet(first, second, 1)), "open: {first:?}, {second:?}");
            second[1] = first[1];
            let spread = has_area(second.map(Vec3::from)) && are_spread(first, second);
            assert!(!(spread && is_folded(first, second)), "spread: {first:?}, {second:?}");
            for (proofs, is_proof) in proofs.iter_mut().zip([apart, open, spread]) {
                *proofs += usize::from(is_proof);
            }
        }
        assert!(proofs.into_iter().all(|proofs| proofs > 2_000), "only {proofs:?} proofs");
    }
}
