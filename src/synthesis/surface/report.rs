//! What was done for a surface, and what could not be done as wished.

use crate::synthesis::tree::NodeId;

/// What was done for a surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SurfaceReport {
    /// Vessels that leave others.
    pub laterals: usize,
    /// Laterals that leave between the same rings as others, since they are too close for rings of their own.
    pub joined: usize,
    /// Laterals whose opening is flatter than they are wide, for lack of room along the vessel that they leave.
    pub shortened: usize,
    /// Laterals whose opening lies beside the place where they leave, by more than half its length.
    pub moved: usize,
    /// Last nodes of vessels that end within the lumen of the vessel that they leave. They have no faces.
    pub absorbed: Vec<NodeId>,
}
