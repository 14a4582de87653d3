//! A closed surface as a Bevy mesh.

use crate::synthesis::{binding::SkinVertex, surface::SurfaceMesh};
use bevy::{
    asset::RenderAssetUsages,
    camera::primitives::Aabb,
    math::{Vec3, Vec4},
    mesh::{Indices, Mesh, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues},
};
use std::sync::Arc;

/// Most vertices that indices of 16 bits can count; the last index is reserved.
const MOST_SHORT: usize = u16::MAX as usize;

/// A triangle list with positions, normals, texture coordinates and tangents, in the space of the tree. Both worlds keep
/// it. Vertices have the order of the surface.
impl From<&SurfaceMesh> for Mesh {
    fn from(surface: &SurfaceMesh) -> Self {
        mesh_around(surface, Vec3::ZERO, surface.tangents())
    }
}

/// The same, with positions from an origin, and the surface's tangents.
pub(super) fn mesh_around(surface: &SurfaceMesh, origin: Vec3, tangents: Vec<Vec4>) -> Mesh {
    let positions: Vec<[f32; 3]> = surface.positions.iter().map(|&at| (at - origin).to_array()).collect();
    let indices = surface.triangles().flatten();
    let indices = if positions.len() <= MOST_SHORT {
        Indices::U16(indices.map(|vertex| vertex as u16).collect())
    } else {
        Indices::U32(indices.collect())
    };
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, surface.normals.clone())
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, surface.uvs.clone())
        .with_inserted_attribute(Mesh::ATTRIBUTE_TANGENT, tangents)
        .with_inserted_indices(indices)
}

/// Writes moved vertices into a mesh that was made by [`mesh_around`]. A mesh that an app has changed otherwise keeps
/// what doesn't fit.
pub(super) fn write_vertices(
    mesh: &mut Mesh,
    origin: Vec3,
    vertices: impl ExactSizeIterator<Item = SkinVertex> + Clone,
) {
    write(mesh, Mesh::ATTRIBUTE_POSITION, vertices.clone().map(|vertex| vertex.position - origin));
    write(mesh, Mesh::ATTRIBUTE_NORMAL, vertices.clone().map(|vertex| vertex.normal));
    if let Ok(VertexAttributeValues::Float32x4(tangents)) = mesh.try_attribute_mut(Mesh::ATTRIBUTE_TANGENT) {
        for (out, vertex) in tangents.iter_mut().zip(vertices) {
            let [x, y, z] = vertex.tangent.to_array();
            *out = [x, y, z, out[3]];
        }
    }
}

fn write(mesh: &mut Mesh, attribute: MeshVertexAttribute, values: impl Iterator<Item = Vec3>) {
    if let Ok(VertexAttributeValues::Float32x3(out)) = mesh.try_attribute_mut(attribute) {
        for (out, value) in out.iter_mut().zip(values) {
            *out = value.to_array();
        }
    }
}

/// The vertices of a surface at rest.
pub(super) fn at_rest(surface: &SurfaceMesh) -> impl ExactSizeIterator<Item = SkinVertex> + Clone {
    let tangents: Arc<[Vec4]> = surface.tangents().into();
    (0..surface.positions.len()).map(move |vertex| SkinVertex {
        position: surface.positions[vertex],
        normal: surface.normals[vertex],
        tangent: tangents[vertex].truncate(),
    })
}

/// The box around some points from an origin, with some room.
pub(super) fn box_around(points: impl Iterator<Item = Vec3>, origin: Vec3, room: f32) -> Aabb {
    let bounds = points.fold(None, |bounds: Option<(Vec3, Vec3)>, point| {
        let (low, high) = bounds.unwrap_or((point, point));
        Some((low.min(point), high.max(point)))
    });
    bounds.map_or_else(Aabb::default, |(low, high)| Aabb::from_min_max(low - origin - room, high - origin + room))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plugin::triangle_mesh,
        synthesis::{
            surface::{Surface, SurfaceSettings},
            tree::{NO_PARENT, VesselTree},
        },
    };

    #[test]
    fn a_surface_keeps_its_triangles_on_the_way_through_bevy() {
        let tree =
            VesselTree::from_arrays(vec![Vec3::ZERO, Vec3::X], vec![NO_PARENT, 0], vec![0.1; 2]).expect("a tree");
        for (level, is_short) in [(1, true), (4, false)] {
            let settings = SurfaceSettings { level, most_sides: 64, least_sides: 64, ..SurfaceSettings::default() };
            let surface = Surface::new(&tree, &settings).expect("a surface").mesh;
            let mesh = Mesh::from(&surface);
            assert_eq!(matches!(mesh.indices(), Some(Indices::U16(_))), is_short, "{} vertices", mesh.count_vertices());
            let read = triangle_mesh(&mesh).expect("it is a mesh");
            assert_eq!(read.positions(), surface.positions);
            assert!(read.triangles().iter().copied().eq(surface.triangles()));
        }
    }
}
