//! The parts of a surface file, and their check before anything is written.

use crate::synthesis::io::lines::one_line;
use crate::synthesis::surface::SurfaceMesh;
use crate::synthesis::tree::{ByKind, VesselKind, VesselTree};
use bevy_math::ops;
use std::io::{self, BufWriter, ErrorKind, Write};

/// One tree's surface in a file.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePart<'a> {
    /// Name of the object in the file. Formats of text lines get it on one line; without any letter it is that of the
    /// kind. Several parts may share a name.
    pub name: &'a str,
    /// Kind of the vessels.
    pub kind: VesselKind,
    /// The tree inside the surface.
    pub tree: &'a VesselTree,
    /// The surface. Its nodes are those of `tree`.
    pub mesh: &'a SurfaceMesh,
    /// Colour of the surface, linear sRGB. Limits: 0 to 1.
    pub color: [f32; 3],
}

impl<'a> SurfacePart<'a> {
    /// Colours of the kinds, linear sRGB: those in which vessels are drawn by default.
    pub const DEFAULT_COLORS: ByKind<[f32; 3]> = ByKind {
        artery: [0.342_392, 0.003_936, 0.004_896],
        vein: [0.050_876, 0.021_981, 0.187_317],
        portal_vein: [0.024_515, 0.015_325, 0.132_868],
        duct: [0.073_239, 0.147_319, 0.017_389],
    };

    /// A part with the name and the default colour of its kind.
    pub fn new(kind: VesselKind, tree: &'a VesselTree, mesh: &'a SurfaceMesh) -> Self {
        Self { name: kind.name(), kind, tree, mesh, color: Self::DEFAULT_COLORS[kind] }
    }

    /// The name on one line, that of the kind if there is none.
    pub(super) fn line_name(&self) -> String {
        let name = one_line(self.name);
        if name.is_empty() { self.kind.name().to_owned() } else { name }
    }

    /// The colour as it is displayed, sRGB.
    pub(super) fn display_color(&self) -> [u8; 3] {
        self.color.map(|linear| {
            let curved =
                if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * ops::powf(linear, 1.0 / 2.4) - 0.055 };
            (curved.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
        })
    }
}

/// Branch and Strahler order of every node of a tree.
pub(super) struct Measures {
    branches: Vec<u32>,
    orders: Vec<u32>,
}

impl Measures {
    pub(super) fn of(tree: &VesselTree) -> Self {
        Self { branches: tree.branches().of_nodes().to_vec(), orders: tree.strahler_orders() }
    }

    /// Branch of a node's segment; -1 for a root, which has none.
    pub(super) fn branch(&self, node: u32) -> i32 {
        i32::try_from(self.branches[node as usize]).unwrap_or(-1)
    }

    pub(super) fn order(&self, node: u32) -> u32 {
        self.orders[node as usize]
    }
}

/// The faces of the closed surface: three or four vertices, copies among them; three only if `divided`.
pub(super) fn polygons(mesh: &SurfaceMesh, divided: bool) -> impl Iterator<Item = ([u32; 4], usize)> + '_ {
    let (whole, triangles) = if divided { (&[][..], Some(mesh.triangles())) } else { (&mesh.faces[..], None) };
    let triangles = triangles.into_iter().flatten().map(|[a, b, c]| [a, b, c, c]);
    whole.iter().copied().chain(triangles).filter_map(|face| polygon(mesh, face))
}

/// Of neighbouring corners in the same place, the last one counts. `None` for a face without area that has only two
/// places: leaving it out opens nothing, since its two edges close each other.
fn polygon(mesh: &SurfaceMesh, face: [u32; 4]) -> Option<([u32; 4], usize)> {
    let (mut corners, mut len) = (face, 0);
    for at in 0..face.len() {
        let next = face[(at + 1) % face.len()];
        if mesh.original(face[at]) != mesh.original(next) {
            corners[len] = face[at];
            len += 1;
        }
    }
    (len >= 3).then_some((corners, len))
}

/// Number of faces that [`polygons`] gives, and of vertices with places of their own, over all parts.
pub(super) fn closed_counts(parts: &[SurfacePart], divided: bool) -> (usize, usize) {
    let faces = parts.iter().map(|part| polygons(part.mesh, divided).count()).sum();
    (faces, parts.iter().map(|part| part.mesh.unique()).sum())
}

