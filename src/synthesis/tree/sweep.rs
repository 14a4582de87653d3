//! Data derived from the three arrays: children, tips, depth, path length, Strahler order, branches.
//!
//! In: a [`VesselTree`], with parents before their children. Out: arrays with one entry per node or per branch.
//! Everything here is one or two loops over the nodes, in O(n): a reverse loop passes values from the tips to the roots
//! ([`VesselTree::fold_to_roots`]), a forward loop from the roots to the tips ([`VesselTree::fold_to_tips`]). There is
//! no recursion, so a vessel of a million nodes in a row is no problem.

use super::{NO_PARENT, VesselTree};

impl VesselTree {
    /// Passes values from the tips to the roots.
    ///
    /// `values` has one entry per node. `merge(parent, child)` is called once per segment, children in falling order of
    /// their index, each after all of its own children.
    ///
    /// # Panics
    /// If `values` does not have one entry per node.
    pub fn fold_to_roots<T>(&self, values: &mut [T], mut merge: impl FnMut(&mut T, &T)) {
        assert_eq!(values.len(), self.len(), "one value per node");
        for (node, &parent) in self.parents().iter().enumerate().rev() {
            if parent != NO_PARENT {
                let (before, rest) = values.split_at_mut(node);
                merge(&mut before[parent as usize], &rest[0]);
            }
        }
    }

    /// Passes values from the roots to the tips.
    ///
    /// `values` has one entry per node. `step(node, parent, child)` is called once per segment in rising order of the
    /// node, each after its parent, and gets the parent's value and its own.
    ///
    /// # Panics
    /// If `values` does not have one entry per node.
    pub fn fold_to_tips<T>(&self, values: &mut [T], mut step: impl FnMut(usize, &T, &mut T)) {
        assert_eq!(values.len(), self.len(), "one value per node");
        for (node, parent) in self.segments() {
            let (before, rest) = values.split_at_mut(node);
            step(node, &before[parent], &mut rest[0]);
        }
    }

    /// Number of children of every node.
    pub fn child_counts(&self) -> Vec<u32> {
        let mut counts = vec![0; self.len()];
        for (_, parent) in self.segments() {
            counts[parent] += 1;
        }
        counts
    }

    /// Children of every node. See [`Children`].
    pub fn children(&self) -> Children {
        let mut children = Children::default();
        children.rebuild(self);
        children
    }

    /// Indices of the nodes without children, in rising order. A root that has not grown is one of them.
    pub fn tips(&self) -> Vec<u32> {
        let counts = self.child_counts();
        (0u32..).zip(counts).filter(|&(_, count)| count == 0).map(|(node, _)| node).collect()
    }

    /// Number of segments between every node and its root.
    pub fn depths(&self) -> Vec<u32> {
        let mut depths = vec![0; self.len()];
        self.fold_to_tips(&mut depths, |_, parent, child| *child = parent + 1);
        depths
    }

    /// Number of splits (nodes with two or more children) between every segment and its root, by the segment's end
    /// node. The root itself does not count: segments that leave it have level 0.
    pub fn bifurcation_levels(&self) -> Vec<u32> {
        let counts = self.child_counts();
        let mut levels = vec![0; self.len()];
        for (node, parent) in self.segments() {
            let is_split = counts[parent] > 1 && self.parents()[parent] != NO_PARENT;
            levels[node] = levels[parent] + u32::from(is_split);
        }
        levels
    }

    /// Length along the vessel from the root to every node, in tissue lengths.
    ///
    /// Summed in f64, so that a long vessel of short segments keeps its accuracy.
    pub fn path_lengths(&self) -> Vec<f64> {
        let mut lengths = vec![0.0; self.len()];
        self.fold_to_tips(&mut lengths, |node, parent, child| *child = parent + self.segment_length(node));
        lengths
    }

    /// Length of the segment that ends in a node, in tissue lengths; 0 for a root.
    ///
    /// # Panics
    /// If the node is not in this tree.
    pub fn segment_length(&self, node: usize) -> f64 {
        f64::from(self.segment_vector(node).length())
    }

    /// The root that every node belongs to.
    pub fn root_of_nodes(&self) -> Vec<u32> {
        let mut roots: Vec<u32> = (0u32..).zip(self.parents()).map(|(node, _)| node).collect();
        self.fold_to_tips(&mut roots, |_, parent, child| *child = *parent);
        roots
    }

    /// Strahler order of every node, and so of the segment that ends in it.
    ///
    /// A tip has order 1. If the highest order k among the children occurs once, the node has order k; if it occurs
    /// twice or more, k + 1.
    ///
    /// Source: Strahler, "Quantitative analysis of watershed geomorphology" (1957).
    pub fn strahler_orders(&self) -> Vec<u32> {
        // Highest order among the children, and its number of occurrences.
        let mut highest = vec![(0u32, 0u32); self.len()];
        let order = |(highest, count): (u32, u32)| if count == 1 { highest } else { highest + 1 };
        self.fold_to_roots(&mut highest, |parent, &child| {
            let order = order(child);
            match order.cmp(&parent.0) {
                std::cmp::Ordering::Greater => *parent = (order, 1),
                std::cmp::Ordering::Equal => parent.1 += 1,
                std::cmp::Ordering::Less => {}
            }
        });
        highest.into_iter().map(order).collect()
    }

