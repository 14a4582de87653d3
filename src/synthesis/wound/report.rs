//! Identifiers of ends and clamps, and reports of actions.

use crate::synthesis::haemodynamics::EndSide;
use crate::synthesis::tree::{NodeId, Place};
use bevy_math::Vec3;

/// Identifier of a severed end of a vessel. It stays the same while the end exists, through clamps, seals, and the undo
/// of its removal, and is never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(Clone, Hash, PartialEq))]
pub struct EndId {
    /// Index in the ledger's list.
    pub index: u32,
    /// Number of the action that severed the vessel, see [`Wounds::generation`](super::Wounds::generation).
    pub generation: u32,
}

/// Identifier of a clamp on a vessel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ClampId {
    /// Index in the ledger's list.
    pub index: u32,
    /// Number of the action that put it on.
    pub generation: u32,
}

/// One end of a severed vessel, at its present position.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct SeveredEnd {
    /// Its identifier.
    pub id: EndId,
    /// The place of its tip on the tree, after retraction.
    pub place: Place,
    /// Its side of the cut.
    pub side: EndSide,
    /// Whether its lumen is open: it is not sealed, and nothing closes its piece of the segment.
    ///
    /// An open end bleeds only if blood can reach it, which the flow determines: no blood reaches a piece between two
    /// cuts, or one behind a clamp on another segment.
    pub is_open: bool,
    /// The tip's position, in tissue lengths.
    pub position: Vec3,
    /// Unit vector out of the lumen, along the vessel.
    pub direction: Vec3,
    /// Radius of the vessel, in tissue lengths.
    pub radius: f32,
}

/// The changes of an action or its undo.
///
/// Ends that were open before and after are in neither list, nor are those closed both times, such as the ends of a cut
/// through a sealed vessel.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct WoundReport {
    /// Number of places at which a vessel was severed. 0 for all but cuts.
    pub severed: usize,
    /// Newly opened ends, in the order of the nodes, then from parent to node.
    pub opened: Vec<SeveredEnd>,
    /// Ends that were open before and are now closed or gone.
    pub closed: Vec<EndId>,
    /// Newly placed clamps.
    pub clamped: Vec<ClampId>,
    /// Clamps that were removed: taken off, or cut away with their vessel.
    pub unclamped: Vec<ClampId>,
    /// The nodes whose segments were severed, removed, closed or healed, each once: those to update in the flow and to
    /// draw again. Whole segments beside them whose look also changed are returned by
    /// [`FlatEnds::update`](crate::synthesis::instances::FlatEnds::update).
    pub changed: Vec<NodeId>,
}

impl WoundReport {
    /// Whether anything changed.
    pub fn is_empty(&self) -> bool {
        self.changed.is_empty()
    }
}