/// A large buffer before a file: vertices are written a few bytes at a time.
pub(super) fn buffered<W: Write>(out: W) -> BufWriter<W> {
    BufWriter::with_capacity(1 << 16, out)
}

/// The error for contents that a file cannot have.
pub(super) fn invalid(message: impl Into<String>) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, message.into())
}

/// Checks that every part is well formed: arrays of equal length, indices in range, numbers finite.
///
/// # Errors
/// [`ErrorKind::InvalidInput`], with the part and the value.
pub(super) fn check(parts: &[SurfacePart]) -> io::Result<()> {
    for (number, part) in parts.iter().enumerate() {
        let fault = unequal_length(part.mesh).or_else(|| lost_index(part)).or_else(|| odd_number(part));
        if let Some(fault) = fault {
            return Err(invalid(format!("surface part {number}, {:?}: {fault}", part.name)));
        }
    }
    Ok(())
}

/// An array that has not one entry per vertex.
fn unequal_length(mesh: &SurfaceMesh) -> Option<String> {
    let vertices = mesh.positions.len();
    let arrays = [
        ("normals", mesh.normals.len()),
        ("texture coordinates", mesh.uvs.len()),
        ("radii", mesh.radii.len()),
        ("nodes", mesh.nodes.len()),
    ];
    if let Some((name, len)) = arrays.into_iter().find(|&(_, len)| len != vertices) {
        return Some(format!("{len} {name} for {vertices} vertices"));
    }
    if mesh.copies.len() > vertices {
        return Some(format!("{} of its {vertices} vertices are copies", mesh.copies.len()));
    }
    // The last index is reserved in GLB.
    (vertices >= u32::MAX as usize).then(|| format!("{vertices} vertices are more than an index of 32 bits can count"))
}

/// A reference to something that is not there.
fn lost_index(part: &SurfacePart) -> Option<String> {
    let SurfacePart { mesh, tree, .. } = part;
    let (vertices, unique, nodes) = (mesh.positions.len(), mesh.unique(), tree.len());
    let lost_corner = |face: &[u32; 4]| face.iter().copied().find(|&corner| corner as usize >= vertices);
    let corner = mesh.faces.iter().enumerate().find_map(|(face, corners)| Some((face, lost_corner(corners)?)));
    if let Some((face, corner)) = corner {
        return Some(format!("face {face} has vertex {corner}, but there are {vertices}"));
    }
    if let Some(copy) = mesh.copies.iter().position(|&original| original as usize >= unique) {
        let (vertex, original) = (unique + copy, mesh.copies[copy]);
        return Some(format!("vertex {vertex} is a copy of {original}, but the originals end before {unique}"));
    }
    let vertex = mesh.nodes.iter().position(|&node| node as usize >= nodes)?;
    Some(format!("vertex {vertex} belongs to node {}, but the tree has {nodes}", mesh.nodes[vertex]))
}

/// A number that is not finite, or a colour beyond its limits.
fn odd_number(part: &SurfacePart) -> Option<String> {
    let mesh = part.mesh;
    if !part.color.iter().all(|value| (0.0..=1.0).contains(value)) {
        return Some(format!("its colour {:?} is not between 0 and 1", part.color));
    }
    first_odd("position", &mesh.positions, |value| value.is_finite())
        .or_else(|| first_odd("normal", &mesh.normals, |value| value.is_finite()))
        .or_else(|| first_odd("texture coordinate", &mesh.uvs, |value| value.is_finite()))
        .or_else(|| first_odd("radius", &mesh.radii, |value| value.is_finite()))
}

