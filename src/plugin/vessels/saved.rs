//! What is kept of vessels that are saved or cloned: all of a given tree, and of one that grew what tells it from others.

use crate::synthesis::tree::{VesselKind, VesselTree};
use serde::{Deserialize, Serialize};

/// [`Vessels`](crate::plugin::Vessels) as they are written to a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Vessels", deny_unknown_fields)]
pub(super) struct SavedVessels {
    pub kind: VesselKind,
    /// Hash of the tree at rest.
    #[serde(default)]
    pub hash: Option<u64>,
    /// `None` for vessels that grew.
    #[serde(default)]
    pub given: Option<GivenTree>,
}

/// A tree that did not grow.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GivenTree {
    pub tree: VesselTree,
    pub birth_steps: Vec<u32>,
}
