//! From a Bevy mesh to the triangles of a tissue.
//!
//! In: a [`Mesh`] of any index format, as a triangle list or strip. Out: a [`TriangleMesh`] in the mesh's local space.

use crate::synthesis::{
    mesh::{MeshError, TriangleMesh},
    pace::{Pace, at_once},
};
use bevy::{
    math::{Vec2, Vec3},
    mesh::{Indices, Mesh, MeshAccessError, PrimitiveTopology, VertexAttributeValues, VertexFormat},
};

/// Why a mesh cannot be an organ.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrganMeshError {
    /// The file is missing or broken, or has no mesh with that label.
    #[error("the mesh asset was not loaded ({reason}); check its path and label")]
    NotLoaded {
        /// The asset server's error.
        reason: String,
    },
    /// Points and lines have no surface.
    #[error("the mesh's topology is {found:?}; it must be TriangleList or TriangleStrip")]
    Topology {
        /// Topology of the mesh.
        found: PrimitiveTopology,
    },
    /// Without positions there are no triangles.
    #[error("the mesh has no positions; insert Mesh::ATTRIBUTE_POSITION")]
    NoPositions,
    /// The positions are not three floats each.
    #[error("the mesh's positions are {found:?}; they must be Float32x3")]
    PositionFormat {
        /// Format of the positions.
        found: VertexFormat,
    },
    /// Bevy has moved the data to the graphics card.
    #[error(
        "the mesh's data are on the graphics card only; create or load it with \
         RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD"
    )]
    OnGpuOnly,
    /// The triangles themselves are wrong.
    #[error(transparent)]
    Triangles(#[from] MeshError),
}

/// The parts of a mesh that an organ needs: unchecked, so that the frame waits only for the copy.
pub(crate) struct MeshCopy {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Texture coordinates, one per vertex, if the mesh has any.
    pub(crate) uvs: Option<Vec<Vec2>>,
}

impl MeshCopy {
    /// Checks it.
    pub(crate) async fn check(self, pace: &Pace) -> Result<TriangleMesh, OrganMeshError> {
        Ok(TriangleMesh::new_paced(self.positions, self.triangles, self.uvs, pace).await?)
    }
}

/// Reads the triangles of a mesh.
///
/// Without indices the vertices are used in order. In a strip every second triangle is flipped, so that all face the
/// same way, and an index with all bits set begins a new strip. Left-over vertices at the end are dropped, as on the
/// graphics card. Vertices keep their indices, and their texture coordinates if those are two floats each.
///
/// # Errors
/// [`OrganMeshError`] if the mesh cannot be an organ.
pub fn triangle_mesh(mesh: &Mesh) -> Result<TriangleMesh, OrganMeshError> {
    at_once(copy_mesh(mesh)?.check(&Pace::default()))
}

/// The positions of a mesh's vertices, if they are in main memory and three floats each.
pub(crate) fn vertex_positions(mesh: &Mesh) -> Option<&[[f32; 3]]> {
    mesh.try_attribute(Mesh::ATTRIBUTE_POSITION).ok()?.as_float3()
}

/// Copies what [`triangle_mesh`] reads.
pub(crate) fn copy_mesh(mesh: &Mesh) -> Result<MeshCopy, OrganMeshError> {
    let topology = mesh.primitive_topology();
    if !matches!(topology, PrimitiveTopology::TriangleList | PrimitiveTopology::TriangleStrip) {
        return Err(OrganMeshError::Topology { found: topology });
    }
    let values = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION).map_err(|error| match error {
        MeshAccessError::ExtractedToRenderWorld => OrganMeshError::OnGpuOnly,
        MeshAccessError::NotFound => OrganMeshError::NoPositions,
    })?;
    let positions = values.as_float3().ok_or_else(|| OrganMeshError::PositionFormat { found: values.into() })?;
    let positions: Vec<Vec3> = positions.iter().copied().map(Vec3::from).collect();
    let triangles = match mesh.try_indices_option().map_err(|_| OrganMeshError::OnGpuOnly)? {
        Some(Indices::U16(indices)) => triangles(indices, u16::MAX, topology),
        Some(Indices::U32(indices)) => triangles(indices, u32::MAX, topology),
        None => triangles(&(0..positions.len() as u32).collect::<Vec<_>>(), u32::MAX, topology),
    };
    let uvs = uvs(mesh).filter(|uvs| uvs.len() == positions.len());
    Ok(MeshCopy { positions, triangles, uvs })
}

