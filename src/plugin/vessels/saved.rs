//! The saved form of vessels, for files and clones: a given tree as a whole, and a hash of one that grew.

use crate::plugin::vessels::tree::Vessels;
use crate::synthesis::tree::{VesselKind, VesselTree};
use bevy::ecs::entity::{ComponentCloneCtx, SourceComponent};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// [`Vessels`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Vessels", deny_unknown_fields)]
struct SavedVessels {
    kind: VesselKind,
    /// Hash of the tree at rest.
    #[serde(default)]
    hash: Option<u64>,
    /// `None` for vessels that grew.
    #[serde(default)]
    given: Option<GivenTree>,
}

/// A tree that did not grow.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GivenTree {
    tree: VesselTree,
    birth_steps: Vec<u32>,
}

impl Serialize for Vessels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let given = (!self.is_grown())
            .then(|| GivenTree { tree: self.tree_at_rest().into_owned(), birth_steps: self.birth_steps().to_vec() });
        SavedVessels { kind: self.kind(), hash: self.hash(), given }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Vessels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let SavedVessels { kind, hash, given } = SavedVessels::deserialize(deserializer)?;
        let vessels = match given {
            Some(GivenTree { tree, birth_steps }) => Self::from_tree(kind, &tree, &birth_steps),
            None => Self::new(kind),
        };
        Ok(vessels.awaiting(hash))
    }
}

impl Vessels {
    /// The vessels with only what a file keeps.
    pub(crate) fn as_saved(&self) -> Self {
        let saved = if self.is_grown() {
            Self::new(self.kind())
        } else {
            Self::from_tree(self.kind(), &self.tree_at_rest(), self.birth_steps())
        };
        saved.awaiting(self.hash())
    }
}

/// Clones vessels with only what a file keeps, since each clone has a growth of its own.
pub(super) fn clone_as_saved(source: &SourceComponent, context: &mut ComponentCloneCtx) {
    if let Some(vessels) = source.read::<Vessels>() {
        context.write_target_component(vessels.as_saved());
    }
}
