//! Files that are written whole or not at all.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// The reason why a file was not written. The old file at its path is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The path has no file name.
    #[error("{} names no file; add a file name", path.display())]
    NoFileName {
        /// The path given.
        path: PathBuf,
    },
    /// The path's extension belongs to no format that can be written.
    #[error("cannot write {}: {}; surfaces are written as {known}", path.display(), unknown(extension))]
    UnknownExtension {
        /// The path given.
        path: PathBuf,
        /// Its extension without the dot, empty if it has none.
        extension: String,
        /// The known extensions.
        known: String,
    },
    /// No file can be created in the folder: it is missing, or the user has no permission.
    #[error("cannot create a file beside {}: {source}", path.display())]
    Create {
        /// The path given.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The content could not be written completely: the disk is full, or its source failed.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The path given.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The finished file cannot be renamed: a folder has that name, or another program holds the file.
    #[error("cannot replace {}: {source}", path.display())]
    Replace {
        /// The path given.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

fn unknown(extension: &str) -> String {
    match extension {
        "" => "it has no extension".to_owned(),
        other => format!("\".{other}\" is no known extension"),
    }
}

/// Writes a file so that its path always holds either the old or the whole new content.
///
/// The content goes to a temporary file in the same folder, which is flushed, synchronised with the disk, and renamed
/// to the file in one step. If anything fails, or `write` panics, the temporary file is removed. A process that is
/// killed can leave one behind, with a name that ends in `.tmp`; nothing reads it, and [`remove_stale`] removes it. A
/// symbolic link at the path is replaced, not followed. A replaced file passes on its permissions.
///
/// # Errors
/// The failure, with the path. The file at the path is unchanged then.
pub fn write_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let path = path.as_ref();
    let name = path.file_name().ok_or_else(|| WriteError::NoFileName { path: path.to_owned() })?;
    let (file, temporary) =
        Temporary::create(path, name).map_err(|source| WriteError::Create { path: path.to_owned(), source })?;
    fill(file, path, write).map_err(|source| WriteError::Write { path: path.to_owned(), source })?;
    temporary.replace(path).map_err(|source| WriteError::Replace { path: path.to_owned(), source })
}

fn fill(file: File, path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(file);
    write(&mut out)?;
    let file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
    if let Ok(before) = fs::symlink_metadata(path)
        && before.is_file()
    {
        file.set_permissions(before.permissions())?;
    }
    file.sync_all()
}

/// A file that is removed unless it takes its final name.
struct Temporary {
    path: PathBuf,
    is_done: bool,
}

impl Temporary {
    /// Number of names tried before giving up on a folder full of leftovers.
    const TRIES: u32 = 1000;

    /// Makes a new, empty file in the folder of `target`, under a name that no other file, thread or process has.
    fn create(target: &Path, name: &OsStr) -> io::Result<(File, Self)> {
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        for _ in 0..Self::TRIES {
            let number = COUNTER.fetch_add(1, Ordering::Relaxed);
            let mut hidden = OsString::from(".");
            hidden.push(name);
            hidden.push(format!(".{}-{number}.tmp", std::process::id()));
            let path = target.with_file_name(hidden);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => {
                    // Says that someone writes it. Where files cannot be locked, its age alone says so.
                    let _ = file.try_lock();
                    return Ok((file, Self { path, is_done: false }));
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::Error::new(ErrorKind::AlreadyExists, "too many leftover .tmp files; remove them"))
    }

    fn replace(mut self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        self.is_done = true;
        sync_folder(target);
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.is_done {
            // Nothing can be done about a file that cannot be removed; the first error is reported.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Removes the temporary files that killed processes left in a folder, and returns their number.
///
/// Such a file has a name that [`write_atomically`] gives, and is locked by no process. `is_old` says of it whether it has
/// not been written for a while, such as a minute: for a moment a living writer may have its file unlocked. Files that
/// other processes write at this time, on this or another machine, stay, as does what cannot be locked or removed.
///
/// # Errors
/// If the folder cannot be read.
pub fn remove_stale(folder: impl AsRef<Path>, is_old: impl Fn(&fs::Metadata) -> bool) -> io::Result<usize> {
    let mut removed = 0;
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let is_stale = is_temporary(&entry.file_name())
            // Before it is opened, since opening a pipe waits for a reader.
            && entry.metadata().is_ok_and(|found| found.is_file() && is_old(&found))
            && OpenOptions::new().write(true).open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if is_stale && fs::remove_file(entry.path()).is_ok() {
            removed += 1;
        }
    }
    Ok(removed)
}

/// Whether a name is `.NAME.PROCESS-NUMBER.tmp`.
fn is_temporary(name: &OsStr) -> bool {
    let inner = name.as_encoded_bytes().strip_prefix(b".").and_then(|name| name.strip_suffix(b".tmp"));
    let Some(numbers) = inner.and_then(|inner| inner.rsplit(|&byte| byte == b'.').next()) else { return false };
    let mut parts = numbers.split(|&byte| byte == b'-');
    let mut is_number = || parts.next().is_some_and(|part| !part.is_empty() && part.iter().all(u8::is_ascii_digit));
    is_number() && is_number() && parts.next().is_none()
}

/// Makes the new name survive a power cut, if folders can be synchronised. The content is safe either way.
#[cfg(unix)]
fn sync_folder(target: &Path) {
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

#[cfg(not(unix))]
fn sync_folder(_target: &Path) {}
