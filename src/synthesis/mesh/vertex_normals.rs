//! Normals at the vertices of a mesh.

use super::{TriangleMesh, Welding, doubled_normal, unit};
use crate::synthesis::pace::{Pace, at_once};
use bevy_math::{DVec3, Vec3};

impl TriangleMesh {
    /// Unit normal of every vertex: the mean over its triangles, weighted by their area.
    ///
    /// Vertices at the same position share one normal, so that texture seams don't show. `Vec3::ZERO` for a vertex
    /// without triangles, or whose triangles cancel out.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        self.vertex_normals_with(&self.weld())
    }

    /// [`vertex_normals`](Self::vertex_normals) with an existing welding.
    pub fn vertex_normals_with(&self, welding: &Welding) -> Vec<Vec3> {
        at_once(self.vertex_normals_paced(welding, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn vertex_normals_paced(&self, welding: &Welding, pace: &Pace) -> Vec<Vec3> {
        let mut sums = vec![DVec3::ZERO; welding.count()];
        let add = |triangle: usize| {
            let normal = doubled_normal(self.corners(triangle));
            for &corner in &self.triangles()[triangle] {
                sums[welding.vertex(corner)] += normal;
            }
        };
        pace.part(0.0..0.6).each(self.triangles().len(), add).await;
        let normals: Vec<Vec3> = pace.part(0.6..0.9).collect(sums.len(), |welded| unit(sums[welded])).await;
        pace.part(0.9..1.0).collect(self.positions().len(), |vertex| normals[welding.vertex(vertex as u32)]).await
    }
}
