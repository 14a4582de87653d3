//! The mesh that vessels are painted on.

use super::error::BakeError;
use super::limits::MOST_UV;
use super::tangents::tangents;
use super::welds::Welds;
use crate::synthesis::{
    mesh::{ShadedMesh, TriangleMesh},
    pace::{Pace, at_once},
};
use bevy_math::{Vec2, Vec3, Vec4};

/// Most textures that a triangle may span.
const MOST_SPAN: f32 = 2.0;
/// Largest share of the surface that may be without texels.
const MOST_USELESS: f64 = 0.5;

/// A mesh with texture coordinates, normals and tangents: what vessels are painted on.
///
/// Coordinates outside 0 to 1 are wrapped, as a sampler that repeats does. u goes to the right and v down in the
/// picture. Charts may be mirrored; charts that lie on each other share their texels.
#[derive(Clone, Debug)]
pub struct Canvas {
    pub(super) mesh: TriangleMesh,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) tangents: Vec<Vec4>,
    pub(super) colors: Option<VertexColors>,
    pub(super) welds: Welds,
    /// For each vertex, the one of the mesh that was unwrapped, if any was.
    pub(super) sources: Option<Vec<u32>>,
    /// Triangles with an area whose texture coordinates have none.
    pub(super) flat_uvs: usize,
}

/// What a renderer has for each vertex. Without normals or tangents they are computed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CanvasAttributes {
    /// Texture coordinates.
    pub uvs: Vec<Vec2>,
    /// Unit normals.
    pub normals: Option<Vec<Vec3>>,
    /// Tangents in the plane of the normal; the fourth component, 1 or −1, times normal × tangent is the bitangent.
    pub tangents: Option<Vec<Vec4>>,
    /// Colours by which the base is multiplied.
    pub colors: Option<VertexColors>,
}

/// Colours per vertex, by which the base of a texture is multiplied: that of each texel by what lies between the
/// corners of its triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VertexColors {
    /// The colours, linear sRGB. Limits: at least 0.
    pub colors: Vec<Vec3>,
    /// Whether the renderer multiplies the texture by them, too, as Bevy does for meshes with colours. Then they are
    /// not in the map of colours, and those of vessels are divided by them, so that both are right on the screen, as
    /// far as such a product can be as bright as the vessels. Otherwise the base in the map is already multiplied.
    pub are_drawn: bool,
}

