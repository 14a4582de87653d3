//! The trees in their tissue: changes of them, which are tried, and kept or undone.

use super::{
    domain::Domain,
    forest::{Forest, NONE, Node},
    index::SegmentGrid,
    sums::{Below, Sums},
};
use bevy_math::DVec3;

/// Factor by which the radius of a segment may grow before its neighbours are looked at again.
pub(super) const SLACK: f64 = 1.05;

/// All trees, with the tissue around them.
#[derive(Clone, Debug)]
pub(super) struct Space {
    pub domain: Domain,
    pub forest: Forest,
    pub index: SegmentGrid,
    /// For each tree, the fourth power of the radius of a load of 1 at full pressure.
    pub unit: Vec<f64>,
    /// The root node of each tree.
    pub roots: Vec<u32>,
    /// Flow of the next terminal, in that of a mean one.
    pub share: f64,
    /// Number of the first nodes, those of given trees, which stay where they are.
    pub given: u32,
    /// Factor of the radii for which new segments must have room: what they are expected to grow by.
    pub reserve: f64,
    /// The last segment that had to become wider and had no room, of those before a change, and the segment beside it
    /// that was in the way; itself where that was the border.
    pub blocked: Option<[u32; 2]>,
    /// The segment that was in the way of the last one without room; itself where that was the border.
    pub in_the_way: u32,
    /// Nodes as they were before a change, in the order in which they were changed.
    pub(super) before: Vec<(u32, Node)>,
    /// Number of nodes before the change.
    nodes_before: usize,
    /// Segments taken out of the index and put back in with other ends.
    moved: Vec<u32>,
    /// Buffer: bounds of neighbours that become tighter.
    pub(super) tightened: Vec<(u32, f32)>,
    /// Buffer: segments wider than their bounds, and segments still to be looked at, with their radii and those of
    /// their parents.
    pub(super) wide: Vec<u32>,
    pub(super) stack: Vec<(u32, f64, f64)>,
}

impl Space {
    pub(super) fn new(domain: Domain, forest: Forest) -> Self {
        let side = 2.0 * domain.diagonal();
        let corner = domain.corner.min(domain.corner + domain.axes[0] * domain.sides.x);
        let corner = corner.min(domain.corner + domain.axes[1] * domain.sides.y);
        Self {
            index: SegmentGrid::new(corner - DVec3::splat(0.5 * side), side),
            domain,
            forest,
            unit: Vec::new(),
            roots: Vec::new(),
            share: 1.0,
            given: 0,
            reserve: 1.0,
            blocked: None,
            in_the_way: NONE,
            before: Vec::new(),
            nodes_before: 0,
            moved: Vec::new(),
            tightened: Vec::new(),
            wide: Vec::new(),
            stack: Vec::new(),
        }
    }

    /// The root segment of a tree.
    pub(super) fn root_segment(&self, tree: u32) -> u32 {
        self.forest.node(self.roots[tree as usize]).children[0]
    }

    /// The radius of a segment, in tissue lengths.
    pub(super) fn radius(&self, segment: u32) -> f64 {
        let unit = self.unit[self.forest.node(segment).tree as usize];
        (unit * self.forest.fourth_power(segment)).sqrt().sqrt()
    }

    /// Begins a change.
    pub(super) fn begin(&mut self) {
        self.before.clear();
        self.moved.clear();
        self.nodes_before = self.forest.nodes.len();
    }

    /// Takes back all since [`begin`](Self::begin).
    pub(super) fn undo(&mut self) {
        let moved = std::mem::take(&mut self.moved);
        for &segment in &moved {
            self.index.remove(&self.forest, segment);
        }
        while let Some((node, before)) = self.before.pop() {
            *self.forest.node_mut(node) = before;
        }
        self.forest.nodes.truncate(self.nodes_before);
        for &segment in moved.iter().filter(|&&segment| (segment as usize) < self.nodes_before) {
            self.index.insert(&self.forest, segment);
        }
        self.moved = moved;
    }

    /// A node to be changed.
    pub(super) fn change(&mut self, node: u32) -> &mut Node {
        if (node as usize) < self.nodes_before {
            self.before.push((node, *self.forest.node(node)));
        }
        self.forest.node_mut(node)
    }

