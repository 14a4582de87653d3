//! Which triangles of a mesh face inwards, so that vessels are lifted off the outside.
//!
//! In: a mesh as files have it, with shells that are reversed, holed or open. Out: the triangles to be turned. A shell is
//! a part of the surface joined by edges with two triangles. It faces outwards if it encloses a positive volume: that of
//! a closed shell is exact, that of a holed or open one is measured about its own centre. Sheets enclose next to
//! nothing. They stay as they are, unless all of them together enclose something: the walls of a box, unconnected.

use super::{
    MeshTopology, TriangleIndex, TriangleMesh, doubled_normal, tetrahedron_volume,
    topology::Patches,
    winding::{largest_of, shells_against},
};
use crate::synthesis::pace::Pace;
use bevy_math::DVec3;

/// Volume that an open part must enclose to have an inside, relative to a ball with the same area.
const ENCLOSING: f64 = 0.1;

/// What a part of a surface amounts to.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    area: f64,
    /// The sum over all triangles of area times centre.
    moment: DVec3,
    /// The sum of areas along the normals: zero if the part is closed.
    flow: DVec3,
    /// Volume about the origin of measurement.
    volume: f64,
}

impl Part {
    fn add(&mut self, other: &Self) {
        self.area += other.area;
        self.moment += other.moment;
        self.flow += other.flow;
        self.volume += other.volume;
    }

    /// Volume about its own centre.
    fn own_volume(&self) -> f64 {
        if self.area > 0.0 { self.volume - (self.moment / self.area).dot(self.flow) / 3.0 } else { 0.0 }
    }

    /// Whether it encloses a volume worth speaking of.
    fn encloses(&self) -> bool {
        let ball = self.area * (self.area / std::f64::consts::PI).sqrt() / 6.0;
        self.own_volume().abs() > ENCLOSING * ball
    }
}

/// Which triangles face inwards. `index` is that of the mesh.
pub(crate) async fn inward_triangles(
    mesh: &TriangleMesh,
    topology: &MeshTopology,
    index: &TriangleIndex,
    pace: &Pace,
) -> Vec<bool> {
    let misoriented = topology.misoriented_paced(mesh, &pace.part(0.0..0.4)).await;
    let mesh = mesh.clone().with_flipped_paced(|triangle| misoriented[triangle], &pace.part(0.4..0.45)).await;
    let (patches, closed) = topology.manifold_patches(&pace.part(0.45..0.7)).await;
    let parts = parts(&mesh, &patches, &pace.part(0.7..0.8)).await;
    let volumes: Vec<f64> = parts.iter().map(Part::own_volume).collect();
    // Closed shells agree with the largest of them, except cavities in it.
    let mut inward = shells_against(&mesh, &patches, &closed, &volumes, index, &pace.part(0.8..0.9)).await;
    let whole = largest_of(volumes.iter().zip(&closed).filter(|&(_, &closed)| closed).map(|(&volume, _)| volume));
    let is_sheet = |patch: usize| !closed[patch] && !parts[patch].encloses();
    let mut sheets = Part::default();
    (0..patches.count).filter(|&patch| is_sheet(patch)).for_each(|patch| sheets.add(&parts[patch]));
    let sheets_face_in = sheets.encloses() && sheets.own_volume() < 0.0;
    for (patch, inward) in inward.iter_mut().enumerate() {
        *inward = match (closed[patch], is_sheet(patch)) {
            (true, _) => *inward != (whole < 0.0),
            (false, true) => sheets_face_in,
            (false, false) => volumes[patch] < 0.0,
        };
    }
    let is_inward = |triangle: usize| {
        patches.of_triangle[triangle].is_some_and(|patch| misoriented[triangle] != inward[patch as usize])
    };
    pace.part(0.9..1.0).collect(misoriented.len(), is_inward).await
}

async fn parts(mesh: &TriangleMesh, patches: &Patches, pace: &Pace) -> Vec<Part> {
    let mut parts = vec![Part::default(); patches.count];
    // Near the mesh, so that the terms of one far from the origin do not cancel.
    let origin = mesh.corners(0)[0];
    let add = |triangle: usize| {
        if let Some(patch) = patches.of_triangle[triangle] {
            let corners = mesh.corners(triangle);
            let (flow, center) = (0.5 * doubled_normal(corners), corners.map(|corner| corner.as_dvec3() / 3.0));
            let center = center[0] + center[1] + center[2] - origin.as_dvec3();
            let (area, volume) = (flow.length(), tetrahedron_volume(corners, origin));
            parts[patch as usize].add(&Part { area, moment: area * center, flow, volume });
        }
    };
    pace.each(patches.of_triangle.len(), add).await;
    parts
}
