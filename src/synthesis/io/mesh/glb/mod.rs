//! Reading an organ's mesh from a glTF 2.0 file, binary (`.glb`) or text (`.gltf`).
//!
//! The `gltf` crate decodes the JSON. The container and its binary data are read here, with every offset and count
//! checked, so that a damaged file gives an error.

use super::read::{Fault, MeshReadError, read_bytes};
use crate::synthesis::mesh::{MAX_TRIANGLES, TriangleMesh};
use bevy_math::{Mat4, Quat, Vec2, Vec3};
use gltf::json::{
    self, Accessor, Index, Root,
    accessor::{ComponentType, Type},
    buffer::View,
    mesh::{Mode, Primitive, Semantic},
    root::Get,
    validation::Checked,
};
use std::path::Path;

/// Extensions that compress the data of a mesh.
const COMPRESSIONS: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Reads all triangles of a file's scene as one mesh, each placed by its node's transform.
///
/// Supports triangle lists, strips and fans; positions as floats or quantised; the first set of texture coordinates, if
/// every part has one; buffers within the file, as data URIs, or in separate files. Points and lines are ignored.
///
/// # Errors
/// [`MeshReadError`], which names the file and the cause.
pub fn read_glb(path: &Path) -> Result<TriangleMesh, MeshReadError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    read_bytes(path).and_then(|bytes| decode(&bytes, folder)).map_err(|fault| fault.in_file(path))
}

fn decode(bytes: &[u8], folder: &Path) -> Result<TriangleMesh, Fault> {
    let (text, blob) = if bytes.starts_with(MAGIC) { chunks(bytes)? } else { (bytes, None) };
    let root: Root = json::deserialize::from_slice(text)
        .map_err(|error| Fault::content(format!("it is not a glTF 2.0 file ({error})")))?;
    if let Some(name) = root.extensions_required.iter().find(|name| COMPRESSIONS.contains(&name.as_str())) {
        return Err(Fault::content(format!("its meshes are compressed ({name}); export it without compression")));
    }
    let buffers = buffers(&root, blob, folder)?;
    let mut parts = Parts { has_uvs: true, ..Parts::default() };
    for (mesh, transform) in placed_meshes(&root)? {
        for primitive in &find(&root, mesh, "mesh")?.primitives {
            parts.add(&Source { root: &root, buffers: &buffers }, primitive, transform)?;
        }
    }
    let uvs = parts.has_uvs.then_some(parts.uvs);
    Ok(TriangleMesh::new(parts.positions, parts.triangles, uvs)?)
}

/// First bytes of a binary file.
const MAGIC: &[u8] = b"glTF";

/// The JSON and the binary chunk of a binary file.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    let word = |offset: usize| {
        let word = bytes.get(offset..offset + 4).and_then(|word| word.try_into().ok());
        word.map(u32::from_le_bytes).ok_or_else(|| Fault::content("it ends within its header"))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(Fault::content(format!("it is of glTF version {version}; only version 2 is read")));
    }
    let chunk = |offset: usize, kind: &[u8]| {
        let length = word(offset)? as usize;
        if bytes.get(offset + 4..offset + 8) != Some(kind) {
            return Err(Fault::content("its chunks are not JSON and BIN"));
        }
        let end = (offset + 8).saturating_add(length);
        bytes.get(offset + 8..end).ok_or_else(|| {
            Fault::content(format!("it is cut short: {end} bytes are announced, {} are there", bytes.len()))
        })
    };
    let text = chunk(12, b"JSON")?;
    let next = 20 + text.len();
    let blob = if next < bytes.len() { Some(chunk(next, b"BIN\0")?) } else { None };
    Ok((text, blob))
}

/// The bytes of every buffer.
fn buffers(root: &Root, blob: Option<&[u8]>, folder: &Path) -> Result<Vec<Vec<u8>>, Fault> {
    let load = |(number, buffer): (usize, &json::Buffer)| match buffer.uri.as_deref() {
        None if number == 0 => blob
            .map(<[u8]>::to_vec)
            .ok_or_else(|| Fault::content("its first buffer is missing: the file has no binary chunk")),
        None => Err(Fault::content(format!("buffer {number} has no source"))),
        Some(uri) => match uri.strip_prefix("data:") {
            Some(data) => data
                .split_once(";base64,")
                .and_then(|(_, text)| decode_base64(text))
                .ok_or_else(|| Fault::content(format!("buffer {number} is not valid base64 data"))),
            None => read_bytes(&folder.join(decode_percent(uri))),
        },
    };
    root.buffers.iter().enumerate().map(load).collect()
}

fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    Some(bytes)
}

/// A relative URI as a file name.
fn decode_percent(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let code = after.get(..2).and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Looks up the target of an index of the JSON.
fn find<'a, T>(root: &'a Root, index: Index<T>, what: &str) -> Result<&'a T, Fault>
where
    Root: Get<T>,
{
    root.get(index).ok_or_else(|| Fault::content(format!("it refers to {what} {}, which is not there", index.value())))
}

