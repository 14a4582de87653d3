//! Trees from which a growth continues.
//!
//! Their centre lines stay as they are, even outside the tissue. Radii follow from the flow, as those of all vessels
//! do.

use super::{
    error::{CcoError, GivenTreeError},
    forest::{NONE, Node},
    space::Space,
    sums::Below,
};
use crate::synthesis::tree::{NO_PARENT, VesselKind, VesselTree};

impl Space {
    /// Takes over a given tree, or forest, whose terminals have the flows that `share` gives. Returns the numbers of
    /// its trees and its terminal nodes.
    ///
    /// # Errors
    /// A tree that is no binary one, whose root has other than one child, or whose vessels overlap.
    pub(super) fn adopt(
        &mut self,
        kind: VesselKind,
        given: &VesselTree,
        unit: f64,
        mut share: impl FnMut() -> f64,
    ) -> Result<(Vec<u32>, Vec<u32>), CcoError> {
        let refused = |node: usize, reason| Err(CcoError::GivenTree { kind, node: node as u32, reason });
        given.validate().map_err(|error| CcoError::GivenTree {
            kind,
            node: 0,
            reason: GivenTreeError::Invalid { reason: error.to_string() },
        })?;
        let (first, mut trees) = (self.forest.nodes.len() as u32, Vec::new());
        for (node, (&at, &parent)) in given.positions().iter().zip(given.parents()).enumerate() {
            let own = first + node as u32;
            if parent == NO_PARENT {
                let tree = self.roots.len() as u32;
                self.roots.push(own);
                self.unit.push(unit);
                trees.push(tree);
                self.forest.nodes.push(Node::new(at, NONE, tree, 0.0));
                continue;
            }
            let parent = first + parent;
            let above = self.forest.node_mut(parent);
            let slots = if above.parent == NONE { 1 } else { 2 };
            let Some(slot) = (0..slots).find(|&slot| above.children[slot] == NONE) else {
                return refused((parent - first) as usize, GivenTreeError::TooManyChildren { most: slots as u32 });
            };
            above.children[slot] = own;
            let tree = above.tree;
            if above.at == at {
                return refused(node, GivenTreeError::NoLength);
            }
            self.forest.nodes.push(Node::new(at, parent, tree, 0.0));
        }
        let end = self.forest.nodes.len() as u32;
        let mut terminals = Vec::new();
        for node in (first..end).rev() {
            let own = self.forest.node(node);
            let (parent, children) = (own.parent, own.children);
            if parent == NONE {
                if children[0] == NONE {
                    return refused((node - first) as usize, GivenTreeError::NoVessel);
                }
                continue;
            }
            if children[0] == NONE {
                self.forest.node_mut(node).flow = share();
                terminals.push(node);
            }
            let below = match children {
                [NONE, _] => Below::default(),
                [a, b] => Below::join(&self.forest.sums(a), &self.forest.sums(b), self.forest.exponent),
            };
            self.measure(node, &below);
            let flow = self.forest.node(node).flow;
            self.forest.node_mut(parent).flow += flow;
        }
        self.given = end;
        self.begin();
        let segments: Vec<u32> = (first..end).filter(|&node| self.forest.node(node).parent != NONE).collect();
        self.enter(&segments);
        for &segment in &segments {
            if !self.clear(segment, 1.0) {
                let radius = self.radius(segment) as f32;
                return refused((segment - first) as usize, GivenTreeError::Overlaps { radius });
            }
        }
        for &segment in segments.iter().rev() {
            let strain = self.forest.strain_of(segment);
            self.forest.node_mut(segment).strain = strain;
        }
        terminals.reverse();
        Ok((trees, terminals))
    }
}
