//! Reading an organ's mesh from a Wavefront OBJ file.
//!
//! Source: "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual, Wavefront 1995. Of a file, only what
//! makes a surface is read; the rest may be of any kind and in any encoding.

mod face;
mod polygon;
mod statement;

use super::read::{BAD_POSITION, MeshDataError};
use crate::synthesis::{
    io::lines::{Utf16, text},
    mesh::{TriangleMesh, is_usable},
};
use bevy_math::{Vec2, Vec3};
use face::{Corner, Faces, NO_UV};
use polygon::Polygons;
use statement::{Statement, Statements};

/// Reads all faces of an OBJ file as one mesh.
///
/// Polygons, also concave ones, are cut into triangles. Lines, points, normals, colours, groups and materials are
/// ignored, and so are vertices without a face. The mesh has texture coordinates if every corner of every face has
/// some. Vertices are in the order of the file.
///
/// # Errors
/// [`MeshDataError`], which names the line: a vertex without three numbers; a face that refers to a vertex, texture
/// coordinate or normal that is not there, or crosses itself; curved surfaces and calls of other files, which are not
/// read. Text in UTF-16, and a file without a usable surface.
pub fn read_obj_mesh(bytes: &[u8]) -> Result<TriangleMesh, MeshDataError> {
    let text = text(bytes).map_err(|Utf16| MeshDataError::content(Utf16::CAUSE))?;
    let mut object = Object::default();
    for statement in Statements::new(text) {
        let (line, statement) = statement?;
        object.read(line, &statement).map_err(|cause| MeshDataError::Line { line, cause })?;
    }
    object.into_mesh()
}

/// The contents of a file.
#[derive(Default)]
struct Object {
    positions: Vec<Vec3>,
    /// The line of each vertex.
    lines: Vec<u32>,
    uvs: Vec<Vec2>,
    faces: Faces,
}

impl Object {
    fn read(&mut self, line: usize, statement: &Statement) -> Result<(), &'static str> {
        let mut words = statement.words();
        match statement.keyword() {
            b"v" => {
                let mut coordinate = || {
                    let word = words.next().ok_or("a vertex has fewer than 3 coordinates")?;
                    number(word).ok_or("a coordinate is no number, such as 0.5 or -1e-3")
                };
                self.positions.push(Vec3::new(coordinate()?, coordinate()?, coordinate()?));
                self.lines.push(u32::try_from(line).map_err(|_| "it has more lines than can be numbered")?);
            }
            // Unreadable ones don't decide: growth needs none. The second is 0 where there is only one.
            b"vt" => {
                let mut next = |missing: f32| words.next().map_or(missing, |word| number(word).unwrap_or(f32::NAN));
                self.uvs.push(Vec2::new(next(f32::NAN), 1.0 - next(0.0)));
            }
            b"vn" => self.faces.normals += 1,
            b"f" | b"fo" => self.faces.add(line, words, self.positions.len(), self.uvs.len())?,
            b"surf" | b"bzp" | b"bsp" | b"cdp" => {
                return Err("curved surfaces are not read; export the organ as polygons");
            }
            b"call" | b"csh" => return Err("it calls another file; export the organ as one file"),
            _ => {}
        }
        Ok(())
    }

    fn into_mesh(self) -> Result<TriangleMesh, MeshDataError> {
        let at_line = |line: u32, cause| MeshDataError::Line { line: line as usize, cause };
        self.faces.check(self.positions.len(), self.uvs.len()).map_err(|(line, cause)| at_line(line, cause))?;
        let bad = |&&Corner { vertex, .. }: &&Corner| !is_usable(self.positions[vertex as usize]);
        if let Some(corner) = self.faces.corners.iter().find(bad) {
            return Err(at_line(self.lines[corner.vertex as usize], BAD_POSITION));
        }
        let has_uvs =
            self.faces.corners.iter().all(|corner| corner.uv != NO_UV && self.uvs[corner.uv as usize].is_finite());
        let vertex_of = |corner: &Corner| if has_uvs { *corner } else { Corner { uv: NO_UV, ..*corner } };
        let mut vertices: Vec<Corner> = self.faces.corners.iter().map(vertex_of).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut triangles = Vec::new();
        let mut polygons = Polygons::default();
        for (line, corners) in self.faces.iter() {
            let corner = |corner: &Corner| self.positions[corner.vertex as usize].as_dvec3();
            let cut = polygons.cut(corners.iter().map(corner)).map_err(|cause| at_line(line, cause))?;
            // Every vertex is there, so that the search always finds it.
            let place = |at: u32| {
                let vertex = vertex_of(&corners[at as usize]);
                vertices.binary_search(&vertex).map_or(u32::MAX, |place| place as u32)
            };
            triangles.extend(cut.iter().map(|triangle| triangle.map(place)));
        }
        let positions = vertices.iter().map(|vertex| self.positions[vertex.vertex as usize]).collect();
        let uvs = has_uvs.then(|| vertices.iter().map(|vertex| self.uvs[vertex.uv as usize]).collect());
        Ok(TriangleMesh::new(positions, triangles, uvs)?)
    }
}

/// A decimal number; NaN and infinity, too, which only a vertex that is used must not be.
fn number(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests;
