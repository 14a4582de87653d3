//! Shared by readers of all formats: the bytes of a file, and errors.

use crate::synthesis::mesh::MeshError;
use std::{
    io,
    path::{Path, PathBuf},
};

/// The reason why a mesh could not be read from a file.
#[derive(Debug, thiserror::Error)]
pub enum MeshReadError {
    /// The file, or one it refers to, cannot be read.
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
    /// Content that is damaged or of an unsupported kind.
    #[error("cannot read {}: {cause}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: String,
    },
    /// Content that makes no usable mesh.
    #[error("cannot use the mesh in {}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with the mesh.
        source: MeshError,
    },
}

/// An error while decoding content, before the file's name is known.
#[derive(Debug)]
pub(super) enum Fault {
    /// A file that the content refers to cannot be read.
    Io(PathBuf, io::Error),
    /// Any other error in the content.
    Content(String),
    /// An error in the decoded mesh.
    Mesh(MeshError),
}

impl Fault {
    pub(super) fn content(cause: impl Into<String>) -> Self {
        Self::Content(cause.into())
    }

    pub(super) fn in_file(self, path: &Path) -> MeshReadError {
        let named = path.to_path_buf();
        match self {
            Self::Io(path, source) => MeshReadError::Io { path, source },
            Self::Content(cause) => MeshReadError::Content { path: named, cause },
            Self::Mesh(source) => MeshReadError::Mesh { path: named, source },
        }
    }
}

impl From<MeshError> for Fault {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error)
    }
}

/// The bytes of a file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, Fault> {
    std::fs::read(path).map_err(|error| Fault::Io(path.to_path_buf(), error))
}
