//! The queries of a cut for the segments of its tree.

use crate::synthesis::segment_index::Region;
use crate::synthesis::tree::{NodeId, VesselTree};

/// Finds segments of a tree, each identified by its end node.
///
/// A closure `|region: &Region, visit: &mut dyn FnMut(NodeId)|` over a [`SegmentIndex`](super::SegmentIndex) is one.
/// With a table of children, implement [`leaving`](Self::leaving) from it, which saves an index query for most ends.
pub trait SegmentSearch {
    /// Calls `visit` with at least the segments that meet a region; others, and repeats, do no harm.
    fn candidates(&mut self, region: &Region, visit: &mut dyn FnMut(NodeId));

    /// Calls `visit` with at least the segments that leave a node; others, and repeats, do no harm.
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
