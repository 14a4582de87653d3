//! Which node perceives a drain: open nodes, their perception volumes, and the drains of each node.

use super::drains::{Attraction, Drains, Found};
use super::forest::{Forest, ON_THE_NODE};
use super::lengths::Lengths;
use crate::synthesis::parallel;

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
/// A drain acts on the nearest open node within the influence distance that sees it, if it lies in that node's perception
/// volume; if not, it waits. `nearest open node` is exact: of two at equal distance, the older wins. Only drains with a change
/// nearby, and those that acted in the step before, are tested.
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
    drains.keep_awake(|drain, hearing| {
        let Some(node) = hearing.node() else { return false };
        if hearing.distance > reach {
            return false;
        }
        let acts = perceives(forest, lengths, node, hearing.cos);
        if acts {
            pulls.push(Pull { node, drain });
        }
        // If tips become finer from step to step, sprouts beside a vessel leave it at ever wider angles.
        acts || lengths.sprouts_turn && forest.children(node) == 1
    });
    pulls.sort_unstable();
}

/// Searches the nearest open nodes of drains that need a new search. Reuses its buffers.
#[derive(Debug, Default)]
pub(crate) struct Search {
    asking: Vec<u32>,
    found: Vec<Found>,
}

impl Search {
    fn refresh(&mut self, forest: &Forest, lengths: &Lengths, drains: &mut Drains) {
        self.asking.clear();
        self.asking.extend(drains.awake().iter().filter(|&&drain| drains.is_searching(drain)));
        let shared = &*drains;
        let find = |&drain: &u32| nearest_open(forest, lengths, shared.attraction(drain));
        parallel::map_many_into(&self.asking, &mut self.found, Found::default(), find);
        for (&drain, &found) in self.asking.iter().zip(&self.found) {
            drains.settle(drain, found);
        }
    }
}

/// The nearest open node within the influence distance that sees a drain, and the distance to the nearest node of any
/// kind.
fn nearest_open(forest: &Forest, lengths: &Lengths, drain: Attraction) -> Found {
    let accepts = |node| is_open(forest, lengths, node) && forest.sees(node, drain.side);
    let (nearest, closest) = forest.index().nearest_two(drain.position, lengths.reach(), lengths.influence, accepts);
    let found = nearest.and_then(|(node, distance)| {
        let cos = forest.cos_to(node, drain)?;
        Some(Found { node: Some(node), distance, cos, closest })
    });
    found.unwrap_or(Found { closest, ..Found::default() })
}

/// Whether a drain lies in a node's perception volume; its distance has been tested before (Eq. 2 and 3). `cos` is the
/// cosine of the angle between the node's direction and the direction to the drain.
fn perceives(forest: &Forest, lengths: &Lengths, node: u32, cos: f32) -> bool {
    if forest.is_root(node) || cos == ON_THE_NODE {
        return true;
    }
    if forest.children(node) == 0 {
        return cos >= lengths.cos_half_perception;
    }
    // |θ − α| ≤ γ/2 for the angle θ to the drain and the angle α of a sprout, in cosines, which fall as angles grow. Where
    // α − γ/2 is below 0, or α + γ/2 above π, that limit is none.
    let (half_cos, half_sin) = (lengths.cos_half_perception, lengths.sin_half_perception);
    let (sprout_cos, sprout_sin) = forest.sprout(node);
    let (along, across) = (sprout_cos * half_cos, sprout_sin * half_sin);
    (sprout_cos >= half_cos || cos <= along + across) && (sprout_cos <= -half_cos || cos >= along - across)
}

/// Compares the acting drains with the result of testing all drains.
#[cfg(test)]
pub(super) fn assert_none_sleeps_in(forest: &Forest, lengths: &Lengths, drains: &Drains, pulls: &[Pull]) {
    let reach = lengths.influence * lengths.influence;
    let asked = drains.slots().filter_map(|drain| {
        let hearing = drains.hearing(drain);
        let node = hearing.node().filter(|_| hearing.distance <= reach)?;
        let cos = forest.cos_to(node, drains.attraction(drain))?;
        perceives(forest, lengths, node, cos).then_some(Pull { node, drain })
    });
    let mut expected: Vec<Pull> = asked.collect();
    expected.sort_unstable();
    assert_eq!(pulls, expected);
}
