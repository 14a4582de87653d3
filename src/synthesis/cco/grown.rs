//! The trees of one kind as a [`VesselTree`], in the order from the roots.

use super::{forest::NONE, space::Space};
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};

/// A settled tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Grown {
    pub tree: VesselTree,
    /// The step in which each node was born.
    pub birth_steps: Vec<u32>,
    /// Nodes to be visited: node, parent in the tree, and the fourth power of the parent's radius.
    stack: Vec<(u32, u32, f64)>,
}

impl Grown {
    /// Makes the tree anew.
    pub(super) fn settle(&mut self, space: &Space, trees: &[u32]) {
        self.tree.clear();
        self.birth_steps.clear();
        for &tree in trees.iter().rev() {
            self.stack.push((space.roots[tree as usize], NO_PARENT, 0.0));
        }
        let forest = &space.forest;
        let count = forest.nodes.iter().filter(|node| trees.contains(&node.tree)).count();
        self.tree.reserve_exact(count);
        self.birth_steps.reserve_exact(count);
        while let Some((node, parent, parent_fourth)) = self.stack.pop() {
            let own = forest.node(node);
            let fourth = if own.parent == NONE {
                space.unit[own.tree as usize] * forest.node(own.children[0]).load
            } else {
                parent_fourth * forest.thinning(node)
            };
            let radius = fourth.sqrt().sqrt() as f32;
            let id = match parent {
                NO_PARENT => self.tree.push_root(own.at, radius),
                parent => self.tree.push_child(NodeId(parent), own.at, radius),
            };
            // Two nodes are born in each step, after the given ones.
            self.birth_steps.push(node.checked_sub(space.given).map_or(0, |born| born / 2 + 1));
            let children = own.children.iter().rev().filter(|&&child| child != NONE);
            self.stack.extend(children.map(|&child| (child, id.0, fourth)));
        }
    }
}
