//! A link through which blood flows from an artery to a vein.

use super::NodeId;

/// A stretch of capillary bed between an artery and a vein.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BedLink {
    /// The node that blood comes from.
    pub arterial: NodeId,
    /// The node that blood goes to.
    pub venous: NodeId,
}
