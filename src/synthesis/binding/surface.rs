//! Nodes bound to triangles.

use super::map_all;
use crate::synthesis::{
    mesh::{TriangleMesh, Welding, doubled_normal, unit},
    tissue::TriangleIndex,
};
use bevy_math::{DVec3, Vec3};

/// Length of an offset, relative to the size of the coordinates, below which a node lies on the surface: a few
/// roundings. Such nodes need no frame.
const ON_SURFACE: f32 = 1.0e-6;

/// Squared length of the sum of three weighted unit normals below which they cancel out.
const CANCELLED: f32 = 1.0e-6;

/// A node's place relative to a triangle.
#[derive(Clone, Copy, Debug)]
struct Bond {
    /// The triangle's vertices, turned so that the edge from the first to the second is good for a frame.
    corners: [u32; 3],
    /// Weights of the second and the third; the three sum to 1.
    weights: [f32; 2],
    /// From the point with these weights to the node, in the frame there.
    offset: Vec3,
}

/// An organ's vertices, with the normal of each.
#[derive(Clone, Copy)]
struct Pose<'a> {
    vertices: &'a [Vec3],
    normals: &'a [Vec3],
}

impl Pose<'_> {
    /// The point of a triangle that weights stand for.
    fn point(&self, corners: [u32; 3], [v, w]: [f32; 2]) -> Vec3 {
        let [a, b, c] = corners.map(|corner| self.vertices[corner as usize]);
        a + (b - a) * v + (c - a) * w
    }

    /// Unit normal, interpolated; the triangle's own where those of its corners cancel out.
    fn normal(&self, corners: [u32; 3], [v, w]: [f32; 2]) -> Vec3 {
        let [a, b, c] = corners.map(|corner| self.normals[corner as usize]);
        let mixed = a * (1.0 - v - w) + b * v + c * w;
        if mixed.length_squared() > CANCELLED {
            mixed.normalize()
        } else {
            unit(doubled_normal(corners.map(|corner| self.vertices[corner as usize])))
        }
    }

    /// Part of the first edge across a normal, at any length.
    fn edge_across(&self, corners: [u32; 3], normal: Vec3) -> Vec3 {
        let edge = self.vertices[corners[1] as usize] - self.vertices[corners[0] as usize];
        edge - normal * normal.dot(edge)
    }

    /// A node's offset in space.
    fn offset(&self, bond: &Bond) -> Vec3 {
        let normal = self.normal(bond.corners, bond.weights);
        let tangent = self.edge_across(bond.corners, normal).normalize_or_zero();
        tangent * bond.offset.x + normal.cross(tangent) * bond.offset.y + normal * bond.offset.z
    }

    fn position(&self, bond: &Bond) -> Vec3 {
        let point = self.point(bond.corners, bond.weights);
        if bond.offset == Vec3::ZERO { point } else { point + self.offset(bond) }
    }
}

#[derive(Clone, Debug)]
pub(super) struct SurfaceBonds {
    mesh: TriangleMesh,
    index: TriangleIndex,
    welding: Welding,
    rest_normals: Vec<Vec3>,
    bonds: Vec<Bond>,
    /// Of each vertex, as it was last followed.
    normals: Vec<Vec3>,
    /// Of each welded vertex, while normals are computed.
    sums: Vec<DVec3>,
}

impl SurfaceBonds {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let welding = mesh.weld();
        let normals = mesh.vertex_normals_with(&welding);
        Self {
            index: TriangleIndex::new(mesh),
            mesh: mesh.clone(),
            sums: Vec::new(),
            welding,
            rest_normals: normals.clone(),
            bonds: Vec::new(),
            normals,
        }
    }

    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    pub fn vertices(&self) -> usize {
        self.mesh.positions().len()
    }

    /// Binds the nodes from a number on.
    pub fn bind(&mut self, from: usize, nodes: &[Vec3]) {
        self.bonds.truncate(from);
        let pose = Pose { vertices: self.mesh.positions(), normals: &self.rest_normals };
        for &node in &nodes[from..] {
            let found = self.index.closest(node).expect("nodes are finite, and a mesh has a triangle with an area");
            let bond = bond(&pose, self.mesh.triangles()[found.triangle], found.barycentric, node);
            self.bonds.push(bond);
        }
    }

    pub fn follow(&mut self, vertices: &[Vec3], positions: &mut [Vec3]) {
        self.measure_normals(vertices);
        let pose = Pose { vertices, normals: &self.normals };
        map_all(&self.bonds, positions, |bond| pose.position(bond));
    }

    pub fn normal(&self, node: usize) -> Vec3 {
        let Bond { corners, weights: [v, w], .. } = self.bonds[node];
        let [a, b, c] = corners.map(|corner| self.normals[corner as usize]);
        (a * (1.0 - v - w) + b * v + c * w).normalize_or_zero()
    }

    /// As [`TriangleMesh::vertex_normals_with`], in buffers that stay.
    fn measure_normals(&mut self, vertices: &[Vec3]) {
        self.sums.clear();
        self.sums.resize(self.welding.count(), DVec3::ZERO);
        for corners in self.mesh.triangles() {
            let normal = doubled_normal(corners.map(|corner| vertices[corner as usize]));
            for &corner in corners {
                self.sums[self.welding.vertex(corner)] += normal;
            }
        }
        for (vertex, normal) in self.normals.iter_mut().enumerate() {
            *normal = unit(self.sums[self.welding.vertex(vertex as u32)]);
        }
    }
}

/// Binds a node to a triangle, at the point of it with three weights.
fn bond(pose: &Pose, [a, b, c]: [u32; 3], weights: Vec3, node: Vec3) -> Bond {
    let turns =
        [([a, b, c], [weights.y, weights.z]), ([b, c, a], [weights.z, weights.x]), ([c, a, b], [weights.x, weights.y])];
    let normal = pose.normal(turns[0].0, turns[0].1);
    let across = |corners| pose.edge_across(corners, normal).length_squared();
    let (corners, weights) =
        turns.into_iter().max_by(|x, y| across(x.0).total_cmp(&across(y.0))).expect("there are three turns");
    // Measured from the point that following begins from, so that its rounding cancels out.
    let normal = pose.normal(corners, weights);
    let tangent = pose.edge_across(corners, normal).normalize_or_zero();
    let away = node - pose.point(corners, weights);
    let on_surface = away.length() <= ON_SURFACE * node.abs().max_element();
    let offset = Vec3::new(away.dot(tangent), away.dot(normal.cross(tangent)), away.dot(normal));
    Bond { corners, weights, offset: if on_surface { Vec3::ZERO } else { offset } }
}