impl Canvas {
    /// A canvas of a mesh as a renderer draws it.
    ///
    /// # Errors
    /// Texture coordinates that are missing or useless, and attributes that are not one per vertex or not finite.
    pub fn new(mesh: TriangleMesh, attributes: CanvasAttributes) -> Result<Self, BakeError> {
        at_once(Self::new_paced(mesh, attributes, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(mesh: TriangleMesh, attributes: CanvasAttributes, pace: &Pace) -> Result<Self, BakeError> {
        let CanvasAttributes { uvs, normals, tangents: given, colors } = attributes;
        let vertices = mesh.positions().len();
        let counts = [
            ("texture coordinates", Some(uvs.len())),
            ("normals", normals.as_ref().map(Vec::len)),
            ("tangents", given.as_ref().map(Vec::len)),
            ("colours", colors.as_ref().map(|colors| colors.colors.len())),
        ];
        for (what, count) in counts {
            if let Some(count) = count.filter(|&count| count != vertices) {
                return Err(BakeError::AttributeCount { what, count, vertices });
            }
        }
        let is_bad = |vertex: usize| normals.as_ref().is_some_and(|normals| !normals[vertex].is_finite());
        if let Some(vertex) = (0..vertices).find(|&vertex| is_bad(vertex)) {
            return Err(BakeError::BadAttribute { what: "normal", vertex });
        }
        let is_bad = |vertex: usize| given.as_ref().is_some_and(|tangents| !tangents[vertex].is_finite());
        if let Some(vertex) = (0..vertices).find(|&vertex| is_bad(vertex)) {
            return Err(BakeError::BadAttribute { what: "tangent", vertex });
        }
        let is_bad = |color: &Vec3| !(color.is_finite() && color.min_element() >= 0.0);
        if let Some(vertex) = colors.as_ref().and_then(|colors| colors.colors.iter().position(is_bad)) {
            return Err(BakeError::BadAttribute { what: "colour", vertex });
        }
        let flat_uvs = check_uvs(&mesh, &uvs, &pace.part(0.0..0.1)).await?;
        let normals = match normals {
            Some(normals) => normals.into_iter().map(|normal| normal.normalize_or(Vec3::Y)).collect(),
            None => {
                let welding = mesh.weld_paced(&pace.part(0.1..0.2)).await;
                let doubled = |triangle| crate::synthesis::mesh::doubled_normal(mesh.corners(triangle));
                mesh.vertex_normals_paced(&welding, doubled, &pace.part(0.2..0.4)).await
            }
        };
        let welds = Welds::of(&mesh, &uvs, &normals, &pace.part(0.4..0.6)).await;
        let tangents = match given {
            Some(tangents) => tangents,
            None => tangents(&mesh, (&uvs, &normals), &welds, &pace.part(0.6..1.0)).await,
        };
        pace.rest(1.0).await;
        Ok(Self { mesh, uvs, normals, tangents, colors, welds, sources: None, flat_uvs })
    }

    /// A canvas of a mesh with all drawing attributes, whose colours are drawn. Without colours it is white, as a renderer
    /// draws it.
    ///
    /// # Errors
    /// Those of [`new`](Self::new), and a mesh that is not usable.
    pub fn of_shaded(mesh: &ShadedMesh) -> Result<Self, BakeError> {
        at_once(Self::of_shaded_paced(mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`of_shaded`](Self::of_shaded).
    pub async fn of_shaded_paced(mesh: &ShadedMesh, pace: &Pace) -> Result<Self, BakeError> {
        let (positions, triangles) = (mesh.positions.clone(), mesh.triangles.clone());
        let checked = TriangleMesh::new_paced(positions, triangles, None, &pace.part(0.0..0.1)).await?;
        let colors = mesh.colors.iter().map(|&[red, green, blue, _]| Vec3::new(red, green, blue)).collect();
        let attributes = CanvasAttributes {
            uvs: mesh.uvs.clone(),
            normals: Some(mesh.normals.clone()),
            tangents: None,
            colors: (!mesh.colors.is_empty()).then_some(VertexColors { colors, are_drawn: true }),
        };
        Self::new_paced(checked, attributes, &pace.part(0.1..1.0)).await
    }

    /// A canvas of a mesh from a file, with smooth normals.
    ///
    /// # Errors
    /// Those of [`new`](Self::new), and a mesh without texture coordinates.
    pub fn of_mesh(mesh: &TriangleMesh) -> Result<Self, BakeError> {
        let uvs = mesh.uvs().ok_or(BakeError::NoUvs)?.to_vec();
        Self::new(mesh.clone(), CanvasAttributes { uvs, ..CanvasAttributes::default() })
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Texture coordinates of every vertex.
    pub fn uvs(&self) -> &[Vec2] {
        &self.uvs
    }

    /// Unit normals of every vertex.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Tangents of every vertex, for a mesh that is drawn with the map of normals.
    pub fn tangents(&self) -> &[Vec4] {
        &self.tangents
    }

    /// Whether the base in the map of colours is multiplied by colours per vertex.
    pub(super) fn tints_base(&self) -> bool {
        self.colors.as_ref().is_some_and(|colors| !colors.are_drawn)
    }

    /// The colour between the corners of a triangle, or beside them, and whether the renderer draws it.
    pub(super) fn color_at(&self, triangle: usize, weights: Vec3) -> Option<(Vec3, bool)> {
        let VertexColors { colors, are_drawn } = self.colors.as_ref()?;
        let [a, b, c] = self.mesh.triangles()[triangle].map(|vertex| colors[vertex as usize]);
        Some(((a * weights.x + b * weights.y + c * weights.z).max(Vec3::ZERO), *are_drawn))
    }

    /// For each vertex, the one of the mesh that was unwrapped; `None` if the mesh had its own chart.
    pub fn sources(&self) -> Option<&[u32]> {
        self.sources.as_deref()
    }
}

/// Checks texture coordinates. Returns the number of triangles with an area whose coordinates have none.
async fn check_uvs(mesh: &TriangleMesh, uvs: &[Vec2], pace: &Pace) -> Result<usize, BakeError> {
    let is_bad = |vertex: usize| !(uvs[vertex].abs().max_element() <= MOST_UV) || !uvs[vertex].is_finite();
    if let Some(vertex) = pace.part(0.0..0.2).find(uvs.len(), is_bad).await {
        return Err(BakeError::BadUv { vertex, u: uvs[vertex].x, v: uvs[vertex].y });
    }
    let (mut whole, mut useless, mut count) = (0.0, 0.0, 0);
    let mut tiled = None;
    let measure = |triangle: usize| {
        let area = mesh.triangle_area(triangle);
        let [a, b, c] = mesh.triangles()[triangle].map(|corner| uvs[corner as usize]);
        whole += area;
        if area > 0.0 && has_no_area([a, b, c]) {
            useless += area;
            count += 1;
        }
        let span = (a.max(b).max(c) - a.min(b).min(c)).max_element();
        if span > MOST_SPAN && tiled.is_none() {
            tiled = Some((triangle, span));
        }
    };
    pace.part(0.2..1.0).each(mesh.triangles().len(), measure).await;
    if let Some((triangle, span)) = tiled {
        return Err(BakeError::TiledUvs { triangle, span });
    }
    if useless > MOST_USELESS * whole {
        return Err(BakeError::UselessUvs { percent: (100.0 * useless / whole) as f32 });
    }
    Ok(count)
}

/// Whether texture coordinates of a triangle have no area to speak of.
pub(super) fn has_no_area([a, b, c]: [Vec2; 3]) -> bool {
    let (across, down) = (b - a, c - a);
    let longest = across.length_squared().max(down.length_squared()).max((c - b).length_squared());
    !(across.perp_dot(down).abs() > 1.0e-6 * longest)
}
