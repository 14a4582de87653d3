//! Trunks: a tree as tubes that branches leave.
//!
//! In: a tree. Out: runs of nodes. A run follows the widest child at each node, unless that turns back by more than a
//! right angle (the backward connection of Skjermo & Eidheim 2005, section 3): then all children leave the trunk's end
//! as laterals. An only child is always followed. The nodes of a root with several children lie in one trunk, from tip to tip.

use super::direction::unit;
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree, sweep::Children};
use bevy_math::Vec3;

const NONE: u32 = u32::MAX;
/// Segments over which a direction is measured, at most. Those of traced vessels are shorter than their noise.
const FEW: usize = 64;

/// Where a trunk begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Base {
    /// At a root of the tree, which it closes with an end of its own, or at the tip behind a root that it runs through.
    Root {
        /// The place of the root among the trunk's nodes.
        at: u32,
    },
    /// At a node of another trunk: the trunk's first node is that one's node.
    Joint {
        /// The other trunk, which comes before this one.
        trunk: u32,
        /// The place of the joint among the other trunk's nodes.
        at: u32,
    },
}

/// All trunks of a tree, each after the one that it leaves.
#[derive(Debug)]
pub(super) struct Trunks {
    nodes: Vec<u32>,
    starts: Vec<u32>,
    bases: Vec<Base>,
    lateral_starts: Vec<u32>,
    laterals: Vec<u32>,
}

impl Trunks {
    /// The trunks of a tree.
    pub fn of(tree: &VesselTree) -> Self {
        let courses = Courses::of(tree);
        let mut trunks = Self {
            nodes: Vec::with_capacity(tree.len()),
            starts: vec![0],
            bases: Vec::new(),
            lateral_starts: Vec::new(),
            laterals: Vec::new(),
        };
        // For every node, its trunk and its place in it.
        let mut places = vec![(0, 0); tree.len()];
        for (node, &parent) in tree.parents().iter().enumerate() {
            if parent != NO_PARENT
                && (courses.next[parent as usize] == node as u32 || courses.back[parent as usize] == node as u32)
            {
                continue;
            }
            let (trunk, start) = (trunks.bases.len() as u32, trunks.nodes.len());
            if parent == NO_PARENT {
                trunks.nodes.extend(courses.along(courses.back[node]));
                trunks.nodes[start..].reverse();
                trunks.bases.push(Base::Root { at: (trunks.nodes.len() - start) as u32 });
            } else {
                let (trunk, at) = places[parent as usize];
                trunks.bases.push(Base::Joint { trunk, at });
                trunks.nodes.push(parent);
            }
            let own = start + usize::from(parent != NO_PARENT);
            trunks.nodes.extend(courses.along(node as u32));
            for (at, &node) in (start..).zip(&trunks.nodes[start..]).skip(own - start) {
                places[node as usize] = (trunk, (at - start) as u32);
            }
            trunks.starts.push(trunks.nodes.len() as u32);
        }
        trunks.list_laterals();
        trunks
    }

    /// Number of trunks.
    pub fn len(&self) -> usize {
        self.bases.len()
    }

    /// The nodes of a trunk, from its base to its tip.
    pub fn nodes(&self, trunk: usize) -> &[u32] {
        &self.nodes[self.starts[trunk] as usize..self.starts[trunk + 1] as usize]
    }

    /// Where a trunk begins.
    pub fn base(&self, trunk: usize) -> Base {
        self.bases[trunk]
    }

    /// The trunks that leave a trunk, in the order of their joints along it.
    pub fn laterals(&self, trunk: usize) -> &[u32] {
        &self.laterals[self.lateral_starts[trunk] as usize..self.lateral_starts[trunk + 1] as usize]
    }

    fn list_laterals(&mut self) {
        let mut sorted: Vec<(u32, u32, u32)> = (0u32..)
            .zip(&self.bases)
            .filter_map(|(lateral, base)| match *base {
                Base::Root { .. } => None,
                Base::Joint { trunk, at } => Some((trunk, at, lateral)),
            })
            .collect();
        sorted.sort_unstable();
        self.lateral_starts = vec![0; self.len() + 1];
        for (trunk, ..) in &sorted {
            self.lateral_starts[*trunk as usize + 1] += 1;
        }
        for trunk in 0..self.len() {
            self.lateral_starts[trunk + 1] += self.lateral_starts[trunk];
        }
        self.laterals = sorted.into_iter().map(|(.., lateral)| lateral).collect();
    }
}

/// With which child a trunk goes on at each node.
struct Courses {
    next: Vec<u32>,
    /// For a root in the middle of a trunk, the child on its other side.
    back: Vec<u32>,
}

impl Courses {
    fn of(tree: &VesselTree) -> Self {
        let children = tree.children();
        let (mut next, mut back) = (vec![NONE; tree.len()], vec![NONE; tree.len()]);
        for node in 0..tree.len() {
            if let [only] = children.of(node) {
                next[node] = *only;
                continue;
            }
            let leaving = |child: usize| leaving(tree, &children, child);
            let Some(ahead) = arriving(tree, node) else {
                next[node] = widest(tree, &children, node, |_| Some(0.0));
                if next[node] != NONE {
                    let first = leaving(next[node] as usize);
                    let straightness = |child: usize| Some(-first.dot(leaving(child))).filter(|&share| share > 0.0);
                    back[node] = widest(tree, &children, node, straightness);
                }
                continue;
            };
            let straightness = |child: usize| Some(ahead.dot(leaving(child))).filter(|&share| share >= 0.0);
            next[node] = widest(tree, &children, node, straightness);
        }
        Self { next, back }
    }

    /// The nodes of a course from one on.
    fn along(&self, from: u32) -> impl Iterator<Item = u32> + '_ {
        let mut node = from;
        std::iter::from_fn(move || {
            let here = node;
            (here != NONE).then(|| {
                node = self.next[here as usize];
                here
            })
        })
    }
}

/// The widest child that may follow a node: one with a straightness. Of equals the straightest, of these the first.
fn widest(tree: &VesselTree, children: &Children, node: usize, straightness: impl Fn(usize) -> Option<f32>) -> u32 {
    let mut widest = (NONE, 0.0, 0.0);
    for &child in children.of(node) {
        let Some(straightness) = straightness(child as usize) else { continue };
        let radius = tree.radii()[child as usize];
        if widest.0 == NONE || radius > widest.1 || (radius == widest.1 && straightness > widest.2) {
            widest = (child, radius, straightness);
        }
    }
    widest.0
}

/// Unit direction in which a vessel arrives at a node, over a radius; `None` for a root, zero if it has no length.
fn arriving(tree: &VesselTree, node: usize) -> Option<Vec3> {
    let here = tree.positions()[node];
    let mut from = tree.parent(NodeId(node as u32))?;
    for _ in 0..FEW {
        match tree.parent(from) {
            Some(before) if tree.positions()[from.index()].distance(here) < tree.radii()[node] => from = before,
            _ => break,
        }
    }
    Some(unit(here - tree.positions()[from.index()]).unwrap_or(Vec3::ZERO))
}

/// Unit direction in which a child leaves its parent, over a radius; zero if it has no length.
fn leaving(tree: &VesselTree, children: &Children, child: usize) -> Vec3 {
    let from = tree.positions()[tree.parents()[child] as usize];
    let mut to = child;
    for _ in 0..FEW {
        match children.of(to) {
            [first, ..] if tree.positions()[to].distance(from) < tree.radii()[child] => to = *first as usize,
            _ => break,
        }
    }
    unit(tree.positions()[to] - from).unwrap_or(Vec3::ZERO)
}
