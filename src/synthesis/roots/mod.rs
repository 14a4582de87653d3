//! Where vessels enter the tissue.
//!
//! In: a [`Roots`] description, the tissue and the generator's [`RootSpacing`]. Out: the points at which each kind of
//! vessels begins, by [`Roots::resolve`]. The seed decides everything that is chosen automatically
//! ([`Stream::Roots`](crate::synthesis::random::Stream::Roots)).

mod error;
mod hollow;
mod placement;
mod resolve;
mod spread;
#[cfg(test)]
mod tests;
mod within;

pub use error::RootError;
pub use placement::{RootPlacement, RootPlacements, RootSpacing, Roots};
