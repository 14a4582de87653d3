//! A shared mesh with an index of its triangles, to evaluate vertex values anywhere.

use super::{SurfacePoint, TriangleIndex, TriangleMesh};
use crate::synthesis::pace::{Pace, at_once};
use bevy_math::Vec3;
use std::sync::Arc;

/// A mesh and the index of its triangles. A clone shares both.
#[derive(Clone, Debug)]
pub struct IndexedMesh {
    mesh: Arc<TriangleMesh>,
    index: Arc<TriangleIndex>,
}

impl IndexedMesh {
    /// Indexes a mesh.
    pub fn new(mesh: impl Into<Arc<TriangleMesh>>) -> Self {
        at_once(Self::new_paced(mesh.into(), &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn new_paced(mesh: Arc<TriangleMesh>, pace: &Pace) -> Self {
        let index = Arc::new(TriangleIndex::new_paced(&mesh, pace).await);
        Self { mesh, index }
    }

    /// Indexes a mesh whose [faces](TriangleMesh::faces_paced) are known.
    pub(crate) async fn of_paced(mesh: Arc<TriangleMesh>, faces: &[u32], pace: &Pace) -> Self {
        let index = Arc::new(TriangleIndex::of_paced(&mesh, faces, pace).await);
        Self { mesh, index }
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The index of its triangles.
    pub fn index(&self) -> &TriangleIndex {
        &self.index
    }

    /// The value at a point of the mesh, given one value for each vertex: linear over each triangle.
    ///
    /// # Panics
    /// If there are fewer values than vertices.
    pub fn value_at(&self, point: &SurfacePoint, values: &[f32]) -> f32 {
        let corners = self.mesh.triangles()[point.triangle].map(|vertex| values[vertex as usize]);
        Vec3::from_array(corners).dot(point.barycentric)
    }

    /// The value at the point of the mesh nearest to `point`; `None` if that is not finite.
    ///
    /// # Panics
    /// If there are fewer values than vertices.
    pub fn value_near(&self, point: Vec3, values: &[f32]) -> Option<f32> {
        self.index.closest(point).map(|found| self.value_at(&found, values))
    }
}
