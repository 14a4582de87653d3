//! Reading an organ's mesh from a file, by its extension.

use super::{glb::read_glb, obj_read::read_obj_mesh, read::MeshReadError};
use crate::synthesis::mesh::TriangleMesh;
use std::path::Path;

/// Reads the mesh in a `.glb`, `.gltf` or `.obj` file.
///
/// # Errors
/// [`MeshReadError`], which names the file and the cause.
pub fn load_mesh(path: &Path) -> Result<TriangleMesh, MeshReadError> {
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    match ending.as_deref().and_then(|ending| ending.to_str()) {
        Some("glb" | "gltf") => read_glb(path),
        Some("obj") => read_obj_mesh(path),
        _ => Err(MeshReadError::UnknownFormat { path: path.to_path_buf() }),
    }
}