    /// The branches: runs of segments between splits. See [`Branches`].
    pub fn branches(&self) -> Branches {
        Branches::of(self)
    }
}

/// Children of every node, as compressed rows: one array of all children and one with the start of each node's
/// children.
///
/// Keeps its memory from one [`rebuild`](Self::rebuild) to the next.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Children {
    starts: Vec<u32>,
    nodes: Vec<u32>,
}

impl Children {
    /// Fills the table from a tree, replacing its old contents.
    pub fn rebuild(&mut self, tree: &VesselTree) {
        self.starts.clear();
        self.starts.resize(tree.len() + 1, 0);
        for (_, parent) in tree.segments() {
            self.starts[parent] += 1;
        }
        // Each entry becomes the end of its row, and walks back to the row's start as the row is filled from behind.
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.nodes.clear();
        self.nodes.resize(end as usize, 0);
        for (node, &parent) in tree.parents().iter().enumerate().rev() {
            if parent != NO_PARENT {
                let slot = &mut self.starts[parent as usize];
                *slot -= 1;
                self.nodes[*slot as usize] = node as u32;
            }
        }
    }

    /// Children of a node in rising order; empty for a tip.
    ///
    /// # Panics
    /// If the node is not in the tree.
    pub fn of(&self, node: usize) -> &[u32] {
        &self.nodes[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// Number of nodes of the table's tree.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether the table's tree has no nodes.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The branches of a tree: runs of segments from a root or split to the next split or tip.
///
/// A split is a node with two or more children. Every segment belongs to exactly one branch; a root without children
/// has none. Branches are in the order of their first segment, so a parent branch comes before its children.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Branches {
    starts: Vec<u32>,
    nodes: Vec<u32>,
    parents: Vec<u32>,
    of_nodes: Vec<u32>,
}

impl Branches {
    /// Value of [`parent`](Self::parent) and [`of_nodes`](Self::of_nodes) for no branch.
    const NONE: u32 = u32::MAX;

    fn of(tree: &VesselTree) -> Self {
        let counts = tree.child_counts();
        let mut branches = Self { of_nodes: vec![Self::NONE; tree.len()], ..Self::default() };
        // Lengths first: every branch includes its start node.
        for (node, parent) in tree.segments() {
            let before = branches.of_nodes[parent];
            if before == Self::NONE || counts[parent] > 1 {
                branches.of_nodes[node] = branches.parents.len() as u32;
                branches.parents.push(before);
                branches.starts.push(2);
            } else {
                branches.of_nodes[node] = before;
                branches.starts[before as usize] += 1;
            }
        }
        branches.starts.push(0);
        let mut end = 0;
        for start in &mut branches.starts {
            end += std::mem::replace(start, end);
        }
        branches.fill(tree, end as usize);
        branches
    }

    /// Writes every branch's nodes in path order; rising index is path order within a branch.
    fn fill(&mut self, tree: &VesselTree, total: usize) {
        self.nodes.resize(total, Self::NONE);
        let mut next = self.starts.clone();
        for (node, parent) in tree.segments() {
            let branch = self.of_nodes[node] as usize;
            if next[branch] == self.starts[branch] {
                self.nodes[next[branch] as usize] = parent as u32;
                next[branch] += 1;
            }
            self.nodes[next[branch] as usize] = node as u32;
            next[branch] += 1;
        }
    }

    /// Number of branches.
    pub fn len(&self) -> usize {
        self.parents.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.parents.is_empty()
    }

    /// Nodes of a branch along the vessel: its start (a root or split), then one for each of its segments.
    ///
    /// # Panics
    /// If there are not that many branches.
    pub fn nodes(&self, branch: usize) -> &[u32] {
        &self.nodes[self.starts[branch] as usize..self.starts[branch + 1] as usize]
    }

    /// Nodes of every branch. See [`nodes`](Self::nodes).
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        (0..self.len()).map(|branch| self.nodes(branch))
    }

    /// The parent branch of a branch; `None` for one that begins at a root.
    ///
    /// # Panics
    /// If there are not that many branches.
    pub fn parent(&self, branch: usize) -> Option<usize> {
        let parent = self.parents[branch];
        (parent != Self::NONE).then_some(parent as usize)
    }

    /// The branch of the segment that ends in each node; `u32::MAX` for a root.
    pub fn of_nodes(&self) -> &[u32] {
        &self.of_nodes
    }

    /// Strahler order of every branch: that of all its segments. `node_orders` are
    /// [`VesselTree::strahler_orders`] of the same tree.
    ///
    /// # Panics
    /// If the orders are those of a tree with fewer nodes.
    pub fn strahler_orders(&self, node_orders: &[u32]) -> Vec<u32> {
        self.iter().map(|nodes| node_orders[nodes[1] as usize]).collect()
    }
}
