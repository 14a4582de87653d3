//! The closed meshes of an organ's vessels, their figures and their files.

use super::{Format, Job};
use bevy_vessels::synthesis::{
    growth::Growth,
    io::{SurfaceOptions, SurfacePart, WriteError, save_surface},
    mesh::TriangleMesh,
    segment_index::{SegmentIndex, overlaps},
    surface::{Surface, SurfaceError, SurfaceReport},
    tree::{ByKind, VesselTree},
};
use serde::{Serialize, Serializer};
use std::path::Path;
use std::time::Instant;

/// The surface of one kind of vessels, as drawn.
pub struct Meshed {
    tree: VesselTree,
    surface: Surface,
    ms: f64,
}

/// The surfaces of all kinds that have vessels; none if the job asks for none.
pub fn meshes(job: &Job, growth: &dyn Growth) -> Result<ByKind<Option<Meshed>>, SurfaceError> {
    let mut meshes = ByKind::from_fn(|_| None);
    let Some(settings) = &job.surface else { return Ok(meshes) };
    for (kind, grown) in growth.trees().iter() {
        let Some(tree) = grown.map(|grown| grown.vessels()).filter(|tree| !tree.is_empty()) else { continue };
        let start = Instant::now();
        let surface = Surface::new(&tree, settings)?;
        let ms = 1e3 * start.elapsed().as_secs_f64();
        meshes[kind] = Some(Meshed { tree, surface, ms: (ms * 1e3).round() / 1e3 });
    }
    Ok(meshes)
}

impl Format {
    /// What follows the organ's name in the names of files of closed meshes; `None` for other formats.
    pub fn mesh_ending(self) -> Option<&'static str> {
        match self {
            Self::Glb => Some(".glb"),
            Self::Stl => Some(".stl"),
            Self::Ply => Some(".ply"),
            Self::Off => Some(".off"),
            // The other OBJ file has the plain name.
            Self::ObjMesh => Some("_mesh.obj"),
            Self::Swc | Self::Obj | Self::Csv | Self::Levels | Self::Gxl | Self::Svg | Self::Eps => None,
        }
    }
}

/// Writes all kinds to one file, as parts with their names. The format is that of the path's extension.
pub fn save(path: &Path, meshes: &ByKind<Option<Meshed>>, comments: Vec<String>) -> Result<(), WriteError> {
    let parts: Vec<SurfacePart> = meshes
        .iter()
        .filter_map(|(kind, meshed)| Some((kind, meshed.as_ref()?)))
        .map(|(kind, meshed)| SurfacePart::new(kind, &meshed.tree, &meshed.surface.mesh))
        .collect();
    // Programs that measure PLY files often read triangles only.
    let triangles = path.extension().is_some_and(|extension| extension == "ply");
    save_surface(path, &parts, &SurfaceOptions { comments, triangles, ..SurfaceOptions::default() })
}

/// Figures of the mesh of one kind of vessels.
#[derive(Debug, Serialize)]
pub struct MeshFigures {
    /// Triangles of the closed surface.
    pub triangles: usize,
    /// Vertices, without copies along the seams of texture coordinates.
    vertices: usize,
    /// Whether the surface is closed, with one outside and a single fan of faces around each vertex.
    closed: bool,
    /// Vertices − edges + faces: 2 for each tree.
    euler: i64,
    /// Triangles that intersect another one.
    self_intersections: usize,
    /// Pairs of segments that overlap though they are not neighbours in the tree.
    input_overlaps: usize,
    /// Enclosed volume, in cubic tissue lengths.
    volume: f64,
    /// Wall time of the mesh alone, in milliseconds.
    mesh_ms: f64,
    /// What was done where the plain way did not do.
    #[serde(serialize_with = "as_object")]
    ladder: Vec<(&'static str, usize)>,
}

impl MeshFigures {
    /// Measures a mesh.
    pub fn of(Meshed { tree, surface, ms }: &Meshed) -> Self {
        let mesh = &surface.mesh;
        let check = mesh.validate();
        let closure = check.closure;
        let triangles: Vec<[u32; 3]> = mesh.closed_triangles().collect();
        Self {
            triangles: triangles.len(),
            vertices: mesh.unique(),
            closed: closure.is_closed() && closure.is_oriented() && closure.is_manifold(),
            euler: closure.euler(),
            self_intersections: check.intersecting_triangles(),
            input_overlaps: overlaps(tree, &SegmentIndex::new(tree)).len(),
            volume: TriangleMesh::new(mesh.positions.clone(), triangles, None).map_or(0.0, |mesh| mesh.signed_volume()),
            mesh_ms: *ms,
            ladder: ladder(&surface.report),
        }
    }
}

/// The report on a surface as named numbers. A new field of the report is a new line here.
fn ladder(report: &SurfaceReport) -> Vec<(&'static str, usize)> {
    vec![
        ("laterals", report.laterals),
        ("joined", report.joined),
        ("shortened", report.shortened),
        ("moved", report.moved),
        ("remade", report.remade.len()),
        ("left", report.left.len()),
        ("absorbed", report.absorbed.len()),
    ]
}

fn as_object<S: Serializer>(entries: &[(&'static str, usize)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(entries.iter().copied())
}
