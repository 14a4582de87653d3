//! Randomness that is the same on every platform: streams from one seed, many numbers at once, and weighted choice.

pub(crate) mod alias_table;
pub(crate) mod many;
mod streams;

pub use streams::{Stream, VesselRng};
