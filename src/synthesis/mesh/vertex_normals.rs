//! Normals at the vertices of a mesh.

use super::{TriangleMesh, Welding, doubled_normal, unit};
use crate::synthesis::pace::{Pace, at_once};
use bevy_math::{DVec3, Vec3};

/// Share of the summed areas below which the sum of their normals is rounding: they cancel out.
const CANCELLED_SHARE: f64 = 1.0e-6;

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
        let normal = |triangle| doubled_normal(self.corners(triangle));
        at_once(self.vertex_normals_paced(welding, normal, &Pace::default()))
    }

    /// The same with a given normal of each triangle, as long as its weight. A [paced](crate::synthesis::pace) work.
    pub(crate) async fn vertex_normals_paced(
        &self,
        welding: &Welding,
        normal: impl Fn(usize) -> DVec3,
        pace: &Pace,
    ) -> Vec<Vec3> {
        let mut sums = vec![(DVec3::ZERO, 0.0); welding.count()];
        let add = |triangle: usize| {
            let normal = normal(triangle);
            let weight = normal.length();
            for &corner in &self.triangles()[triangle] {
                let (sum, weights) = &mut sums[welding.vertex(corner)];
                *sum += normal;
                *weights += weight;
            }
        };
        pace.part(0.0..0.6).each(self.triangles().len(), add).await;
        let mean = |welded: usize| {
            let (sum, weights): (DVec3, f64) = sums[welded];
            if sum.length() > CANCELLED_SHARE * weights { unit(sum) } else { Vec3::ZERO }
        };
        let normals: Vec<Vec3> = pace.part(0.6..0.9).collect(sums.len(), mean).await;
        pace.part(0.9..1.0).collect(self.positions().len(), |vertex| normals[welding.vertex(vertex as u32)]).await
    }
}
