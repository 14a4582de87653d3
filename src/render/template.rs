//! The mesh that all chunks share: copies of a cone with round ends, shaped on the GPU.

use crate::plugin::SegmentChanges;
use bevy::{
    asset::RenderAssetUsages,
    math::ops,
    mesh::{Indices, Mesh, PrimitiveTopology},
};
use std::f32::consts::TAU;

/// Segments that one chunk entity draws.
pub const SEGMENTS_PER_CHUNK: usize = SegmentChanges::CHUNK;

/// Builds the chunk mesh: [`SEGMENTS_PER_CHUNK`] copies of a template with `sides` corners around and `cap_rings` rings
/// between the rim and the pole of its far end.
///
/// What the attributes hold is for the shader: the position is cosine and sine around the axis and the end (0 or 1), the
/// texture coordinate is the segment within the chunk and the latitude within the cap. The near end has a plain cap: it
/// sits in the round end of the parent segment, and is seen at roots only.
pub fn chunk_mesh(sides: u32, cap_rings: u32) -> Mesh {
    let mut template = Template::default();
    for slot in 0..SEGMENTS_PER_CHUNK {
        template.push_segment(slot as f32, sides, cap_rings);
    }
    // the shapes exist on the GPU alone: a copy in the main world would only mislead picking and bounding boxes
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, template.around)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, template.normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, template.place)
        .with_inserted_indices(Indices::U32(template.indices))
}

#[derive(Default)]
struct Template {
    around: Vec<[f32; 3]>,
    /// Not read by the shader, which knows the true normals; Bevy's normal prepass expects the attribute.
    normals: Vec<[f32; 3]>,
    place: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Template {
    fn push_segment(&mut self, slot: f32, sides: u32, cap_rings: u32) {
        let near_pole = self.push_vertex(slot, [1.0, 0.0, 0.0], 1.0);
        let near_rim = self.push_ring(slot, sides, 0.0, 0.0);
        let mut ring = self.push_ring(slot, sides, 1.0, 0.0);
        self.fan(near_pole, near_rim, sides, true);
        self.band(near_rim, ring, sides);
        for cap_ring in 1..=cap_rings {
            let next = self.push_ring(slot, sides, 1.0, cap_ring as f32 / (cap_rings + 1) as f32);
            self.band(ring, next, sides);
            ring = next;
        }
        let far_pole = self.push_vertex(slot, [1.0, 0.0, 1.0], 1.0);
        self.fan(far_pole, ring, sides, false);
    }

    fn push_vertex(&mut self, slot: f32, around: [f32; 3], latitude: f32) -> u32 {
        let index = self.around.len() as u32;
        self.around.push(around);
        self.normals.push([around[0], around[1], 0.0]);
        self.place.push([slot, latitude]);
        index
    }

    /// A ring of vertices, counter-clockwise seen from the far end; returns its first index.
    fn push_ring(&mut self, slot: f32, sides: u32, end: f32, latitude: f32) -> u32 {
        let first = self.around.len() as u32;
        for side in 0..sides {
            let (sin, cos) = ops::sin_cos(TAU * side as f32 / sides as f32);
            self.push_vertex(slot, [cos, sin, end], latitude);
        }
        first
    }

    /// Two triangles per side between a ring and the next one towards the far end.
    fn band(&mut self, near: u32, far: u32, sides: u32) {
        for side in 0..sides {
            let next = (side + 1) % sides;
            let (a, b, c, d) = (near + side, near + next, far + next, far + side);
            self.indices.extend([a, b, c, a, c, d]);
        }
    }

    /// One triangle per side between a pole and its ring.
    fn fan(&mut self, pole: u32, ring: u32, sides: u32, near_end: bool) {
        for side in 0..sides {
            let (a, b) = (ring + side, ring + (side + 1) % sides);
            self.indices.extend(if near_end { [pole, b, a] } else { [pole, a, b] });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::mesh::VertexAttributeValues;
    use std::collections::BTreeSet;

    /// Directed edges of the first segment's triangles.
    fn first_segment_edges(mesh: &Mesh, vertices: u32) -> Vec<(u32, u32)> {
        let Some(Indices::U32(indices)) = mesh.indices() else { panic!("32-bit indices") };
        indices
            .chunks(3)
            .filter(|triangle| triangle[0] < vertices)
            .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
            .collect()
    }

    #[test]
    fn every_segment_is_a_closed_oriented_surface() {
        for (sides, cap_rings) in [(3, 0), (8, 1), (12, 3)] {
            let mesh = chunk_mesh(sides, cap_rings);
            let vertices = (2 + sides * (2 + cap_rings)) as usize;
            assert_eq!(mesh.count_vertices(), vertices * SEGMENTS_PER_CHUNK);
            let edges = first_segment_edges(&mesh, vertices as u32);
            let unique: BTreeSet<_> = edges.iter().copied().collect();
            assert_eq!(unique.len(), edges.len(), "no edge is used twice in one direction");
            assert!(edges.iter().all(|&(a, b)| unique.contains(&(b, a))), "every edge has its twin");
            let (v, e, f) = (vertices as isize, edges.len() as isize / 2, edges.len() as isize / 3);
            assert_eq!(v - e + f, 2);
        }
    }

    #[test]
    fn triangles_face_outwards() {
        let mesh = chunk_mesh(8, 1);
        let Some(VertexAttributeValues::Float32x3(around)) = mesh.attribute(Mesh::ATTRIBUTE_POSITION) else {
            panic!("three floats")
        };
        let Some(Indices::U32(indices)) = mesh.indices() else { panic!("32-bit indices") };
        // the template as a cylinder: sides only, where normals are radial
        let sides = indices.chunks(3).filter(|t| t.iter().all(|&i| mesh_latitude(&mesh, i) == 0.0));
        for triangle in sides.take(16) {
            let [a, b, c] = [0, 1, 2].map(|k| bevy::math::Vec3::from(around[triangle[k] as usize]));
            let outwards = (a + b + c) * bevy::math::Vec3::new(1.0, 1.0, 0.0);
            assert!((b - a).cross(c - a).dot(outwards) > 0.0);
        }
    }

    fn mesh_latitude(mesh: &Mesh, vertex: u32) -> f32 {
        let Some(VertexAttributeValues::Float32x2(place)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else {
            panic!("two floats")
        };
        place[vertex as usize][1]
    }
}
