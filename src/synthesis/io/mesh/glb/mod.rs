//! Reading an organ's mesh from a glTF 2.0 file, binary (`.glb`) or text (`.gltf`).
//!
//! Source: "glTF 2.0 Specification", Khronos Group 2021, ISO/IEC 12113:2022. The way of the data: the [`container`]
//! gives JSON and binary data; the [`document`] is what the JSON says of shapes; the [`scene`] says where nodes stand;
//! a part's [`pose`] places its vertices, which [`data`] decodes; [`part`] joins them. A [`budget`] is asked before
//! memory is taken.

mod budget;
mod container;
mod data;
mod document;
mod neighbour;
mod part;
mod pose;
mod scene;

use super::read::MeshDataError;
use crate::synthesis::{
    io::lines::{Utf16, text},
    mesh::TriangleMesh,
};
use bevy_math::{DAffine3, Quat, Vec3};
use data::{Data, Elements};
use document::{Document, Instancing, Primitive, Shape, find};
use part::Parts;
use pose::{Joints, Motion, Pose};
use scene::{Placed, placed, placed_meshes};
use std::path::Path;

/// Reads all triangles of a file's scene as one mesh, each placed as it is shown.
///
/// The scene is the default one, or else the first. Supports triangle lists, strips and fans; positions as floats or
/// quantised, also sparse; transforms of nodes, also mirrored ones; skins in the pose of their joints; morph targets by
/// their default weights; instances (`EXT_mesh_gpu_instancing`); the first set of texture coordinates, if every part
/// has one. Points and lines, hidden nodes and nodes of scale 0 are ignored, and so are vertices without a triangle.
///
/// The data is in the file, or in data URIs. [`load_mesh`](super::load_mesh) reads that of other files, too. A file
/// becomes at most 16 MiB, or 32 times its size if that is more, so that no file takes all memory.
///
/// # Errors
/// [`MeshDataError`], which names the cause: damage; a version other than 2; an extension that the file requires and
/// this function does not know, such as compression.
pub fn read_glb(bytes: &[u8]) -> Result<TriangleMesh, MeshDataError> {
    read_gltf_in(bytes, None)
}

/// The same, with data in files of a folder.
pub(super) fn read_gltf_in(bytes: &[u8], folder: Option<&Path>) -> Result<TriangleMesh, MeshDataError> {
    let (json, blob) = if bytes.starts_with(container::MAGIC) { container::chunks(bytes)? } else { (bytes, None) };
    let json = text(json).map_err(|Utf16| MeshDataError::content(Utf16::CAUSE))?;
    let document = Document::read(json)?;
    let data = Data::new(&document, blob, folder);
    data.budget.add_present(bytes.len());
    let mut joints = Joints::new(&document);
    let mut parts = Parts::new();
    for shown in placed_meshes(&document, &data.budget)? {
        for motion in motions(&shown, &data, &mut joints)? {
            add_mesh(&mut parts, &document, &data, &shown, &motion)?;
        }
    }
    parts.into_mesh()
}

/// The motions of a mesh: one, or that of each instance.
fn motions(shown: &Placed, data: &Data, joints: &mut Joints) -> Result<Vec<Motion>, MeshDataError> {
    let instancing = shown.node.extensions.as_ref().and_then(|extensions| extensions.instancing.as_ref());
    match (shown.node.skin, instancing) {
        (None, None) => Ok(vec![Motion::Rigid(shown.transform)]),
        (Some(skin), None) => Ok(vec![joints.motion(data, skin)?]),
        (None, Some(instancing)) => instances(instancing, shown.transform, data),
        (Some(_), Some(_)) => {
            Err(MeshDataError::content("a node has a skin and instances, which have no meaning together"))
        }
    }
}

/// The transforms of instances, by the extension `EXT_mesh_gpu_instancing`.
fn instances(
    Instancing { attributes }: &Instancing,
    parent: DAffine3,
    data: &Data,
) -> Result<Vec<Motion>, MeshDataError> {
    let vectors = |name: &str| attributes.get(name).map(|&found| data.elements(found, Shape::Vec3)).transpose();
    let (translations, scales): (Option<Elements<3>>, Option<Elements<3>>) =
        (vectors("TRANSLATION")?, vectors("SCALE")?);
    let rotations: Option<Elements<4>> =
        attributes.get("ROTATION").map(|&found| data.elements(found, Shape::Vec4)).transpose()?;
    let counts = [translations.as_ref(), scales.as_ref()].map(|vectors| vectors.map(Elements::count));
    let mut counts = counts.into_iter().chain([rotations.as_ref().map(Elements::count)]).flatten();
    let count = counts.next().ok_or_else(|| MeshDataError::content("a node has instances, but not their places"))?;
    if counts.any(|other| other != count) {
        return Err(MeshDataError::content("the attributes of instances are not of one number"));
    }
    data.budget.take(count, size_of::<Motion>() as u64)?;
    let instance = |number: usize| {
        let vector = |vectors: &Option<Elements<3>>, default: Vec3| {
            vectors.as_ref().map_or(default, |vectors| Vec3::from_array(vectors.floats(number))).as_dvec3()
        };
        let rotation = rotations.as_ref().map_or(Quat::IDENTITY.to_array(), |rotations| rotations.floats(number));
        let own = placed(vector(&translations, Vec3::ZERO), Some(rotation), vector(&scales, Vec3::ONE))?;
        Ok(Motion::Rigid(parent * own))
    };
    (0..count).map(instance).collect()
}

fn add_mesh(
    parts: &mut Parts,
    document: &Document,
    data: &Data,
    shown: &Placed,
    motion: &Motion,
) -> Result<(), MeshDataError> {
    let mesh = find(&document.meshes, shown.mesh, "a mesh")?;
    if motion.leaves_nothing() {
        return Ok(());
    }
    for primitive in &mesh.primitives {
        data.budget.take(1, size_of::<Primitive>() as u64)?;
        // Points and lines have no surface; whatever is wrong with them does not matter.
        let is_surface =
            matches!(primitive.mode, Primitive::TRIANGLES | Primitive::TRIANGLE_STRIP | Primitive::TRIANGLE_FAN);
        if is_surface && let Some(pose) = Pose::new(data, shown.node, mesh, primitive, motion)? {
            parts.add(data, primitive, &pose)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
