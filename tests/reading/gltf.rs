//! What of a glTF file is shown, and where. Each file holds a unit square; the expected places are worked out by hand.

use crate::builder::{Glb, square_part};
use bevy_math::{Vec2, Vec3, vec3};
use bevy_vessels::synthesis::{io::read_glb, mesh::TriangleMesh};
use serde_json::{Value, json};

fn read(glb: &Glb, members: Value) -> TriangleMesh {
    glb.read(members.clone()).unwrap_or_else(|error| panic!("{error}: {members}"))
}

fn message(glb: &Glb, members: Value) -> String {
    glb.read(members).expect_err("a fault").to_string()
}

/// Asserts a mesh of so much area between two corners.
fn assert_is(mesh: &TriangleMesh, area: f64, min: Vec3, max: Vec3) {
    let bounds = mesh.bounds();
    assert!((mesh.area() - area).abs() < 1e-5 * area, "area {} instead of {area}", mesh.area());
    let close = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1e-5;
    assert!(close(bounds.min.into(), min) && close(bounds.max.into(), max), "{bounds:?} instead of {min} to {max}");
}

const UNIT: Vec3 = vec3(1.0, 1.0, 0.0);

#[test]
fn the_default_scene_is_shown_or_else_the_first() {
    let glb = Glb::square();
    let nodes = json!([{"mesh": 0}, {"mesh": 0, "translation": [20, 0, 0]}]);
    let scenes = json!([{"nodes": [0]}, {"nodes": [1]}]);
    assert_is(&read(&glb, json!({"nodes": nodes, "scenes": scenes})), 1.0, Vec3::ZERO, UNIT);
    let second = read(&glb, json!({"nodes": nodes, "scenes": scenes, "scene": 1}));
    assert_is(&second, 1.0, 20.0 * Vec3::X, UNIT + 20.0 * Vec3::X);
    assert_is(&read(&glb, json!({"nodes": nodes})), 2.0, Vec3::ZERO, UNIT + 20.0 * Vec3::X);
    assert!(message(&glb, json!({"nodes": nodes, "scenes": scenes, "scene": 2})).contains("a scene"));
}