/// The meshes of the scene with the transform of their node.
fn placed_meshes(root: &Root) -> Result<Vec<(Index<json::Mesh>, Mat4)>, Fault> {
    let mut pending: Vec<(Index<json::Node>, Mat4)> = match (root.scene, root.scenes.first()) {
        (Some(scene), _) => find(root, scene, "scene")?.nodes.iter().map(|&node| (node, Mat4::IDENTITY)).collect(),
        (None, Some(scene)) => scene.nodes.iter().map(|&node| (node, Mat4::IDENTITY)).collect(),
        (None, None) => top_nodes(root).into_iter().map(|node| (node, Mat4::IDENTITY)).collect(),
    };
    // From a stack: reversed, so that meshes come in the order of the file.
    pending.reverse();
    let mut seen = vec![false; root.nodes.len()];
    let mut meshes = Vec::new();
    while let Some((index, parent)) = pending.pop() {
        let node = find(root, index, "node")?;
        if std::mem::replace(&mut seen[index.value()], true) {
            return Err(Fault::content(format!("node {} is reached twice; nodes must form a tree", index.value())));
        }
        let transform = parent * local_transform(node);
        meshes.extend(node.mesh.map(|mesh| (mesh, transform)));
        pending.extend(node.children.iter().flatten().rev().map(|&child| (child, transform)));
    }
    Ok(meshes)
}

/// The nodes that are no child.
fn top_nodes(root: &Root) -> Vec<Index<json::Node>> {
    let mut child = vec![false; root.nodes.len()];
    for index in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(child) = child.get_mut(index.value()) {
            *child = true;
        }
    }
    (0..root.nodes.len()).filter(|&node| !child[node]).map(|node| Index::new(node as u32)).collect()
}

fn local_transform(node: &json::Node) -> Mat4 {
    if let Some(matrix) = &node.matrix {
        return Mat4::from_cols_array(matrix);
    }
    Mat4::from_scale_rotation_translation(
        node.scale.map_or(Vec3::ONE, Vec3::from_array),
        node.rotation.map_or(Quat::IDENTITY, |rotation| Quat::from_array(rotation.0)),
        node.translation.map_or(Vec3::ZERO, Vec3::from_array),
    )
}

/// The mesh under construction.
#[derive(Default)]
struct Parts {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    uvs: Vec<Vec2>,
    has_uvs: bool,
}

impl Parts {
    fn add(&mut self, source: &Source, primitive: &Primitive, transform: Mat4) -> Result<(), Fault> {
        let Checked::Valid(mode) = primitive.mode else { return Err(Fault::content("a primitive has no valid mode")) };
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = attribute(Semantic::Positions) else { return Ok(()) };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let positions: Vec<[f32; 3]> = source.vectors(positions, Type::Vec3)?;
        let indices = match primitive.indices {
            Some(indices) => source.indices(indices)?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
            return Err(Fault::content(format!("it refers to vertex {index} of a part with {}", positions.len())));
        }
        let first = self.positions.len() as u32;
        let mirrored = transform.determinant() < 0.0;
        let order = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
        let triangles = triangles(mode, &indices);
        if self.positions.len().saturating_add(positions.len()) > MAX_TRIANGLES
            || self.triangles.len().saturating_add(triangles.len()) > MAX_TRIANGLES
        {
            return Err(Fault::content(format!("it has more than {MAX_TRIANGLES} vertices or triangles")));
        }
        self.triangles.extend(triangles.into_iter().map(|corners| order(corners).map(|index| index + first)));
        self.positions.extend(positions.iter().map(|&point| transform.transform_point3(Vec3::from_array(point))));
        self.has_uvs &= match attribute(Semantic::TexCoords(0)) {
            Some(uvs) => {
                let uvs: Vec<[f32; 2]> = source.vectors(uvs, Type::Vec2)?;
                self.uvs.extend(uvs.into_iter().map(Vec2::from_array));
                self.uvs.len() == self.positions.len()
            }
            None => false,
        };
        Ok(())
    }
}

/// The triangles of a list of vertices.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => indices.as_chunks().0.to_vec(),
        // Every other triangle of a strip is reversed.
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(number, corners)| match corners {
                &[a, b, c] if number % 2 == 1 => [b, a, c],
                corners => [corners[0], corners[1], corners[2]],
            })
            .collect(),
        _ => indices
            .split_first()
            .map(|(&hub, rim)| rim.windows(2).map(|pair| [hub, pair[0], pair[1]]).collect())
            .unwrap_or_default(),
    }
}

/// The JSON and the data that it describes.
struct Source<'a> {
    root: &'a Root,
    buffers: &'a [Vec<u8>],
}

