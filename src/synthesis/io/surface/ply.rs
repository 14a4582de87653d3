//! PLY, binary little-endian: the surface with the measures of its vessels, for evaluation.
//!
//! Source: Turk, "The PLY Polygon File Format" (1994).

use super::SurfaceOptions;
use super::part::{Measures, SurfacePart, buffered, check, closed_counts, invalid, polygons};
use crate::synthesis::io::{WriteError, write_atomically};
use std::io::{self, Write};
use std::path::Path;

/// Writes surfaces to a PLY file, whole or not at all. See [`write_surface_ply`].
///
/// # Errors
/// Those of [`write_atomically`] and of [`write_surface_ply`].
pub fn save_surface_ply(
    path: impl AsRef<Path>,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_surface_ply(out, parts, options))
}

/// Writes the surfaces of all parts, joined, as binary little-endian PLY.
///
/// | of each vertex | type | meaning |
/// |---|---|---|
/// | `x`, `y`, `z` | float | position, tissue lengths |
/// | `nx`, `ny`, `nz` | float | unit normal |
/// | `red`, `green`, `blue` | uchar | colour of the part, sRGB |
/// | `radius` | float | radius of the vessel, tissue lengths |
/// | `node` | uint | node of the vertex within its own tree, from 0 |
/// | `branch` | int | branch within that tree, from 0; -1 at a root |
/// | `strahler` | uchar | Strahler order, from 1 |
///
/// | of each face | type | meaning |
/// |---|---|---|
/// | `vertex_indices` | list of uchar, int | three or four corners, anticlockwise seen from outside |
/// | `kind` | uchar | kind of the vessels: 0 arteries, 1 veins, 2 portal veins, 3 ducts |
///
/// Vertices on a texture's seam are written once, so that the surface is closed for every program that reads it. Such a
/// vertex has two texture coordinates, and a PLY vertex holds one; therefore there are none. Names of parts stand in
/// comments, in their order. For programs that want faces of one size there is [`SurfaceOptions::triangles`].
///
/// # Errors
/// Those of `out`; [`InvalidInput`](io::ErrorKind::InvalidInput), before anything is written, if a part is not well
/// formed, or if there are 2³¹ vertices or faces or more.
pub fn write_surface_ply(out: impl Write, parts: &[SurfacePart], options: &SurfaceOptions) -> io::Result<()> {
    check(parts)?;
    let (faces, vertices) = closed_counts(parts, options.triangles);
    check_counts(faces, vertices)?;
    let mut out = buffered(out);
    write_header(&mut out, parts, options, (faces, vertices))?;
    for part in parts {
        write_vertices(&mut out, part)?;
    }
    let mut first = 0;
    for part in parts {
        write_faces(&mut out, part, options.triangles, first)?;
        first += part.mesh.unique() as u32;
    }
    out.flush()
}

/// Many programs hold counts and indices in an `int`.
fn check_counts(faces: usize, vertices: usize) -> io::Result<()> {
    if faces.max(vertices) <= i32::MAX as usize {
        return Ok(());
    }
    Err(invalid(format!(
        "{vertices} vertices and {faces} faces are more than the {} of each that a PLY file can hold; write the parts to \
         files of their own, or make the surface coarser",
        i32::MAX
    )))
}

/// Properties of a vertex, in the order in which they are written.
const VERTEX: &str = "\
property float x
property float y
property float z
property float nx
property float ny
property float nz
property uchar red
property uchar green
property uchar blue
property float radius
property uint node
property int branch
property uchar strahler
";

fn write_header(
    out: &mut impl Write,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
    (faces, vertices): (usize, usize),
) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    let names = parts.iter().map(|part| format!("part {} ({})", part.line_name(), part.kind.name()));
    for line in options.lines().into_iter().chain(names) {
        // Some programs look for the end of the header anywhere in a line.
        writeln!(out, "comment {}", line.replace("end_header", "end header"))?;
    }
    write!(out, "element vertex {vertices}\n{VERTEX}element face {faces}\n")?;
    writeln!(out, "property list uchar int vertex_indices\nproperty uchar kind\nend_header")
}

fn write_vertices(out: &mut impl Write, part: &SurfacePart) -> io::Result<()> {
    let (mesh, color, measures) = (part.mesh, part.display_color(), Measures::of(part.tree));
    for vertex in 0..mesh.unique() {
        let node = mesh.nodes[vertex];
        for number in mesh.positions[vertex].to_array().into_iter().chain(mesh.normals[vertex].to_array()) {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&color)?;
        out.write_all(&mesh.radii[vertex].to_le_bytes())?;
        out.write_all(&node.to_le_bytes())?;
        out.write_all(&measures.branch(node).to_le_bytes())?;
        // An order of k needs 2^(k − 1) tips: it fits.
        out.write_all(&[measures.order(node) as u8])?;
    }
    Ok(())
}

