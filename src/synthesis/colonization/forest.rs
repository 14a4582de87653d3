//! The forest of one system while it grows: the tree, with further data of each node for growth.

use super::drains::Attraction;
use super::powers::Powers;
use crate::synthesis::space::point_grid::PointGrid;
use crate::synthesis::tissue::{Facet, Tissue, TissuePoint};
use crate::synthesis::tree::murray;
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use bevy_math::{Vec3, bounding::Aabb3d, ops};

/// A growing forest. All vectors have one entry per node.
///
/// Instead of radii, growth uses the *sum* of a node, r^κ in units of the full terminal radius: a tip's own, elsewhere
/// that of its children. Sums are up to date after every step, but the radii in the tree only after
/// [`settle`](Self::settle), since a power for every changed node and step would be most of the work.
#[derive(Debug, Default)]
pub(crate) struct Forest {
    pub tree: VesselTree,
    /// Unit direction of the segment that ends in the node, zero for a root.
    pub directions: Vec<Vec3>,
    /// Normal of the tissue's surface, zero in a volume.
    pub normals: Vec<Vec3>,
    /// The facet of the tissue's surface that the node lies on.
    facets: Vec<Option<Facet>>,
    /// Step in which the node was born, 0 for initial nodes.
    pub birth_steps: Vec<u32>,
    kin: Vec<Kin>,
    fanouts: Vec<Fanout>,
    index: PointGrid,
    /// Nodes whose sum must be computed again.
    unsummed: NodeSet,
    /// Nodes whose sum changed since the radii were last settled.
    unsettled: NodeSet,
    /// Nodes whose radius the last settling changed.
    changed: Vec<u32>,
    /// Radius of a new tip, and its sum.
    tip: (f32, f32),
    terminal_radius: f32,
    exponent: f32,
    powers: Powers,
}

/// A node's sum and its children, as a list that begins with the youngest.
#[derive(Clone, Copy, Debug)]
struct Kin {
    sum: f32,
    first_child: u32,
    next_sibling: u32,
}

/// The cosine of a drain on the node itself, which counts as in front of it.
pub(crate) const ON_THE_NODE: f32 = 2.0;

/// Cosine of the angle between a direction and the direction from a node to a drain.
fn cos_at(direction: Vec3, node: Vec3, drain: Vec3) -> f32 {
    (drain - node).try_normalize().map_or(ON_THE_NODE, |toward| direction.dot(toward).clamp(-1.0, 1.0))
}

/// Cosine of the angle between two facets from which each lies on the other side of a wall.
const AVERTED: f32 = -0.5;

/// Cosine of the angle between two facets from which one lies round an edge from the other.
const ROUND: f32 = 0.5;
/// Share of the squared way to a point from which it counts as off a facet: a little more than that of a ball.
const RAISED: f32 = 0.02;

/// Share of the squared way to a drain that must be along a facet.
const STEEP: f32 = 1e-6;

/// No child.
const NONE: u32 = u32::MAX;

/// Number of a node's children, and whether it is a root.
#[derive(Clone, Copy, Debug, Default)]
struct Fanout(u16);

impl Fanout {
    const ROOT: u16 = 1 << 15;
}

impl Forest {
    /// Empties the forest, keeping its memory.
    pub fn reset(&mut self, bounds: &Aabb3d, cell: f32, terminal_radius: f32, exponent: f32) {
        self.tree.clear();
        self.directions.clear();
        self.normals.clear();
        self.facets.clear();
        self.birth_steps.clear();
        self.kin.clear();
        self.fanouts.clear();
        self.unsummed.clear();
        self.unsettled.clear();
        self.changed.clear();
        self.index.reset(bounds, cell);
        self.terminal_radius = terminal_radius;
        self.exponent = exponent;
        self.tip = (terminal_radius, 1.0);
        self.powers.set_exponent(exponent);
        self.powers.meet(1.0);
    }

    /// The index over all nodes.
    pub fn index(&self) -> &PointGrid {
        &self.index
    }

    /// Adapts the cells to changed lengths: finer cells for shorter ones.
    pub fn resize_cells(&mut self, cell: f32) {
        self.index.resize_cells(cell);
    }

    /// Sets the radius of tips born from now on.
    pub fn set_tip_radius(&mut self, radius: f32) {
        if radius != self.tip.0 {
            self.tip = (radius, self.sum_of(radius));
        }
    }

    /// Adds a root, with the given radius if it were a tip.
    pub fn add_root(&mut self, at: TissuePoint, radius: f32) {
        self.tree.push_root(at.position, radius);
        self.add_channels(at, Vec3::ZERO, self.sum_of(radius), 0);
        self.fanouts.push(Fanout(Fanout::ROOT));
    }

