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
    /// Joints whose faces would have met each other, by a node of each: their surface is the outline of the union of
    /// their segments.
    pub remade: Vec<NodeId>,
    /// Joints whose faces still meet each other, by a node of each: their segments run through each other so that the
    /// outline of their union has holes.
    pub left: Vec<NodeId>,
    /// Loops that stay open, by a node of each: it lies within the lumen of another vessel.
    pub unclosed: Vec<NodeId>,
    /// Last nodes of vessels that end within the lumen of the vessel that they leave. They have no faces.
    pub absorbed: Vec<NodeId>,
}
