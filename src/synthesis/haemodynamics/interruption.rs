//! Cuts and clamps, laid over the tree.

use super::{
    EndSide, FlowError, Network, NetworkEnd,
    network::{CLOSED, REFERENCE, SOURCE, node_slot},
};
use crate::synthesis::tree::NodeId;

/// The hole at the end of a severed vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Outlet {
    /// Radius of the hole before any clotting.
    ///
    /// Units: tissue lengths. Limits: finite, > 0. Usually the vessel's radius.
    pub radius: f32,
}

/// A gap in a segment, laid over the tree by cuts and clamps.
///
/// The vessel is intact from the parent to the share `first`, and from the share `last` to the node; what lies between
/// carries nothing. A plain clamp has `first == last` and both ends closed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Interruption {
    /// Share of the segment, counted from the parent, up to which the vessel is intact. Limits: 0 to `last`.
    pub first: f32,
    /// Share from which it is intact again. Limits: `first` to 1.
    pub last: f32,
    /// The hole at `first`; `None` where that end is clamped, sealed or tied.
    pub proximal: Option<Outlet>,
    /// The hole at `last`; `None` where that end is closed.
    pub distal: Option<Outlet>,
}

impl Interruption {
    /// A clamp at a share of the segment: closed on both sides.
    pub fn clamp(along: f32) -> Self {
        Self { first: along, last: along, proximal: None, distal: None }
    }

    /// A cut at a share of the segment, open on both sides with holes of a radius in tissue lengths.
    pub fn cut(along: f32, radius: f32) -> Self {
        let outlet = Some(Outlet { radius });
        Self { first: along, last: along, proximal: outlet, distal: outlet }
    }

    fn validate(&self, node: u32) -> Result<(), FlowError> {
        let Self { first, last, .. } = *self;
        FlowError::check_share("the first share of an interruption", f64::from(first))?;
        FlowError::check_share("the last share of an interruption", f64::from(last))?;
        if first > last {
            return Err(FlowError::InterruptionBackwards { node, first, last });
        }
        for outlet in [self.proximal, self.distal].into_iter().flatten() {
            FlowError::check_positive("the radius of an outlet in tissue lengths", f64::from(outlet.radius))?;
        }
        Ok(())
    }
}

impl Network {
    /// The gap in a node's segment, if there is one.
    pub fn interruption(&self, node: NodeId) -> Option<Interruption> {
        self.interruptions.binary_search_by_key(&node.0, |&(node, _)| node).ok().map(|at| self.interruptions[at].1)
    }

