//! Loops: vessels that a tree cannot hold, since they close a way round.
//!
//! In: a tree and its closing vessels. Out: a tree of all of them, in which one segment of each loop is cut into two twigs
//! whose tips lie beside each other. There the tubes are joined, in place of ends: see [`seams`](super::seams).
//!
//! A loop is cut where it has most room, far from its joints: a closing vessel may be shorter than it is wide, and lie in
//! the lumen of those that it joins. So the tree is hung up anew.

use super::settings::SurfaceError;
use crate::synthesis::tree::{NO_PARENT, NodeId, VesselTree};
use bevy_math::Vec3;
use std::{borrow::Cow, collections::BTreeSet};

/// Distance of both tips: at most and at least, in radii, and at most as a share of the segment's length.
const MOST_GAP: f32 = 1.0;
const LEAST_GAP: f32 = 0.25;
const MOST_SHARE: f32 = 0.2;
/// Room that a half needs to leave a joint, in the joint's radii and in its own.
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

/// A network as a tree that has some segments in two halves.
pub(super) struct Looped<'a> {
    pub tree: Cow<'a, VesselTree>,
    /// For each node, the one that users know; of the tip of a half, the one that it leaves. Empty without loops.
    own: Vec<u32>,
    /// Nodes before the tips; two tips for each loop.
    first_tip: usize,
}

impl<'a> Looped<'a> {
    /// A tree with some closing vessels.
    pub fn of(tree: &'a VesselTree, closing: &[ClosingVessel]) -> Result<Self, SurfaceError> {
        if closing.is_empty() {
            return Ok(Self { tree: Cow::Borrowed(tree), own: Vec::new(), first_tip: tree.len() });
        }
        let mut network = Network::of(tree, closing)?;
        for (number, vessel) in closing.iter().enumerate() {
            network.close(vessel, tree.len() + number)?;
        }
        let (tree, own) = network.hung_up()?;
        Ok(Self { first_tip: tree.len() - 2 * network.cuts.len(), tree: Cow::Owned(tree), own })
    }

    /// Number of loops.
    pub fn len(&self) -> usize {
        (self.tree.len() - self.first_tip) / 2
    }

    /// The loop that is cut at a tip.
    pub fn at(&self, node: u32) -> Option<usize> {
        (node as usize).checked_sub(self.first_tip).map(|tip| tip / 2)
    }

    /// The node that users know.
    pub fn own(&self, node: u32) -> u32 {
        self.own.get(node as usize).copied().unwrap_or(node)
    }
}

/// A network and a forest that spans it.
struct Network<'a> {
    tree: &'a VesselTree,
    /// Radius of each segment by its child, then of each closing vessel.
    radii: Vec<f32>,
    /// For each node, the one before it in the forest and the segment between them.
    parents: Vec<(u32, usize)>,
    /// Number of segments at each node.
    degrees: Vec<u32>,
    /// Segments that are not in the forest, each with its ends.
    cuts: Vec<([u32; 2], usize)>,
}

impl<'a> Network<'a> {
    fn of(tree: &'a VesselTree, closing: &[ClosingVessel]) -> Result<Self, SurfaceError> {
        let (mut radii, mut degrees) = (tree.radii().to_vec(), vec![0; tree.len()]);
        for (node, parent) in tree.segments() {
            degrees[node] += 1;
            degrees[parent] += 1;
        }
        for &ClosingVessel { ends, radius } in closing {
            if let Some(node) = ends.into_iter().find(|node| node.index() >= tree.len()) {
                return Err(SurfaceError::ClosingNode { node, nodes: tree.len() });
            }
            if !(radius > 0.0 && radius.is_finite()) {
                return Err(SurfaceError::ClosingRadius { ends, radius });
            }
            ends.iter().for_each(|node| degrees[node.index()] += 1);
            radii.push(radius);
        }
        let parents = tree.parents().iter().enumerate().map(|(node, &parent)| (parent, node)).collect();
        Ok(Self { tree, radii, parents, degrees, cuts: Vec::new() })
    }

    fn position(&self, node: u32) -> Vec3 {
        self.tree.positions()[node as usize]
    }

    /// Adds a closing vessel, and cuts the loop that it closes.
    fn close(&mut self, vessel: &ClosingVessel, segment: usize) -> Result<(), SurfaceError> {
        let [a, b] = vessel.ends.map(|NodeId(node)| node);
        let Some([from_a, from_b]) = self.ways(a, b) else {
            // It joins two trees.
            self.hang(b, a, segment, None);
            return Ok(());
        };
        // Around the loop: from the meeting down to a, over the closing vessel, and from b up again.
        let mut around: Vec<u32> = from_a.iter().rev().copied().collect();
        let down = around.len() - 1;
        around.extend(&from_b);
        let segment_after = |place: usize| match place {
            place if place < down => self.parents[around[place + 1] as usize].1,
            place if place == down => segment,
            place => self.parents[around[place] as usize].1,
        };
        let Some(place) = self.roomiest(&around, segment_after) else {
            return Err(SurfaceError::ClosingLength { ends: vessel.ends });
        };
        let cut = ([around[place], around[place + 1]], segment_after(place));
        match place {
            place if place < down => self.hang(a, b, segment, Some(cut.1)),
            place if place > down => self.hang(b, a, segment, Some(cut.1)),
            _ => {}
        }
        self.cuts.push(cut);
        Ok(())
    }

