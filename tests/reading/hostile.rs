//! Small files that describe much: what a file takes follows from its size.

use crate::builder::{Glb, container, square_part};
use bevy_vessels::synthesis::io::{SwcReadOptions, read_glb, read_obj_mesh, read_swc};
use serde_json::{Value, json};
use std::{
    alloc::{GlobalAlloc, Layout, System as Heap},
    cell::Cell,
};

thread_local! {
    /// Bytes of this thread, and the most of them since a measurement began.
    static BYTES: Cell<(isize, isize)> = const { Cell::new((0, 0)) };
}

fn count(bytes: isize) {
    BYTES.with(|counter| {
        let (now, most) = counter.get();
        let now = now + bytes;
        counter.set((now, most.max(now)));
    });
}

struct Counting;

// SAFETY: every call goes on to the system's allocator unchanged.
#[expect(unsafe_code, reason = "an allocator cannot be written otherwise")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { Heap.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { Heap.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both may exist while one is copied.
        count(size as isize);
        count(-(layout.size() as isize));
        unsafe { Heap.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What any file may take, in bytes.
const LEAST: usize = 20 << 20;

/// Asserts that reading takes at most 100 bytes for each of a file's, or [`LEAST`]; returns whether it was read.
fn check<T, E: std::fmt::Display>(name: &str, bytes: &[u8], read: impl Fn(&[u8]) -> Result<T, E>) -> Option<String> {
    let before = BYTES.with(|counter| {
        counter.set((counter.get().0, counter.get().0));
        counter.get().0
    });
    let outcome = read(bytes).err().map(|error| error.to_string());
    let taken = (BYTES.with(Cell::get).1 - before) as usize;
    assert!(taken <= LEAST.max(100 * bytes.len()), "{name}: {taken} bytes for a file of {}", bytes.len());
    outcome
}

fn refused(name: &str, bytes: &[u8]) {
    let message = check(name, bytes, read_glb).unwrap_or_else(|| panic!("{name} was read"));
    assert!(message.contains("describes much more") || message.contains("no data"), "{name}: {message}");
}

#[test]
fn announced_sizes_take_no_memory() {
    for count in [67_108_861, u32::MAX, 16_777_216] {
        let mut glb = Glb::square();
        let place = glb.bytes("SCALAR", 5121, &[7], 1);
        let zeros = glb.accessor(json!({"componentType": 5126, "count": count, "type": "VEC3"}));
        let part = |attributes: Value, indices: Value| {
            let parts = json!([{"attributes": attributes, "indices": indices, "mode": 5}]);
            json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": parts}]})
        };
        refused("positions", &glb.file(part(json!({"POSITION": zeros}), Value::Null)));
        let sparse =
            json!({"count": 1, "indices": {"bufferView": place, "componentType": 5121}, "values": {"bufferView": 0}});
        let mut one = json!({"componentType": 5126, "count": count, "type": "VEC3", "sparse": sparse});
        let sparse_positions = glb.accessor(one.clone());
        refused("sparse positions", &glb.file(part(json!({"POSITION": sparse_positions}), json!(1))));
        one["type"] = "SCALAR".into();
        one["componentType"] = 5121.into();
        let sparse_indices = glb.accessor(one);
        refused("sparse indices", &glb.file(part(json!({"POSITION": 0}), json!(sparse_indices))));
        let instances = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": zeros}}});
        refused("instances", &glb.file(json!({"nodes": [{"mesh": 0, "extensions": instances}]})));
    }
}

#[test]
fn copies_of_copies_are_refused() {
    let glb = Glb::square();
    // As many nodes as parts: a file of 2 MB that describes 600 million squares.
    let nodes = vec![json!({"mesh": 0}); 30_000];
    let parts = vec![square_part(); 20_000];
    let members = json!({"nodes": nodes, "meshes": [{"primitives": parts}]});
    refused("nodes and parts", &glb.file(members));
    let lines = vec![json!({"attributes": {}, "mode": 1}); 20_000];
    refused("nothing, often", &glb.file(json!({"nodes": nodes, "meshes": [{"primitives": lines}]})));
    // What is usual is read: 1000 squares.
    let usual = glb.file(json!({"nodes": nodes[..1000]}));
    assert_eq!(check("usual", &usual, read_glb), None);
    let mut glb = Glb::square();
    let many: Vec<[f32; 3]> = (0..30_000).map(|at| [at as f32, (at % 7) as f32, 0.0]).collect();
    let many = glb.floats("VEC3", &many);
    let shared = vec![json!({"attributes": {"POSITION": many}, "indices": 1}); 10_000];
    refused("a large array, often", &glb.file(json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": shared}]})));
}

#[test]
fn skins_and_targets_are_bounded() {
    let mut glb = Glb::square();
    let joints = glb.bytes("VEC4", 5121, &[0; 16], 4);
    let weights = glb.floats("VEC4", &[[1.0, 0.0, 0.0, 0.0]; 4]);
    let part = json!({"attributes": {"POSITION": 0, "JOINTS_0": joints, "WEIGHTS_0": weights}, "indices": 1});
    let mut nodes = vec![json!({"mesh": 0, "skin": 0}); 3000];
    nodes.push(json!({}));
    let skin = json!({"joints": vec![3000; 100_000]});
    refused("joints", &glb.file(json!({"nodes": nodes, "skins": [skin], "meshes": [{"primitives": [part]}]})));
    let targets = vec![json!({"POSITION": 0}); 1000];
    let morphed = json!({"attributes": {"POSITION": 0}, "indices": 1, "targets": targets});
    let mesh = json!({"primitives": vec![morphed; 10], "weights": vec![0.5; 1000]});
    refused("targets", &glb.file(json!({"nodes": vec![json!({"mesh": 0}); 3000], "meshes": [mesh]})));
}

#[test]
fn long_lists_and_deep_trees_take_what_they_must() {
    for (name, list) in [
        ("nodes", "{}"),
        ("scenes", "{}"),
        ("accessors", "{}"),
        ("bufferViews", "{}"),
        ("buffers", "{}"),
        ("meshes", "{}"),
        ("skins", "{}"),
        ("images", "{}"),
        ("materials", "{}"),
        ("nodes", r#"{"mesh":0}"#),
        ("nodes", r#"{"extensions":{}}"#),
        ("nodes", r#"{"weights":[]}"#),
        ("meshes", r#"{"primitives":[{}]}"#),
        ("meshes", r#"{"primitives":[{"attributes":{"":0}}]}"#),
    ] {
        let long = vec![list; 300_000].join(",");
        let json = format!(r#"{{"asset":{{"version":"2.0"}},"{name}":[{long}]}}"#);
        assert!(check(name, &container(&json, &[]), read_glb).is_some());
    }
    let chain: Vec<String> = (1..100_000).map(|child| format!(r#"{{"children":[{child}]}}"#)).collect();
    let json = format!(r#"{{"asset":{{"version":"2.0"}},"nodes":[{},{{}}]}}"#, chain.join(","));
    assert!(check("a chain", &container(&json, &[]), read_glb).is_some());
    let deep = format!(r#"{{"asset":{{"version":"2.0"}},"extras":{}{}}}"#, "[".repeat(1 << 20), "]".repeat(1 << 20));
    assert!(check("brackets", &container(&deep, &[]), read_glb).is_some());
}

#[test]
fn text_takes_what_it_must() {
    let corners: String = (0..200_000).map(|_| " 1").collect();
    let vertices = "v 0 0 0\n".repeat(100_000);
    for (name, text) in [
        ("one face", format!("v 0 0 0\nf{corners}\n")),
        ("vertices", vertices.clone()),
        ("texture coordinates", "vt 0\n".repeat(100_000)),
        ("small faces", format!("v 0 0 0\n{}", "f\n".repeat(500_000))),
        ("triangles", format!("v 0 0 0\n{}", "f 1 1 1\n".repeat(200_000))),
        ("continued", format!("f{}", " \\\n".repeat(300_000))),
        ("words", "v ".repeat(500_000)),
    ] {
        assert!(check(name, text.as_bytes(), read_obj_mesh).is_some(), "{name} was read");
    }
    // A comb of so many teeth is cut in time, or refused by the number of its corners.
    for teeth in [2000, 50_000] {
        let vertices: String = (0..2 * teeth).map(|at| format!("v {at} {} 0\n", at % 2)).collect();
        let face: String = (1..=2 * teeth).map(|corner| format!(" {corner}")).collect();
        let text = format!("{vertices}v {teeth} -1 0\nf{face} {}\n", 2 * teeth + 1);
        let message = check("a comb", text.as_bytes(), read_obj_mesh);
        assert_eq!(message.is_some_and(|message| message.contains("4096 corners")), teeth > 2000);
    }
    let nodes = "1 0 0 0 0 1 -1\n".repeat(100_000);
    assert!(check("nodes", nodes.as_bytes(), |bytes| read_swc(bytes, &SwcReadOptions::default())).is_some());
}
