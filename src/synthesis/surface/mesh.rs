//! The mesh of a surface: what is drawn, bent and written to files.

use super::direction::unit;
use crate::synthesis::mesh::Closure;
use crate::synthesis::pace::{Pace, at_once};
use bevy_math::{Vec2, Vec3, Vec4};

/// A closed mesh around a vessel tree.
///
/// All arrays of vertices have the same length. A vertex where the texture begins and ends is stored once for each of
/// its texture coordinates: the first [`unique`](Self::unique) vertices have places of their own, and the others are
/// copies, which share place, normal, node and radius with their [`original`](Self::original).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Positions, in tissue lengths.
    pub positions: Vec<Vec3>,
    /// Unit normals, outwards.
    pub normals: Vec<Vec3>,
    /// Texture coordinates: u around the vessel, from minus to plus half its circumference, and v along it from its
    /// base, both in tissue lengths. So a texture that repeats has the same size from trunk to twig.
    pub uvs: Vec<Vec2>,
    /// Radius of the vessel at each vertex, in tissue lengths.
    pub radii: Vec<f32>,
    /// Node of the tree whose segment each vertex belongs to.
    pub nodes: Vec<u32>,
    /// Faces, anticlockwise seen from outside. A triangle repeats its last vertex.
    pub faces: Vec<[u32; 4]>,
    /// The original of every copied vertex; the copies are the last vertices.
    pub copies: Vec<u32>,
}

impl SurfaceMesh {
    /// Number of vertices with places of their own.
    pub fn unique(&self) -> usize {
        self.positions.len() - self.copies.len()
    }

    /// The vertex of which another one is a copy, or that vertex itself.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn original(&self, vertex: u32) -> u32 {
        (vertex as usize).checked_sub(self.unique()).map_or(vertex, |copy| self.copies[copy])
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.faces.iter().map(|[_, _, c, d]| if c == d { 1 } else { 2 }).sum()
    }

    /// The faces as triangles; a face with four vertices is divided along its shorter diagonal.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.faces.iter().flat_map(|&face| self.divided(face))
    }

    /// The triangles of a face.
    pub(super) fn divided(&self, [a, b, c, d]: [u32; 4]) -> impl Iterator<Item = [u32; 3]> + use<> {
        let [pa, pb, pc, pd] = [a, b, c, d].map(|vertex| self.positions[vertex as usize]);
        let (first, second) = if c == d {
            ([a, b, c], None)
        } else if pa.distance_squared(pc) <= pb.distance_squared(pd) {
            ([a, b, c], Some([a, c, d]))
        } else {
            ([a, b, d], Some([b, c, d]))
        };
        std::iter::once(first).chain(second)
    }

    /// The triangles, with originals in place of copies: the closed surface.
    pub fn closed_triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.triangles().map(|corners| corners.map(|corner| self.original(corner)))
    }

    /// How the surface closes: 2 for each tree as Euler characteristic, and no open edge.
    pub fn closure(&self) -> Closure {
        Closure::of(&self.positions, &self.closed_triangles().collect::<Vec<_>>())
    }
}

impl SurfaceMesh {
    /// Adds what copies share with their originals.
    pub(super) fn complete(&mut self) {
        let count = self.copies.len();
        self.positions.reserve_exact(count);
        self.normals.reserve_exact(count);
        self.radii.reserve_exact(count);
        self.nodes.reserve_exact(count);
        for &original in &self.copies {
            let original = original as usize;
            self.positions.push(self.positions[original]);
            self.normals.push(self.normals[original]);
            self.radii.push(self.radii[original]);
            self.nodes.push(self.nodes[original]);
        }
    }

    /// Unit tangents of all vertices, for normal maps: the direction of rising u on the faces around each vertex, across
    /// its normal, with the sign of the bitangent as fourth value, as in glTF. They are not stored: a large mesh takes a
    /// quarter less memory without them.
    pub fn tangents(&self) -> Vec<Vec4> {
        at_once(self.tangents_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn tangents_paced(&self, pace: &Pace) -> Vec<Vec4> {
        let mut tangents = vec![Vec4::W; self.positions.len()];
        let add = |face: usize| {
            let [a, b, c, d] = self.faces[face];
            let [pa, pb, pc, pd] = [a, b, c, d].map(|vertex| self.positions[vertex as usize]);
            let [ua, ub, uc, ud] = [a, b, c, d].map(|vertex| self.uvs[vertex as usize]);
            let (across, along) = ((pb + pc) - (pa + pd), (pc + pd) - (pa + pb));
            let (du, dv) = ((ub + uc) - (ua + ud), (uc + ud) - (ua + ub));
            // The solution of across = du.x·T + du.y·B and along = dv.x·T + dv.y·B for T, times the determinant.
            let determinant = du.x * dv.y - du.y * dv.x;
            let tangent = (across * dv.y - along * du.y) * determinant.signum();
            for vertex in [a, b, c, d] {
                tangents[vertex as usize] += tangent.extend(0.0);
            }
        };
        pace.part(0.0..0.6).each(self.faces.len(), add).await;
        pace.part(0.6..1.0)
            .each(tangents.len(), |vertex| {
                let (sum, normal) = (tangents[vertex].truncate(), self.normals[vertex]);
                let flat = sum - normal * normal.dot(sum);
                tangents[vertex] = unit(flat).unwrap_or_else(|| normal.any_orthonormal_vector()).extend(1.0);
            })
            .await;
        tangents
    }
}
