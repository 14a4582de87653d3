//! Triangle meshes of organs: checked once, then safe for every stage.
//!
//! In: positions, triangles and optional texture coordinates, as in a file or an engine's mesh: vertices may be
//! duplicated along seams, triangles may be degenerate. [`TriangleMesh::new`] refuses only meshes that no stage can
//! use, and says why. Out: measures ([area](TriangleMesh::area), [volume](TriangleMesh::signed_volume),
//! [bounds](TriangleMesh::bounds)), smooth [normals](TriangleMesh::vertex_normals) and the
//! [`topology`](super::topology).

use crate::synthesis::pace::{Pace, at_once};
use bevy_math::{
    DVec3, Vec2, Vec3,
    bounding::{Aabb3d, BoundingVolume},
};

/// Largest absolute coordinate of a vertex, in tissue lengths. Squares of areas stay finite below it.
pub const MAX_COORDINATE: f32 = 1.0e9;

/// Whether all coordinates are finite and within [`MAX_COORDINATE`].
pub(crate) fn is_usable(position: Vec3) -> bool {
    // The maximum of NaN and a number may be the number, so both are tested.
    position.is_finite() && position.abs().max_element() <= MAX_COORDINATE
}

/// Most triangles of a mesh, and most vertices.
pub const MAX_TRIANGLES: usize = 1 << 26;

/// Area of a triangle, relative to the square of its longest edge, below which it counts as degenerate.
const DEGENERATE_SHAPE: f64 = 1.0e-10;

/// Why a mesh cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No vertices, or no triangles.
    #[error("the mesh has {vertices} vertices and {triangles} triangles; it needs at least 3 and 1")]
    Empty {
        /// Number of vertices.
        vertices: usize,
        /// Number of triangles.
        triangles: usize,
    },
    /// More vertices or triangles than [`MAX_TRIANGLES`].
    #[error("the mesh has {count} {what}, more than {MAX_TRIANGLES}; decimate it first")]
    TooLarge {
        /// What exceeds the limit.
        what: &'static str,
        /// Their number.
        count: usize,
    },
    /// A vertex with a NaN or infinite coordinate, or one beyond [`MAX_COORDINATE`].
    #[error(
        "vertex {vertex} is at {position}; coordinates must be finite and within ±{MAX_COORDINATE}: repair or rescale the mesh"
    )]
    BadPosition {
        /// The first such vertex.
        vertex: usize,
        /// Its position.
        position: Vec3,
    },
    /// A triangle with a vertex that does not exist.
    #[error(
        "triangle {triangle} refers to vertex {index}, but there are {vertices} vertices; the index buffer is damaged"
    )]
    IndexOutOfRange {
        /// The first such triangle.
        triangle: usize,
        /// The index found.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Texture coordinates that are not one per vertex.
    #[error("the mesh has {uvs} texture coordinates for {vertices} vertices; give one per vertex, or none")]
    UvCount {
        /// Number of texture coordinates.
        uvs: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// Every triangle is degenerate.
    #[error(
        "all {triangles} triangles have no area (their corners coincide or lie on a line); the mesh is collapsed, perhaps by a scale of 0"
    )]
    NoArea {
        /// Number of triangles.
        triangles: usize,
    },
}

/// An indexed triangle mesh, checked by [`new`](Self::new).
///
/// It has at least one triangle with an area, every index is in range and every coordinate finite. Triangles are
/// counter-clockwise seen from outside where the mesh has an outside.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) uvs: Option<Vec<Vec2>>,
}

