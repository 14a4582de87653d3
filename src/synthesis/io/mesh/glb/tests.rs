//! All supported variants of files, and damaged ones.

use super::{
    container::{MAGIC, decode_base64},
    part::triangles,
    *,
};
use crate::synthesis::mesh::MeshError;
use bevy_math::Vec3;

/// A binary file of a JSON text and data.
fn binary(text: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    let length = 12 + 8 + text.len() + 8 + data.len();
    bytes.extend(2u32.to_le_bytes());
    bytes.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text.as_bytes()), (b"BIN\0", data)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// Four corners of a unit square as 16-bit integers, 8 bytes apart, then two triangles of 8-bit indices.
fn square() -> Vec<u8> {
    let mut data = Vec::new();
    for [x, y] in [[0i16, 0], [100, 0], [100, 100], [0, 100]] {
        data.extend([x, y, 0, 0].into_iter().flat_map(i16::to_le_bytes));
    }
    data.extend([0, 1, 2, 0, 2, 3, 0, 0]);
    data
}

/// The JSON of the square, with a mode, a list of nodes and the source of its data.
fn text(mode: u32, nodes: &str, uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_mesh_quantization"],
        "scenes":[{{"nodes":[0]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":{mode}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5122,"count":4,"type":"VEC3","min":[0,0,0],"max":[100,100,0]}},
        {{"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":32,"byteStride":8}},{{"buffer":0,"byteOffset":32,"byteLength":6}}],
        "buffers":[{{"byteLength":40{uri}}}]}}"#
    )
}

const NODE: &str = r#"{"mesh":0,"scale":[0.01,0.01,0.01]}"#;

fn read(bytes: &[u8]) -> Result<TriangleMesh, MeshDataError> {
    read_gltf_in(bytes, Some(Path::new(".")))
}

#[test]
fn quantised_positions_and_node_transforms_are_read() -> Result<(), MeshDataError> {
    let mesh = read(&binary(&text(4, NODE, ""), &square()))?;
    assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
    assert!((mesh.area() - 1.0).abs() < 1e-6);
    // A mirrored child beside its moved parent: two squares, both facing up.
    let nodes = format!(
        r#"{{"mesh":0,"children":[1],"translation":[0,0,5],"scale":[0.01,0.01,1]}},{}"#,
        r#"{"mesh":0,"scale":[-1,1,1]}"#
    );
    let mesh = read(&binary(&text(4, &nodes, ""), &square()))?;
    assert_eq!((mesh.positions().len(), mesh.triangles().len()), (8, 4));
    assert!((0..4).all(|triangle| mesh.triangle_normal(triangle) == Vec3::Z));
    assert!(mesh.positions().iter().all(|position| position.z == 5.0));
    assert!((mesh.bounds().min.x + 1.0).abs() < 1e-6);
    Ok(())
}

#[test]
fn strips_and_fans_are_triangles() {
    assert_eq!(triangles(Primitive::TRIANGLE_STRIP, &[0, 1, 2, 3]), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(triangles(Primitive::TRIANGLE_FAN, &[0, 1, 2, 3]), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(triangles(Primitive::TRIANGLES, &[0, 1, 2, 3]), [[0, 1, 2]]);
    for mode in [Primitive::TRIANGLE_STRIP, Primitive::TRIANGLE_FAN, Primitive::TRIANGLES] {
        assert!(triangles(mode, &[]).is_empty() && triangles(mode, &[0, 1]).is_empty());
    }
    // Lines only: nothing to grow on.
    let lines = read(&binary(&text(1, NODE, ""), &square()));
    assert!(matches!(lines, Err(MeshDataError::Mesh(MeshError::Empty { .. }))));
}

#[test]
fn data_uris_and_files_are_read() -> Result<(), MeshDataError> {
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let data = [square(), vec![0, 0]].concat();
    let base64: String = data
        .as_chunks::<3>()
        .0
        .iter()
        .flat_map(|&[a, b, c]| {
            let bits = u32::from_be_bytes([0, a, b, c]);
            [18, 12, 6, 0].map(|shift| char::from(letters[(bits >> shift & 63) as usize]))
        })
        .collect();
    let uri = format!(r#","uri":"data:application/octet-stream;base64,{base64}""#);
    assert_eq!(read(text(4, NODE, &uri).as_bytes())?.triangles().len(), 2);
    assert_eq!(decode_base64("aGk="), Some(b"hi".to_vec()));
    assert_eq!(decode_base64("a-k="), None);
    let missing = read(text(4, NODE, r#","uri":"no%20such.bin""#).as_bytes());
    assert!(matches!(missing, Err(MeshDataError::Data { path, .. }) if path == Path::new("./no such.bin")));
    Ok(())
}

#[test]
fn damaged_files_are_errors() {
    let whole = binary(&text(4, NODE, ""), &square());
    for end in 0..whole.len() - 2 {
        assert!(read(&whole[..end]).is_err(), "{end} bytes of {} were read", whole.len());
    }
    for place in 0..whole.len() {
        for change in [1u8, 16, 128, 255] {
            let mut bent = whole.clone();
            bent[place] ^= change;
            // It may still be a mesh, but must not panic.
            let _ = read(&bent);
        }
    }
    for (from, to) in [
        (r#""nodes":[0]"#, r#""nodes":[7]"#),
        (r#""mesh":0"#, r#""mesh":3"#),
        (r#""mesh":0"#, r#""mesh":0,"children":[0]"#),
        (r#""POSITION":0"#, r#""POSITION":1"#),
        (r#""POSITION":0"#, r#""POSITION":9"#),
        (r#""indices":1"#, r#""indices":0"#),
        (r#""count":4"#, r#""count":5"#),
        (r#""count":4"#, r#""count":18446744073709551615"#),
        (r#""byteLength":32"#, r#""byteLength":4000"#),
        (r#""byteOffset":32"#, r#""byteOffset":18446744073709551615"#),
        (r#""byteStride":8"#, r#""byteStride":18446744073709551615"#),
        (r#""buffer":0"#, r#""buffer":2"#),
        ("KHR_mesh_quantization", "KHR_draco_mesh_compression"),
        ("5122", "5127"),
    ] {
        let bent = text(4, NODE, "").replace(from, to);
        assert!(read(&binary(&bent, &square())).is_err(), "{to} was read");
    }
    let mut past = square();
    past[32] = 9;
    assert!(read(&binary(&text(4, NODE, ""), &past)).is_err(), "an index beyond the vertices was read");
}
