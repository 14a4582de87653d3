//! STL, binary: triangles only, for printing and volume meshing.
//!
//! Source: the interface specification for stereolithography, 3D Systems (1989).

use super::part::{SurfacePart, buffered, check, invalid};
use super::{SurfaceOptions, notes::generator};
use crate::synthesis::io::{WriteError, write_atomically};
use bevy_math::{DVec3, Vec3};
use std::io::{self, Write};
use std::path::Path;

/// Bytes before the number of triangles.
const HEADER: usize = 80;
/// Bytes of a triangle: normal, three corners, and two bytes without a meaning.
const FACET: usize = 50;

/// Writes surfaces to an STL file, whole or not at all. See [`write_surface_stl`].
///
/// # Errors
/// Those of [`write_atomically`] and of [`write_surface_stl`].
pub fn save_surface_stl(
    path: impl AsRef<Path>,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_surface_stl(out, parts, options))
}

/// Writes the surfaces of all parts as the triangles of one binary STL solid.
///
/// Faces with four corners are divided along their shorter diagonal. The normal of a triangle is that of its plane, and
/// zero if it has no area. Corners in the same place have the same bits. The header has room for the generator and the
/// unit only; the format has no place for names and colours.
///
/// # Errors
/// Those of `out`; [`InvalidInput`](io::ErrorKind::InvalidInput), before anything is written, if a part is not well
/// formed, or if there are 2³² triangles or more.
pub fn write_surface_stl(out: impl Write, parts: &[SurfacePart], options: &SurfaceOptions) -> io::Result<()> {
    check(parts)?;
    let count = facet_count(parts.iter().map(|part| part.mesh.triangle_count() as u64).sum())?;
    let mut out = buffered(out);
    out.write_all(&header(options))?;
    out.write_all(&count.to_le_bytes())?;
    for SurfacePart { mesh, .. } in parts {
        for corners in mesh.closed_triangles() {
            out.write_all(&facet(corners.map(|corner| mesh.positions[corner as usize])))?;
        }
    }
    out.flush()
}

fn facet_count(triangles: u64) -> io::Result<u32> {
    u32::try_from(triangles).map_err(|_| {
        invalid(format!(
            "{triangles} triangles are more than the {} of an STL file; write the parts to files of their own, or make \
             the surface coarser",
            u32::MAX
        ))
    })
}

/// The generator and the unit, filled up with zeros. It begins with the crate's name, never with `solid`, which would
/// announce a file of text.
fn header(options: &SurfaceOptions) -> [u8; HEADER] {
    let unit = options.scale.map(|scale| format!(", unit: {} m", scale.metres())).unwrap_or_default();
    let text = format!("{}, binary STL{unit}", generator());
    let mut header = [0; HEADER];
    header.iter_mut().zip(text.bytes()).for_each(|(to, from)| *to = from);
    header
}

fn facet(corners: [Vec3; 3]) -> [u8; FACET] {
    let mut facet = [0; FACET];
    let vectors = [normal(corners), corners[0], corners[1], corners[2]];
    let (numbers, _) = facet.as_chunks_mut();
    for (to, from) in numbers.iter_mut().zip(vectors.iter().flat_map(|vector| vector.to_array())) {
        *to = from.to_le_bytes();
    }
    facet
}

/// Unit normal of a triangle, zero if it has no area. In f64, where the smallest edges still have an area.
fn normal(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners.map(|corner| DVec3::new(corner.x.into(), corner.y.into(), corner.z.into()));
    (b - a).cross(c - a).normalize_or_zero().as_vec3()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Welded, assert_closed, prism, tree};
    use super::*;
    use crate::synthesis::surface::SurfaceMesh;
    use crate::synthesis::tree::VesselKind;
    use crate::synthesis::units::Scale;

    fn written(parts: &[SurfacePart], options: &SurfaceOptions) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_surface_stl(&mut bytes, parts, options).unwrap();
        bytes
    }

    /// Normal and corners of every triangle.
    fn read(bytes: &[u8]) -> Vec<[Vec3; 4]> {
        let count = u32::from_le_bytes(bytes[80..84].try_into().unwrap()) as usize;
        assert_eq!(bytes.len(), 84 + 50 * count);
        let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
        let vector = |bytes: &[u8]| Vec3::new(number(&bytes[..4]), number(&bytes[4..8]), number(&bytes[8..12]));
        let facet = |bytes: &[u8]| std::array::from_fn(|at| vector(&bytes[12 * at..]));
        bytes[84..].chunks(50).map(facet).collect()
    }

    #[test]
    fn prisms_come_back_closed_with_normals_outwards() {
        let (tree, mesh) = (tree(), prism(6, 4));
        let far =
            SurfaceMesh { positions: mesh.positions.iter().map(|at| at + 9.0 * Vec3::X).collect(), ..mesh.clone() };
        let parts = [&mesh, &far].map(|mesh| SurfacePart::new(VesselKind::Vein, &tree, mesh));
        let facets = read(&written(&parts, &SurfaceOptions::default()));
        assert_eq!(facets.len(), 2 * (2 * 6 * 3 + 2 * 6));
        let mut welded = Welded::default();
        let triangles: Vec<Vec<u32>> = facets
            .iter()
            .map(|[_, corners @ ..]| corners.iter().map(|&corner| welded.number(corner)).collect())
            .collect();
        assert_eq!(assert_closed(&triangles), 4, "two spheres");
        for (number, [normal, a, b, c]) in facets.iter().enumerate() {
            assert!((normal.length() - 1.0).abs() < 1e-6);
            let centre = 1.5 * Vec3::Z + if number < facets.len() / 2 { Vec3::ZERO } else { 9.0 * Vec3::X };
            assert!(normal.dot((a + b + c) / 3.0 - centre) > 0.5, "triangle {number} faces inwards");
        }
    }

    #[test]
    fn headers_name_the_unit_and_never_begin_as_text() {
        let options =
            SurfaceOptions { scale: Some(Scale::CENTIMETRES), comments: vec!["long ".repeat(99)], triangles: false };
        let bytes = written(&[], &options);
        assert_eq!(bytes.len(), 84);
        assert!(!bytes.starts_with(b"solid"));
        let text = String::from_utf8(bytes[..80].to_vec()).unwrap();
        assert!(text.trim_end_matches('\0').ends_with("binary STL, unit: 0.01 m"), "{text}");
        let (tree, mesh) = (tree(), SurfaceMesh::default());
        assert_eq!(written(&[SurfacePart::new(VesselKind::Vein, &tree, &mesh)], &options), bytes);
    }

    #[test]
    fn triangles_without_area_have_no_normal() {
        assert_eq!(normal([Vec3::X, Vec3::X, Vec3::Y]), Vec3::ZERO);
        assert_eq!(normal([Vec3::ZERO, Vec3::X, 2.0 * Vec3::X]), Vec3::ZERO);
        let tiny = f32::from_bits(1);
        assert_eq!(normal([Vec3::ZERO, tiny * Vec3::X, tiny * Vec3::Y]), Vec3::Z);
        assert_eq!(normal([Vec3::ZERO, f32::MAX * Vec3::X, f32::MAX * Vec3::Y]), Vec3::Z);
    }

    #[test]
    fn too_many_triangles_are_an_error_with_the_number() {
        assert_eq!(facet_count(u64::from(u32::MAX)).unwrap(), u32::MAX);
        let message = facet_count(1 << 32).unwrap_err().to_string();
        assert!(message.contains("4294967296 triangles") && message.contains("coarser"), "{message}");
    }
}
