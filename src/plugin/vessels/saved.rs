//! The saved form of vessels, for files and clones: a given tree as a whole, and a hash of one that grew.

use crate::synthesis::tree::{VesselKind, VesselTree};
use serde::{Deserialize, Serialize};

/// [`Vessels`](crate::plugin::Vessels) in a file.
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