    /// Adds a tree with one segment.
    pub(super) fn plant(&mut self, root: DVec3, terminal: DVec3, unit: f64) -> [u32; 2] {
        self.forest.make_room();
        let (tree, first) = (self.roots.len() as u32, self.forest.nodes.len() as u32);
        let mut node = Node::new(root.as_vec3(), NONE, tree, self.share);
        node.children[0] = first + 1;
        self.forest.nodes.push(node);
        self.forest.nodes.push(Node::new(terminal.as_vec3(), first, tree, self.share));
        self.roots.push(first);
        self.unit.push(unit);
        self.measure(first + 1, &Below::default());
        self.enter(&[first + 1]);
        [first, first + 1]
    }

    /// Takes back the last planted tree, after [`begin`](Self::begin).
    pub(super) fn uproot(&mut self) {
        self.undo();
        self.roots.pop();
        self.unit.pop();
    }

    /// Splits a segment at a place, from which a new segment leads to a terminal. Returns the new nodes: the
    /// bifurcation and the terminal.
    pub(super) fn split(&mut self, segment: u32, place: DVec3, terminal: DVec3) -> [u32; 2] {
        let (parent, tree) = (self.forest.node(segment).parent, self.forest.node(segment).tree);
        let joint = self.forest.nodes.len() as u32;
        let below = self.forest.below(segment);
        self.index.remove(&self.forest, segment);
        self.forest.make_room();
        self.forest.nodes.push(Node::new(place.as_vec3(), parent, tree, 0.0));
        self.forest.nodes.push(Node::new(terminal.as_vec3(), joint, tree, self.share));
        let children = &mut self.change(parent).children;
        children[usize::from(children[0] != segment)] = joint;
        self.change(segment).parent = joint;
        self.measure(segment, &below);
        self.measure(joint + 1, &Below::default());
        let flow = self.forest.node(segment).flow;
        let node = self.forest.node_mut(joint);
        (node.children, node.flow) = ([segment, joint + 1], flow);
        self.carry(joint, self.share);
        self.enter(&[joint, segment, joint + 1]);
        [joint, joint + 1]
    }

    /// Moves a bifurcation.
    pub(super) fn shift(&mut self, joint: u32, place: DVec3) {
        let children = self.forest.node(joint).children;
        let below = children.map(|child| self.forest.below(child));
        for segment in [joint, children[0], children[1]] {
            self.index.remove(&self.forest, segment);
        }
        self.change(joint).at = place.as_vec3();
        for (child, below) in children.into_iter().zip(below) {
            self.change(child);
            self.measure(child, &below);
        }
        self.carry(joint, 0.0);
        self.enter(&[joint, children[0], children[1]]);
    }

    /// Sets length and sums of a segment, whose node may be changed.
    pub(super) fn measure(&mut self, segment: u32, below: &Below) {
        let exponent = self.forest.exponent;
        let length = self.forest.length(segment);
        let node = self.forest.node_mut(segment);
        node.set_reach(length);
        node.set(&Sums::of(node.flow, length, below, exponent));
    }

    /// Carries changed sums of a bifurcation's children up to the root, with more flow on all the way.
    fn carry(&mut self, mut joint: u32, gain: f64) {
        let exponent = self.forest.exponent;
        let length = self.forest.length(joint);
        self.change(joint).set_reach(length);
        loop {
            let length = self.forest.length(joint);
            let [a, b] = self.forest.node(joint).children;
            let below = Below::join(&self.forest.sums(a), &self.forest.sums(b), exponent);
            let node = self.change(joint);
            node.flow += gain;
            node.set(&Sums::of(node.flow, length, &below, exponent));
            joint = node.parent;
            if self.forest.node(joint).parent == NONE {
                return;
            }
        }
    }

    /// Puts changed segments into the index, with the widest bounds that they may get.
    pub(super) fn enter(&mut self, segments: &[u32]) {
        for &segment in segments {
            let bound = SLACK * self.radius(segment);
            self.forest.node_mut(segment).bound = bound as f32;
            self.index.insert(&self.forest, segment);
            self.moved.push(segment);
        }
    }
}
