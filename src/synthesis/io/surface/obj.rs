//! Wavefront OBJ: the surface as polygons with texture coordinates, for modelling.
//!
//! Source: Wavefront Technologies, "Object Files (.obj)", Advanced Visualizer manual, appendix B.

use super::SurfaceOptions;
use super::part::{SurfacePart, buffered, check, invalid, polygons};
use crate::synthesis::io::{WriteError, write_atomically};
use crate::synthesis::surface::SurfaceMesh;
use std::io::{self, Write};
use std::path::Path;

/// Writes surfaces to an OBJ file, whole or not at all. See [`write_surface_obj`].
///
/// # Errors
/// Those of [`write_atomically`] and of [`write_surface_obj`].
pub fn save_surface_obj(
    path: impl AsRef<Path>,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_surface_obj(out, parts, options))
}

/// Writes surfaces as OBJ, one object (`o`) per part, in the group (`g`) of its kind.
///
/// Places (`v`) and normals (`vn`) are written once for each vertex with a place of its own, texture coordinates (`vt`)
/// for all vertices, so the surface is closed and has its seams. Faces keep
/// their four corners, unless [`SurfaceOptions::triangles`] says otherwise. The first coordinate of
/// a texture goes around the vessel; the second is 1 − v, since OBJ counts it upwards and [`SurfaceMesh::uvs`], as in
/// glTF, downwards. Every number has enough digits to be read back to the same bits. There is no material file, thus no
/// colour.
///
/// # Errors
/// Those of `out`; [`InvalidInput`](io::ErrorKind::InvalidInput), before anything is written, if a part is not well
/// formed, or if there are 2³² vertices or more.
pub fn write_surface_obj(out: impl Write, parts: &[SurfacePart], options: &SurfaceOptions) -> io::Result<()> {
    check(parts)?;
    check_count(parts.iter().map(|part| part.mesh.positions.len() as u64).sum())?;
    let mut out = buffered(out);
    for line in options.lines() {
        writeln!(out, "# {line}")?;
    }
    let mut before = Before { places: 0, textures: 0 };
    for part in parts {
        // The object comes last: programs that know only one name take the latest.
        writeln!(out, "g {}\no {}", part.kind.name(), part.line_name())?;
        write_vertices(&mut out, part.mesh)?;
        write_faces(&mut out, part.mesh, options.triangles, &before)?;
        before.places += part.mesh.unique() as u64;
        before.textures += part.mesh.positions.len() as u64;
    }
    out.flush()
}

fn check_count(vertices: u64) -> io::Result<()> {
    if vertices <= u64::from(u32::MAX) {
        return Ok(());
    }
    let message = "vertices are more than programs can number in an OBJ file; write the parts to files of their own, or \
                   make the surface coarser";
    Err(invalid(format!("{vertices} {message}")))
}

/// Number of vertices in the file before those of a part.
struct Before {
    places: u64,
    textures: u64,
}

fn write_vertices(out: &mut impl Write, mesh: &SurfaceMesh) -> io::Result<()> {
    for position in &mesh.positions[..mesh.unique()] {
        writeln!(out, "v {} {} {}", position.x, position.y, position.z)?;
    }
    for uv in &mesh.uvs {
        writeln!(out, "vt {} {}", uv.x, 1.0 - uv.y)?;
    }
    for normal in &mesh.normals[..mesh.unique()] {
        writeln!(out, "vn {} {} {}", normal.x, normal.y, normal.z)?;
    }
    Ok(())
}

