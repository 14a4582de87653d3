//! Files beside a glTF file, and files that are none.

use crate::builder::Glb;
use bevy_vessels::synthesis::io::{MeshReadError, SwcReadOptions, load_mesh, load_swc, read_glb};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// A temporary folder of a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_vessels_reading_{name}_{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder for temporary files");
        Self(path)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, bytes).expect("a file");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

/// A glTF file with a triangle whose positions are in other files, one for each URI.
fn gltf(uris: &[&str], length: usize) -> String {
    let buffers: Vec<_> = uris.iter().map(|uri| json!({"byteLength": length, "uri": uri})).collect();
    let numbers = 0..uris.len();
    let views: Vec<_> = numbers.clone().map(|buffer| json!({"buffer": buffer, "byteLength": 36})).collect();
    let accessors: Vec<_> = numbers
        .clone()
        .map(|view| json!({"bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3"}))
        .collect();
    let parts: Vec<_> = numbers.map(|accessor| json!({"attributes": {"POSITION": accessor}})).collect();
    json!({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": parts}],
        "accessors": accessors, "bufferViews": views, "buffers": buffers})
    .to_string()
}

fn triangle() -> Vec<u8> {
    [0.0f32, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0].into_iter().flat_map(f32::to_le_bytes).collect()
}

fn message(path: &Path) -> String {
    load_mesh(path).expect_err("a fault").to_string()
}

#[test]
fn data_is_read_from_the_folder_of_the_file_and_below() {
    let folder = Folder::new("below");
    for name in ["a b.bin", "data/c.bin"] {
        folder.write(name, triangle());
    }
    let path = folder.write("organ.gltf", gltf(&["a%20b.bin", "./data/c.bin", "a b.bin"], 36));
    assert_eq!(load_mesh(&path).expect("a mesh").area(), 3.0);
    // Alone, the same bytes have no folder.
    let message = read_glb(&fs::read(&path).expect("bytes")).expect_err("no folder").to_string();
    assert!(message.contains("in another file"), "{message}");
}

#[test]
fn no_other_file_is_read() {
    let folder = Folder::new("other");
    let secret = folder.write("secret.bin", triangle());
    let inner = folder.write("inner/own.bin", triangle());
    let absolute = secret.display().to_string();
    for uri in ["../secret.bin", "%2e%2e/secret.bin", "x/../../secret.bin", &absolute, "/dev/zero", "file:own.bin", ""]
    {
        let path = folder.write("inner/organ.gltf", gltf(&[uri], 36));
        let message = message(&path);
        assert!(message.contains("not in its own folder") && !message.contains("secret"), "{uri}: {message}");
    }
    let path = folder.write("inner/organ.gltf", gltf(&["missing.bin"], 36));
    assert!(message(&path).contains("missing.bin"));
    let path = folder.write("inner/organ.gltf", gltf(&["."], 36));
    assert!(message(&path).contains("no regular file"));
    // No more than is announced, though more is there.
    fs::write(&inner, [triangle(), triangle()].concat()).expect("a file");
    let path = folder.write("inner/organ.gltf", gltf(&["own.bin"], 35));
    assert!(message(&path).contains("beyond its data"));
}

#[test]
#[cfg(unix)]
fn links_pipes_and_devices_are_refused() {
    let folder = Folder::new("pipes");
    folder.write("secret.bin", triangle());
    let inner = folder.0.join("inner");
    fs::create_dir_all(&inner).expect("a folder");
    std::os::unix::fs::symlink("../secret.bin", inner.join("out.bin")).expect("a link");
    std::os::unix::fs::symlink("/dev/zero", inner.join("zero.obj")).expect("a link");
    std::os::unix::fs::symlink("own.bin", inner.join("in.bin")).expect("a link");
    folder.write("inner/own.bin", triangle());
    let organ = |uri: &str| folder.write("inner/organ.gltf", gltf(&[uri], 36));
    assert!(message(&organ("out.bin")).contains("not in its own folder"));
    assert_eq!(load_mesh(&organ("in.bin")).expect("a mesh").area(), 1.0, "a link within the folder");
    assert!(message(&inner.join("zero.obj")).contains("no regular file"));
    let made = |name: &str| std::process::Command::new("mkfifo").arg(inner.join(name)).status();
    for name in ["pipe.bin", "pipe.glb", "pipe.obj", "pipe.swc"] {
        assert!(made(name).is_ok_and(|status| status.success()), "mkfifo {name}");
    }
    // None of these waits for a writer.
    assert!(message(&organ("pipe.bin")).contains("no regular file"));
    for name in ["pipe.glb", "pipe.obj"] {
        assert!(matches!(load_mesh(&inner.join(name)), Err(MeshReadError::Io { .. })));
    }
    for path in [inner.join("pipe.swc"), PathBuf::from("/dev/zero"), inner] {
        let message = load_swc(&path, &SwcReadOptions::default()).expect_err("no file").to_string();
        assert!(message.contains("no regular file"), "{message}");
    }
}

#[test]
fn messages_repeat_nothing_that_a_file_holds() {
    let folder = Folder::new("quiet");
    // Text where floats are expected: as numbers, it is beyond what a coordinate may be, or an index.
    let text = "root:x:0:0:root:/root:/bin/bash\nkey=hunter2\n";
    folder.write("passwd", text);
    let numbers = ["7.1", "1814", "8245", "0x", "hunter", "root:", "e+", "e22", "1919905650"];
    let quiet = |message: String| {
        assert!(numbers.iter().all(|number| !message.contains(number)), "{message}");
    };
    quiet(message(&folder.write("a.gltf", gltf(&["passwd"], 36))));
    let mut glb = Glb::square();
    let indices = glb.bytes("SCALAR", 5125, &text.as_bytes()[..36], 9);
    let part = json!({"attributes": {"POSITION": 0}, "indices": indices});
    let members = json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [part]}]});
    quiet(message(&folder.write("b.glb", glb.file(members))));
    for ending in ["gltf", "glb", "obj"] {
        quiet(message(&folder.write(&format!("c.{ending}"), text)));
        quiet(message(&folder.write(&format!("d.{ending}"), format!("glTF{text}"))));
        quiet(message(&folder.write(&format!("e.{ending}"), format!("f {text}"))));
        quiet(message(
            &folder.write(&format!("g.{ending}"), format!("{{\"asset\": \"{}\"}}", text.trim().replace('\n', " "))),
        ));
    }
    let path = folder.write("f.swc", format!("1 0 0 0 0 1 -1\n{text}"));
    quiet(load_swc(&path, &SwcReadOptions::default()).expect_err("no tree").to_string());
    let path = folder.write("g.swc", format!("1 0 {} 0 0 1 -1\n", text.replace('\n', "")));
    quiet(load_swc(&path, &SwcReadOptions::default()).expect_err("no tree").to_string());
}