impl Source<'_> {
    /// The bytes behind a view, from `offset` on, and the view's stride if it has one.
    fn view(&self, view: Index<View>, offset: u64) -> Result<(&[u8], Option<usize>), Fault> {
        let view = find(self.root, view, "buffer view")?;
        let range = || {
            let start = usize::try_from(view.byte_offset.map_or(0, |offset| offset.0)).ok()?;
            let end = start.checked_add(usize::try_from(view.byte_length.0).ok()?)?;
            let bytes = self.buffers.get(view.buffer.value())?.get(start..end)?;
            bytes.get(usize::try_from(offset).ok()?..)
        };
        let bytes = range().ok_or_else(|| Fault::content("a buffer view reaches beyond its buffer"))?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0)))
    }

    /// An accessor's vectors as floats.
    fn vectors<const N: usize>(&self, accessor: Index<Accessor>, kind: Type) -> Result<Vec<[f32; N]>, Fault> {
        let accessor = find(self.root, accessor, "accessor")?;
        if accessor.type_ != Checked::Valid(kind) {
            return Err(Fault::content(format!("an accessor is not of type {kind:?}")));
        }
        let (component, count) = shape(accessor)?;
        let read = |bytes: &[u8]| {
            let size = component.size();
            std::array::from_fn(|axis| component_value(component, accessor.normalized, &bytes[axis * size..]))
        };
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                self.elements(view, offset, count, N * component.size(), read)?
            }
            // Without a view all values are zero, except the sparse ones.
            None => vec![[0.0; N]; count],
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(index) = sparse.indices.component_type else {
                return Err(Fault::content("a sparse accessor has no valid index type"));
            };
            let count = usize::try_from(sparse.count.0).unwrap_or(usize::MAX).min(count);
            let read_index = |bytes: &[u8]| integer(index.0, bytes);
            let places = self.elements(
                sparse.indices.buffer_view,
                sparse.indices.byte_offset.0,
                count,
                index.0.size(),
                read_index,
            )?;
            let (view, offset) = (sparse.values.buffer_view, sparse.values.byte_offset.0);
            let replacements = self.elements(view, offset, count, N * component.size(), read)?;
            for (place, replacement) in places.into_iter().zip(replacements) {
                *values
                    .get_mut(place as usize)
                    .ok_or_else(|| Fault::content("a sparse accessor refers to a value that is not there"))? =
                    replacement;
            }
        }
        Ok(values)
    }

    /// An accessor's indices.
    fn indices(&self, accessor: Index<Accessor>) -> Result<Vec<u32>, Fault> {
        let accessor = find(self.root, accessor, "accessor")?;
        let (component, count) = shape(accessor)?;
        let unsigned = matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        let (Some(view), true) = (accessor.buffer_view, unsigned && accessor.type_ == Checked::Valid(Type::Scalar))
        else {
            return Err(Fault::content("the indices of a part are not unsigned integers in a buffer view"));
        };
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        self.elements(view, offset, count, component.size(), |bytes| integer(component, bytes))
    }

    /// Reads `count` elements of `size` bytes.
    fn elements<T>(
        &self,
        view: Index<View>,
        offset: u64,
        count: usize,
        size: usize,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Fault> {
        let (bytes, stride) = self.view(view, offset)?;
        let stride = stride.unwrap_or(size);
        let end = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
        if end.is_none_or(|end| end > bytes.len()) {
            return Err(Fault::content("an accessor reaches beyond its buffer view; the file is damaged"));
        }
        Ok((0..count).map(|number| read(&bytes[number * stride..number * stride + size])).collect())
    }
}

/// Component type and count of an accessor.
fn shape(accessor: &Accessor) -> Result<(ComponentType, usize), Fault> {
    let Checked::Valid(component) = accessor.component_type else {
        return Err(Fault::content("an accessor has no valid component type"));
    };
    match usize::try_from(accessor.count.0) {
        Ok(count) if count <= 3 * MAX_TRIANGLES => Ok((component.0, count)),
        _ => Err(Fault::content(format!("an accessor has {} elements, too many", accessor.count.0))),
    }
}

/// A component as a float: normalised by section 3.11 of the glTF 2.0 specification, or unchanged.
fn component_value(component: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let (value, largest) = match (component, bytes) {
        (ComponentType::I8, &[a, ..]) => (f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a, ..]) => (f32::from(a), 255.0),
        (ComponentType::I16, &[a, b, ..]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b, ..]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::U32, &[a, b, c, d, ..]) => (u32::from_le_bytes([a, b, c, d]) as f32, u32::MAX as f32),
        (ComponentType::F32, &[a, b, c, d, ..]) => return f32::from_le_bytes([a, b, c, d]),
        // `elements` gives every reader the requested bytes.
        _ => return f32::NAN,
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}

/// An unsigned component.
fn integer(component: ComponentType, bytes: &[u8]) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a, ..]) => a.into(),
        (ComponentType::U16, &[a, b, ..]) => u16::from_le_bytes([a, b]).into(),
        (ComponentType::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
        // Not a valid index: the caller refuses it as out of range.
        _ => u32::MAX,
    }
}

#[cfg(test)]
mod tests;
