//! What tells one thing from another that took its place.

use std::sync::atomic::{AtomicU64, Ordering};

/// Tells one tree, tissue or log from another that took its place. The same while a tree grows.
///
/// The default is that of nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lineage(u64);

impl Lineage {
    /// One that nothing else has.
    pub fn new_one() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}