/// The faces of a part whose vertices begin with number `first`.
fn write_faces(out: &mut impl Write, part: &SurfacePart, divided: bool, first: u32) -> io::Result<()> {
    let (mesh, kind) = (part.mesh, part.kind.index() as u8);
    for (corners, len) in polygons(mesh, divided) {
        out.write_all(&[len as u8])?;
        for &corner in &corners[..len] {
            out.write_all(&(first + mesh.original(corner)).to_le_bytes())?;
        }
        out.write_all(&[kind])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{MEASURES, assert_closed, lopsided, prism, tree};
    use super::*;
    use crate::synthesis::surface::SurfaceMesh;
    use crate::synthesis::tree::VesselKind;
    use std::collections::BTreeMap;

    /// A file's elements: a row for each, with the values of every property.
    type Elements = BTreeMap<String, Vec<BTreeMap<String, Vec<f64>>>>;

    /// Reads any binary little-endian file, by its header alone. Returns the comments, too.
    fn read(bytes: &[u8]) -> (Vec<String>, Elements) {
        let mark = b"end_header\n";
        let end = bytes.windows(mark.len()).position(|window| window == mark).unwrap();
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let mut data = &bytes[end + mark.len()..];
        let mut lines = header.lines();
        assert_eq!((lines.next(), lines.next()), (Some("ply"), Some("format binary_little_endian 1.0")));
        let (mut comments, mut layout) = (Vec::new(), Vec::<(&str, usize, Vec<Vec<&str>>)>::new());
        for line in lines {
            match line.split(' ').collect::<Vec<_>>()[..] {
                ["comment", ..] => comments.push(line["comment ".len()..].to_owned()),
                ["element", name, count] => layout.push((name, count.parse().unwrap(), Vec::new())),
                ["property", ref words @ ..] => layout.last_mut().unwrap().2.push(words.to_vec()),
                _ => panic!("{line}"),
            }
        }
        let mut element = |properties: &[Vec<&str>]| {
            let value = |words: &Vec<&str>| match words[..] {
                ["list", count, kind, name] => {
                    let count = number(&mut data, count) as usize;
                    (name.to_owned(), (0..count).map(|_| number(&mut data, kind)).collect())
                }
                [kind, name] => (name.to_owned(), vec![number(&mut data, kind)]),
                _ => panic!("{words:?}"),
            };
            properties.iter().map(value).collect::<BTreeMap<_, _>>()
        };
        let elements = layout
            .iter()
            .map(|(name, count, properties)| ((*name).to_owned(), (0..*count).map(|_| element(properties)).collect()))
            .collect();
        assert!(data.is_empty(), "{} bytes are left", data.len());
        (comments, elements)
    }

    fn number(data: &mut &[u8], kind: &str) -> f64 {
        let size = if kind == "uchar" { 1 } else { 4 };
        let (bytes, rest) = data.split_at(size);
        *data = rest;
        let word = || bytes.try_into().unwrap();
        match kind {
            "uchar" => bytes[0].into(),
            "float" => f32::from_le_bytes(word()).into(),
            "uint" => u32::from_le_bytes(word()).into(),
            "int" => i32::from_le_bytes(word()).into(),
            _ => panic!("{kind}"),
        }
    }

    fn written(parts: &[SurfacePart], comments: &[&str]) -> Vec<u8> {
        let comments = comments.iter().map(|&comment| comment.to_owned()).collect();
        let mut bytes = Vec::new();
        write_surface_ply(&mut bytes, parts, &SurfaceOptions { comments, ..SurfaceOptions::default() }).unwrap();
        bytes
    }

    #[test]
    fn surfaces_come_back_closed_with_all_values() {
        let (tree, odd, mesh) = (tree(), lopsided(), prism(5, 4));
        let duct = SurfacePart { color: [1.0, 0.0, 0.214_041_1], ..SurfacePart::new(VesselKind::Duct, &tree, &mesh) };
        let parts = [SurfacePart::new(VesselKind::Artery, &tree, &odd), duct];
        let (_, elements) = read(&written(&parts, &[]));
        let (vertices, faces) = (&elements["vertex"], &elements["face"]);
        let polygons: Vec<Vec<u32>> =
            faces.iter().map(|face| face["vertex_indices"].iter().map(|&corner| corner as u32).collect()).collect();
        assert_eq!(assert_closed(&polygons), 4);
        assert_eq!(faces.iter().filter(|face| face["kind"] == [3.0]).count(), mesh.faces.len());
        assert_eq!(faces.iter().filter(|face| face["kind"] == [0.0]).count(), odd.faces.len());
        assert_eq!(vertices.len(), odd.unique() + mesh.unique());
        let expected = parts.iter().flat_map(|part| (0..part.mesh.unique()).map(move |vertex| (part, vertex)));
        for (read, (part, vertex)) in vertices.iter().zip(expected) {
            let is = |names: &[&str], values: &[f64]| {
                assert!(names.iter().zip(values).all(|(name, value)| read[*name] == [*value]), "{read:?} {values:?}");
            };
            is(&["x", "y", "z"], &part.mesh.positions[vertex].to_array().map(f64::from));
            is(&["nx", "ny", "nz"], &part.mesh.normals[vertex].to_array().map(f64::from));
            is(&["red", "green", "blue"], &part.display_color().map(f64::from));
            let node = part.mesh.nodes[vertex];
            let (branch, order) = MEASURES[node as usize];
            let radius = part.mesh.radii[vertex].into();
            is(&["radius", "node", "branch", "strahler"], &[radius, node.into(), branch.into(), order.into()]);
        }
        assert_eq!(duct.display_color(), [255, 0, 127]);
    }

    #[test]
    fn comments_cannot_end_the_header() {
        let (tree, mesh) = (tree(), SurfaceMesh::default());
        let part = SurfacePart { name: "a \"b\"\nend_header\n", ..SurfacePart::new(VesselKind::Vein, &tree, &mesh) };
        let (comments, elements) = read(&written(&[part], &["one\nend_header\nelement face 7", ""]));
        assert_eq!(comments[1..], ["one", "end header", "element face 7", "part a \"b\" end header (venous)"]);
        assert!(elements.values().all(Vec::is_empty) && elements.len() == 2);
    }

    #[test]
    fn too_many_vertices_are_an_error_with_the_number() {
        let most = i32::MAX as usize;
        assert!(check_counts(most, most).is_ok());
        for (faces, vertices) in [(most + 1, 1), (1, most + 1)] {
            let message = check_counts(faces, vertices).unwrap_err().to_string();
            assert!(message.contains("2147483648") && message.contains("coarser"), "{message}");
        }
    }
}
