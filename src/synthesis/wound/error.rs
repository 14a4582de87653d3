//! Errors of actions on vessels.

use super::{BladeError, ClampId};
use crate::synthesis::tree::Place;

/// The reason why an action on the vessels was refused. Nothing has changed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WoundError {
    /// The blade cannot be used.
    #[error(transparent)]
    Blade(#[from] BladeError),
    /// A node that the tree doesn't have.
    #[error("node {node} is not in this tree of {nodes} nodes; take places from the tree that is operated on")]
    NoSuchNode {
        /// The node.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A place on a root.
    #[error("node {node} is a root, which is the end of no segment; take a place on a segment that leaves it")]
    OnRoot {
        /// The node.
        node: u32,
    },
    /// A share beyond the ends of a segment.
    #[error("the place lies at share {along} of the segment that ends in node {node}; it must be 0 to 1")]
    Along {
        /// The node.
        node: u32,
        /// The share.
        along: f32,
    },
    /// A place in a gap.
    #[error("there is no vessel left at share {} of the segment that ends in node {}; take the nearest place", .place.along, .place.node.0)]
    NoVessel {
        /// The place.
        place: Place,
    },
    /// A clamp that is not on.
    #[error("clamp {} of action {} is not on; it was taken off, undone, or cut away with its vessel", .clamp.index, .clamp.generation)]
    NoSuchClamp {
        /// The clamp.
        clamp: ClampId,
    },
    /// A calibre that is not above zero.
    #[error("the largest calibre to seal is {calibre}; it must be above 0, in tissue lengths")]
    Calibre {
        /// The value found.
        calibre: f32,
    },
    /// A ledger in a file with contents that no action can produce.
    #[error("the ledger of wounds is broken at node {node}: {what}; save it again, or leave it out")]
    BrokenLedger {
        /// The node.
        node: u32,
        /// What is wrong.
        what: &'static str,
    },
    /// A setting of the retraction that is negative or not finite.
    #[error("{what} of the retraction is {value}; it must be finite and at least 0")]
    Retraction {
        /// Which setting.
        what: &'static str,
        /// The value found.
        value: f32,
    },
}
