//! Closed meshes of vessels in examples: their faces, and the net of their edges.

use crate::scene::light::moist_tissue;
use bevy::{
    asset::RenderAssetUsages,
    ecs::system::SystemParam,
    light::NotShadowCaster,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use bevy_vessels::synthesis::surface::SurfaceMesh;

/// Height of edges over their faces, as a share of the vessel's radius.
const LIFT: f32 = 0.012;

/// The assets of meshes.
#[derive(SystemParam)]
pub struct VesselMeshes<'w> {
    meshes: ResMut<'w, Assets<Mesh>>,
    materials: Option<ResMut<'w, Assets<StandardMaterial>>>,
}

impl VesselMeshes<'_> {
    /// Faces as moist tissue of a colour.
    pub fn tissue(&mut self, faces: Mesh, color: Color) -> impl Bundle + use<> {
        (Mesh3d(self.meshes.add(faces)), self.material(moist_tissue(color)))
    }

    /// The edges of the faces, without the diagonals that divide them into triangles.
    pub fn edges(&mut self, mesh: &SurfaceMesh) -> impl Bundle + use<> {
        let ink = StandardMaterial { base_color: Color::srgb(0.02, 0.02, 0.03), unlit: true, ..default() };
        (Mesh3d(self.meshes.add(edges(mesh))), self.material(ink), NotShadowCaster)
    }

    /// Without a renderer there are no materials.
    fn material(&mut self, material: StandardMaterial) -> MeshMaterial3d<StandardMaterial> {
        let handle = self.materials.as_mut().map(|materials| materials.add(material));
        MeshMaterial3d(handle.unwrap_or_default())
    }
}

fn edges(mesh: &SurfaceMesh) -> Mesh {
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for [a, b, c, d] in mesh.faces.iter().map(|face| face.map(|corner| mesh.original(corner))) {
        edges.extend([[a, b], [b, c], [c, d], [d, a]].map(|[from, to]| [from.min(to), from.max(to)]));
    }
    edges.sort_unstable();
    edges.dedup();
    // A triangle repeats its last vertex.
    edges.retain(|[from, to]| from != to);
    let lifted = |vertex: usize| mesh.positions[vertex] + LIFT * mesh.radii[vertex] * mesh.normals[vertex];
    Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, (0..mesh.unique()).map(lifted).collect::<Vec<_>>())
        .with_inserted_indices(Indices::U32(edges.concat()))
}
