//! Which vertices of a mesh are the same: by position, by texture coordinates, and by all.

use crate::synthesis::mesh::TriangleMesh;
use crate::synthesis::pace::Pace;
use bevy_math::{Vec2, Vec3};

/// For every vertex, the first of those that are the same.
#[derive(Clone, Debug)]
pub(super) struct Welds {
    /// The same position.
    pub position: Vec<u32>,
    /// The same position and texture coordinates: what a chart holds together.
    pub chart: Vec<u32>,
    /// The same normal as well: what shares a tangent.
    pub whole: Vec<u32>,
}

impl Welds {
    /// Welds the vertices of a mesh.
    pub async fn of(mesh: &TriangleMesh, uvs: &[Vec2], normals: &[Vec3], pace: &Pace) -> Self {
        let welding = mesh.weld_paced(&pace.part(0.0..0.6)).await;
        let vertices = uvs.len();
        // The vertices at each position, as a list of lists.
        let mut starts = vec![0u32; welding.count() + 1];
        (0..vertices).for_each(|vertex| starts[welding.vertex(vertex as u32) + 1] += 1);
        (0..welding.count()).for_each(|at| starts[at + 1] += starts[at]);
        let (mut members, mut next) = (vec![0u32; vertices], starts.clone());
        for vertex in 0..vertices as u32 {
            let place = &mut next[welding.vertex(vertex)];
            members[*place as usize] = vertex;
            *place += 1;
        }
        let mut welds = Self { position: vec![0; vertices], chart: vec![0; vertices], whole: vec![0; vertices] };
        let at_position = |at: usize| {
            let group = &members[starts[at] as usize..starts[at + 1] as usize];
            for (number, &vertex) in group.iter().enumerate() {
                let v = vertex as usize;
                let same_uv = |&&other: &&u32| uvs[other as usize] == uvs[v];
                let same = |&&other: &&u32| uvs[other as usize] == uvs[v] && normals[other as usize] == normals[v];
                welds.position[v] = group[0];
                welds.chart[v] = *group[..number].iter().find(same_uv).unwrap_or(&vertex);
                welds.whole[v] = *group[..number].iter().find(same).unwrap_or(&vertex);
            }
        };
        pace.part(0.6..1.0).each(welding.count(), at_position).await;
        welds
    }
}
