//! Who hears a drain: open nodes, their perception volumes, and the drains of each node.

use super::forest::Forest;
use super::lengths::Lengths;
use crate::synthesis::attraction::{Drains, Nearest};
use bevy_math::{Vec3, ops};

/// A drain that acts on a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Pull {
    pub node: u32,
    pub drain: u32,
}

/// Whether another vessel may leave a node.
pub(crate) fn is_open(forest: &Forest, lengths: &Lengths, node: u32) -> bool {
    let children = forest.children(node);
    match (forest.is_root(node), lengths.lateral_sprouts) {
        (true, _) => children < lengths.root_children,
        (false, true) => children < 2,
        (false, false) => children == 0,
    }
}

/// Finds the drains that act in this step, sorted by node.
///
/// A drain acts on its nearest open node within the influence distance, if it lies in that node's perception volume; if
/// not, it waits. `nearest open node` is settled exactly: of two at one distance the older wins.
pub(crate) fn associate(
    forest: &Forest,
    lengths: &Lengths,
    drains: &mut Drains,
    search: &mut Search,
    pulls: &mut Vec<Pull>,
) {
    search.refresh(forest, lengths, drains);
    pulls.clear();
    let reach = lengths.influence * lengths.influence;
    for drain in drains.slots() {
        if let Nearest::Node(node, distance) = drains.nearest(drain)
            && distance <= reach
            && perceives(forest, lengths, node, drains.position(drain))
        {
            pulls.push(Pull { node, drain });
        }
    }
    pulls.sort_unstable();
}

/// Searches for nearest open nodes, for those drains that must look anew. Keeps its buffers.
#[derive(Debug, Default)]
pub(crate) struct Search {
    asking: Vec<u32>,
    found: Vec<Nearest>,
}

impl Search {
    fn refresh(&mut self, forest: &Forest, lengths: &Lengths, drains: &mut Drains) {
        self.asking.clear();
        self.asking.extend(drains.slots().filter(|&drain| match drains.nearest(drain) {
            Nearest::Unknown => true,
            Nearest::Nobody => false,
            Nearest::Node(node, _) => !is_open(forest, lengths, node),
        }));
        let shared = &*drains;
        let find = |&drain: &u32| {
            let center = shared.position(drain);
            let open = |node| is_open(forest, lengths, node);
            match forest.index().nearest_within(center, lengths.influence, open) {
                Some((node, distance)) => Nearest::Node(node, distance),
                None => Nearest::Nobody,
            }
        };
        super::parallel::map_into(&self.asking, &mut self.found, Nearest::Unknown, find);
        for (&drain, &nearest) in self.asking.iter().zip(&self.found) {
            drains.set_nearest(drain, nearest);
        }
    }
}

/// Whether a point lies in a node's perception volume; its distance has been tested before (Eq. 2 and 3).
fn perceives(forest: &Forest, lengths: &Lengths, node: u32, point: Vec3) -> bool {
    if forest.is_root(node) {
        return true;
    }
    let index = node as usize;
    let Some(toward) = (point - forest.tree.positions()[index]).try_normalize() else {
        // A drain on the node itself is in front of it as much as anywhere.
        return true;
    };
    let cos = forest.directions[index].dot(toward);
    if forest.children(node) == 0 {
        return cos >= lengths.cos_half_perception;
    }
    let best = forest.sprout_angle(node, lengths.terminal_radius);
    let angle = ops::acos(cos.clamp(-1.0, 1.0));
    (angle - best).abs() <= lengths.half_perception
}
