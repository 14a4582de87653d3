//! Nodes bound to triangles.

use super::{
    frames::{Frames, LANES, Vectors},
    vertices::{Vertex, Vertices, WORTH_SHARING},
};
use crate::synthesis::{
    mesh::{TriangleIndex, TriangleMesh, doubled_normal, unit},
    pace::{Pace, SHORT_STRETCH},
    parallel,
};
use bevy_math::{Vec3, Vec3A, Vec4};
use std::ops::Range;

/// Length of an offset, relative to the size of the coordinates, below which a node lies on the surface: a few rounding
/// errors. Such nodes need no frame.
const ON_SURFACE: f32 = 1.0e-6;

/// Squared length of the sum of three weighted unit normals below which they cancel out.
const CANCELLED: f32 = 1.0e-6;

/// A node's place relative to a triangle.
#[derive(Clone, Copy, Debug)]
struct Bond {
    /// The triangle's vertices, rotated so that the edge from the first to the second suits a frame.
    corners: [u32; 3],
    /// Weights of the second and the third; all three sum to 1.
    weights: [f32; 2],
    /// From the point with these weights to the node, in the frame there.
    offset: Vec3,
}

impl Bond {
    /// The point of the triangle with these weights.
    #[inline]
    fn point(&self, vertices: &[Vertex]) -> Vec3A {
        let [a, b, c] = self.corners.map(|corner| vertices[corner as usize].position);
        a + (b - a) * self.weights[0] + (c - a) * self.weights[1]
    }

    fn edge(&self, vertices: &[Vertex]) -> Vec3A {
        vertices[self.corners[1] as usize].position - vertices[self.corners[0] as usize].position
    }

    /// The interpolated normal at any length.
    #[inline]
    fn normal(&self, vertices: &[Vertex]) -> Vec3A {
        let [a, b, c] = self.corners.map(|corner| vertices[corner as usize].normal);
        let [v, w] = self.weights;
        a * (1.0 - v - w) + b * v + c * w
    }

    /// Unit normal of the triangle itself, zero if it has no area.
    #[cold]
    fn normal_of_triangle(&self, vertices: &[Vertex]) -> Vec3A {
        unit(doubled_normal(self.corners.map(|corner| vertices[corner as usize].position.into()))).into()
    }
}

/// The frames at the points of four bonds. `scale` brings the organ's coordinates near 1.
#[inline]
fn frames(bonds: &[Bond; LANES], vertices: &[Vertex], scale: f32) -> Frames {
    let edges = Vectors::from(bonds.each_ref().map(|bond| bond.edge(vertices))).times(Vec4::splat(scale));
    let normals = Vectors::from(bonds.each_ref().map(|bond| bond.normal(vertices)));
    if normals.dot(normals).min_element() > CANCELLED {
        return Frames::new(edges, normals);
    }
    let normal = |bond: &Bond| {
        let normal = bond.normal(vertices);
        if normal.length_squared() > CANCELLED { normal } else { bond.normal_of_triangle(vertices) }
    };
    Frames::new(edges, bonds.each_ref().map(normal).into())
}

/// Positions of four nodes.
#[inline]
fn nodes(bonds: &[Bond; LANES], vertices: &[Vertex], scale: f32) -> [Vec3; LANES] {
    let points = bonds.each_ref().map(|bond| bond.point(vertices));
    if bonds.iter().all(|bond| bond.offset == Vec3::ZERO) {
        return points.map(Vec3::from);
    }
    let Frames { along, across, up } = frames(bonds, vertices, scale);
    let lanes = |axis: usize| Vec4::from_array(bonds.each_ref().map(|bond| bond.offset[axis]));
    let offsets = along.times(lanes(0)).plus(across.times(lanes(1))).plus(up.times(lanes(2)));
    let offsets = <[Vec3A; LANES]>::from(offsets);
    std::array::from_fn(|lane| Vec3::from(points[lane] + offsets[lane]))
}

