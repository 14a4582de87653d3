//! Finds the segments of a tree that a box, a region or a ray meets, and the nearest one, while the tree grows and
//! moves.
//!
//! In: a [`VesselTree`](crate::synthesis::tree::VesselTree). Out: a [`SegmentIndex`] that can be queried at any time of
//! a growth.

mod depth;
mod index;
mod overlaps;
mod ray_cast;
mod region;
pub(crate) mod round_cone;
mod run;
mod search;

pub use index::SegmentIndex;
pub use overlaps::overlaps;
pub use ray_cast::RayCast;
pub use region::Region;
pub(crate) use region::axes;
pub use round_cone::{MAX_FLARE, start_radius};
pub use search::SegmentSearch;
