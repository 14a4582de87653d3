//! What is read of a glTF document's JSON.
//!
//! Only what decides the shape of meshes is here. The rest, from materials to animations, may be of any kind. Values are
//! small: even lists of empty objects take less than 100 bytes for each byte of text.

use super::super::read::MeshDataError;
use gltf::json;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Extensions that compress the data of a mesh.
const COMPRESSIONS: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Extensions that a file may require: those that are read, and those that change no shape.
const KNOWN: [&str; 12] = [
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "MSFT_texture_dds",
    "KHR_lights_punctual",
    "KHR_xmp_json_ld",
    "KHR_animation_pointer",
    "EXT_lights_image_based",
];

/// Begin of the names of extensions that change how a surface looks.
const MATERIALS: &str = "KHR_materials_";

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    asset: Asset,
    extensions_required: Vec<String>,
    pub(super) scene: Option<u32>,
    pub(super) scenes: Vec<Scene>,
    pub(super) nodes: Vec<Node>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) skins: Vec<Skin>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<View>,
    pub(super) buffers: Vec<Buffer>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Asset {
    version: String,
    min_version: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Vec<u32>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) mesh: Option<u32>,
    pub(super) skin: Option<u32>,
    pub(super) children: Option<Box<[u32]>>,
    pub(super) matrix: Option<Box<[f32; 16]>>,
    pub(super) translation: Option<Box<[f32; 3]>>,
    pub(super) rotation: Option<Box<[f32; 4]>>,
    pub(super) scale: Option<Box<[f32; 3]>>,
    pub(super) weights: Option<Box<[f32]>>,
    pub(super) extensions: Option<Box<NodeExtensions>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
    #[serde(rename = "KHR_node_visibility")]
    pub(super) visibility: Option<Visibility>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Instancing {
    pub(super) attributes: Attributes,
}

#[derive(Deserialize)]
#[serde(default)]
pub(super) struct Visibility {
    pub(super) visible: bool,
}

impl Default for Visibility {
    fn default() -> Self {
        Self { visible: true }
    }
}

/// Accessors by the names of what they hold.
pub(super) type Attributes = BTreeMap<String, u32>;

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Box<[f32]>>,
}

#[derive(Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<u32>,
    pub(super) mode: u64,
    pub(super) targets: Option<Box<[Attributes]>>,
}

impl Default for Primitive {
    fn default() -> Self {
        Self { attributes: Attributes::new(), indices: None, mode: Self::TRIANGLES, targets: None }
    }
}

impl Primitive {
    pub(super) const TRIANGLES: u64 = 4;
    pub(super) const TRIANGLE_STRIP: u64 = 5;
    pub(super) const TRIANGLE_FAN: u64 = 6;
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) joints: Vec<u32>,
    pub(super) inverse_bind_matrices: Option<u32>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<u32>,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: Shape,
    pub(super) sparse: Option<Box<Sparse>>,
}

/// How many components an element has.
#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize)]
pub(super) enum Shape {
    #[serde(rename = "SCALAR")]
    Scalar,
    #[serde(rename = "VEC2")]
    Vec2,
    #[serde(rename = "VEC3")]
    Vec3,
    #[serde(rename = "VEC4")]
    Vec4,
    #[serde(rename = "MAT4")]
    Mat4,
    /// Any other, which nothing that is read has.
    #[default]
    #[serde(other)]
    Other,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparsePart,
    pub(super) values: SparsePart,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct SparsePart {
    pub(super) buffer_view: u32,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct View {
    pub(super) buffer: u32,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u32>,
}

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) byte_length: u64,
    pub(super) uri: Option<String>,
}

impl Document {
    /// Reads the JSON of a document of a version, and with extensions, that can be read.
    pub(super) fn read(text: &[u8]) -> Result<Self, MeshDataError> {
        let document: Self = json::deserialize::from_slice(text).map_err(|error| {
            // The error's own text may repeat what stands in the file.
            let (line, column) = (error.line(), error.column());
            let what = if error.is_data() { "holds a value of a wrong type" } else { "is damaged" };
            MeshDataError::content(format!(
                "it is not a glTF 2.0 file: its JSON {what} at line {line}, column {column}"
            ))
        })?;
        let is_read = |version: &str| version == "2" || version.starts_with("2.");
        if !is_read(&document.asset.version) {
            return Err(MeshDataError::content(
                "it does not say that it is of glTF version 2, the only one that is read",
            ));
        }
        if document.asset.min_version.as_deref().is_some_and(|least| least != "2" && least != "2.0") {
            return Err(MeshDataError::content("it asks for a version of glTF after 2.0; export it as 2.0"));
        }
        document.check_extensions()?;
        Ok(document)
    }

    fn check_extensions(&self) -> Result<(), MeshDataError> {
        let is_known = |name: &str| KNOWN.contains(&name) || name.starts_with(MATERIALS);
        let Some(name) = self.extensions_required.iter().find(|name| !is_known(name)) else { return Ok(()) };
        if COMPRESSIONS.contains(&name.as_str()) {
            return Err(MeshDataError::content(format!(
                "its meshes are compressed ({name}); export it without compression"
            )));
        }
        // Only what can be the name of an extension is repeated.
        const MOST_LETTERS: usize = 64;
        let is_name =
            name.len() <= MOST_LETTERS && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        let name = if is_name { name } else { "of no valid name" };
        Err(MeshDataError::content(format!("it requires the extension {name}, which is not read; export it without")))
    }
}

/// Looks up what an index of the JSON refers to: `what`, with its article.
pub(super) fn find<'a, T>(list: &'a [T], index: u32, what: &str) -> Result<&'a T, MeshDataError> {
    list.get(index as usize).ok_or_else(|| MeshDataError::content(format!("it refers to {what} that is not there")))
}
