//! OFF, the text format of geometry libraries: vertices and polygons, nothing else.
//!
//! Source: the Geomview manual, "OFF Files" (geomview.org/docs/html/OFF.html).

use super::SurfaceOptions;
use super::part::{SurfacePart, buffered, check, closed_counts, polygons};
use crate::synthesis::io::{WriteError, write_atomically};
use std::io::{self, Write};
use std::path::Path;

/// Writes surfaces to an OFF file, whole or not at all. See [`write_surface_off`].
///
/// # Errors
/// Those of [`write_atomically`] and of [`write_surface_off`].
pub fn save_surface_off(
    path: impl AsRef<Path>,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_surface_off(out, parts, options))
}

/// Writes the surfaces of all parts as one OFF object.
///
/// Vertices on a texture's seam are written once, so the surface is closed. Faces keep their four corners, unless
/// [`SurfaceOptions::triangles`] says otherwise. Every number
/// has enough digits to be read back to the same bits. The remarks are comments below the first line.
///
/// # Errors
/// Those of `out`; [`InvalidInput`](io::ErrorKind::InvalidInput), before anything is written, if a part is not well
/// formed.
pub fn write_surface_off(out: impl Write, parts: &[SurfacePart], options: &SurfaceOptions) -> io::Result<()> {
    check(parts)?;
    let (faces, vertices) = closed_counts(parts, options.triangles);
    let mut out = buffered(out);
    writeln!(out, "OFF")?;
    for line in options.lines() {
        writeln!(out, "# {line}")?;
    }
    // The number of edges is read by no program; 0 is customary.
    writeln!(out, "{vertices} {faces} 0")?;
    for SurfacePart { mesh, .. } in parts {
        for position in &mesh.positions[..mesh.unique()] {
            writeln!(out, "{} {} {}", position.x, position.y, position.z)?;
        }
    }
    let mut first = 0;
    for SurfacePart { mesh, .. } in parts {
        for (corners, len) in polygons(mesh, options.triangles) {
            write!(out, "{len}")?;
            for &corner in &corners[..len] {
                write!(out, " {}", first + u64::from(mesh.original(corner)))?;
            }
            writeln!(out)?;
        }
        first += mesh.unique() as u64;
    }
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_closed, lopsided, prism, tree};
    use super::*;
    use crate::synthesis::surface::SurfaceMesh;
    use crate::synthesis::tree::VesselKind;
    use bevy_math::Vec3;

    fn written(parts: &[SurfacePart]) -> String {
        let mut bytes = Vec::new();
        let options = SurfaceOptions { comments: vec!["3 3 3\nOFF".to_owned()], ..SurfaceOptions::default() };
        write_surface_off(&mut bytes, parts, &options).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    fn read(text: &str) -> (Vec<Vec3>, Vec<Vec<u32>>) {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        assert_eq!(lines.next(), Some("OFF"));
        let mut row = || lines.next().unwrap().split(' ').collect::<Vec<_>>();
        let counts: Vec<usize> = row().iter().map(|number| number.parse().unwrap()).collect();
        let mut vertex = || {
            let row = row();
            assert_eq!(row.len(), 3);
            Vec3::from_array(std::array::from_fn(|axis| row[axis].parse().unwrap()))
        };
        let vertices = (0..counts[0]).map(|_| vertex()).collect();
        let mut face = || {
            let row = row();
            assert_eq!(row[0], (row.len() - 1).to_string());
            row[1..].iter().map(|corner| corner.parse().unwrap()).collect()
        };
        let faces = (0..counts[1]).map(|_| face()).collect();
        assert_eq!((counts[2], lines.next()), (0, None));
        (vertices, faces)
    }

    #[test]
    fn surfaces_come_back_closed_and_to_the_same_bits() {
        let (tree, odd, mesh) = (tree(), lopsided(), prism(5, 4));
        let parts = [&odd, &mesh].map(|mesh| SurfacePart::new(VesselKind::Vein, &tree, mesh));
        let (vertices, faces) = read(&written(&parts));
        assert_eq!(vertices, [&odd.positions[..odd.unique()], &mesh.positions[..mesh.unique()]].concat());
        assert_eq!(assert_closed(&faces), 4);
        let (quads, triangles): (Vec<_>, Vec<_>) = faces.iter().partition(|face| face.len() == 4);
        assert_eq!((quads.len(), triangles.len()), (15 + 5, 10 + 14));
    }

    #[test]
    fn nothing_gives_an_empty_object() {
        assert_eq!(read(&written(&[])), (vec![], vec![]));
        let (tree, mesh) = (tree(), SurfaceMesh::default());
        assert_eq!(read(&written(&[SurfacePart::new(VesselKind::Vein, &tree, &mesh)])), (vec![], vec![]));
    }
}
