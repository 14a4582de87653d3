//! Loops: vessels that a tree cannot hold, since they close a way round.
//!
//! In: a tree and its closing vessels. Out: a tree that has each of them as two twigs, whose tips lie beside each other in
//! the vessel's middle. There the tubes are joined, in place of ends: see [`seams`](super::seams).

use super::settings::SurfaceError;
use crate::synthesis::tree::{NodeId, VesselTree};
use std::borrow::Cow;

/// Distance of both tips: at most and at least, in radii, and at most as a share of the vessel's length.
const MOST_GAP: f32 = 1.0;
const LEAST_GAP: f32 = 0.25;
const MOST_SHARE: f32 = 0.2;
/// Room that a half needs to leave a vessel, in that vessel's radii and in its own.
const ROOM: [f32; 2] = [1.1, 1.4];

/// A vessel between two nodes of a tree, or of two trees, that is not a segment of it: networks with loops are a tree and
/// some of these. Each adds a way round, a handle of the surface, or joins two trees.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct ClosingVessel {
    /// The nodes at both ends.
    pub ends: [NodeId; 2],
    /// Its radius, in the unit of the tree's positions. Limits: above 0.
    pub radius: f32,
}

impl ClosingVessel {
    /// The vessel between two nodes that is as wide as the thinner one.
    ///
    /// # Panics
    /// If the tree has no such nodes.
    pub fn between(tree: &VesselTree, a: NodeId, b: NodeId) -> Self {
        Self { ends: [a, b], radius: tree.radii()[a.index()].min(tree.radii()[b.index()]) }
    }
}

/// A tree with the halves of its closing vessels.
pub(super) struct Looped<'a> {
    pub tree: Cow<'a, VesselTree>,
    closing: &'a [ClosingVessel],
    /// Number of nodes of the tree itself; after them come two for each closing vessel.
    own: usize,
}

impl<'a> Looped<'a> {
    /// The tree with some closing vessels.
    pub fn of(tree: &'a VesselTree, closing: &'a [ClosingVessel]) -> Result<Self, SurfaceError> {
        let own = tree.len();
        if closing.is_empty() {
            return Ok(Self { tree: Cow::Borrowed(tree), closing, own });
        }
        let (mut positions, mut parents, mut radii) =
            (tree.positions().to_vec(), tree.parents().to_vec(), tree.radii().to_vec());
        let mut neighbours = vec![0u32; own];
        for (node, parent) in tree.segments() {
            neighbours[node] += 1;
            neighbours[parent] += 1;
        }
        for &ClosingVessel { ends, radius } in closing {
            if let Some(node) = ends.into_iter().find(|node| node.index() >= own) {
                return Err(SurfaceError::ClosingNode { node, nodes: own });
            }
            let [from, to] = ends.map(|node| tree.positions()[node.index()]);
            let length = from.distance(to);
            if !(length > 0.0) {
                return Err(SurfaceError::ClosingLength { ends });
            }
            if !(radius > 0.0 && radius.is_finite()) {
                return Err(SurfaceError::ClosingRadius { ends, radius });
            }
            let needed = ends.map(|node| match neighbours[node.index()] {
                // It goes on where another vessel ends.
                0 | 1 => 0.0,
                _ => ROOM[0] * tree.radii()[node.index()] + ROOM[1] * radius,
            });
            let spare = length - needed[0] - needed[1];
            let gap = spare.clamp(LEAST_GAP * radius, MOST_GAP * radius).min(MOST_SHARE * length);
            // Both halves get what they need, or as much of it as there is, and share the rest.
            let first = if spare > gap {
                needed[0] + 0.5 * (spare - gap)
            } else {
                (length - gap) * needed[0] / (needed[0] + needed[1])
            };
            positions.extend([from.lerp(to, first / length), from.lerp(to, (first + gap) / length)]);
            parents.extend(ends.map(|NodeId(node)| node));
            radii.extend([radius; 2]);
        }
        let tree = VesselTree::from_arrays(positions, parents, radii)
            .map_err(|_| SurfaceError::ClosingLength { ends: closing[0].ends })?;
        Ok(Self { tree: Cow::Owned(tree), closing, own })
    }

    /// Number of closing vessels.
    pub fn len(&self) -> usize {
        self.closing.len()
    }

    /// The closing vessel whose half ends at a node.
    pub fn at(&self, node: u32) -> Option<usize> {
        (node as usize).checked_sub(self.own).map(|extra| extra / 2)
    }

    /// The node of the tree itself: for the tip of a half, the one that it leaves.
    pub fn own(&self, node: u32) -> u32 {
        match (node as usize).checked_sub(self.own) {
            None => node,
            Some(extra) => self.closing[extra / 2].ends[extra % 2].0,
        }
    }
}
