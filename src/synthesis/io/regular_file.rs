//! The bytes of files. Only regular files are read: a pipe or a device may never end.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Most bytes of one file: as many as the header of a GLB file can announce.
pub(super) const MOST_BYTES: u64 = u32::MAX as u64;

/// All bytes of a regular file.
///
/// # Errors
/// Those of the system; [`ErrorKind::InvalidInput`] for a folder, pipe or device, and for a file of more than
/// [`MOST_BYTES`].
pub(super) fn read_whole(path: &Path) -> io::Result<Vec<u8>> {
    let (file, length) = open(path)?;
    if length > MOST_BYTES {
        return Err(refused("it has more than 4 GiB"));
    }
    read(file, length)
}

/// The first bytes of a regular file: `most` of them, or all if it has fewer.
///
/// # Errors
/// Those of the system; [`ErrorKind::InvalidInput`] for a folder, pipe or device.
#[cfg(feature = "mesh_files")]
pub(super) fn read_start(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (file, length) = open(path)?;
    read(file, length.min(most))
}

/// A regular file and its length.
fn open(path: &Path) -> io::Result<(File, u64)> {
    let check = |found: fs::Metadata| match found.is_file() {
        true => Ok(found.len()),
        false => Err(refused("it is no regular file")),
    };
    // Before it is opened, since opening a pipe waits for a writer; and after, since another may have taken its place.
    check(fs::metadata(path)?)?;
    let file = File::open(path)?;
    let length = check(file.metadata()?)?;
    Ok((file, length))
}

fn read(file: File, length: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let size = usize::try_from(length).map_err(|_| ErrorKind::OutOfMemory)?;
    bytes.try_reserve_exact(size).map_err(|_| ErrorKind::OutOfMemory)?;
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn refused(cause: &'static str) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, cause)
}
