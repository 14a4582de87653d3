//! Procedural organs as Bevy meshes.

use crate::synthesis::{mesh::ShadedMesh, texture::Canvas};
use bevy::{
    asset::RenderAssetUsages,
    mesh::{Indices, Mesh, PrimitiveTopology},
};

/// A triangle list with positions, normals, UVs, vertex colours if there are any, and tangents where the UVs allow it.
/// Both worlds keep it, so that vessels can grow on it and be painted into its texture.
impl From<ShadedMesh> for Mesh {
    fn from(organ: ShadedMesh) -> Self {
        let tangents = Canvas::of_shaded(&organ).map(|canvas| canvas.tangents().to_vec());
        let mut mesh = Self::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Self::ATTRIBUTE_POSITION, organ.positions)
            .with_inserted_attribute(Self::ATTRIBUTE_NORMAL, organ.normals)
            .with_inserted_attribute(Self::ATTRIBUTE_UV_0, organ.uvs)
            .with_inserted_indices(Indices::U32(organ.triangles.into_iter().flatten().collect()));
        if !organ.colors.is_empty() {
            mesh.insert_attribute(Self::ATTRIBUTE_COLOR, organ.colors);
        }
        match tangents {
            Ok(tangents) => mesh.with_inserted_attribute(Self::ATTRIBUTE_TANGENT, tangents),
            Err(_) => mesh,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::organ::procedural::*;
    use crate::{plugin::triangle_mesh, synthesis::organ::LiverSettings};

    #[test]
    fn an_organ_keeps_its_triangles_on_the_way_through_bevy() {
        let organ = LiverSettings { subdivisions: 2, ..Default::default() }.generate().expect("within limits").mesh;
        let read = triangle_mesh(&Mesh::from(organ.clone())).expect("an organ's mesh is readable");
        assert_eq!(read.positions(), organ.positions);
        assert_eq!(read.triangles(), organ.triangles);
    }
}
