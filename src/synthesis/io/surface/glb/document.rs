//! The JSON of a GLB file: what is in it, and where.

use super::super::SurfaceOptions;
use super::super::notes::generator;
use super::super::part::SurfacePart;
use bevy_math::Vec3;
use gltf::json::{
    self, Accessor, Buffer, Index, Material, Mesh, Node, Root, Scene, Value,
    accessor::{ComponentType, GenericComponentType, Type},
    buffer::{Target, View},
    extras::RawValue,
    material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor},
    mesh::{Primitive, Semantic},
    validation::Checked::Valid,
};
use std::{collections::BTreeMap, io};

/// Roughness of wet tissue: a film of water gives broad, bright highlights.
const WET_ROUGHNESS: f32 = 0.35;

/// An array's elements: the attribute's name (without one, the indices of triangles), the shape, the type of components,
/// and whether integers stand for 0 to 1.
type Array = (Option<fn() -> Semantic>, Type, ComponentType, bool);

/// The arrays of vertices, in the order of the data.
pub(super) const ATTRIBUTES: [Array; 9] = [
    (Some(|| Semantic::Positions), Type::Vec3, ComponentType::F32, false),
    (Some(|| Semantic::Normals), Type::Vec3, ComponentType::F32, false),
    (Some(|| Semantic::Tangents), Type::Vec4, ComponentType::F32, false),
    (Some(|| Semantic::TexCoords(0)), Type::Vec2, ComponentType::F32, false),
    (Some(|| Semantic::Colors(0)), Type::Vec4, ComponentType::U8, true),
    // Their names get an underscore in the file.
    (Some(|| Semantic::Extras("RADIUS".to_owned())), Type::Scalar, ComponentType::F32, false),
    (Some(|| Semantic::Extras("NODE".to_owned())), Type::Scalar, ComponentType::F32, false),
    (Some(|| Semantic::Extras("BRANCH".to_owned())), Type::Scalar, ComponentType::F32, false),
    (Some(|| Semantic::Extras("STRAHLER".to_owned())), Type::Scalar, ComponentType::F32, false),
];

/// The corners of triangles.
const INDICES: Array = (None, Type::Scalar, ComponentType::U32, false);

/// glTF has no empty arrays: a part without faces has no mesh.
pub(super) fn has_mesh(part: &SurfacePart) -> bool {
    !part.mesh.faces.is_empty()
}

/// The JSON under construction.
#[derive(Default)]
pub(super) struct Document {
    root: Root,
    /// Bytes of the arrays described so far. All arrays have a multiple of four.
    pub(super) length: u64,
}

impl Document {
    pub(super) fn new(parts: &[SurfacePart], options: &SurfaceOptions) -> io::Result<Self> {
        let mut document = Self::default();
        document.root.asset.generator = Some(generator());
        document.root.asset.extras = asset_extras(options)?;
        let mut nodes = Vec::new();
        for part in parts {
            let mesh = if has_mesh(part) { Some(document.push_mesh(part)?) } else { None };
            let extras = raw(&BTreeMap::from([("kind", Value::from(part.kind.name()))]))?;
            let node = Node { mesh, name: Some(part.name.to_owned()), extras: Some(extras), ..Node::default() };
            nodes.push(document.root.push(node));
        }
        // glTF has no empty scenes either.
        if !nodes.is_empty() {
            let scene = Scene { extensions: None, extras: Default::default(), name: None, nodes };
            document.root.scene = Some(document.root.push(scene));
        }
        if document.length > 0 {
            document.root.push(Buffer {
                byte_length: document.length.into(),
                name: None,
                uri: None,
                extensions: None,
                extras: Default::default(),
            });
        }
        Ok(document)
    }

    /// The text, filled up with spaces to a multiple of four bytes.
    pub(super) fn text(&self) -> io::Result<Vec<u8>> {
        let mut text = json::serialize::to_vec(&self.root)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        Ok(text)
    }

    fn push_mesh(&mut self, part: &SurfacePart) -> io::Result<Index<Mesh>> {
        let vertices = part.mesh.positions.len() as u64;
        let mut attributes = BTreeMap::new();
        for array in ATTRIBUTES {
            let accessor = self.push_array(array, vertices);
            if let Some(semantic) = array.0 {
                attributes.insert(Valid(semantic()), accessor);
            }
        }
        if let Some(positions) = attributes.get(&Valid(Semantic::Positions)) {
            let (low, high) = bounds(&part.mesh.positions);
            let accessor = &mut self.root.accessors[positions.value()];
            accessor.min = Some(json::serialize::to_value(low.to_array())?);
            accessor.max = Some(json::serialize::to_value(high.to_array())?);
        }
        let indices = self.push_array(INDICES, 3 * part.mesh.triangle_count() as u64);
        let primitive = Primitive {
            attributes,
            extensions: None,
            extras: Default::default(),
            indices: Some(indices),
            material: Some(self.root.push(material(part))),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
        };
        Ok(self.root.push(Mesh {
            extensions: None,
            extras: Default::default(),
            name: Some(part.name.to_owned()),
            primitives: vec![primitive],
            weights: None,
        }))
    }

    /// Describes the next array of the data, with a buffer view of its own.
    fn push_array(&mut self, (semantic, shape, component, normalized): Array, count: u64) -> Index<Accessor> {
        let bytes = count * (shape.multiplicity() * component.size()) as u64;
        let target = if semantic.is_some() { Target::ArrayBuffer } else { Target::ElementArrayBuffer };
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: bytes.into(),
            byte_offset: Some(self.length.into()),
            byte_stride: None,
            name: None,
            target: Some(Valid(target)),
            extensions: None,
            extras: Default::default(),
        });
        self.length += bytes;
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: count.into(),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Valid(shape),
            min: None,
            max: None,
            name: None,
            normalized,
            sparse: None,
        })
    }
}

fn material(part: &SurfacePart) -> Material {
    let [red, green, blue] = part.color;
    let surface = PbrMetallicRoughness {
        base_color_factor: PbrBaseColorFactor([red, green, blue, 1.0]),
        metallic_factor: StrengthFactor(0.0),
        roughness_factor: StrengthFactor(WET_ROUGHNESS),
        ..PbrMetallicRoughness::default()
    };
    Material { name: Some(part.name.to_owned()), pbr_metallic_roughness: surface, ..Material::default() }
}

fn bounds(positions: &[Vec3]) -> (Vec3, Vec3) {
    let nothing = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    positions.iter().fold(nothing, |(low, high), &position| (low.min(position), high.max(position)))
}

/// The unit and the comments, if there are any.
fn asset_extras(options: &SurfaceOptions) -> io::Result<json::Extras> {
    let mut extras = BTreeMap::new();
    if let Some(scale) = options.scale {
        extras.insert("metres_per_unit", Value::from(scale.metres()));
    }
    if !options.comments.is_empty() {
        extras.insert("comments", Value::from(options.comments.clone()));
    }
    if extras.is_empty() { Ok(None) } else { raw(&extras).map(Some) }
}

fn raw(extras: &BTreeMap<&str, Value>) -> io::Result<Box<RawValue>> {
    Ok(RawValue::from_string(json::serialize::to_string(extras)?)?)
}
