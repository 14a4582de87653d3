//! Reading an organ's mesh from a Wavefront OBJ file.

use super::read::{Fault, MeshReadError, read_bytes};
use crate::synthesis::mesh::TriangleMesh;
use bevy_math::{Vec2, Vec3};
use std::path::Path;

/// Reads all objects of an OBJ file as one mesh. Polygons are cut into triangles; materials are not read.
///
/// # Errors
/// [`MeshReadError`], which names the file and the cause.
pub fn read_obj_mesh(path: &Path) -> Result<TriangleMesh, MeshReadError> {
    read_bytes(path).and_then(|bytes| decode(&bytes)).map_err(|fault| fault.in_file(path))
}

fn decode(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut &*bytes, &options, no_materials)
        .map_err(|error| Fault::content(format!("it is not a valid OBJ file ({error})")))?;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let mut uvs = Vec::new();
    for tobj::Model { mesh, .. } in models {
        let first = u32::try_from(positions.len()).map_err(|_| Fault::content("it has too many vertices"))?;
        positions.extend(mesh.positions.as_chunks().0.iter().map(|&corner| Vec3::from_array(corner)));
        uvs.extend(mesh.texcoords.as_chunks().0.iter().map(|&[u, v]| Vec2::new(u, 1.0 - v)));
        let corners = mesh.indices.as_chunks().0.iter();
        triangles.extend(corners.map(|corners| corners.map(|index| index.saturating_add(first))));
    }
    // Texture coordinates for only some of the vertices are of no use.
    let uvs = (uvs.len() == positions.len()).then_some(uvs);
    Ok(TriangleMesh::new(positions, triangles, uvs)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "# a square\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        o one\nusemtl red\nf 1/1 2/2 3/3 4/4\n";

    #[test]
    fn polygons_and_texture_coordinates_are_read() -> Result<(), Fault> {
        let mesh = decode(SQUARE.as_bytes())?;
        assert_eq!(mesh.triangles().len(), 2);
        assert_eq!(mesh.area(), 1.0);
        assert_eq!(mesh.uvs().map(|uvs| uvs[0]), Some(Vec2::new(0.0, 1.0)));
        let without = SQUARE.replace("/1", "").replace("/2", "").replace("/3", "").replace("/4", "");
        assert_eq!(decode(without.as_bytes())?.uvs(), None);
        Ok(())
    }

    #[test]
    fn damaged_files_are_errors() {
        for bad in [
            "",
            "f 1 2 3",
            "v 0 0\nf 1 1 1",
            "v a b c",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -7 1 2",
            "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3",
            "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 99999999999999999999 2 3",
            "\u{0}\u{1}\u{2}",
        ] {
            assert!(decode(bad.as_bytes()).is_err(), "{bad:?} was read");
        }
        assert!(decode(&[0xff, 0xfe, 0x80, b'\n', b'f']).is_err());
        let text = SQUARE.as_bytes();
        for end in 0..text.len() {
            // The rest may be a mesh or not.
            let _ = decode(&text[..end]);
            let mut bent = text.to_vec();
            bent[end] = bent[end].wrapping_mul(31).wrapping_add(17);
            let _ = decode(&bent);
        }
    }
}