/// Corners as `place/texture/normal`. OBJ counts from 1.
fn write_faces(out: &mut impl Write, mesh: &SurfaceMesh, divided: bool, before: &Before) -> io::Result<()> {
    for (corners, len) in polygons(mesh, divided) {
        write!(out, "f")?;
        for &corner in &corners[..len] {
            let place = before.places + 1 + u64::from(mesh.original(corner));
            write!(out, " {place}/{}/{place}", before.textures + 1 + u64::from(corner))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::tree;
    use super::*;
    use crate::synthesis::tree::VesselKind;
    use crate::synthesis::units::Scale;

    fn written(parts: &[SurfacePart], options: &SurfaceOptions) -> String {
        let mut bytes = Vec::new();
        write_surface_obj(&mut bytes, parts, options).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn headers_are_comments_and_names_stay_on_their_line() {
        let (tree, mesh) = (tree(), SurfaceMesh::default());
        let options = SurfaceOptions {
            scale: Some(Scale::METRES),
            comments: vec!["v 0 0 0\nf 1 1 1\\".to_owned()],
            triangles: true,
        };
        let part = SurfacePart { name: "the \"left\"\nv 1\\", ..SurfacePart::new(VesselKind::Duct, &tree, &mesh) };
        let text = written(&[part], &options);
        let own = ["# unit: 1 m", "# v 0 0 0", "# f 1 1 1/", "g ductal", "o the \"left\" v 1/"];
        assert_eq!(text.lines().skip(1).collect::<Vec<_>>(), own);
        assert_eq!(written(&[], &SurfaceOptions::default()).lines().count(), 1);
    }

    #[test]
    fn too_many_vertices_are_an_error_with_the_number() {
        assert!(check_count(u64::from(u32::MAX)).is_ok());
        assert!(check_count(1 << 32).unwrap_err().to_string().contains("4294967296 vertices"));
    }

    #[test]
    #[cfg(feature = "mesh_files")]
    fn surfaces_come_back_closed_with_their_seams() {
        use super::super::testing::{assert_closed, lopsided, prism};
        use bevy_math::Vec3;
        let (tree, odd, mesh) = (tree(), lopsided(), prism(5, 4));
        let named = SurfacePart { name: "left\nhepatic 'duct'", ..SurfacePart::new(VesselKind::Duct, &tree, &mesh) };
        let parts = [SurfacePart::new(VesselKind::Artery, &tree, &odd), named];
        let text = written(&parts, &SurfaceOptions::default());
        let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
        let (models, _) =
            tobj::load_obj_buf(&mut text.as_bytes(), &tobj::LoadOptions::default(), no_materials).unwrap();
        let names: Vec<&str> = models.iter().map(|model| model.name.as_str()).collect();
        assert_eq!(names, ["arterial", "left hepatic 'duct'"]);
        for (tobj::Model { mesh: read, .. }, SurfacePart { mesh, .. }) in models.iter().zip(parts) {
            // Every corner, in the order of the faces. tobj numbers vertices as it meets them.
            let corners = mesh.faces.iter().flat_map(|[a, b, c, d]| {
                let len = if c == d { 3 } else { 4 };
                [*a, *b, *c, *d].into_iter().take(len)
            });
            let vector = |values: &[f32], index: u32| Vec3::from_slice(&values[3 * index as usize..]);
            let mut met = 0;
            for (at, corner) in corners.enumerate() {
                let (vertex, place) = (corner as usize, mesh.original(corner) as usize);
                assert_eq!(vector(&read.positions, read.indices[at]), mesh.positions[place]);
                assert_eq!(vector(&read.normals, read.normal_indices[at]), mesh.normals[place]);
                let texture = &read.texcoords[2 * read.texcoord_indices[at] as usize..][..2];
                assert_eq!(texture, [mesh.uvs[vertex].x, 1.0 - mesh.uvs[vertex].y]);
                met = at + 1;
            }
            assert_eq!((met, read.positions.len()), (read.indices.len(), 3 * mesh.unique()));
            assert_eq!(read.texcoords.len(), 2 * mesh.positions.len());
            let mut rest = read.indices.as_slice();
            let polygons: Vec<Vec<u32>> = read
                .face_arities
                .iter()
                .map(|&len| {
                    let (face, after) = rest.split_at(len as usize);
                    rest = after;
                    face.to_vec()
                })
                .collect();
            assert_eq!(assert_closed(&polygons), 2);
        }
    }
}
