//! The shared files that once failed, where they are there. What makes each of them special is also tested without
//! them.

use crate::shared;
use bevy_vessels::synthesis::{
    io::{SwcReadOptions, load_mesh, load_swc},
    mesh::TriangleMesh,
};
use std::path::{Path, PathBuf};

fn folder() -> Option<PathBuf> {
    shared::folder("cases")
}

fn read(folder: &Path, name: &str) -> TriangleMesh {
    load_mesh(&folder.join(name)).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn meshes_have_their_area() {
    let Some(folder) = folder() else { return };
    // That of the sphere of radius 1 in the files.
    const SPHERE: f64 = 12.521_61;
    for (name, area) in [
        ("u_plate.obj", 7.0),
        ("u_plate_right.obj", 7.0),
        ("dart_bad.obj", 4.0),
        ("dart_ok.obj", 4.0),
        ("box.obj", 6.0),
        ("box_bom.obj", 6.0),
        ("box_bom_spare.obj", 6.0),
        ("box_continued_lines.obj", 6.0),
        ("face_comment.obj", 6.0),
        ("vertex_comment.obj", 6.0),
        ("rgba.obj", 6.0),
        ("box_cr_only.obj", 6.0),
        ("box_and_near_polyline.obj", 6.0),
        ("node_scaled.glb", SPHERE),
        ("armature_scaled.glb", SPHERE * 1e-4),
        ("morph_weights.glb", 2.0),
        ("instanced_required.glb", 3.0 * SPHERE),
        ("hidden_far.glb", SPHERE),
        ("scene1.glb", 25.0 * SPHERE),
        ("no_default.glb", SPHERE),
        ("sphere_and_line.glb", SPHERE),
        ("mirrored_pair.glb", 2.0 * SPHERE),
    ] {
        let found = read(&folder, name).area();
        assert!((found / area - 1.0).abs() < 1e-5, "{name}: {found} instead of {area}");
    }
}

#[test]
fn meshes_are_where_they_are_shown_and_face_out() {
    let Some(folder) = folder() else { return };
    for name in ["node_scaled.glb", "hidden_far.glb", "sphere_and_line.glb"] {
        let bounds = read(&folder, name).bounds();
        assert!(bounds.min.abs().max_element() < 1.001 && bounds.max.abs().max_element() < 1.001, "{name}: {bounds:?}");
    }
    let sphere = read(&folder, "hidden_far.glb").signed_volume();
    assert!((sphere - 4.159).abs() < 0.001, "{sphere}");
    let pair = read(&folder, "mirrored_pair.glb").signed_volume();
    assert!((pair - 2.0 * sphere).abs() < 1e-4, "{pair}: one of the two faces in");
    // The slot of the letter U is free.
    let plate = read(&folder, "u_plate.obj");
    for triangle in 0..plate.triangles().len() {
        let [a, b, c] = plate.corners(triangle);
        let middle = (a + b + c) / 3.0;
        assert!(!(1.0..2.0).contains(&middle.x) || middle.y < 1.0, "{middle} is in the slot");
    }
}

#[test]
fn hostile_meshes_are_refused() {
    let Some(folder) = folder() else { return };
    for (name, expected) in [
        ("unknown_required.glb", "ACME_displaced_geometry"),
        ("asset_1_0.glb", "version 2"),
        ("no_view_67108864.glb", "no data"),
        ("uri_dev_zero.gltf", "not in its own folder"),
        ("uri_dotdot.gltf", "not in its own folder"),
        ("tobj_overflow_vn.obj", "line 5"),
    ] {
        let message = load_mesh(&folder.join(name)).expect_err(name).to_string();
        assert!(message.contains(name) && message.contains(expected), "{name}: {message}");
    }
}

#[test]
fn trees_have_all_their_nodes() {
    let Some(folder) = folder() else { return };
    for name in ["cr_only.swc", "float_ids.swc"] {
        let tree = load_swc(folder.join(name), &SwcReadOptions::default()).expect(name);
        assert_eq!((tree.len(), tree.roots().count()), (4, 1), "{name}");
    }
}
