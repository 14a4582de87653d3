//! Reading an organ's mesh from a file, by its extension.

use super::{
    glb::read_gltf_in,
    obj_read::read_obj_mesh,
    read::{MeshDataError, MeshReadError},
};
use crate::synthesis::{io::regular_file::read_whole, mesh::TriangleMesh};
use std::path::Path;

/// Reads the mesh in a `.glb`, `.gltf` or `.obj` file, as [`read_glb`](super::read_glb) and [`read_obj_mesh`] do.
///
/// Binary data may also be in other files, in the folder of the glTF file or below it, and of each no more is read than
/// the glTF file announces. Only regular files are read, of at most 4 GiB.
///
/// # Errors
/// [`MeshReadError`], which names the file and the cause.
pub fn load_mesh(path: &Path) -> Result<TriangleMesh, MeshReadError> {
    let named = || path.to_path_buf();
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    let read: fn(&[u8], &Path) -> Result<TriangleMesh, MeshDataError> =
        match ending.as_deref().and_then(|ending| ending.to_str()) {
            Some("glb" | "gltf") => |bytes, folder| read_gltf_in(bytes, Some(folder)),
            Some("obj") => |bytes, _| read_obj_mesh(bytes),
            _ => return Err(MeshReadError::UnknownFormat { path: named() }),
        };
    let bytes = read_whole(path).map_err(|source| MeshReadError::Io { path: named(), source })?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    read(&bytes, folder).map_err(|source| MeshReadError::Content { path: named(), source })
}
