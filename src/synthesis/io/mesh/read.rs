//! Errors of the readers of all formats.
//!
//! A message names places in a file (lines, parts), never what stands there: the file may not be what its name says,
//! and messages end up in logs.

use crate::synthesis::mesh::MeshError;
use std::{io, path::PathBuf};

/// The reason why a mesh could not be read from a file.
#[derive(Debug, thiserror::Error)]
pub enum MeshReadError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// An unsupported extension.
    #[error("cannot read {}: meshes are read from .glb, .gltf and .obj files", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// Content that is damaged, of an unsupported kind, or no usable mesh.
    #[error("cannot use {}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: MeshDataError,
    },
}

/// The reason why bytes could not be read as a mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshDataError {
    /// A line of an OBJ file that is damaged or of an unsupported kind.
    #[error("line {line}: {cause}")]
    Line {
        /// The line, from 1; the first of those that are continued.
        line: usize,
        /// What is wrong with it.
        cause: &'static str,
    },
    /// Content that is damaged or of an unsupported kind.
    #[error("{cause}")]
    Content {
        /// What is wrong with it.
        cause: String,
    },
    /// A file of binary data, which the glTF file names, cannot be read.
    #[error("its data in {} cannot be read: {source}", path.display())]
    Data {
        /// The file of data.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// No usable mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

impl MeshDataError {
    pub(super) fn content(cause: impl Into<String>) -> Self {
        Self::Content { cause: cause.into() }
    }
}

/// What is wrong with a vertex that [`is_usable`](crate::synthesis::mesh::is_usable) refuses.
pub(super) const BAD_POSITION: &str =
    "a vertex has a coordinate that is not finite or beyond ±1e9; repair or rescale the mesh";