    /// Adds a tip of a given radius to an initial node.
    pub fn add_given(&mut self, parent: u32, at: TissuePoint, radius: f32) {
        self.add_child(parent, at, radius, self.sum_of(radius), 0);
    }

    /// Adds a tip to a node, and returns it. The next [`sum_up`](Self::sum_up) updates the sums towards the root.
    pub fn add_tip(&mut self, parent: u32, at: TissuePoint, step: u32) -> u32 {
        let (radius, sum) = self.tip;
        self.add_child(parent, at, radius, sum, step)
    }

    fn add_child(&mut self, parent: u32, at: TissuePoint, radius: f32, sum: f32, step: u32) -> u32 {
        let above = parent as usize;
        let direction = (at.position - self.tree.positions()[above]).normalize_or_zero();
        let id = self.tree.push_child(NodeId(parent), at.position, radius).0;
        self.add_channels(at, direction, sum, step);
        let fanout = &mut self.fanouts[above].0;
        if *fanout & !Fanout::ROOT < Fanout::ROOT - 1 {
            *fanout += 1;
        }
        self.fanouts.push(Fanout::default());
        self.kin[id as usize].next_sibling = std::mem::replace(&mut self.kin[above].first_child, id);
        self.unsummed.insert(parent);
        id
    }

    fn add_channels(&mut self, at: TissuePoint, direction: Vec3, sum: f32, step: u32) {
        self.directions.push(direction);
        self.normals.push(at.normal);
        self.facets.push(at.facet);
        self.birth_steps.push(step);
        self.unsettled.insert(self.kin.len() as u32);
        self.kin.push(Kin { sum, first_child: NONE, next_sibling: NONE });
        self.index.push(at.position);
    }

    /// A node as a point of the tissue.
    pub fn point(&self, node: u32) -> TissuePoint {
        let node = node as usize;
        TissuePoint { position: self.tree.positions()[node], normal: self.normals[node], facet: self.facets[node] }
    }

    /// Finds the facets of all nodes anew, on another tissue.
    pub fn stand_on(&mut self, tissue: &dyn Tissue) {
        for (&position, own) in self.tree.positions().iter().zip(&mut self.facets) {
            *own = if tissue.has_facets() { tissue.point_at(position).facet } else { None };
        }
    }

    /// Where a node sees a drain: on a surface as far away as it is, in the direction along the node's facet.
    pub fn sight(&self, node: u32, drain: Vec3) -> Vec3 {
        let Some(facet) = self.facets[node as usize] else { return drain };
        let position = self.tree.positions()[node as usize];
        let way = drain - position;
        let along = way - facet.normal * way.dot(facet.normal);
        let square = along.length_squared();
        // One that is straight above or below is in no direction along the facet.
        if square > STEEP * way.length_squared() { position + along * (way.length() / square.sqrt()) } else { drain }
    }

    /// Whether a node sees a drain on a side of the tissue's surface, of which the normal is given: not if it lies behind,
    /// on the other side of a wall.
    pub fn sees(&self, node: u32, side: Vec3) -> bool {
        self.facets[node as usize].is_none_or(|facet| facet.normal.dot(side) > AVERTED)
    }

    /// Whether a node supplies a side of the tissue's surface near it: not round a sharp edge, so that vessels are drawn
    /// round it, and not through a wall.
    pub fn supplies(&self, node: u32, side: Vec3) -> bool {
        self.facets[node as usize].is_none_or(|facet| facet.normal.dot(side) > ROUND)
    }

    /// Whether a point lies so far above or below a node's facet that it may be round an edge, or on the other side of a
    /// wall.
    pub fn is_steep(&self, node: u32, point: Vec3) -> bool {
        let way = point - self.tree.positions()[node as usize];
        self.facets[node as usize].is_some_and(|facet| {
            let height = way.dot(facet.normal);
            height * height > RAISED * way.length_squared()
        })
    }

    /// Cosine of the angle between a node's direction and that in which it sees a drain; `None` if it doesn't see it.
    pub fn cos_to(&self, node: u32, drain: Attraction) -> Option<f32> {
        let index = node as usize;
        let cos = || cos_at(self.directions[index], self.tree.positions()[index], self.sight(node, drain.position));
        self.sees(node, drain.side).then(cos)
    }

    /// r^κ of a radius in units of the terminal one.
    fn sum_of(&self, radius: f32) -> f32 {
        if radius == self.terminal_radius { 1.0 } else { ops::powf(radius / self.terminal_radius, self.exponent) }
    }

    /// Number of children of a node, at most 32,767.
    pub fn children(&self, node: u32) -> u32 {
        u32::from(self.fanouts[node as usize].0 & !Fanout::ROOT)
    }

    /// Whether a node is a root.
    pub fn is_root(&self, node: u32) -> bool {
        self.fanouts[node as usize].0 & Fanout::ROOT != 0
    }

