//! A mesh with all drawing attributes, exchanged by organs, surfaces and files.

use super::{MeshError, TriangleMesh};
use bevy_math::{Vec2, Vec3};
use std::ops::Range;

/// Triangles of an organ with all drawing attributes.
///
/// Positions are in metres, normals are unit vectors that point out of the tissue, triangles wind counter-clockwise seen
/// from outside. The surface is closed once vertices at equal positions are welded: along the seams of the UV chart a
/// position occurs twice, with the same normal and another UV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadedMesh {
    /// Vertex positions, in metres.
    pub positions: Vec<Vec3>,
    /// Unit normals, one per vertex.
    pub normals: Vec<Vec3>,
    /// Texture coordinates in [0, 1]², one per vertex. Each organ documents their directions.
    pub uvs: Vec<Vec2>,
    /// Tissue colours, linear RGB with an alpha of 1, one per vertex.
    pub colors: Vec<[f32; 4]>,
    /// Triangles, as indices into the vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl ShadedMesh {
    /// Some of the triangles with only the vertices they use, such as the outer side of a wall.
    ///
    /// Indices beyond the end of [`triangles`](Self::triangles) are left out. Vertices keep their order and normals.
    #[must_use]
    pub fn part(&self, triangles: Range<usize>) -> Self {
        let end = triangles.end.min(self.triangles.len());
        let chosen = &self.triangles[triangles.start.min(end)..end];
        let mut index = vec![u32::MAX; self.positions.len()];
        for &vertex in chosen.iter().flatten() {
            index[vertex as usize] = 0;
        }
        let mut part = Self::default();
        for (vertex, slot) in index.iter_mut().enumerate().filter(|(_, slot)| **slot == 0) {
            *slot = part.positions.len() as u32;
            part.positions.push(self.positions[vertex]);
            part.normals.push(self.normals[vertex]);
            part.uvs.push(self.uvs[vertex]);
            part.colors.push(self.colors[vertex]);
        }
        part.triangles = chosen.iter().map(|corners| corners.map(|corner| index[corner as usize])).collect();
        part
    }

    /// The checked triangles for all stages, with UVs.
    ///
    /// # Errors
    /// Those of [`TriangleMesh::new`]. Meshes of organs and their parts have none, except an empty part.
    pub fn triangle_mesh(&self) -> Result<TriangleMesh, MeshError> {
        TriangleMesh::new(self.positions.clone(), self.triangles.clone(), Some(self.uvs.clone()))
    }

    /// Volume enclosed by the surface, in cubic metres; negative if it is inside out. Only meaningful for closed
    /// meshes.
    pub fn signed_volume(&self) -> f32 {
        let six_volumes: f64 = self
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| self.positions[corner as usize].as_dvec3());
                a.dot(b.cross(c))
            })
            .sum();
        (six_volumes / 6.0) as f32
    }

    /// Smallest and largest coordinates, in metres; zeros for an empty mesh.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let Some(&first) = self.positions.first() else { return (Vec3::ZERO, Vec3::ZERO) };
        self.positions.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)))
    }

    /// Sets the normals from the triangles, weighted by area.
    ///
    /// `shared[v]` is the vertex whose normal `v` shares, or `v` itself, so that seams don't show.
    pub(crate) fn compute_normals(&mut self, shared: &[u32]) {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
            let doubled_area = (b - a).cross(c - a);
            for corner in corners {
                sums[shared[*corner as usize] as usize] += doubled_area;
            }
        }
        self.normals = shared.iter().map(|&vertex| sums[vertex as usize].normalize_or(Vec3::Y)).collect();
    }
}
