//! What was done for a surface, and what could not be done as wished.

use crate::synthesis::tree::NodeId;

/// What was done for a surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SurfaceReport {
    /// Vessels that leave others.
    pub laterals: usize,
    /// Last nodes of vessels that end within the lumen of the vessel that they leave. They have no faces.
    pub absorbed: Vec<NodeId>,
}