    /// Cosine and sine of the angle at which a new tip leaves an inter-node beside its only child.
    pub fn sprout(&self, node: u32) -> (f32, f32) {
        // With one child, the sum at the node is the child's.
        let sum = self.kin[node as usize].sum / self.tip.1;
        let cos = murray::sprout_cos(self.powers.root(sum), self.powers.root(1.0 + sum));
        (cos, (1.0 - cos * cos).max(0.0).sqrt())
    }

    /// Computes the sums of all nodes that new tips changed, from the tips to the roots. `changed` is called for each
    /// old node among them.
    ///
    /// A node's sum is always computed from scratch, from its youngest child to its oldest, so it doesn't depend on the
    /// history. Children come after their parents: one descent through the set meets every node after its children.
    pub fn sum_up(&mut self, mut changed: impl FnMut(u32)) {
        while let Some(node) = self.unsummed.pop_last() {
            let sum = self.children_of(node).map(|child| self.kin[child as usize].sum).sum();
            let own = &mut self.kin[node as usize];
            if sum != own.sum {
                own.sum = sum;
                self.powers.meet(sum);
                self.unsettled.insert(node);
                changed(node);
                let parent = self.tree.parents()[node as usize];
                if parent != NO_PARENT {
                    self.unsummed.insert(parent);
                }
            }
        }
    }

    fn children_of(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        let link = |child: u32| (child != NONE).then_some(child);
        let next = move |&child: &u32| link(self.kin[child as usize].next_sibling);
        std::iter::successors(link(self.kin[node as usize].first_child), next)
    }

    /// Computes by Murray's law the radii of all nodes whose sum changed since the last time, from the tips to the
    /// roots.
    pub fn settle(&mut self) {
        self.changed.clear();
        let radii = self.tree.radii_mut();
        while let Some(node) = self.unsettled.pop_last() {
            let sum = self.kin[node as usize].sum;
            radii[node as usize] = self.terminal_radius * self.powers.root(sum);
            self.changed.push(node);
        }
    }

    /// Nodes whose radius the last settling changed, new ones included, from the tips to the roots.
    pub fn changed(&self) -> &[u32] {
        &self.changed
    }
}

/// A set of nodes that returns them from the last to the first. Members may be added meanwhile, below the last one
/// taken.
#[derive(Debug, Default)]
struct NodeSet {
    words: Vec<u64>,
    /// Number of words up to the last one with members.
    end: usize,
}

impl NodeSet {
    fn clear(&mut self) {
        self.words.clear();
        self.end = 0;
    }

    fn insert(&mut self, node: u32) {
        let word = node as usize / 64;
        if word >= self.words.len() {
            self.words.resize(word + 1, 0);
        }
        self.words[word] |= 1 << (node % 64);
        self.end = self.end.max(word + 1);
    }

    fn pop_last(&mut self) -> Option<u32> {
        while let Some(last) = self.end.checked_sub(1) {
            let word = &mut self.words[last];
            if *word != 0 {
                let bit = 63 - word.leading_zeros();
                *word &= !(1 << bit);
                return Some(last as u32 * 64 + bit);
            }
            self.end = last;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32) -> TissuePoint {
        TissuePoint::new(Vec3::X * x, Vec3::ZERO)
    }

    #[test]
    fn radii_of_a_tree_come_from_its_tips() {
        let (exponent, mut forest) = (2.55, Forest::default());
        forest.reset(&Aabb3d::new(Vec3::ZERO, Vec3::ONE), 0.1, 0.01, exponent);
        forest.add_root(at(0.0), 0.01);
        for (parent, x) in [(0, 0.1), (1, 0.2), (1, 0.3)] {
            forest.add_tip(parent, at(x), 0);
        }
        let mut summed = Vec::new();
        forest.sum_up(|node| summed.push(node));
        forest.settle();
        let radii = forest.tree.radii();
        let expected = murray::parent_radius(0.01, 0.01, exponent);
        assert!((radii[1] - expected).abs() < 1e-7 && (radii[0] - expected).abs() < 1e-7);
        assert!((radii[2] - 0.01).abs() < 1e-8);
        assert_eq!((summed, forest.changed()), (vec![1, 0], &[3, 2, 1, 0][..]));
        forest.settle();
        assert!(forest.changed().is_empty());
    }

    #[test]
    fn a_set_gives_its_members_from_the_last_to_the_first() {
        let mut set = NodeSet::default();
        [5, 700, 64, 63, 5].into_iter().for_each(|node| set.insert(node));
        assert_eq!(set.pop_last(), Some(700));
        set.insert(699);
        set.insert(3);
        let rest: Vec<u32> = std::iter::from_fn(|| set.pop_last()).collect();
        assert_eq!(rest, [699, 64, 63, 5, 3]);
        assert_eq!(set.pop_last(), None);
    }
}
