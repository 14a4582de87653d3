//! What actions are known by, and what they report.

use crate::synthesis::haemodynamics::EndSide;
use crate::synthesis::tree::{NodeId, Place};
use bevy_math::Vec3;

/// A severed end of a vessel. Stays the same while the end exists, through clamps, seals, and the undoing of what took
/// it away; never given to another end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(Clone, Hash, PartialEq))]
pub struct EndId {
    /// Place in the ledger's list.
    pub index: u32,
    /// Number of the action that severed the vessel, see [`Wounds::generation`](super::Wounds::generation).
    pub generation: u32,
}

/// A clamp on a vessel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ClampId {
    /// Place in the ledger's list.
    pub index: u32,
    /// Number of the action that put it on.
    pub generation: u32,
}

/// One end of a severed vessel, where it is now.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct SeveredEnd {
    /// What it is known by.
    pub id: EndId,
    /// Where on the tree its tip is, after it drew back.
    pub place: Place,
    /// Which side of the cut.
    pub side: EndSide,
    /// Whether its lumen is open: not sealed, and nothing closes the piece of vessel that ends here.
    ///
    /// An open end bleeds only where blood can reach it, which is for the flow to say: on a piece between two cuts, or
    /// behind a clamp on another segment, none can.
    pub is_open: bool,
    /// The tip's position, in tissue lengths.
    pub position: Vec3,
    /// Unit vector out of the lumen, along the vessel.
    pub direction: Vec3,
    /// Radius of the vessel, in tissue lengths.
    pub radius: f32,
}

/// What an action, or the undoing of one, changed.
///
/// Ends that were open before and after are in neither list, nor are those that were closed both times, such as the ends
/// of a cut through a sealed vessel.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct WoundReport {
    /// Number of places at which a vessel was severed. 0 for all but cuts.
    pub severed: usize,
    /// Ends that are open now and were not before, in the order of the nodes, then from parent to node.
    pub opened: Vec<SeveredEnd>,
    /// Ends that were open before and are closed, or gone, now.
    pub closed: Vec<EndId>,
    /// Clamps that are on now and were not before.
    pub clamped: Vec<ClampId>,
    /// Clamps that were on before and no longer are: taken off, or cut away with their vessel.
    pub unclamped: Vec<ClampId>,
    /// The nodes whose segments were severed, taken out, closed or healed, each once: what to tell the flow and to draw
    /// anew. Which whole segments beside them look otherwise, too, is told by
    /// [`FlatEnds::update`](crate::synthesis::instances::FlatEnds::update).
    pub changed: Vec<NodeId>,
}

impl WoundReport {
    /// Whether anything changed.
    pub fn is_empty(&self) -> bool {
        self.changed.is_empty()
    }
}