#[test]
fn nodes_place_mirror_and_hide_their_meshes() {
    let glb = Glb::square();
    let shown = |nodes: Value| read(&glb, json!({"nodes": nodes}));
    // A quarter turn about z, then twice as large, then moved.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turned = shown(json!([{"children": [1], "translation": [5, 0, 1], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0, half, half]}]));
    assert_is(&turned, 4.0, vec3(3.0, 0.0, 1.0), vec3(5.0, 2.0, 1.0));
    let mirrored = shown(json!([{"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1]}]));
    assert_is(&mirrored, 2.0, vec3(-1.0, 0.0, 0.0), UNIT);
    assert!((0..4).all(|triangle| mirrored.triangle_normal(triangle) == Vec3::Z), "both face up");
    // Far parts that nothing is left of do not count; a flat mesh may be flattened.
    for scale in [[0, 0, 0], [0, 0, 3], [0, 5, 0]] {
        let hidden = json!([{"mesh": 0}, {"mesh": 0, "scale": scale, "translation": [1000, 0, 0]}]);
        assert_is(&shown(hidden), 1.0, Vec3::ZERO, UNIT);
        let child = json!([{"mesh": 0}, {"children": [2], "scale": scale}, {"mesh": 0, "translation": [9, 9, 9]}]);
        assert_is(&shown(child), 1.0, Vec3::ZERO, UNIT);
    }
    assert_is(&shown(json!([{"mesh": 0, "scale": [1, 1, 0]}])), 1.0, Vec3::ZERO, UNIT);
    let invisible = json!([{"mesh": 0}, {"extensions": {"KHR_node_visibility": {"visible": false}}, "children": [2]},
        {"mesh": 0, "translation": [9, 9, 9]}]);
    assert_is(&shown(invisible), 1.0, Vec3::ZERO, UNIT);
    // Far apart and back again.
    let far = json!([{"children": [1], "translation": [1e8, 0, 0]}, {"mesh": 0, "translation": [-1e8, 0, 0]}]);
    assert_is(&shown(far), 1.0, Vec3::ZERO, UNIT);
    for (node, expected) in [
        (json!({"mesh": 0, "translation": [1e39, 0, 0]}), "not finite"),
        (json!({"mesh": 0, "translation": [1e10, 0, 0]}), "beyond"),
        (json!({"mesh": 0, "rotation": [0, 0, 0, 0]}), "rotation"),
        (json!({"mesh": 0, "matrix": [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}), "last row"),
    ] {
        let message = message(&glb, json!({"nodes": [node]}));
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn skins_are_posed_by_their_joints_alone() {
    let mut glb = Glb::square();
    // The left side follows the first joint, the right side the second; the joints' weights add up to 2.
    let joints = glb.bytes("VEC4", 5121, &[0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 4);
    let weights = glb.floats("VEC4", &[[2.0, 0.0, 0.0, 0.0]; 4]);
    let moved = |x: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    let inverse = glb.floats("MAT4", &[moved(0.0), moved(-10.0)]);
    let part = |attributes: Value| json!([{"primitives": [{"attributes": attributes, "indices": 1}]}]);
    let skinned = json!({"POSITION": 0, "JOINTS_0": joints, "WEIGHTS_0": weights});
    let members = |second: Value, attributes: Value| {
        json!({
            "nodes": [{"mesh": 0, "skin": 0, "scale": [100, 100, 100], "translation": [500, 0, 0]},
                {"children": [2, 3], "scale": [0.5, 0.5, 0.5]}, {}, second],
            "meshes": part(attributes), "skins": [{"joints": [2, 3], "inverseBindMatrices": inverse}],
        })
    };
    // At rest the second joint is at 10, and all is halved.
    let rest = read(&glb, members(json!({"translation": [10, 0, 0]}), skinned.clone()));
    assert_is(&rest, 0.25, Vec3::ZERO, 0.5 * UNIT);
    let drawn_out = read(&glb, members(json!({"translation": [12, 0, 0]}), skinned.clone()));
    assert_is(&drawn_out, 0.75, Vec3::ZERO, vec3(1.5, 0.5, 0.0));
    // A second set of joints, with all the weight, on the first joint.
    let mut both = skinned.clone();
    let none = glb.floats("VEC4", &[[0.0; 4]; 4]);
    let last = glb.floats("VEC4", &[[0.0, 0.0, 0.0, 1.0]; 4]);
    let first = glb.bytes("VEC4", 5123, &[0; 32], 4);
    both["WEIGHTS_0"] = none.into();
    both["JOINTS_1"] = first.into();
    both["WEIGHTS_1"] = last.into();
    assert_is(&read(&glb, members(json!({}), both)), 0.25, Vec3::ZERO, 0.5 * UNIT);
    // Mirrored joints: the square faces as before.
    let mut mirrored = members(json!({"translation": [10, 0, 0]}), skinned.clone());
    mirrored["nodes"][1]["scale"] = json!([-0.5, 0.5, 0.5]);
    let mirrored = read(&glb, mirrored);
    assert_is(&mirrored, 0.25, vec3(-0.5, 0.0, 0.0), vec3(0.0, 0.5, 0.0));
    assert_eq!(mirrored.triangle_normal(0), Vec3::Z);
    let faulty = |change: &dyn Fn(&mut Value)| {
        let mut members = members(json!({}), skinned.clone());
        change(&mut members);
        message(&glb, members)
    };
    let attributes = |members: &mut Value, name: &str, value: Value| {
        members["meshes"][0]["primitives"][0]["attributes"][name] = value;
    };
    assert!(faulty(&|members| attributes(members, "WEIGHTS_0", none.into())).contains("add up to more than 0"));
    assert!(faulty(&|members| attributes(members, "WEIGHTS_1", none.into())).contains("lacks joints"));
    assert!(faulty(&|members| attributes(members, "JOINTS_0", weights.into())).contains("unsigned"));
    assert!(faulty(&|members| members["skins"][0]["joints"] = json!([2])).contains("joint that is not there"));
    assert!(faulty(&|members| members["skins"][0]["joints"] = json!([2, 3, 2])).contains("fewer matrices"));
    assert!(faulty(&|members| members["nodes"][0]["skin"] = json!(3)).contains("skin"));
}

#[test]
fn morph_targets_count_by_their_default_weights() {
    let mut glb = Glb::square();
    let right = glb.floats("VEC3", &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]]);
    let up = glb.floats("VEC3", &[[0.0; 3], [0.0; 3], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let shown = |mesh_weights: Value, node_weights: Value| {
        let targets = json!([{"POSITION": right}, {"POSITION": up, "NORMAL": 99}]);
        let mut mesh = json!({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "targets": targets}]});
        let mut node = json!({"mesh": 0});
        mesh["weights"] = mesh_weights;
        node["weights"] = node_weights;
        glb.read(json!({"meshes": [mesh], "nodes": [node]}))
    };
    let area = |mesh_weights, node_weights| shown(mesh_weights, node_weights).expect("a mesh").area();
    assert_eq!(area(Value::Null, Value::Null), 1.0);
    assert_eq!(area(json!([1, 0]), Value::Null), 2.0);
    assert_eq!(area(json!([1, 0]), json!([0, 0.5])), 1.5, "those of the node come first");
    assert_eq!(area(json!([1, 1]), Value::Null), 4.0);
    assert!(shown(json!([1]), Value::Null).is_err_and(|error| error.to_string().contains("one weight")));
}

#[test]
fn instances_are_shown_where_they_are() {
    let mut glb = Glb::square();
    let places = glb.floats("VEC3", &[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 7.0, 0.0]]);
    let scales = glb.floats("VEC3", &[[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [0.0, 0.0, 0.0]]);
    // Half a turn about z as 8-bit integers.
    let turns = glb.bytes("VEC4", 5120, &[0, 0, 0, 127, 0, 0, 0, 127, 0, 0, 127, 0], 3);
    glb.accessor(json!({"bufferView": turns, "componentType": 5120, "count": 3, "type": "VEC4", "normalized": true}));
    let shown = |attributes: Value, required: bool| {
        let extensions = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        let mut members = json!({"nodes": [{"mesh": 0, "scale": [2, 2, 2], "extensions": extensions}]});
        if required {
            members["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing", "KHR_materials_ior"]);
        }
        glb.read(members)
    };
    for required in [false, true] {
        let three = shown(json!({"TRANSLATION": places, "_COLOUR": 99}), required).expect("a mesh");
        assert_is(&three, 12.0, Vec3::ZERO, vec3(12.0, 16.0, 0.0));
    }
    let two = shown(json!({"TRANSLATION": places, "SCALE": scales}), true).expect("a mesh");
    assert_is(&two, 12.0, Vec3::ZERO, vec3(14.0, 2.0, 0.0));
    let turned = shown(json!({"TRANSLATION": places, "ROTATION": turns + 1}), true).expect("a mesh");
    assert_is(&turned, 12.0, vec3(-2.0, 0.0, 0.0), vec3(12.0, 14.0, 0.0));
    assert!(shown(json!({"TRANSLATION": places, "SCALE": 0}), true).is_err(), "3 places, 4 scales");
    assert!(shown(json!({"_COLOUR": 0}), true).is_err(), "instances without places");
    let skinned =
        json!({"nodes": [{"mesh": 0, "skin": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}}]});
    assert!(message(&glb, skinned).contains("no meaning together"));
}

#[test]
fn what_growth_does_not_use_does_not_decide() {
    let mut glb = Glb::square();
    let line = glb.floats("VEC3", &[[0.0, 0.0, 2.0], [0.0, f32::NAN, 3.0]]);
    let spare = glb.floats("VEC3", &[[9.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN; 3]]);
    let own = glb.bytes("SCALAR", 5121, &[1, 2, 3], 3);
    let members = json!({
        "nodes": [{"mesh": 0, "camera": "none"}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": line}, "mode": 3}, {"attributes": {"POSITION": 99}, "indices": 98, "mode": 0},
            {"attributes": {"POSITION": 0, "NORMAL": 99, "TANGENT": 1}, "indices": 1, "material": 7},
            {"attributes": {"POSITION": spare}, "indices": own}, {"attributes": {"NORMAL": 0}}]}],
        "materials": "no list", "images": [{"uri": "/dev/zero"}], "animations": [3], "extensionsUsed": ["ACME_any"],
        "skins": [{"joints": [77]}], "cameras": null,
    });
    let mesh = read(&glb, members);
    assert_is(&mesh, 1.5, Vec3::ZERO, UNIT);
    assert_eq!(mesh.positions().len(), 7, "vertices without a triangle are left out");
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut glb = Glb::square();
    let place = glb.bytes("SCALAR", 5121, &[1, 2], 2);
    let value = glb.floats("VEC3", &[[3.0, 0.0, 0.0], [3.0, 1.0, 0.0]]);
    let sparse = |count: u32| {
        let indices = json!({"bufferView": place, "componentType": 5121});
        json!({"count": count, "indices": indices, "values": {"bufferView": value}})
    };
    let over = json!({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse(2)});
    let over = glb.accessor(over);
    // From zeros: the triangle 1 2 3 of the second square has its last corner at the origin.
    let alone = glb.accessor(json!({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse(2)}));
    let reindexed = json!({"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR", "sparse": {"count": 1,
        "indices": {"bufferView": place, "componentType": 5121}, "values": {"bufferView": place, "byteOffset": 1}}});
    let reindexed = glb.accessor(reindexed);
    let damaged = glb.accessor(json!({"componentType": 5126, "count": 2, "type": "VEC3", "sparse": sparse(2)}));
    let part = |positions: usize, indices: usize| {
        let part = json!({"attributes": {"POSITION": positions}, "indices": indices});
        json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [part]}]})
    };
    assert_eq!(read(&glb, part(over, 1)).area(), 3.0);
    assert_eq!(read(&glb, part(alone, 1)).area(), 1.5);
    // The first triangle becomes 0 2 2.
    assert_eq!(read(&glb, part(0, reindexed)).area(), 0.5);
    assert!(message(&glb, part(damaged, 1)).contains("an element that is not there"));
}