    /// The ways from two nodes up to where they meet, both with that node; `None` for nodes of two trees.
    fn ways(&self, a: u32, b: u32) -> Option<[Vec<u32>; 2]> {
        let mut ways = [vec![a], vec![b]];
        let mut seen = [BTreeSet::from([a]), BTreeSet::from([b])];
        // Step by step, so that no way gets much longer than the loop.
        let mut is_up = [false; 2];
        let meeting = loop {
            if let Some(&meeting) = ways[0].last().filter(|node| seen[1].contains(node)) {
                break meeting;
            }
            if let Some(&meeting) = ways[1].last().filter(|node| seen[0].contains(node)) {
                break meeting;
            }
            for way in 0..2 {
                let parent = ways[way].last().map_or(NO_PARENT, |&last| self.parents[last as usize].0);
                is_up[way] = parent == NO_PARENT;
                if !is_up[way] {
                    ways[way].push(parent);
                    seen[way].insert(parent);
                }
            }
            if is_up == [true; 2] {
                return None;
            }
        };
        for way in &mut ways {
            let end = way.iter().position(|&node| node == meeting).unwrap_or(0);
            way.truncate(end + 1);
        }
        Some(ways)
    }

    /// The place around a loop after which the middle of a segment is farthest from joints, in radii. `None` if the whole
    /// loop has no length.
    fn roomiest(&self, around: &[u32], segment_after: impl Fn(usize) -> usize) -> Option<usize> {
        let lengths: Vec<f32> =
            around.windows(2).map(|pair| self.position(pair[0]).distance(self.position(pair[1]))).collect();
        let count = lengths.len();
        // Length from each segment's middle to the next joint, going on, and coming back.
        let room = |places: &mut dyn Iterator<Item = usize>, joint: &dyn Fn(usize) -> usize| -> Vec<f32> {
            let (mut room, mut way) = (vec![f32::INFINITY; count], f32::INFINITY);
            for place in places {
                let is_joint = self.degrees[around[joint(place)] as usize] > 2;
                way = if is_joint { 0.0 } else { way };
                room[place] = way + 0.5 * lengths[place];
                way += lengths[place];
            }
            room
        };
        let back = room(&mut (0..2 * count).map(|place| place % count), &|place| place);
        let on = room(&mut (0..2 * count).rev().map(|place| place % count), &|place| (place + 1) % count);
        let score = |place: usize| (back[place].min(on[place]) / self.radii[segment_after(place)], lengths[place]);
        (0..count).filter(|&place| lengths[place] > 0.0).max_by(|&a, &b| {
            let ((room, length), (other, long)) = (score(a), score(b));
            room.total_cmp(&other).then(length.total_cmp(&long)).then(b.cmp(&a))
        })
    }

    /// Hangs a node below another one, and below it what was above it, up to a segment that is cut.
    fn hang(&mut self, mut node: u32, mut parent: u32, mut segment: usize, cut: Option<usize>) {
        loop {
            let (before, its) = std::mem::replace(&mut self.parents[node as usize], (parent, segment));
            if before == NO_PARENT || cut == Some(its) {
                break;
            }
            (node, parent, segment) = (before, node, its);
        }
    }

    /// The forest as a tree with the halves of what is cut, and each node's own.
    fn hung_up(&self) -> Result<(VesselTree, Vec<u32>), SurfaceError> {
        let mut children: Vec<Vec<u32>> = vec![Vec::new(); self.parents.len()];
        let mut order = Vec::with_capacity(self.parents.len());
        for (node, &(parent, _)) in self.parents.iter().enumerate() {
            match children.get_mut(parent as usize) {
                Some(children) => children.push(node as u32),
                None => order.push(node as u32),
            }
        }
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            order.extend(&children[node as usize]);
            next += 1;
        }
        let mut numbers = vec![NO_PARENT; order.len()];
        order.iter().enumerate().for_each(|(number, &node)| numbers[node as usize] = number as u32);
        let mut positions: Vec<Vec3> = order.iter().map(|&node| self.position(node)).collect();
        let parent = |&node: &u32| numbers.get(self.parents[node as usize].0 as usize).copied().unwrap_or(NO_PARENT);
        let mut parents: Vec<u32> = order.iter().map(parent).collect();
        let radius = |&node: &u32| match self.parents[node as usize] {
            (NO_PARENT, _) => self.tree.radii()[node as usize],
            (_, segment) => self.radii[segment],
        };
        let mut radii: Vec<f32> = order.iter().map(radius).collect();
        for &(ends, segment) in &self.cuts {
            positions.extend(self.tips(ends, self.radii[segment]));
            parents.extend(ends.map(|node| numbers[node as usize]));
            radii.extend([self.radii[segment]; 2]);
            order.extend(ends);
        }
        let tree = VesselTree::from_arrays(positions, parents, radii).map_err(SurfaceError::Network)?;
        Ok((tree, order))
    }

    /// Places of both tips of a segment that is cut.
    fn tips(&self, ends: [u32; 2], radius: f32) -> [Vec3; 2] {
        let [from, to] = ends.map(|node| self.position(node));
        let length = from.distance(to);
        let needed = ends.map(|node| match self.degrees[node as usize] {
            // It goes on where another segment ends.
            0..=2 => 0.0,
            _ => ROOM[0] * self.tree.radii()[node as usize] + ROOM[1] * radius,
        });
        let spare = length - needed[0] - needed[1];
        let gap = spare.clamp(LEAST_GAP * radius, MOST_GAP * radius).min(MOST_SHARE * length);
        // Both halves get what they need, or as much of it as there is, and share the rest.
        let first = if spare > gap {
            needed[0] + 0.5 * (spare - gap)
        } else {
            (length - gap) * needed[0] / (needed[0] + needed[1])
        };
        [from.lerp(to, first / length), from.lerp(to, (first + gap) / length)]
    }
}