impl TriangleMesh {
    /// Checks and takes over a mesh. `uvs`, if any, are one per vertex.
    ///
    /// Duplicated vertices and degenerate triangles are kept, so that vertex and triangle numbers stay those of the
    /// source; see [`welded`](Self::welded) for a copy without them.
    ///
    /// # Errors
    /// The first error that makes the mesh unusable: see [`MeshError`].
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, uvs: Option<Vec<Vec2>>) -> Result<Self, MeshError> {
        at_once(Self::new_paced(positions, triangles, uvs, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        uvs: Option<Vec<Vec2>>,
        pace: &Pace,
    ) -> Result<Self, MeshError> {
        let (vertices, count) = (positions.len(), triangles.len());
        for (what, count) in [("vertices", vertices), ("triangles", count)] {
            if count > MAX_TRIANGLES {
                return Err(MeshError::TooLarge { what, count });
            }
        }
        if vertices < 3 || count == 0 {
            return Err(MeshError::Empty { vertices, triangles: count });
        }
        if let Some(vertex) = pace.part(0.0..0.4).find(vertices, |vertex| !is_usable(positions[vertex])).await {
            return Err(MeshError::BadPosition { vertex, position: positions[vertex] });
        }
        let is_missing = |index: u32| index as usize >= vertices;
        let is_damaged = |triangle: usize| triangles[triangle].iter().any(|&index| is_missing(index));
        if let Some(triangle) = pace.part(0.4..0.9).find(count, is_damaged).await
            && let Some(&index) = triangles[triangle].iter().find(|&&index| is_missing(index))
        {
            return Err(MeshError::IndexOutOfRange { triangle, index, vertices });
        }
        if let Some(uvs) = &uvs
            && uvs.len() != vertices
        {
            return Err(MeshError::UvCount { uvs: uvs.len(), vertices });
        }
        let mesh = Self { positions, triangles, uvs };
        // This is nearly always the first triangle.
        if pace.part(0.9..1.0).find(count, |triangle| !mesh.is_degenerate(triangle)).await.is_none() {
            return Err(MeshError::NoArea { triangles: count });
        }
        Ok(mesh)
    }

    /// Position of every vertex, in tissue lengths.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The three vertices of every triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Texture coordinates, one per vertex, if the mesh has any.
    pub fn uvs(&self) -> Option<&[Vec2]> {
        self.uvs.as_deref()
    }

    /// The corners of a triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|index| self.positions[index as usize])
    }

    /// The smallest box that holds every triangle with an area.
    pub fn bounds(&self) -> Aabb3d {
        at_once(self.bounds_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn bounds_paced(&self, pace: &Pace) -> Aabb3d {
        let mut min = Vec3::INFINITY;
        let mut max = Vec3::NEG_INFINITY;
        let enclose = |triangle: usize| {
            let corners = self.corners(triangle);
            if !is_degenerate(corners) {
                for position in corners {
                    min = min.min(position);
                    max = max.max(position);
                }
            }
        };
        pace.each(self.triangles.len(), enclose).await;
        Aabb3d { min: min.into(), max: max.into() }
    }

    /// Area of a triangle, in square tissue lengths.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn triangle_area(&self, triangle: usize) -> f64 {
        0.5 * doubled_normal(self.corners(triangle)).length()
    }

    /// Whether a triangle has no significant area: its corners coincide or lie on a line.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn is_degenerate(&self, triangle: usize) -> bool {
        is_degenerate(self.corners(triangle))
    }

    /// Area of all triangles, in square tissue lengths.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|triangle| self.triangle_area(triangle)).sum()
    }

    /// Volume enclosed by the triangles, by the divergence theorem, in cubic tissue lengths.
    ///
    /// Negative if triangles face inwards. Meaningless for an open mesh. An overlap of shells counts once for each.
    pub fn signed_volume(&self) -> f64 {
        at_once(self.signed_volume_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn signed_volume_paced(&self, pace: &Pace) -> f64 {
        // Relative to the centre, so that the terms of a mesh far from the origin do not cancel.
        let origin = self.bounds_paced(&pace.part(0.0..0.4)).await.center();
        let volume = |triangle: usize| tetrahedron_volume(self.corners(triangle), origin.into());
        pace.part(0.4..1.0).sum(self.triangles.len(), volume).await
    }

    /// Unit normal of a triangle, `Vec3::ZERO` if it is degenerate.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn triangle_normal(&self, triangle: usize) -> Vec3 {
        unit(doubled_normal(self.corners(triangle)))
    }

    /// The same mesh with those triangles reversed for whose number `flip` returns true.
    #[must_use]
    pub fn with_flipped(self, flip: impl Fn(usize) -> bool) -> Self {
        at_once(self.with_flipped_paced(flip, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn with_flipped_paced(mut self, flip: impl Fn(usize) -> bool, pace: &Pace) -> Self {
        let (count, triangles) = (self.triangles.len(), &mut self.triangles);
        let turn = |triangle: usize| {
            if flip(triangle) {
                triangles[triangle].swap(1, 2);
            }
        };
        pace.each(count, turn).await;
        self
    }
}

/// Whether three corners coincide or lie on a line.
pub(crate) fn is_degenerate(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    // NaN and a longest edge of 0 fail it, too.
    let has_area = (b - a).cross(c - a).length() > DEGENERATE_SHAPE * longest;
    !has_area
}

/// The normal of a triangle, as long as twice its area.
pub(crate) fn doubled_normal(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    (b - a).cross(c - a)
}

/// Signed volume of the tetrahedron between a triangle and `origin`, positive if the triangle faces away from it.
pub(crate) fn tetrahedron_volume(corners: [Vec3; 3], origin: Vec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - origin.as_dvec3());
    a.dot(b.cross(c)) / 6.0
}

/// A vector scaled to length 1, or zero.
pub(crate) fn unit(vector: DVec3) -> Vec3 {
    vector.try_normalize().map_or(Vec3::ZERO, |unit| unit.as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(positions: [Vec3; 3]) -> Result<TriangleMesh, MeshError> {
        TriangleMesh::new(positions.to_vec(), vec![[0, 1, 2]], None)
    }

    #[test]
    fn a_triangle_has_its_area_and_normal() -> Result<(), MeshError> {
        let mesh = triangle([Vec3::ZERO, Vec3::X * 2.0, Vec3::Y])?;
        assert_eq!(mesh.area(), 1.0);
        assert_eq!(mesh.triangle_normal(0), Vec3::Z);
        assert_eq!(mesh.vertex_normals(), [Vec3::Z; 3]);
        assert_eq!(mesh.bounds(), Aabb3d { min: Vec3::ZERO.into(), max: Vec3::new(2.0, 1.0, 0.0).into() });
        Ok(())
    }

    #[test]
    fn unusable_meshes_are_refused_by_name() {
        assert_eq!(TriangleMesh::new(vec![], vec![], None), Err(MeshError::Empty { vertices: 0, triangles: 0 }));
        let bad = triangle([Vec3::ZERO, Vec3::new(0.0, f32::NAN, 0.0), Vec3::Y]);
        assert!(matches!(bad, Err(MeshError::BadPosition { vertex: 1, .. })));
        let bad = triangle([Vec3::ZERO, Vec3::X, Vec3::INFINITY]);
        assert!(matches!(bad, Err(MeshError::BadPosition { vertex: 2, .. })));
        let bad = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 7]], None);
        assert_eq!(bad, Err(MeshError::IndexOutOfRange { triangle: 0, index: 7, vertices: 3 }));
        let bad = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], Some(vec![Vec2::ZERO]));
        assert_eq!(bad, Err(MeshError::UvCount { uvs: 1, vertices: 3 }));
        assert_eq!(triangle([Vec3::X, Vec3::X, Vec3::Y]), Err(MeshError::NoArea { triangles: 1 }));
        assert_eq!(triangle([Vec3::X, Vec3::X * 2.0, Vec3::X * 3.0]), Err(MeshError::NoArea { triangles: 1 }));
    }

    #[test]
    fn tiny_and_distant_triangles_are_not_degenerate() {
        let tiny = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner * 1e-15);
        assert!(triangle(tiny).is_ok_and(|mesh| mesh.triangle_normal(0) == Vec3::Z));
        let distant = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| corner * 1e8);
        assert!(triangle(distant).is_ok());
    }
}
