//! Maps of vessels as files.

mod ktx2;
#[cfg(feature = "texture_files")]
mod png;

pub use ktx2::write_ktx2;
#[cfg(feature = "texture_files")]
pub use png::write_png;

use crate::synthesis::io::{WriteError, write_atomically};
use crate::synthesis::texture::BakedMap;
use std::path::Path;

/// Writes a map to a file by [`write_ktx2`], whole or not at all.
///
/// # Errors
/// The failure, with the path.
pub fn save_ktx2(path: impl AsRef<Path>, map: &BakedMap) -> Result<(), WriteError> {
    write_atomically(path, |out| write_ktx2(out, map))
}

/// Writes a map to a file by [`write_png`], whole or not at all.
///
/// # Errors
/// The failure, with the path.
#[cfg(feature = "texture_files")]
pub fn save_png(path: impl AsRef<Path>, map: &BakedMap) -> Result<(), WriteError> {
    write_atomically(path, |out| write_png(out, map))
}
