//! What a mesh was made from.

use crate::synthesis::surface::curve::Curve;
use crate::synthesis::surface::layout::Layout;
use crate::synthesis::surface::trunks::Trunks;
use bevy_math::Vec3;

/// All that a mesh was made from.
#[derive(Debug)]
pub(in crate::synthesis::surface) struct Plan {
    pub trunks: Trunks,
    pub curves: Vec<Curve>,
    pub layout: Layout,
    /// Subtracted from positions for the curves.
    pub origin: Vec3,
    /// Faces of the mesh for each corner of its cage.
    pub faces_per_corner: u32,
}