#[test]
fn texture_coordinates_are_read_if_all_parts_have_them() {
    let mut glb = Glb::square();
    let uvs = glb.bytes("VEC2", 5121, &[0, 0, 255, 0, 255, 255, 0, 255], 4);
    glb.accessor(json!({"bufferView": uvs, "componentType": 5121, "count": 4, "type": "VEC2", "normalized": true}));
    let with = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": uvs + 1}, "indices": 1});
    let read = |parts: Value| read(&glb, json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": parts}]}));
    let mesh = read(json!([with, with]));
    assert_eq!(mesh.uvs().map(|uvs| (uvs.len(), uvs[2])), Some((8, Vec2::ONE)));
    assert!(read(json!([with, square_part()])).uvs().is_none());
}

#[test]
fn versions_and_required_extensions_are_refused_by_name() {
    let glb = Glb::square();
    let with = |members: Value| {
        let mut all = json!({"nodes": [{"mesh": 0}]});
        all.as_object_mut().expect("an object").extend(members.as_object().expect("an object").clone());
        glb.read(all).map_err(|error| error.to_string())
    };
    for asset in [json!({"version": "2.0"}), json!({"version": "2.1", "minVersion": "2.0"})] {
        assert!(with(json!({"asset": asset})).is_ok(), "{asset}");
    }
    for asset in
        [json!({"version": "1.0"}), json!({"version": "20"}), json!({}), json!({"version": "2.1", "minVersion": "2.1"})]
    {
        assert!(with(json!({"asset": asset})).is_err_and(|message| message.contains("version")), "{asset}");
    }
    for name in ["KHR_mesh_quantization", "KHR_materials_unlit", "KHR_texture_transform"] {
        assert!(with(json!({"extensionsRequired": [name]})).is_ok(), "{name}");
    }
    for name in ["ACME_displaced_geometry", "KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
        let message = with(json!({"extensionsRequired": ["KHR_materials_ior", name]})).expect_err(name);
        assert!(message.contains(name) && message.contains("export it without"), "{message}");
    }
    let message = with(json!({"extensionsRequired": ["root:x:0:0:"]})).expect_err("no name");
    assert!(!message.contains("root"), "{message}");
}

#[test]
fn other_chunks_are_skipped() {
    let file = Glb::square().file(json!({"nodes": [{"mesh": 0}]}));
    let json_end = 20 + u32::from_le_bytes([file[12], file[13], file[14], file[15]]) as usize;
    let (json, binary) = file.split_at(json_end);
    let with_more = [json, b"\x04\0\0\0MOREmore", binary].concat();
    assert_eq!(read_glb(&with_more).expect("a mesh").area(), 1.0);
}
