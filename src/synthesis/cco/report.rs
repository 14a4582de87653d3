//! What a growth has reached.

use crate::synthesis::tree::VesselKind;

/// What constrained constructive optimisation has made of one kind of vessels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CcoReport {
    /// The kind.
    pub kind: VesselKind,
    /// Terminals so far.
    pub terminals: u32,
    /// Terminals wanted.
    pub wanted: u32,
    /// Places that were refused, since no connection to them had room.
    pub rejected: u64,
    /// Volume of all segments as cylinders, in cubic tissue lengths.
    pub volume: f64,
    /// Radius of the widest root segment, in tissue lengths; 0 without any.
    pub root_radius: f64,
    /// Whether growth ended before all terminals were placed.
    pub is_stuck: bool,
}
