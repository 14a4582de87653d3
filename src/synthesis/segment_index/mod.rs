//! Which segments of a tree a box, a region or a ray meets, and which is nearest, while the tree grows and moves.
//!
//! In: a [`VesselTree`](crate::synthesis::tree::VesselTree). Out: a [`SegmentIndex`] that answers at any moment of a growth.

mod index;
mod ray_cast;
mod region;
pub(crate) mod round_cone;
mod run;
mod search;

pub use index::SegmentIndex;
pub use ray_cast::RayCast;
pub use region::Region;
pub(crate) use region::axes;
pub use round_cone::{MAX_FLARE, start_radius};
pub use search::SegmentSearch;
