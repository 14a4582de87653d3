//! GLB, the binary form of glTF 2.0: for engines and viewers.
//!
//! The JSON that [`document`] makes describes the arrays of all parts, one after the other; then the arrays follow,
//! straight from the meshes. So no second copy of a mesh is in memory.
//!
//! Source: Khronos, "glTF 2.0 Specification" (2021).

mod document;
#[cfg(test)]
mod tests;

use super::SurfaceOptions;
use super::part::{Measures, SurfacePart, buffered, check, invalid};
use crate::synthesis::io::{WriteError, write_atomically};
use document::{Document, has_mesh};
use std::io::{self, Write};
use std::path::Path;

/// Writes surfaces to a GLB file, whole or not at all. See [`write_surface_glb`].
///
/// # Errors
/// Those of [`write_atomically`] and of [`write_surface_glb`].
pub fn save_surface_glb(
    path: impl AsRef<Path>,
    parts: &[SurfacePart],
    options: &SurfaceOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_surface_glb(out, parts, options))
}

/// Writes surfaces as GLB: a node, a mesh and a material for each part, all three with the part's name.
///
/// | attribute | meaning |
/// |---|---|
/// | `POSITION` | tissue lengths, with bounds |
/// | `NORMAL`, `TANGENT` | unit vectors; the tangent with the sign of the bitangent |
/// | `TEXCOORD_0` | u around the vessel, v along it; not flipped: glTF, like the mesh, counts v downwards |
/// | `COLOR_0` | white: programs multiply it with the material's colour. To be painted, for example by supply |
/// | `_RADIUS` | radius of the vessel, tissue lengths |
/// | `_NODE` | node of the part's tree, from 0 |
/// | `_BRANCH` | branch of that tree, from 0; -1 at a root |
/// | `_STRAHLER` | Strahler order, from 1 |
///
/// The last three are floats, since glTF has no attributes of 32-bit integers. They hold whole numbers below 2²⁴
/// exactly; larger ones are rounded.
///
/// Faces are triangles, with indices of 32 bits. The material has the part's colour, without metal, and the gloss of wet
/// tissue. A node's `extras` say the `kind` of its vessels. The asset's `extras` hold the `comments` and
/// `metres_per_unit`, if given; the coordinates are not scaled by it. A part without faces becomes a node without a mesh.
///
/// # Errors
/// Those of `out`; [`InvalidInput`](io::ErrorKind::InvalidInput), before anything is written, if a part is not well
/// formed, or if the file would have 4 GiB or more, which the format does not allow.
pub fn write_surface_glb(out: impl Write, parts: &[SurfacePart], options: &SurfaceOptions) -> io::Result<()> {
    check(parts)?;
    let document = Document::new(parts, options)?;
    let (text, data) = (document.text()?, document.length);
    let length = file_length(text.len() as u64, data)?;
    let mut out = buffered(out);
    out.write_all(b"glTF")?;
    write_words(&mut out, &[2, length, text.len() as u32])?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    if data > 0 {
        write_words(&mut out, &[data as u32])?;
        out.write_all(b"BIN\0")?;
    }
    for part in parts.iter().filter(|part| has_mesh(part)) {
        write_arrays(&mut out, part)?;
    }
    out.flush()
}

/// Bytes of a file with this much JSON and data: both with their headers, and the file's.
fn file_length(text: u64, data: u64) -> io::Result<u32> {
    let length = 12 + 8 + text + if data > 0 { 8 + data } else { 0 };
    u32::try_from(length).map_err(|_| {
        invalid(format!(
            "a GLB file of {length} bytes is beyond the format's {}; write the parts to files of their own, make the \
             surface coarser, or write PLY",
            u32::MAX
        ))
    })
}

/// The arrays of a part, in the order of [`document::ATTRIBUTES`], then its triangles.
fn write_arrays(out: &mut impl Write, part: &SurfacePart) -> io::Result<()> {
    let (mesh, measures) = (part.mesh, Measures::of(part.tree));
    write_floats(out, mesh.positions.iter().flat_map(|position| position.to_array()))?;
    write_floats(out, mesh.normals.iter().flat_map(|normal| normal.to_array()))?;
    write_floats(out, mesh.tangents().iter().flat_map(|tangent| tangent.to_array()))?;
    write_floats(out, mesh.uvs.iter().flat_map(|uv| uv.to_array()))?;
    for _ in &mesh.positions {
        out.write_all(&[u8::MAX; 4])?;
    }
    write_floats(out, mesh.radii.iter().copied())?;
    write_floats(out, mesh.nodes.iter().map(|&node| node as f32))?;
    write_floats(out, mesh.nodes.iter().map(|&node| measures.branch(node) as f32))?;
    write_floats(out, mesh.nodes.iter().map(|&node| measures.order(node) as f32))?;
    mesh.triangles().try_for_each(|corners| write_words(out, &corners))
}

fn write_floats(out: &mut impl Write, floats: impl Iterator<Item = f32>) -> io::Result<()> {
    for float in floats {
        out.write_all(&float.to_le_bytes())?;
    }
    Ok(())
}

fn write_words(out: &mut impl Write, words: &[u32]) -> io::Result<()> {
    words.iter().try_for_each(|word| out.write_all(&word.to_le_bytes()))
}
