//! A tissue cut into small pieces, so that candidates can be drawn from some of them only.

use bevy_math::Vec3;

/// A part of a tissue: a sector of a ring, a rectangle, a triangle. The pieces of a tissue cover all of it and do not overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissuePiece {
    /// Centre of a ball that holds the piece.
    pub center: Vec3,
    /// Radius of that ball.
    pub reach: f32,
    /// Length, area or volume of the piece.
    pub measure: f32,
    /// Normal of the [facet](super::Facet) that it is a piece of; zero in a tissue without any.
    pub side: Vec3,
    /// The tissue's own identifier of the piece, for [`Tissue::point_of`](super::Tissue::point_of).
    pub id: [u32; 2],
}

/// Number of equal parts, at least one, into which a length is cut so that none is longer than `side`.
pub(super) fn parts(length: f32, side: f32) -> u32 {
    (length / side).ceil().clamp(1.0, 1e6) as u32
}