fn first_odd<T: std::fmt::Debug>(name: &str, values: &[T], is_finite: impl Fn(&T) -> bool) -> Option<String> {
    let vertex = values.iter().position(|value| !is_finite(value))?;
    Some(format!("vertex {vertex} has the {name} {:?}, which is not finite", values[vertex]))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_closed, lopsided, prism, tree};
    use super::*;
    use bevy_math::{Vec2, Vec3};

    /// The message for a prism that was changed.
    fn fault(change: impl FnOnce(&mut SurfaceMesh)) -> String {
        let tree = tree();
        let mut mesh = prism(5, 3);
        change(&mut mesh);
        let part = SurfacePart { name: "left\nlobe", ..SurfacePart::new(VesselKind::Duct, &tree, &mesh) };
        let error = check(&[SurfacePart::new(VesselKind::Vein, &tree, &SurfaceMesh::default()), part]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidInput);
        let message = error.to_string();
        assert!(message.starts_with("surface part 1, \"left\\nlobe\": "), "{message}");
        message
    }

    #[test]
    fn every_fault_is_found_with_its_value() {
        for (message, expected) in [
            (fault(|mesh| mesh.faces[2][3] = 77), "face 2 has vertex 77"),
            (fault(|mesh| mesh.faces[0][0] = u32::MAX), "face 0 has vertex 4294967295"),
            (fault(|mesh| mesh.copies[1] = 40), "is a copy of 40"),
            (fault(|mesh| mesh.nodes[3] = 9), "vertex 3 belongs to node 9, but the tree has 5"),
            (fault(|mesh| mesh.copies = vec![0; 99]), "99 of its"),
            (fault(|mesh| mesh.normals.truncate(2)), "2 normals for"),
            (fault(|mesh| mesh.radii.push(1.0)), "radii for"),
            (fault(|mesh| mesh.positions[1].y = f32::NAN), "vertex 1 has the position Vec3(0.309"),
            (fault(|mesh| mesh.normals[1] = Vec3::INFINITY), "vertex 1 has the normal"),
            (fault(|mesh| mesh.uvs[0] = Vec2::NAN), "vertex 0 has the texture coordinate"),
            (fault(|mesh| mesh.radii[0] = f32::NEG_INFINITY), "vertex 0 has the radius -inf"),
        ] {
            assert!(message.contains(expected), "{expected:?} is not in {message:?}");
        }
        let (tree, mesh) = (tree(), prism(5, 3));
        let mut part = SurfacePart::new(VesselKind::Artery, &tree, &mesh);
        assert!(check(&[part]).is_ok());
        part.color[1] = f32::NAN;
        assert!(check(&[part]).unwrap_err().to_string().contains("colour"));
    }

    #[test]
    fn colours_of_the_kinds_are_displayed_as_drawn() {
        let (tree, mesh) = (VesselTree::new(), SurfaceMesh::default());
        let drawn = [[0.62, 0.05, 0.06], [0.25, 0.16, 0.47], [0.17, 0.13, 0.40], [0.30, 0.42, 0.14]];
        for (kind, drawn) in VesselKind::ALL.into_iter().zip(drawn) {
            let part = SurfacePart::new(kind, &tree, &mesh);
            assert_eq!(part.display_color(), drawn.map(|value: f32| (255.0 * value + 0.5) as u8));
            assert_eq!((part.name, part.line_name()), (kind.name(), kind.name().to_owned()));
        }
        let part = SurfacePart { color: [0.0, 1.0, 0.001], ..SurfacePart::new(VesselKind::Vein, &tree, &mesh) };
        assert_eq!(part.display_color(), [0, 255, 3]);
        assert_eq!(SurfacePart { name: " \n", ..part }.line_name(), "venous");
    }

    #[test]
    fn corners_in_the_same_place_count_once() {
        let mesh = SurfaceMesh { positions: vec![Vec3::ZERO; 6], copies: vec![0, 2], ..SurfaceMesh::default() };
        assert_eq!(polygon(&mesh, [0, 1, 2, 3]), Some(([0, 1, 2, 3], 4)));
        let triangle = |face| polygon(&mesh, face).map(|(corners, len)| corners[..len].to_vec());
        assert_eq!(triangle([0, 1, 3, 3]), Some(vec![0, 1, 3]));
        assert_eq!(triangle([1, 5, 2, 3]), Some(vec![1, 2, 3]));
        assert_eq!(triangle([4, 1, 2, 0]), Some(vec![4, 1, 2]));
        assert_eq!(triangle([0, 1, 4, 4]), None);
        assert_eq!(triangle([2, 2, 5, 5]), None);
    }

    #[test]
    fn divided_faces_are_closed_too() {
        let mesh = lopsided();
        for (divided, lens) in [(false, [14, 5]), (true, [24, 0])] {
            let faces: Vec<Vec<u32>> = polygons(&mesh, divided).map(|(corners, len)| corners[..len].to_vec()).collect();
            assert_eq!([3, 4].map(|len| faces.iter().filter(|face| face.len() == len).count()), lens);
            let closed: Vec<Vec<u32>> =
                faces.iter().map(|face| face.iter().map(|&corner| mesh.original(corner)).collect()).collect();
            assert_eq!(assert_closed(&closed), 2);
        }
    }
}
