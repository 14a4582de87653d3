//! What a cut asks about the segments of its tree.

use crate::synthesis::segment_index::Region;
use crate::synthesis::tree::{NodeId, VesselTree};

/// Finds segments of a tree, each known by the node in which it ends.
///
/// A closure `|region: &Region, visit: &mut dyn FnMut(NodeId)|` over a [`SegmentIndex`](super::SegmentIndex) is one. Who
/// has a table of children gives [`leaving`](Self::leaving) from that, and saves a question to the index for most ends.
pub trait SegmentSearch {
    /// Calls `visit` with at least the segments that meet a region; any others, and repeated ones, change nothing.
    fn candidates(&mut self, region: &Region, visit: &mut dyn FnMut(NodeId));

    /// Calls `visit` with at least the segments that leave a node; any others, and repeated ones, change nothing.
    fn leaving(&mut self, tree: &VesselTree, node: NodeId, visit: &mut dyn FnMut(NodeId)) {
        let at = tree.positions()[node.index()];
        self.candidates(&Region::between(at, at), visit);
    }
}

impl<F: FnMut(&Region, &mut dyn FnMut(NodeId))> SegmentSearch for F {
    fn candidates(&mut self, region: &Region, visit: &mut dyn FnMut(NodeId)) {
        self(region, visit);
    }
}
