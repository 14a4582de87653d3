//! Closed meshes in the batch command: whole files, the same for any split of the work, and figures that add up.

#[path = "../examples/generate/command.rs"]
mod command;

use bevy_vessels::synthesis::{
    io::load_mesh,
    mesh::{Closure, TriangleMesh},
};
use clap::Parser;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Runs the command on a small organ.
fn run(arguments: &[&str]) -> Result<String, command::Failure> {
    let all = [&["generate", "--steps=12", "--samples=300"], arguments].concat();
    let options = command::Options::try_parse_from(all).map_err(|error| command::Failure::Usage(error.to_string()))?;
    let mut bytes = Vec::new();
    command::run(&options, &mut bytes)?;
    Ok(String::from_utf8(bytes).expect("text"))
}

/// The lines of JSON, without the times, which differ between runs.
fn lines(arguments: &[&str]) -> Vec<Value> {
    let text = run(&[&["--json"], arguments].concat()).expect("organs");
    let line = |line: &str| {
        let mut line: Value = serde_json::from_str(line).expect("a line of JSON");
        line["grow_ms"] = Value::Null;
        for kind in ["arterial", "venous"] {
            if let Some(ms) = line[kind].get_mut("mesh").and_then(|mesh| mesh.get_mut("mesh_ms")) {
                assert!(ms.as_f64().is_some_and(|ms| ms > 0.0));
                *ms = Value::Null;
            }
        }
        line
    };
    text.lines().map(line).collect()
}

/// A temporary folder of a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_vessels_generate_mesh_{name}_{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder for temporary files");
        Self(path)
    }

    /// All files, by name, with their bytes.
    fn files(&self) -> Vec<(String, Vec<u8>)> {
        let file = |path: PathBuf| {
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            (name, fs::read(path).expect("a file"))
        };
        let entries = fs::read_dir(&self.0).expect("a folder").map(|entry| entry.expect("an entry").path());
        let mut files: Vec<_> = entries.map(file).collect();
        files.sort();
        files
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

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
    let [line] = lines(&["--tissue=ball", "--seed=3", "--out", &out, "--format=ply,obj,stl,glb,off,obj-mesh"])
        .try_into()
        .expect("one organ");
    let names = ["ball_paper_3.obj", "ball_paper_3.glb", "ball_paper_3.stl", "ball_paper_3.ply", "ball_paper_3.off"];
    let names: Vec<String> = [&names[..], &["ball_paper_3_mesh.obj"]]
        .concat()
        .iter()
        .map(|name| folder.0.join(name).display().to_string())
        .collect();
    assert_eq!(line["files"], serde_json::json!(names));
    let triangles = sum(&line, "triangles");
    assert!(triangles > 100.0);
    let file = |name: &str| fs::read(folder.0.join(name)).expect("a file");
    assert_eq!(file("ball_paper_3.stl").len() as f64, 84.0 + 50.0 * triangles);
    let ply = String::from_utf8_lossy(&file("ball_paper_3.ply")).into_owned();
    assert!(ply.contains(&format!("element face {triangles}\n")), "{}", &ply[..ply.len().min(600)]);
    assert!(ply.contains(&format!("element vertex {}\n", sum(&line, "vertices"))));
    let obj = String::from_utf8(file("ball_paper_3_mesh.obj")).expect("text");
    for text in [&ply, &obj, &String::from_utf8(file("ball_paper_3.off")).expect("text")] {
        assert!(text.contains("vessels of ball, preset paper, seed 3"));
        assert!(text.contains(line["hash"].as_str().expect("a hash")));
    }
    assert!(obj.contains("\no arterial\n") && obj.contains("\no venous\n"));
    let glb = welded(&folder.0.join("ball_paper_3.glb"));
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
        let mut lines = lines(&[&["--count=4", formats, "--out", &out], more].concat());
        lines.iter_mut().for_each(|line| line["files"] = Value::Null);
        (lines, folder.files())
    };
    let (figures, files) = grow("one", &["--threads=1"]);
    assert_eq!(files.len(), 20);
    for (name, more) in [("three", ["--threads=3", "--shard=0/1"]), ("many", ["--threads=16", "--mesh"])] {
        let (other_figures, other_files) = grow(name, &more);
        assert_eq!(other_figures, figures);
        for (file, other) in files.iter().zip(&other_files) {
            assert!(file == other, "{} differs with {more:?}", file.0);
        }
    }
}

#[test]
fn figures_are_there_if_asked_for() {
    let [plain] = lines(&[]).try_into().expect("one organ");
    assert!(plain["arterial"].get("mesh").is_none());
    let [mut line] = lines(&["--mesh"]).try_into().expect("one organ");
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
    let [written] = lines(&["--format=stl"]).try_into().expect("one organ");
    assert!(written["venous"]["mesh"].is_object(), "a mesh format is asked for");
    let text = run(&["--mesh"]).expect("an organ");
    assert_eq!(text.matches(" triangles").count(), 2, "{text}");
}

#[test]
fn level_and_sides_count() {
    let triangles = |more: &[&str]| sum(&lines(&[&["--mesh"], more].concat())[0], "triangles");
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
        let failure = run(&arguments).expect_err("a failure");
        assert_eq!(failure.exit_code(), 2, "{failure}");
        assert!(failure.to_string().contains(expected), "{failure}");
    }
}

#[test]
fn an_organ_without_veins_has_one_part() {
    let folder = Folder::new("veins");
    let out = folder.0.display().to_string();
    let [line] = lines(&["--no-veins", "--out", &out, "--format=obj-mesh"]).try_into().expect("one organ");
    assert!(line["venous"].get("mesh").is_none() && line["arterial"]["mesh"]["closed"] == true);
    let text = String::from_utf8(folder.files()[0].1.clone()).expect("text");
    assert!(text.contains("\no arterial\n") && !text.contains("\no venous\n"));
}