/// The first texture coordinates, if they are two floats each.
fn uvs(mesh: &Mesh) -> Option<Vec<Vec2>> {
    match mesh.try_attribute(Mesh::ATTRIBUTE_UV_0).ok()? {
        VertexAttributeValues::Float32x2(uvs) => Some(uvs.iter().copied().map(Vec2::from).collect()),
        _ => None,
    }
}

/// Triangles of a sequence of indices. `restart` ends a strip; in a list it is a vertex like any other.
fn triangles<I: Copy + PartialEq + Into<u32>>(indices: &[I], restart: I, topology: PrimitiveTopology) -> Vec<[u32; 3]> {
    match topology {
        PrimitiveTopology::TriangleStrip => indices.split(|&index| index == restart).flat_map(strip).collect(),
        _ => indices.chunks_exact(3).map(|corners| [corners[0].into(), corners[1].into(), corners[2].into()]).collect(),
    }
}

/// Triangles of one strip. Those without area, which only connect its parts, are left out.
fn strip<I: Copy + PartialEq + Into<u32>>(corners: &[I]) -> impl Iterator<Item = [u32; 3]> {
    let turned = |(i, corners): (usize, &[I])| {
        let [a, b, c] = [corners[0].into(), corners[1].into(), corners[2].into()];
        if i % 2 == 0 { [a, b, c] } else { [b, a, c] }
    };
    corners.windows(3).enumerate().map(turned).filter(|[a, b, c]| a != b && b != c && c != a)
}

#[cfg(test)]
mod tests {
    use crate::plugin::organ::mesh::*;
    use bevy::asset::RenderAssetUsages;

    const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];

    fn square(topology: PrimitiveTopology) -> Mesh {
        Mesh::new(topology, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, SQUARE.to_vec())
    }

    fn normals(mesh: &TriangleMesh) -> Vec<Vec3> {
        mesh.triangles()
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| mesh.positions()[corner as usize]);
                (b - a).cross(c - a).normalize()
            })
            .collect()
    }

    #[test]
    fn lists_and_strips_with_every_index_format_give_the_same_square() {
        let list = square(PrimitiveTopology::TriangleList);
        let strip = square(PrimitiveTopology::TriangleStrip);
        let meshes = [
            list.clone().with_inserted_indices(Indices::U16(vec![0, 1, 2, 1, 3, 2])),
            list.with_inserted_indices(Indices::U32(vec![0, 1, 2, 1, 3, 2, 0])),
            strip.clone(),
            strip.clone().with_inserted_indices(Indices::U16(vec![0, 1, 2, 3])),
            strip.clone().with_inserted_indices(Indices::U16(vec![0, 1, 2, u16::MAX, 1, 3, 2])),
            strip.with_inserted_indices(Indices::U32(vec![0, 1, 2, u32::MAX, 1, 3, 2, 2])),
        ];
        for mesh in meshes {
            let read = triangle_mesh(&mesh).unwrap_or_else(|error| panic!("{mesh:?}: {error}"));
            assert_eq!(read.positions().len(), 4);
            assert_eq!(normals(&read), [Vec3::Z; 2], "{mesh:?}");
        }
    }

    #[test]
    fn texture_coordinates_are_kept() {
        let plain = square(PrimitiveTopology::TriangleStrip);
        let uvs: Vec<[f32; 2]> = SQUARE.iter().map(|&[x, y, _]| [x, 1.0 - y]).collect();
        let read = |mesh: Mesh| triangle_mesh(&mesh).map(|mesh| mesh.uvs().map(<[Vec2]>::to_vec));
        assert_eq!(read(plain.clone()), Ok(None));
        let kept = read(plain.clone().with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs.clone()));
        assert_eq!(kept, Ok(Some(uvs.into_iter().map(Vec2::from).collect())));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let empty = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
        assert_eq!(triangle_mesh(&empty).err(), Some(OrganMeshError::NoPositions));
        let lines = square(PrimitiveTopology::LineList);
        assert_eq!(triangle_mesh(&lines).err(), Some(OrganMeshError::Topology { found: PrimitiveTopology::LineList }));
        let out_of_range =
            square(PrimitiveTopology::TriangleList).with_inserted_indices(Indices::U16(vec![0, 1, u16::MAX]));
        assert!(matches!(triangle_mesh(&out_of_range), Err(OrganMeshError::Triangles(_))));
        let mut moved = square(PrimitiveTopology::TriangleList);
        assert!(moved.take_gpu_data().is_ok());
        let error = triangle_mesh(&moved).err();
        assert_eq!(error, Some(OrganMeshError::OnGpuOnly));
        assert!(error.is_some_and(|error| error.to_string().contains("MAIN_WORLD")));
    }
}
