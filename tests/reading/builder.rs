//! Binary glTF files, made of arrays and JSON.

use bevy_vessels::synthesis::{
    io::{MeshDataError, read_glb},
    mesh::TriangleMesh,
};
use serde_json::{Value, json};

/// The data of a file under construction.
#[derive(Default)]
pub struct Glb {
    data: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Glb {
    /// A file whose first accessors are the positions of a unit square in the plane of x and y, and its indices: 0 and
    /// 1.
    pub fn square() -> Self {
        let mut glb = Self::default();
        glb.floats("VEC3", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        glb.bytes("SCALAR", 5121, &[0, 1, 2, 0, 2, 3], 6);
        glb
    }

    /// Adds an accessor of floats and returns its index.
    pub fn floats<const N: usize>(&mut self, shape: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.bytes(shape, 5126, &bytes, values.len())
    }

    /// Adds an accessor of `count` elements with components of a type, and returns its index.
    pub fn bytes(&mut self, shape: &str, component: u32, bytes: &[u8], count: usize) -> usize {
        let view = self.views.len();
        self.views.push(json!({"buffer": 0, "byteOffset": self.data.len(), "byteLength": bytes.len()}));
        self.data.extend(bytes);
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        self.accessor(json!({"bufferView": view, "componentType": component, "count": count, "type": shape}))
    }

    /// Adds an accessor as it is and returns its index.
    pub fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// The file, with these members of the JSON beside its data.
    pub fn file(&self, members: Value) -> Vec<u8> {
        let mut root = json!({
            "asset": {"version": "2.0"}, "buffers": [{"byteLength": self.data.len()}],
            "bufferViews": self.views, "accessors": self.accessors,
        });
        let root_members = root.as_object_mut().expect("an object");
        root_members.extend(members.as_object().expect("an object").clone());
        if !root_members.contains_key("meshes") {
            root_members.insert("meshes".into(), json!([{"primitives": [square_part()]}]));
        }
        container(&root.to_string(), &self.data)
    }

    /// Reads the file with these members.
    pub fn read(&self, members: Value) -> Result<TriangleMesh, MeshDataError> {
        read_glb(&self.file(members))
    }
}

/// The square's part.
pub fn square_part() -> Value {
    json!({"attributes": {"POSITION": 0}, "indices": 1})
}

/// A binary file of JSON and data.
pub fn container(json: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + data.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_bytes()), (b"BIN\0", data)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}
