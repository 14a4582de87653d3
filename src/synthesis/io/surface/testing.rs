//! For the tests of all formats: small closed meshes made by hand, and the check that a surface read from a file is
//! closed.

use crate::synthesis::surface::SurfaceMesh;
use crate::synthesis::tree::{NO_PARENT, VesselTree};
use bevy_math::{Vec2, Vec3, ops};
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::TAU;

/// A trunk of one segment with two daughters, the first of two segments.
pub(super) fn tree() -> VesselTree {
    let positions = vec![Vec3::ZERO, Vec3::Z, Vec3::new(1.0, 0.0, 2.0), Vec3::new(-1.0, 0.0, 2.0), 3.0 * Vec3::Z];
    VesselTree::from_arrays(positions, vec![NO_PARENT, 0, 1, 1, 2], vec![1.0, 1.0, 0.5, 0.5, 0.25]).unwrap()
}

/// Branch and Strahler order of every node of [`tree`], counted by hand.
pub(super) const MEASURES: [(i32, u32); 5] = [(-1, 2), (0, 2), (1, 1), (2, 1), (1, 1)];

/// A prism with radius 1 along the z axis: rings of quads at z = 0, 1, 2 …, closed by a fan of triangles at each end.
///
/// The first `rings × sides` vertices are those of the rings, the next two the centres of the ends, and the last ones
/// copies of the first vertex of each ring, with the texture's other end.
pub(super) fn prism(sides: u32, rings: u32) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    let mut vertex = |position: Vec3, normal: Vec3, u: f32, node: u32| {
        mesh.positions.push(position);
        mesh.normals.push(normal);
        mesh.uvs.push(Vec2::new(u, position.z));
        mesh.radii.push(1.0 / (node + 1) as f32);
        mesh.nodes.push(node);
    };
    let on_ring = |ring: u32, side: u32| {
        let (sin, cos) = ops::sin_cos(TAU * side as f32 / sides as f32);
        (Vec3::new(cos, sin, ring as f32), Vec3::new(cos, sin, 0.0), 1 + ring % 4)
    };
    for (ring, side) in (0..rings).flat_map(|ring| (0..sides).map(move |side| (ring, side))) {
        let (position, normal, node) = on_ring(ring, side);
        vertex(position, normal, side as f32 / 3.0, node);
    }
    vertex(Vec3::ZERO, Vec3::NEG_Z, 0.1, 0);
    vertex((rings - 1) as f32 * Vec3::Z, Vec3::Z, 0.1, 4);
    for ring in 0..rings {
        let (position, normal, node) = on_ring(ring, 0);
        vertex(position, normal, sides as f32 / 3.0, node);
        mesh.copies.push(ring * sides);
    }
    mesh.faces = prism_faces(sides, rings);
    mesh
}

fn prism_faces(sides: u32, rings: u32) -> Vec<[u32; 4]> {
    let near = sides * rings;
    let at = |ring: u32, side: u32| if side == sides { near + 2 + ring } else { ring * sides + side };
    let mut faces = Vec::new();
    for side in 0..sides {
        faces.extend((1..rings).map(|ring| {
            let below = ring - 1;
            [at(below, side), at(below, side + 1), at(ring, side + 1), at(ring, side)]
        }));
        faces.push([near, at(0, side + 1), at(0, side), at(0, side)]);
        faces.push([near + 1, at(rings - 1, side), at(rings - 1, side + 1), at(rings - 1, side + 1)]);
    }
    faces
}

/// A short prism with coordinates of very different size, one of whose six quads is divided into triangles.
pub(super) fn lopsided() -> SurfaceMesh {
    let mut mesh = prism(6, 2);
    for position in &mut mesh.positions {
        *position = Vec3::new(0.1 + 1e-3 * position.x, position.y * 1e7 / 3.0, position.z * 1e-20);
    }
    let [a, b, c, d] = mesh.faces[0];
    mesh.faces[0] = [a, b, c, c];
    mesh.faces.push([a, c, d, d]);
    mesh
}

/// Numbers for points, the same one for points of the same bits.
#[derive(Default)]
pub(super) struct Welded(BTreeMap<[u32; 3], u32>);

impl Welded {
    pub(super) fn number(&mut self, point: Vec3) -> u32 {
        let next = self.0.len() as u32;
        *self.0.entry(point.to_array().map(f32::to_bits)).or_insert(next)
    }
}

/// Asserts that every edge is passed once in each direction. Returns V − E + F: 2 for each sphere.
pub(super) fn assert_closed(faces: &[Vec<u32>]) -> i64 {
    let mut edges = BTreeSet::new();
    for face in faces {
        assert!((3..=4).contains(&face.len()), "a face has corners {face:?}");
        for (at, &from) in face.iter().enumerate() {
            let to = face[(at + 1) % face.len()];
            assert!(edges.insert((from, to)), "the edge from {from} to {to} is passed twice");
        }
    }
    let open = edges.iter().find(|&&(from, to)| !edges.contains(&(to, from)));
    assert_eq!(open, None, "an edge without its other side");
    let vertices: BTreeSet<u32> = faces.iter().flatten().copied().collect();
    vertices.len() as i64 - edges.len() as i64 / 2 + faces.len() as i64
}
