//! How much a file may become.

use super::super::read::MeshDataError;
use std::cell::Cell;

/// What every file may become, in bytes.
const LEAST: u64 = 16 << 20;

/// What a file may become for each of its bytes. Without copies, quantised positions without indices become 12 bytes,
/// and no others more.
const FACTOR: u64 = 32;

/// Bytes that reading may take, work included.
///
/// Nodes repeat meshes, parts share data, and accessors announce any size, so that a few bytes can describe more than
/// memory holds. What a file may become follows from its size, and is asked for before memory is.
#[derive(Default)]
pub(super) struct Budget {
    present: Cell<u64>,
    taken: Cell<u64>,
}

impl Budget {
    /// Counts bytes of the file, or of one that belongs to it.
    pub(super) fn add_present(&self, bytes: usize) {
        self.present.set(self.present.get().saturating_add(bytes as u64));
    }

    /// Asks for `count` values of `size` bytes.
    pub(super) fn take(&self, count: usize, size: u64) -> Result<(), MeshDataError> {
        self.taken.set(self.taken.get().saturating_add((count as u64).saturating_mul(size)));
        if self.taken.get() <= self.present.get().saturating_mul(FACTOR).max(LEAST) {
            return Ok(());
        }
        Err(MeshDataError::content(
            "it describes much more than its bytes hold: its nodes repeat meshes too often, or it is damaged; \
             export the organ alone, without instances",
        ))
    }
}
