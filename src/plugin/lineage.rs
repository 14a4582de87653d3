//! Identities that tell a thing from its replacement.

use std::sync::atomic::{AtomicU64, Ordering};

/// Identity of a tree, tissue or log. A replacement has another one; a tree that grows keeps it.
///
/// The default is the lineage of nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lineage(u64);

impl Lineage {
    /// A lineage that nothing else has.
    pub fn new_one() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}
