//! L-systems: strings that are rewritten, and a turtle that draws vessel trees from them.
//!
//! In: a [`Grammar`](rewriting::Grammar) and the [`Turtle`](turtle::Turtle)'s settings. Out: a tree. After Prusinkiewicz &
//! Lindenmayer, "The Algorithmic Beauty of Plants" (1990), chapter 1.

pub mod error;
pub mod presets;
pub mod rewriting;
pub mod turtle;