#[derive(Clone, Debug)]
pub(super) struct SurfaceBonds {
    mesh: TriangleMesh,
    index: TriangleIndex,
    measured: Vertices,
    rest: Vec<Vertex>,
    /// Brings coordinates at rest near 1.
    rest_scale: f32,
    bonds: Vec<Bond>,
    /// The vertices of the last pose.
    vertices: Vec<Vertex>,
}

impl SurfaceBonds {
    pub async fn new(mesh: &TriangleMesh, pace: &Pace) -> Self {
        let (mut measured, mut rest) = (Vertices::new(mesh, &pace.part(0.0..0.3)).await, Vec::new());
        let rest_scale = measured.measure(mesh.positions(), &mut rest);
        Self {
            index: TriangleIndex::new_paced(mesh, &pace.part(0.3..1.0)).await,
            mesh: mesh.clone(),
            measured,
            bonds: Vec::new(),
            vertices: rest.clone(),
            rest,
            rest_scale,
        }
    }

    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    pub fn vertices(&self) -> usize {
        self.rest.len()
    }

    /// Binds the nodes from a number on.
    pub async fn bind(&mut self, from: usize, nodes: &[Vec3], pace: &Pace) {
        self.bonds.truncate(from);
        let nodes = &nodes[from..];
        let bind = |stretch: Range<usize>| {
            for &node in &nodes[stretch] {
                let found = self.index.closest(node).expect("nodes are finite, and a mesh has a triangle with an area");
                let corners = self.mesh.triangles()[found.triangle];
                self.bonds.push(bond(&self.rest, self.rest_scale, corners, found.barycentric, node));
            }
        };
        pace.stretches(nodes.len(), SHORT_STRETCH, bind).await;
    }

    pub fn follow(&mut self, positions: &[Vec3], moved: &mut [Vec3]) {
        let scale = self.measured.measure(positions, &mut self.vertices);
        let vertices = &self.vertices;
        let (bonds, rest) = self.bonds.as_chunks::<LANES>();
        let (fours, others) = moved.as_chunks_mut::<LANES>();
        parallel::map_all(bonds, fours, WORTH_SHARING, |_, bonds| nodes(bonds, vertices, scale));
        if let Some(&last) = rest.last() {
            let bonds = std::array::from_fn(|lane| *rest.get(lane).unwrap_or(&last));
            others.copy_from_slice(&nodes(&bonds, vertices, scale)[..others.len()]);
        }
    }

    pub fn normal(&self, node: usize) -> Vec3 {
        self.bonds[node].normal(&self.vertices).normalize_or_zero().into()
    }
}

/// Binds a node to a triangle, at its point with three weights.
fn bond(vertices: &[Vertex], scale: f32, [a, b, c]: [u32; 3], weights: Vec3, node: Vec3) -> Bond {
    let turn = |corners, weights| Bond { corners, weights, offset: Vec3::ZERO };
    let turns = [
        turn([a, b, c], [weights.y, weights.z]),
        turn([b, c, a], [weights.z, weights.x]),
        turn([c, a, b], [weights.x, weights.y]),
    ];
    let normal = <[Vec3A; LANES]>::from(frames(&[turns[0]; LANES], vertices, scale).up)[0];
    let across = |bond: &Bond| bond.edge(vertices).reject_from_normalized(normal).length_squared();
    let mut bond = turns.into_iter().max_by(|x, y| across(x).total_cmp(&across(y))).expect("there are three turns");
    // Measured from the same point from which positions are computed later, so that its rounding cancels out.
    let away = Vec3A::from(node) - bond.point(vertices);
    if away.length() > ON_SURFACE * node.abs().max_element() {
        let Frames { along, across, up } = frames(&[bond; LANES], vertices, scale);
        bond.offset = Vec3::from_array([along, across, up].map(|axis| away.dot(<[Vec3A; LANES]>::from(axis)[0])));
    }
    bond
}
