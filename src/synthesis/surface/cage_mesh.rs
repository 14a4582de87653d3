//! The cage itself as a mesh, without any subdivision.

use super::half_edges::HalfEdges;
use super::mesh::SurfaceMesh;
use crate::synthesis::pace::Pace;
use bevy_math::{Vec2, Vec3};

const NONE: u32 = u32::MAX;

/// The mesh of half-edges as they are. A pentagon becomes a quad and a triangle.
pub(super) async fn as_it_is(half_edges: HalfEdges, origin: Vec3, pace: &Pace) -> SurfaceMesh {
    let unique = half_edges.vertices.positions.len();
    let mut mesh = SurfaceMesh {
        positions: half_edges.vertices.positions.iter().map(|position| origin + *position).collect(),
        normals: half_edges.face_normals(),
        uvs: vec![Vec2::NAN; unique],
        ..SurfaceMesh::default()
    };
    // Copies of a vertex are a chain from the vertex on.
    let mut next = vec![NONE; unique];
    for face in 0..half_edges.face_count() {
        let corners: Vec<u32> = half_edges
            .face(face)
            .map(|half_edge| {
                let (vertex, uv) = (half_edges.origins[half_edge as usize], half_edges.uvs[half_edge as usize]);
                vertex_with(&mut mesh, vertex, uv, &mut next)
            })
            .collect();
        match corners[..] {
            [a, b, c, d] => mesh.faces.push([a, b, c, d]),
            [a, b, c, d, e] => mesh.faces.extend([[a, b, c, d], [a, d, e, e]]),
            _ => mesh
                .faces
                .extend((2..corners.len()).map(|last| [corners[0], corners[last - 1], corners[last], corners[last]])),
        }
    }
    (mesh.radii, mesh.nodes) = (half_edges.vertices.radii, half_edges.vertices.nodes);
    mesh.complete();
    pace.rest(1.0).await;
    mesh
}

/// The vertex itself if it has these coordinates or none yet, or a copy that has them.
fn vertex_with(mesh: &mut SurfaceMesh, vertex: u32, uv: Vec2, next: &mut Vec<u32>) -> u32 {
    if mesh.uvs[vertex as usize].is_nan() {
        mesh.uvs[vertex as usize] = uv;
        return vertex;
    }
    let mut here = vertex;
    while mesh.uvs[here as usize] != uv {
        if next[here as usize] == NONE {
            let copy = mesh.uvs.len() as u32;
            next[here as usize] = copy;
            next.push(NONE);
            mesh.uvs.push(uv);
            mesh.copies.push(vertex);
            return copy;
        }
        here = next[here as usize];
    }
    here
}
