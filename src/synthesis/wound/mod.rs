//! Cuts through vessels: where a blade meets them.
//!
//! [`SegmentIndex`] finds the segments of a tree by place.

mod round_cone;
mod segment_index;

pub use segment_index::SegmentIndex;