    /// All gaps, in the order of their nodes.
    pub fn interruptions(&self) -> impl ExactSizeIterator<Item = (NodeId, Interruption)> + '_ {
        self.interruptions.iter().map(|&(node, interruption)| (NodeId(node), interruption))
    }

    /// Lays a gap over a node's segment in place of the one that was there, or heals it with `None`.
    ///
    /// Only the path from the segment to its root is computed again. An end that stays as it was keeps how far it has
    /// [closed](Self::set_opening).
    ///
    /// # Errors
    /// When there is no such node, it is a root, or a number is outside its limits.
    pub fn set_interruption(&mut self, node: NodeId, interruption: Option<Interruption>) -> Result<(), FlowError> {
        let parent = self.check_gap(node, interruption.as_ref())?;
        let slot = node_slot(node.index());
        if self.interruption(node) == interruption {
            return Ok(());
        }
        match (self.interruptions.binary_search_by_key(&node.0, |&(node, _)| node), interruption) {
            (Ok(at), Some(interruption)) => self.interruptions[at].1 = interruption,
            (Err(at), Some(interruption)) => self.interruptions.insert(at, (node.0, interruption)),
            (Ok(at), None) => _ = self.interruptions.remove(at),
            (Err(_), None) => {}
        }
        self.revision += 1;
        self.link(node, interruption.is_none());
        self.replace_ends(node, interruption);
        // The new ends count as closed until they are solved for.
        self.load_shunts(&[parent, slot as u32]);
        if !self.sums_stale {
            self.sum_path(slot as u32);
            self.sum_path(parent);
        }
        Ok(())
    }

    /// Takes the gaps of a list in place of all that there are, as after an undo: the same as taking one by one what
    /// differs, at the cost of that, or of one sweep over the tree where that is less.
    ///
    /// `interruptions` is in rising order of the nodes, each once.
    ///
    /// # Errors
    /// As [`set_interruption`](Self::set_interruption), or when the nodes don't rise. The network is as before, then.
    pub fn set_interruptions(&mut self, interruptions: &[(NodeId, Interruption)]) -> Result<(), FlowError> {
        for (node, interruption) in interruptions {
            self.check_gap(*node, Some(interruption))?;
        }
        if let Some(pair) = interruptions.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
            return Err(FlowError::InterruptionsUnordered { before: pair[0].0.0, node: pair[1].0.0 });
        }
        let changed = self.differing(interruptions);
        if changed.len() > Self::FEW_GAPS {
            self.take_gaps(interruptions, &changed);
            return Ok(());
        }
        for node in changed {
            let at = interruptions.binary_search_by_key(&node, |&(node, _)| node).ok();
            self.set_interruption(node, at.map(|at| interruptions[at].1))?;
        }
        Ok(())
    }

    /// Gaps up to which each is laid by itself.
    const FEW_GAPS: usize = 16;
    /// Nodes for each gap below which all sums are made anew, rather than those above the gaps: what a path costs.
    const NODES_PER_PATH: usize = 128;

    /// The nodes whose gaps are others in a list, in rising order.
    fn differing(&self, interruptions: &[(NodeId, Interruption)]) -> Vec<NodeId> {
        let mut before = self.interruptions.iter().map(|&(node, gap)| (NodeId(node), gap)).peekable();
        let mut differing = Vec::new();
        for &(node, gap) in interruptions {
            while let Some((gone, _)) = before.next_if(|&(other, _)| other < node) {
                differing.push(gone);
            }
            if before.next_if(|&(other, _)| other == node).is_none_or(|(_, old)| old != gap) {
                differing.push(node);
            }
        }
        differing.extend(before.map(|(gone, _)| gone));
        differing
    }

    /// Takes the gaps of a list, which differ from those that there are at some nodes, and sums once.
    fn take_gaps(&mut self, interruptions: &[(NodeId, Interruption)], changed: &[NodeId]) {
        self.revision += 1;
        self.interruptions = interruptions.iter().map(|&(node, gap)| (node.0, gap)).collect();
        let mut touched = Vec::with_capacity(2 * changed.len());
        for &node in changed {
            self.link(node, self.interruption(node).is_none());
            let slot = node_slot(node.index());
            touched.extend([slot as u32, self.links[slot].parent]);
        }
        touched.sort_unstable();
        touched.dedup();
        let ends = interruptions.iter().flat_map(|&(node, gap)| ends_of(node, Some(gap))).flatten().collect();
        self.ends.replace_all(ends, changed);
        self.measure_ends();
        self.load_shunts(&touched);
        if changed.len() > self.len() / Self::NODES_PER_PATH {
            self.sums_stale = true;
        }
        if !self.sums_stale {
            self.sum_paths(touched);
        }
    }

    /// Passes a gap, or its healing, and gives the slot of the segment's parent.
    fn check_gap(&self, node: NodeId, interruption: Option<&Interruption>) -> Result<u32, FlowError> {
        self.check(node)?;
        if let Some(interruption) = interruption {
            interruption.validate(node.0)?;
        }
        match self.links[node_slot(node.index())].parent {
            SOURCE => Err(FlowError::NoSegment { node: node.0 }),
            parent => Ok(parent),
        }
    }

    /// Lets a segment carry blood, or none.
    fn link(&mut self, node: NodeId, is_whole: bool) {
        let slot = node_slot(node.index());
        self.links[slot].upstream = if is_whole { self.links[slot].parent } else { REFERENCE };
        self.slots[slot].resistance = if is_whole { self.whole_resistance(node.index()) } else { CLOSED };
    }

    /// Narrows an open end to a share of its outlet's area, as clotting does. 0 closes it.
    ///
    /// `index` is the end's place in [`open_ends`](Self::open_ends).
    ///
    /// # Errors
    /// When `share` is not from 0 to 1.
    ///
    /// # Panics
    /// When there are not that many open ends.
    pub fn set_opening(&mut self, index: usize, share: f64) -> Result<(), FlowError> {
        FlowError::check_share("the opening of an end", share)?;
        self.ends.set_opening(index, share);
        Ok(())
    }

    /// The open ends of an interruption in place of those that the segment had.
    fn replace_ends(&mut self, node: NodeId, interruption: Option<Interruption>) {
        self.ends.replace(node, ends_of(node, interruption));
        self.measure_ends_of(node);
    }
}

/// The open ends of a gap, not measured yet.
fn ends_of(node: NodeId, interruption: Option<Interruption>) -> [Option<NetworkEnd>; 2] {
    interruption.map_or([None; 2], |gap| {
        [
            gap.proximal.map(|outlet| NetworkEnd::new(node, EndSide::Proximal, gap.first, outlet)),
            gap.distal.map(|outlet| NetworkEnd::new(node, EndSide::Distal, gap.last, outlet)),
        ]
    })
}
