//! Checks a surface, and names the vessels of its faults.

use super::mesh::SurfaceMesh;
use crate::synthesis::mesh::{Closure, self_intersections_paced};
use crate::synthesis::pace::{Pace, at_once};
use crate::synthesis::tree::NodeId;

/// What was found in a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceCheck {
    /// How the surface closes.
    pub closure: Closure,
    /// Pairs of triangles that meet though they should not, by their numbers in
    /// [`closed_triangles`](SurfaceMesh::closed_triangles), the lower first.
    pub intersections: Vec<[u32; 2]>,
    /// The segments of these triangles, by their nodes, the lower first; each pair once. A segment may meet itself.
    pub vessels: Vec<[NodeId; 2]>,
    /// Vertices with a position, normal or texture coordinate that is not finite.
    pub not_finite: Vec<u32>,
}

impl SurfaceCheck {
    /// Whether the surface is closed and oriented, and has no face without area, no place that is not finite, and no
    /// two faces that meet.
    pub fn is_sound(&self) -> bool {
        let Self { closure, intersections, not_finite, .. } = self;
        closure.is_closed()
            && closure.is_oriented()
            && closure.is_manifold()
            && closure.degenerate_faces == 0
            && intersections.is_empty()
            && not_finite.is_empty()
    }

    /// Number of triangles that meet others.
    pub fn intersecting_triangles(&self) -> usize {
        let mut triangles: Vec<u32> = self.intersections.iter().flatten().copied().collect();
        triangles.sort_unstable();
        triangles.dedup();
        triangles.len()
    }
}

impl SurfaceMesh {
    /// Checks the surface, exactly: about a million triangles a second.
    pub fn validate(&self) -> SurfaceCheck {
        at_once(self.validate_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn validate_paced(&self, pace: &Pace) -> SurfaceCheck {
        let triangles: Vec<[u32; 3]> = self.closed_triangles().collect();
        let closure = Closure::of(&self.positions, &triangles);
        pace.rest(0.1).await;
        let intersections = self_intersections_paced(&self.positions, &triangles, &pace.part(0.1..1.0)).await;
        let node = |triangle: u32| self.nodes[triangles[triangle as usize][0] as usize];
        let mut vessels: Vec<[NodeId; 2]> = intersections
            .iter()
            .map(|pair| {
                let [a, b] = pair.map(node);
                [NodeId(a.min(b)), NodeId(a.max(b))]
            })
            .collect();
        vessels.sort_unstable();
        vessels.dedup();
        let is_finite = |vertex: usize| {
            self.positions[vertex].is_finite() && self.normals[vertex].is_finite() && self.uvs[vertex].is_finite()
        };
        let not_finite = (0..self.positions.len()).filter(|&vertex| !is_finite(vertex)).map(|vertex| vertex as u32);
        SurfaceCheck { closure, intersections, vessels, not_finite: not_finite.collect() }
    }
}
