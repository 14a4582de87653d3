//! Closed meshes in the batch command: whole files, the same for any split of the work, and figures that add up.

use crate::{Folder, generate, output};
use bevy_vessels::synthesis::{
    io::load_mesh,
    mesh::{Closure, TriangleMesh},
};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The sum of a figure over both kinds.
fn sum(line: &Value, figure: &str) -> f64 {
    ["arterial", "venous"].iter().map(|kind| line[kind]["mesh"][figure].as_f64().expect("a figure")).sum()
}

fn welded(path: &Path) -> TriangleMesh {
    load_mesh(path).expect("a mesh").welded()
}

#[test]
fn each_format_is_one_file_with_all_kinds() {
    let folder = Folder::new("formats");
    let out = folder.0.display().to_string();
    let [line] = generate(&["--tissue=ball", "--seed=3", "--out", &out, "--format=ply,obj,stl,glb,off,obj-mesh"])
        .try_into()
        .expect("one organ");
    let organ = format!("ball_paper_{}_000003", line["run"].as_str().expect("a hash"));
    let path = |ending: &str| folder.0.join(organ.clone() + ending);
    let paths = [".obj", ".glb", ".stl", ".ply", ".off", "_mesh.obj"].map(|ending| path(ending).display().to_string());
    assert_eq!(line["files"], serde_json::json!(paths));
    let triangles = sum(&line, "triangles");
    assert!(triangles > 100.0);
    let file = |ending: &str| fs::read(path(ending)).expect("a file");
    assert_eq!(file(".stl").len() as f64, 84.0 + 50.0 * triangles);
    let ply = String::from_utf8_lossy(&file(".ply")).into_owned();
    assert!(ply.contains(&format!("element face {triangles}\n")), "{}", &ply[..ply.len().min(600)]);
    assert!(ply.contains(&format!("element vertex {}\n", sum(&line, "vertices"))));
    let obj = String::from_utf8(file("_mesh.obj")).expect("text");
    for text in [&ply, &obj, &String::from_utf8(file(".off")).expect("text")] {
        assert!(text.contains("vessels of ball, preset paper, seed 3"));
        assert!(text.contains(line["hash"].as_str().expect("a hash")));
    }
    assert!(obj.contains("\no arterial\n") && obj.contains("\no venous\n"));
    let glb = welded(&path(".glb"));
    let closure = Closure::of(glb.positions(), glb.triangles());
    assert!(closure.is_closed() && closure.is_oriented(), "{closure:?}");
    let volume = sum(&line, "volume");
    assert!((glb.signed_volume() / volume - 1.0).abs() < 1e-4, "{} in the file, {volume}", glb.signed_volume());
}

#[test]
fn files_and_figures_are_the_same_on_any_number_of_threads() {
    let formats = "--format=glb,stl,ply,off,obj-mesh";
    let grow = |name: &str, more: &[&str]| {
        let folder = Folder::new(name);
        let out = folder.0.display().to_string();
        let mut lines = generate(&[&["--count=4", formats, "--out", &out], more].concat());
        lines.iter_mut().for_each(|line| line["files"] = Value::Null);
        // Reports hold times.
        let names = folder.names("").into_iter().filter(|name| !name.ends_with(".json"));
        let file = |name: String| (fs::read(folder.path(&name)).expect("a file"), name);
        (lines, names.map(file).collect::<Vec<_>>())
    };
    let (figures, files) = grow("one", &["--threads=1"]);
    assert_eq!(files.len(), 21, "the settings, too");
    for (name, more) in [("three", ["--threads=3", "--shard=0/1"]), ("many", ["--threads=16", "--mesh"])] {
        let (other_figures, other_files) = grow(name, &more);
        assert_eq!(other_figures, figures);
        for (file, other) in files.iter().zip(&other_files) {
            assert!(file == other, "{} differs with {more:?}", file.1);
        }
    }
}

#[test]
fn figures_are_there_if_asked_for() {
    let [plain] = generate(&[]).try_into().expect("one organ");
    assert!(plain["arterial"].get("mesh").is_none());
    let [mut line] = generate(&["--mesh"]).try_into().expect("one organ");
    for kind in ["arterial", "venous"] {
        let mesh = line[kind]["mesh"].as_object().expect("an object").clone();
        let keys = ["triangles", "vertices", "closed", "euler", "self_intersections", "input_overlaps", "volume"];
        assert!(keys.iter().chain(&["mesh_ms", "ladder"]).all(|key| mesh.contains_key(*key)), "{mesh:?}");
        assert_eq!((&mesh["closed"], mesh.len()), (&true.into(), 9));
        assert!(mesh["volume"].as_f64() > Some(0.0));
        assert!(mesh["euler"].as_i64().is_some_and(|euler| euler > 0 && euler % 2 == 0), "2 for each tree");
        for step in ["laterals", "joined", "shortened", "moved", "remade", "left", "absorbed"] {
            assert!(mesh["ladder"][step].is_u64(), "{step}");
        }
        line[kind].as_object_mut().expect("an object").remove("mesh");
    }
    assert_eq!(line, plain, "the rest is as without");
    let [written] = generate(&["--format=stl"]).try_into().expect("one organ");
    assert!(written["venous"]["mesh"].is_object(), "a mesh format is asked for");
    let text = output(&["--mesh"]).expect("an organ");
    assert_eq!(text.matches(" triangles").count(), 2, "{text}");
}

#[test]
fn level_and_sides_count() {
    let triangles = |more: &[&str]| sum(&generate(&[&["--mesh"], more].concat())[0], "triangles");
    let plain = triangles(&[]);
    assert_eq!(triangles(&["--mesh-level=1", "--mesh-sides=16"]), plain, "the defaults");
    assert!(triangles(&["--mesh-level=2"]) > 3.5 * plain && triangles(&["--mesh-level=0"]) < 0.4 * plain);
    assert!(triangles(&["--mesh-sides=4"]) < plain);
}

#[test]
fn wrong_settings_are_named_with_exit_code_2() {
    for (arguments, expected) in [
        (
            ["--mesh-level=9"],
            "--mesh-level 9, --mesh-sides 16: a surface of level 9 is too fine; set level to 4 or less",
        ),
        (["--mesh-sides=7"], "a surface cannot have 7 sides around a vessel; set 4, 8, 16, 32 or 64"),
        (["--mesh-sides=2"], "a surface cannot have 2 sides"),
        (["--mesh-sides=-1"], "--mesh-sides"),
        (["--format=fbx"], "obj-mesh"),
    ] {
        let failure = output(&arguments).expect_err("a failure");
        assert_eq!(failure.exit_code(), 2, "{failure}");
        assert!(failure.to_string().contains(expected), "{failure}");
    }
}

#[test]
fn an_organ_without_veins_has_one_part() {
    let folder = Folder::new("mesh_veins");
    let out = folder.0.display().to_string();
    let [line] = generate(&["--no-veins", "--out", &out, "--format=obj-mesh"]).try_into().expect("one organ");
    assert!(line["venous"].get("mesh").is_none() && line["arterial"]["mesh"]["closed"] == true);
    let text = fs::read_to_string(line["files"][0].as_str().expect("a path")).expect("text");
    assert!(text.contains("\no arterial\n") && !text.contains("\no venous\n"));
}
