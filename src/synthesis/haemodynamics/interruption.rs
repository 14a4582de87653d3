//! Cuts and clamps, laid over the tree.

use super::{
    EndSide, FlowError, Network, OpenEnd,
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
        self.check(node)?;
        if let Some(interruption) = &interruption {
            interruption.validate(node.0)?;
        }
        let slot = node_slot(node.index());
        let parent = self.links[slot].parent;
        if parent == SOURCE {
            return Err(FlowError::NoSegment { node: node.0 });
        }
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
        self.links[slot].upstream = if interruption.is_some() { REFERENCE } else { parent };
        self.slots[slot].resistance = if interruption.is_some() { CLOSED } else { self.whole_resistance(node.index()) };
        self.replace_ends(node, interruption);
        // The new ends count as closed until they are solved for.
        self.load_shunt(slot as u32);
        self.load_shunt(parent);
        if !self.sums_stale {
            self.sum_path(slot as u32);
            self.sum_path(parent);
        }
        Ok(())
    }

    /// Takes the gaps of a list in place of all that there are, as after an undo. Costs what differs.
    ///
    /// `interruptions` is in rising order of the nodes.
    ///
    /// # Errors
    /// As [`set_interruption`](Self::set_interruption); what came before the fault in the list has been taken.
    pub fn set_interruptions(&mut self, interruptions: &[(NodeId, Interruption)]) -> Result<(), FlowError> {
        let gone: Vec<u32> = self.interruptions.iter().map(|&(node, _)| node).collect();
        for node in gone {
            if interruptions.binary_search_by_key(&node, |&(node, _)| node.0).is_err() {
                self.set_interruption(NodeId(node), None)?;
            }
        }
        for &(node, interruption) in interruptions {
            self.set_interruption(node, Some(interruption))?;
        }
        Ok(())
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
        let open = interruption.map_or([None; 2], |gap| {
            [
                gap.proximal.map(|outlet| OpenEnd::new(node, EndSide::Proximal, gap.first, outlet)),
                gap.distal.map(|outlet| OpenEnd::new(node, EndSide::Distal, gap.last, outlet)),
            ]
        });
        self.ends.replace(node, open);
        self.measure_ends_of(node);
    }
}
