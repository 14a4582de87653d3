//! Cuts and clamps, laid over a network.

use super::{
    EndSide, FlowError, Interruption, Network, NetworkEnd,
    circuit::{CLOSED, REFERENCE, SOURCE, node_slot},
};
use crate::synthesis::tree::NodeId;

impl Network {
    /// The gap in a node's segment, if there is one.
    pub fn interruption(&self, node: NodeId) -> Option<Interruption> {
        self.interruptions.binary_search_by_key(&node.0, |&(node, _)| node).ok().map(|at| self.interruptions[at].1)
    }

    /// All gaps, in the order of their nodes.
    pub fn interruptions(&self) -> impl ExactSizeIterator<Item = (NodeId, Interruption)> + '_ {
        self.interruptions.iter().map(|&(node, interruption)| (NodeId(node), interruption))
    }

    /// Lays a gap over a node's segment, replacing any old one, or heals it with `None`.
    ///
    /// Only the path from the segment to its root is computed again. An unchanged end keeps its
    /// [opening](Self::set_opening).
    ///
    /// # Errors
    /// If there is no such node, it is a root, or a number is outside its limits.
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
        // The new ends count as closed until they are solved.
        self.ends.load_at(&[parent, slot as u32], &mut self.circuit);
        if !self.sums_stale {
            self.circuit.sum_path(slot as u32);
            self.circuit.sum_path(parent);
        }
        Ok(())
    }

    /// Replaces all gaps by those of a list, for example after an undo. The result equals setting the differing gaps
    /// one by one; the cost is that, or one sweep over the tree if that is less.
    ///
    /// `interruptions` is in rising order of the nodes, each once.
    ///
    /// # Errors
    /// As [`set_interruption`](Self::set_interruption), or if the nodes are not in rising order. The network is
    /// unchanged then.
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

    /// Most gaps that are laid one by one.
    const FEW_GAPS: usize = 16;
    /// Nodes per gap below which all sums are made again, instead of those above the gaps: the cost of a path.
    const NODES_PER_PATH: usize = 128;

    /// The nodes whose gaps differ in a list, in rising order.
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

    /// Takes the gaps of a list, which differ from the present ones at some nodes, and sums once.
    fn take_gaps(&mut self, interruptions: &[(NodeId, Interruption)], changed: &[NodeId]) {
        self.revision += 1;
        self.interruptions = interruptions.iter().map(|&(node, gap)| (node.0, gap)).collect();
        let mut touched = Vec::with_capacity(2 * changed.len());
        for &node in changed {
            self.link(node, self.interruption(node).is_none());
            let slot = node_slot(node.index());
            touched.extend([slot as u32, self.circuit.links[slot].parent]);
        }
        touched.sort_unstable();
        touched.dedup();
        let ends = interruptions.iter().flat_map(|&(node, gap)| ends_of(node, Some(gap))).flatten().collect();
        self.ends.replace_all(ends, changed);
        self.measure_ends();
        self.ends.load_at(&touched, &mut self.circuit);
        if changed.len() > self.len() / Self::NODES_PER_PATH {
            self.sums_stale = true;
        }
        if !self.sums_stale {
            self.circuit.sum_paths(touched);
        }
    }

    /// Checks a gap, or its healing, and returns the slot of the segment's parent.
    fn check_gap(&self, node: NodeId, interruption: Option<&Interruption>) -> Result<u32, FlowError> {
        self.check(node)?;
        if let Some(interruption) = interruption {
            interruption.validate(node.0)?;
        }
        match self.circuit.links[node_slot(node.index())].parent {
            SOURCE => Err(FlowError::NoSegment { node: node.0 }),
            parent => Ok(parent),
        }
    }

    /// Connects or disconnects a segment.
    fn link(&mut self, node: NodeId, is_whole: bool) {
        let slot = node_slot(node.index());
        self.circuit.links[slot].upstream = if is_whole { self.circuit.links[slot].parent } else { REFERENCE };
        self.circuit.slots[slot].resistance = if is_whole { self.whole_resistance(node.index()) } else { CLOSED };
    }

    /// Narrows an open end to a share of its outlet's area, as clotting does. 0 closes it.
    ///
    /// `index` is the end's place in [`open_ends`](Self::open_ends).
    ///
    /// # Errors
    /// If `share` is not from 0 to 1.
    ///
    /// # Panics
    /// If there are not that many open ends.
    pub fn set_opening(&mut self, index: usize, share: f64) -> Result<(), FlowError> {
        FlowError::check_share("the opening of an end", share)?;
        self.ends.set_opening(index, share);
        Ok(())
    }

    /// Replaces the open ends of a segment by those of an interruption.
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
