//! Directions that exist for all vectors, also for those without length.

use bevy_math::{Quat, Vec3};

/// The direction of a vector, also of one whose squared length is too small or too large for f32.
#[inline]
pub(super) fn unit(vector: Vec3) -> Option<Vec3> {
    let size = vector.abs().max_element();
    (size > 0.0 && size.is_finite()).then(|| (vector / size).normalize())
}

/// The least rotation from one unit vector to another.
#[inline]
pub(super) fn turn(from: Vec3, to: Vec3) -> Quat {
    Quat::from_rotation_arc(from.normalize(), to.normalize())
}

/// The part of a vector across a unit vector, at unit length; any such vector if there is none.
#[inline]
pub(super) fn across(vector: Vec3, ahead: Vec3) -> Vec3 {
    let flat = vector - ahead * ahead.dot(vector);
    if flat.length_squared() > 1e-8 * vector.length_squared() { unit(flat) } else { None }
        .unwrap_or_else(|| ahead.any_orthonormal_vector())
}
