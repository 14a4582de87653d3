//! Texture coordinates for a mesh without usable ones.

use super::canvas::{Canvas, CanvasAttributes};
use super::error::BakeError;
use super::settings::BakeSettings;
use crate::synthesis::mesh::TriangleMesh;
use crate::synthesis::pace::{Pace, at_once};
use bevy_math::{Vec2, Vec3};

/// Texels between charts and around them, so that the first levels don't mix charts.
const PADDING: u32 = 4;

impl Canvas {
    /// A canvas of a mesh that is cut into charts, each of which is laid flat, for a texture of so many texels.
    ///
    /// Vertices along the cuts are there twice; [`sources`](Self::sources) says which vertex of the mesh each was. A
    /// mesh with `normals`, one per vertex, keeps them; otherwise they are smooth.
    ///
    /// # Errors
    /// A size out of its limits, and normals that are not one per vertex.
    pub fn unwrapped(mesh: &TriangleMesh, normals: Option<&[Vec3]>, size: u32) -> Result<Self, BakeError> {
        at_once(Self::unwrapped_paced(mesh, normals, size, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work. The unwrapping itself is done in one go.
    ///
    /// # Errors
    /// Those of [`unwrapped`](Self::unwrapped).
    pub async fn unwrapped_paced(
        mesh: &TriangleMesh,
        normals: Option<&[Vec3]>,
        size: u32,
        pace: &Pace,
    ) -> Result<Self, BakeError> {
        BakeSettings { size, ..BakeSettings::default() }.validate()?;
        let vertices = mesh.positions().len();
        if let Some(normals) = normals.filter(|normals| normals.len() != vertices) {
            return Err(BakeError::AttributeCount { what: "normals", count: normals.len(), vertices });
        }
        let smooth = normals.map_or_else(|| mesh.vertex_normals(), <[Vec3]>::to_vec);
        let (positions, triangles, uvs) = unwrap(mesh, size)?;
        pace.rest(0.5).await;
        let (sources, uvs): (Vec<u32>, Vec<Vec2>) = uvs.into_iter().unzip();
        let normals = Some(sources.iter().map(|&vertex| smooth[vertex as usize]).collect());
        let positions = sources.iter().map(|&vertex| positions[vertex as usize].into()).collect();
        let checked = TriangleMesh::new_paced(positions, triangles, None, &pace.part(0.5..0.6)).await?;
        let attributes = CanvasAttributes { uvs, normals, ..CanvasAttributes::default() };
        let canvas = Self::new_paced(checked, attributes, &pace.part(0.6..1.0)).await?;
        Ok(Self { sources: Some(sources), ..canvas })
    }
}

/// Triangles of the largest charts, if they are all of one size. Larger charts have fewer borders, and take longer to
/// lay flat: each triangle the longer, the wider its chart.
const CHART_TRIANGLES: f64 = 1000.0;

/// Positions as they were, triangles of new vertices, and for each of these its old vertex and texture coordinates.
type Unwrapped = (Vec<[f32; 3]>, Vec<[u32; 3]>, Vec<(u32, Vec2)>);

fn unwrap(mesh: &TriangleMesh, size: u32) -> Result<Unwrapped, BakeError> {
    let positions: Vec<[f32; 3]> = mesh.positions().iter().map(Vec3::to_array).collect();
    let indices: Vec<u32> = mesh.triangles().iter().flatten().copied().collect();
    let input = uvunwrap::MeshInput::new(&positions, &indices);
    let options = uvunwrap::Options {
        density: uvunwrap::Density::Auto { page_size: size },
        max_chart_area: (mesh.area() * CHART_TRIANGLES / mesh.triangles().len() as f64) as f32,
        padding: PADDING.min(size / 16),
        packing: uvunwrap::Packing::Fast,
        ..uvunwrap::Options::default()
    };
    let failed = |error: uvunwrap::Error| BakeError::Unwrap { cause: error.to_string() };
    let atlas = uvunwrap::generate(&[input], &options).map_err(failed)?;
    if atlas.page_count > 1 {
        let cause = format!("its charts need {} textures of size {size}; raise the size", atlas.page_count);
        return Err(BakeError::Unwrap { cause });
    }
    let Some(output) = atlas.meshes.into_iter().next() else {
        return Err(BakeError::Unwrap { cause: "it has no charts".to_owned() });
    };
    // Pages are cut below the last chart; textures are square.
    let height = atlas.height as f32 / size as f32;
    let width = atlas.width as f32 / size as f32;
    let place = |vertex: &uvunwrap::OutputVertex| (vertex.xref, Vec2::from(vertex.uv) * Vec2::new(width, height));
    let triangles = output.indices.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]]).collect();
    Ok((positions, triangles, output.vertices.iter().map(place).collect()))
}
