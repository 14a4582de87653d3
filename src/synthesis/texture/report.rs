//! What was done for a bake, and what its values mean.

use super::error::BakeWarning;

/// What was done for a bake, and what its values mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakeReport {
    /// Texels within charts.
    pub texels: usize,
    /// Charts of the mesh.
    pub charts: usize,
    /// Whether the texture goes on beyond its right and its lower edge, so that a sampler must repeat it; elsewhere it
    /// must clamp.
    pub repeats: [bool; 2],
    /// Heights over the surface for 0 and 65535, in tissue lengths.
    pub height_range: [f32; 2],
    /// Depth for 65534, in tissue lengths.
    pub depth_range: f32,
    /// What is not as good as it could be.
    pub warnings: Vec<BakeWarning>,
}
