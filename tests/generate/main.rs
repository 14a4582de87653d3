//! The batch command: the same organ for any split of the work, whole files, clear errors.

mod bake;
#[path = "../../examples/generate/command.rs"]
mod command;
mod mesh;
mod procedural;
mod runs;

use bevy_vessels::synthesis::{
    io::{SwcReadOptions, load_swc},
    preset::PresetName,
};
use clap::Parser;
use command::Summary;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Runs the command on a small organ and returns its lines of JSON without the times, which differ between runs.
fn generate(arguments: &[&str]) -> Vec<Value> {
    let text = output(&[&["--json"], arguments].concat()).expect("organs");
    let line = |line: &str| {
        let mut line: Value = serde_json::from_str(line).expect("a line of JSON");
        assert!(line["grow_ms"].as_f64().is_some_and(|ms| ms > 0.0));
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

fn output(arguments: &[&str]) -> Result<String, command::Failure> {
    run(&[&["--steps=12", "--samples=300"], arguments].concat())
}

/// Runs the command with these arguments only.
fn run(arguments: &[&str]) -> Result<String, command::Failure> {
    Ok(run_until(&AtomicBool::new(false), arguments)?.0)
}

/// The same until it is to stop. Returns what it writes, and its summary.
fn run_until(stop: &AtomicBool, arguments: &[&str]) -> Result<(String, Summary), command::Failure> {
    let all = [&["generate"], arguments].concat();
    let options = command::Options::try_parse_from(all).map_err(|error| command::Failure::Usage(error.to_string()))?;
    let mut bytes = Vec::new();
    let summary = command::run(&options, &mut bytes, stop)?;
    Ok((String::from_utf8(bytes).expect("text"), summary))
}

fn failure(arguments: &[&str]) -> (u8, String) {
    let failure = output(arguments).expect_err("a failure");
    (failure.exit_code(), failure.to_string())
}

/// A temporary folder of a test, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_vessels_generate_{name}_{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder for temporary files");
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    /// Names of what is in a folder below, sorted.
    fn names(&self, below: &str) -> Vec<String> {
        let entries = fs::read_dir(self.0.join(below)).expect("a folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).ok();
    }
}

/// The files of an organ.
fn files_of(line: &Value) -> Vec<&str> {
    line["files"].as_array().expect("files").iter().filter_map(Value::as_str).collect()
}

/// The hash of a run in the names of its files.
fn run_of(line: &Value) -> &str {
    line["run"].as_str().expect("a hash")
}

#[test]
fn an_organ_is_the_same_whatever_count_shard_and_threads() {
    for tissue in ["disc", "ball"] {
        let run = |arguments: &[&str]| generate(&[&["--tissue", tissue], arguments].concat());
        let all = run(&["--seed=5", "--count=7", "--threads=1"]);
        let seeds: Vec<u64> = all.iter().filter_map(|line| line["seed"].as_u64()).collect();
        assert_eq!(seeds, [5, 6, 7, 8, 9, 10, 11], "in the order of the seeds");
        assert_eq!(run(&["--seed=5", "--count=7", "--threads=3"]), all);
        assert_eq!(run(&["--seed=5", "--count=7", "--threads=16"]), all);
        for (index, line) in all.iter().enumerate() {
            let seed = format!("--seed={}", 5 + index);
            assert_eq!(run(&[&seed, "--threads=2"]), std::slice::from_ref(line), "alone, on two threads");
        }
        for shard in 0..3 {
            let share: Vec<Value> = all.iter().skip(shard).step_by(3).cloned().collect();
            assert_eq!(run(&["--seed=5", "--count=7", &format!("--shard={shard}/3")]), share);
        }
        assert!(run(&["--count=2", "--shard=2/3"]).is_empty(), "a share of nothing");
        let mut hashes: Vec<&str> = all.iter().filter_map(|line| line["hash"].as_str()).collect();
        assert!(hashes.iter().all(|hash| hash.len() == 16 && u64::from_str_radix(hash, 16).is_ok()));
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), 7, "different seeds differ");
    }
}

#[test]
fn a_line_has_the_fields_that_scripts_read() {
    let text = output(&["--json", "--tissue=box"]).expect("an organ");
    // In this order, which the parsed object does not keep.
    let keys = [
        "tissue", "mode", "preset", "run", "unit", "extent", "seed", "steps", "grow_ms", "hash", "arterial", "venous",
        "files",
    ];
    let mut at = 0;
    for key in keys {
        at += text[at..].find(&format!("\"{key}\":")).unwrap_or_else(|| panic!("{key} is missing or out of place"));
    }
    let line: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(line.as_object().expect("an object").len(), keys.len());
    assert_eq!((&line["tissue"], &line["preset"], &line["steps"]), (&"box".into(), &"paper".into(), &12.into()));
    for kind in ["arterial", "venous"] {
        let measures = line[kind].as_object().expect("an object");
        assert_eq!(measures.len(), 16);
        for key in [
            "nodes",
            "leaves",
            "bifurcations",
            "total_length",
            "root_radius",
            "terminal_radius",
            "angle_mean_deg",
            "angle_sd_deg",
            "strahler_orders",
            "strahler",
            "branching_ratio",
            "length_ratio",
            "diameter_ratio",
            "tortuosity_median",
            "coverage",
            "outside",
        ] {
            assert!(measures.contains_key(key), "{kind} {key}");
        }
    }
    assert!(line["arterial"]["coverage"].as_f64().is_some_and(|share| share > 0.0 && share < 1.0));
}

#[test]
fn files_hold_the_vessels_that_are_reported() {
    let folder = Folder::new("files");
    let out = folder.path("made/for/it");
    let [line] =
        generate(&["--tissue=ball", "--seed=3", "--out", &out, "--format=swc,obj,csv,swc"]).try_into().expect("one");
    let files = files_of(&line);
    let organ = format!("ball_paper_{}_000003", run_of(&line));
    let endings = ["_arterial.swc", "_venous.swc", ".obj", ".csv"];
    assert_eq!(files, endings.map(|ending| Path::new(&out).join(organ.clone() + ending).display().to_string()));
    let besides = [organ.clone() + ".json", organ.replace("_000003", ".ron")];
    let mut names = [&endings.map(|ending| organ.clone() + ending)[..], &besides].concat();
    names.sort();
    assert_eq!(folder.names("made/for/it"), names, "nothing else is left there");
    let report: Value =
        serde_json::from_str(&fs::read_to_string(Path::new(&out).join(&besides[0])).expect("a report")).expect("JSON");
    assert_eq!((&report["hash"], &report["files"]), (&line["hash"], &line["files"]));
    let mut segments = 0;
    for (file, kind) in files.iter().take(2).zip(["arterial", "venous"]) {
        let tree = load_swc(file, &SwcReadOptions::default()).expect("a tree");
        let statistics = tree.statistics();
        assert_eq!(line[kind]["nodes"].as_u64(), Some(statistics.nodes as u64));
        assert_eq!(line[kind]["leaves"].as_u64(), Some(statistics.leaves as u64));
        assert_eq!(line[kind]["total_length"].as_f64(), Some(statistics.total_length), "a ball lifts nothing");
        segments += tree.segments().count();
        let text = fs::read_to_string(file).expect("text");
        assert!(text.contains("seed 3") && text.contains(line["hash"].as_str().expect("a hash")));
    }
    assert_eq!(fs::read_to_string(files[3]).expect("CSV").lines().count(), segments + 1);
    let faces = fs::read_to_string(files[2]).expect("OBJ").lines().filter(|line| line.starts_with("f ")).count();
    assert!(faces > 0 && faces % segments == 0);
}

#[test]
fn veins_can_be_left_out() {
    let folder = Folder::new("veins");
    let out = folder.path("");
    let [with] = generate(&[]).try_into().expect("one organ");
    let [without] = generate(&["--no-veins", "--out", &out]).try_into().expect("one organ");
    assert_eq!(with["arterial"], without["arterial"]);
    assert_eq!(without["venous"]["nodes"], 0);
    assert_eq!(without["venous"]["root_radius"], Value::Null);
    assert_eq!(without["files"].as_array().map(Vec::len), Some(1), "no file without vessels");
}

#[test]
fn one_value_is_set_by_its_path() {
    let hash = |arguments: &[&str]| generate(arguments)[0]["hash"].clone();
    let plain = hash(&[]);
    assert_ne!(hash(&["--set", "arterial.direction_weight=0.9"]), plain);
    assert_eq!(hash(&["--set", "generator.arterial.direction_weight = 0.5"]), plain, "the default it had");
    assert_eq!(hash(&["--set=arterial.direction_weight=0.9", "--set=arterial.direction_weight=0.5"]), plain);
    assert_ne!(hash(&["--set", "roots.artery=Nearest([(0.5, 0, 0), (-0.5, 0, 0)])"]), plain);
    assert_ne!(hash(&["--set", "venous.tissue_growth=Exponential(0.01)"]), plain);
    assert_eq!(generate(&["--set=steps=99"])[0]["steps"], 12, "an option of its own counts more");
    // Infinite thresholds survive being set and being left unchanged.
    let longer = ["--steps=40", "--samples=1000"];
    let lateral = hash(&[&longer[..], &["--set", "arterial.bifurcation_threshold=inf"]].concat());
    assert_ne!(lateral, hash(&longer));
    assert_ne!(hash(&["--preset=lateral", "--set=arterial.direction_weight=0.9"]), hash(&["--preset=lateral"]));
}

#[test]
fn lengths_are_scaled_and_settings_come_from_a_file() {
    let folder = Folder::new("settings");
    let path = folder.path("my own.ron");
    fs::write(&path, PresetName::Paper.ron()).expect("a file");
    let longer = ["--steps=40", "--samples=1000"];
    let [line] = generate(&[&longer[..], &["--settings", &path]].concat()).try_into().expect("one organ");
    assert_eq!(line["preset"], "my own");
    assert_eq!(line["hash"], generate(&longer)[0]["hash"]);
    let [coarse] = generate(&[&longer[..], &["--lengths=2"]].concat()).try_into().expect("one organ");
    let radius = |line: &Value| line["arterial"]["terminal_radius"].as_f64().expect("a radius");
    assert!((radius(&coarse) / radius(&line) - 2.0).abs() < 0.5, "{} {}", radius(&coarse), radius(&line));
    assert!(coarse["arterial"]["nodes"].as_u64() < line["arterial"]["nodes"].as_u64());
}

/// A tetrahedron as a file, the smallest possible organ.
fn tetrahedron(folder: &Folder) -> String {
    let path = folder.path("tetra.obj");
    fs::write(&path, "v 0 0 0\nv 3 0 0\nv 0 3 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n").expect("a file");
    path
}

#[test]
fn an_organs_mesh_grows_on_its_surface_in_its_volume_and_in_stages() {
    let folder = Folder::new("mesh");
    let path = tetrahedron(&folder);
    let mut hashes = Vec::new();
    for mode in ["surface", "lining", "volume", "staged"] {
        // A volume needs more drains than a surface for vessels to perceive them.
        let options = ["--tissue", &path, "--mode", mode, "--steps=25", "--samples=1000", "--lengths=2", "--count=3"];
        let lines = generate(&[&options[..], &["--threads=3"]].concat());
        assert_eq!(lines, generate(&[&options[..], &["--threads=1"]].concat()));
        for line in lines {
            assert!(line["arterial"]["nodes"].as_u64() > Some(10), "{mode}: {line}");
            assert_eq!(line["arterial"]["outside"], 0, "{mode}");
            hashes.push(line["hash"].to_string());
        }
    }
    hashes.sort();
    hashes.dedup();
    assert_eq!(hashes.len(), 9);
}

#[test]
fn the_extent_says_what_a_file_became() {
    let folder = Folder::new("extent");
    let path = tetrahedron(&folder);
    // Three faces of 4.5 and one with edges of 3 √2; a sixth of 3³.
    let area = 13.5 + 4.5 * 3f64.sqrt();
    for (tissue, mode, kind, value) in [
        ("disc", None, "area", std::f64::consts::PI / 4.0),
        ("box", None, "volume", 1.0),
        (&path[..], Some("--mode=surface"), "area", area),
        (&path[..], Some("--mode=volume"), "volume", 4.5),
    ] {
        let arguments: Vec<&str> = ["--tissue", tissue].into_iter().chain(mode).collect();
        let [line] = generate(&arguments).try_into().expect("one organ");
        let extent = line["extent"].as_object().expect("an object");
        assert_eq!((&extent["kind"], extent.len()), (&kind.into(), 2), "{tissue}");
        let found = extent["value"].as_f64().expect("a number");
        // Volumes of meshes are those of their voxels.
        let error = if mode == Some("--mode=volume") { 0.05 } else { 1e-5 };
        assert!((found / value - 1.0).abs() < error, "{tissue}: {found} instead of {value}");
    }
}

/// A ball around the origin, as an OBJ file.
fn ball(folder: &Folder, name: &str, radius: f64) -> String {
    use std::fmt::Write;
    let (sectors, stacks) = (24, 12);
    let mut text = String::new();
    for (stack, sector) in (0..=stacks).flat_map(|stack| (0..sectors).map(move |sector| (stack, sector))) {
        let polar = std::f64::consts::PI * f64::from(stack) / f64::from(stacks);
        let around = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
        let [x, y, z] = [polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin()].map(|at| at * radius);
        writeln!(text, "v {x} {y} {z}").expect("text");
    }
    for (stack, sector) in (0..stacks).flat_map(|stack| (0..sectors).map(move |sector| (stack, sector))) {
        let [a, b] = [sector, (sector + 1) % sectors].map(|sector| stack * sectors + sector + 1);
        writeln!(text, "f {a} {b} {}", a + sectors).expect("text");
        writeln!(text, "f {b} {} {}", b + sectors, a + sectors).expect("text");
    }
    let path = folder.path(name);
    fs::write(&path, text).expect("a file");
    path
}

/// With default settings.
#[test]
fn an_organ_in_any_unit_gets_as_many_vessels() {
    let folder = Folder::new("units");
    for mode in ["--mode=surface", "--mode=volume"] {
        let counts = [("metres.obj", 0.05), ("millimetres.obj", 50.0), ("toy.obj", 25.0)].map(|(name, radius)| {
            let text = run(&["--json", "--tissue", &ball(&folder, name, radius), mode]).expect("an organ");
            let line: Value = serde_json::from_str(&text).expect("a line of JSON");
            ["arterial", "venous"].map(|kind| line[kind]["nodes"].as_f64().expect("a number of nodes"))
        });
        let [metres, others @ ..] = counts;
        assert!(metres.iter().all(|&nodes| nodes > 300.0), "{mode}: {metres:?} are too few to tell");
        for other in others {
            let ratios = [other[0] / metres[0], other[1] / metres[1]];
            assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.08), "{mode}: {other:?}, {metres:?} in metres");
        }
    }
}

#[test]
fn wrong_usage_is_named_with_exit_code_2() {
    for (arguments, expected) in [
        (&["--set=arterial.foo=1"][..], "no setting \"foo\" in arterial; there are direction_weight, "),
        (&["--set=foo=1"], "no setting \"foo\" in generator; there are steps, "),
        (&["--set=foo"], "give it as key=value"),
        (&["--set=arterial.kill_distance.x=1"], "kill_distance has no fields"),
        (&["--set=samples=3, steps: 4"], "not a RON value"),
        (&["--set=samples=many"], "it cannot have this value; now it is 1000"),
        (&["--set=arterial.tissue_growth=Sideways"], "now it is Linear(0.02)"),
        (&["--set=arterial.direction_weight=7"], "direction_weight is 7; it must be between 0 and 1"),
        (&["--steps=0"], "steps is 0; it must be at least 1"),
        (&["--samples=4000000000"], "samples is 4000000000"),
        (&["--samples=0"], "--samples"),
        (&["--obj-sides=2"], "3..=64"),
        (&["--obj-sides=65"], "3..=64"),
        (&["--flow"], "--unit"),
        (&["--unit=inch"], "possible values: m, cm, mm, um"),
        (&["--resume"], "--out"),
        (&["--lengths=0"], "--lengths is 0; it must be finite and above 0"),
        (&["--lengths=NaN"], "--lengths is NaN"),
        (&["--shard=2/2"], "I from 0 to N − 1"),
        (&["--shard=0/0"], "I from 0 to N − 1"),
        (&["--count=0"], "--count"),
        (&["--threads=0"], "--threads"),
        (&["--seed=18446744073709551615", "--count=2"], "more than a seed can be"),
        (&["--preset=nobody"], "there is no preset \"nobody\"; there are paper,"),
        (&["--preset=paper", "--settings=a.ron"], "cannot be used with"),
        (&["--format=png"], "--format"),
        (
            &["--tissue=organ.stl"],
            "--tissue is organ.stl; it must be disc, ball, box, colon, eye, kidney, liver, or a file",
        ),
        (&["--tissue=ball", "--mode=surface"], "--mode is for the mesh of an organ"),
    ] {
        let (code, message) = failure(arguments);
        assert_eq!(code, 2, "{arguments:?}: {message}");
        assert!(message.contains(expected), "{arguments:?}: {message}");
    }
}

#[test]
fn least_volume_is_a_method_with_figures_and_files_of_its_own() {
    let folder = Folder::new("cco");
    let out = folder.path("out");
    let formats = "--format=gxl,svg,eps,levels";
    let text =
        run(&["--method=cco", "--tissue=ball", "--terminals=40", "--json", "--out", &out, formats]).expect("a tree");
    let line: Value = serde_json::from_str(&text).expect("a line of JSON");
    assert_eq!(line["preset"], "cco-ball");
    let cco = &line["cco"];
    assert_eq!((&cco["terminals"], &cco["overlaps"]), (&40.into(), &0.into()));
    assert!(cco["volume"].as_f64().is_some_and(|volume| volume > 0.0) && cco["rejected"].is_u64());
    assert!(cco["root_radius"].as_f64().is_some_and(|radius| (0.5..2.0).contains(&radius)), "in mm");
    assert_eq!((&line["arterial"]["leaves"], &line["venous"]), (&40.into(), &Value::Null));
    let files: Vec<&str> = line["files"].as_array().expect("files").iter().filter_map(Value::as_str).collect();
    let endings = ["_levels.csv", "_arterial.gxl", ".svg", ".eps"];
    assert!(
        files.iter().zip(endings).all(|(file, ending)| file.ends_with(ending) && Path::new(file).exists()),
        "{files:?}"
    );
    assert!(generate(&[]).iter().all(|line| line["cco"].is_null()), "figures of another method");

    let code = |arguments: &[&str]| match run(arguments) {
        Err(failure) => (failure.exit_code(), failure.to_string()),
        Ok(text) => panic!("{arguments:?}: {text}"),
    };
    for (arguments, expected, named) in [
        (&["--method=cco", "--preset=paper"][..], 2, "--method cco conflicts with paper"),
        (&["--method=colonization", "--preset=cco-disc"], 2, "conflicts with cco-disc"),
        (&["--terminals=9"], 2, "--terminals is for --method cco"),
        (&["--method=cco", "--steps=9"], 2, "--steps is for space colonization"),
        (&["--method=cco", "--terminals=0"], 2, "terminals is 0; it must be from 1 to"),
        (&["--method=cco", "--set=flow.artery.rate=(0.0)"], 2, "rate, in m³/s, of the arterial vessels is 0"),
        (&["--method=cco", "--set=roots.artery=Exact([(9, 9, 9)])"], 1, "disc with seed 1: "),
        (&["--method=cco", "--tissue=ball", "--set=perfusion=150", "--terminals=900"], 1, " of 900 arterial terminals"),
    ] {
        let (found, message) = code(arguments);
        assert_eq!(found, expected, "{arguments:?}: {message}");
        assert!(message.contains(named), "{arguments:?}: {message}");
    }
}

#[test]
fn what_goes_wrong_is_named_with_exit_code_1_and_leaves_nothing_half_done() {
    let folder = Folder::new("failures");
    let (file, bad) = (folder.path("file"), folder.path("bad.ron"));
    fs::write(&file, "in the way").expect("a file");
    fs::write(&bad, "(generator: Colonization((steps: 3,, )))").expect("a file");
    let (missing, broken) = (folder.path("missing.glb"), folder.path("broken.glb"));
    fs::write(&broken, "no mesh").expect("a file");
    for (arguments, named) in [
        (&["--settings", &bad][..], "bad.ron: not a preset: 1:"),
        (&["--settings", &folder.path("none.ron")], "none.ron: "),
        (&["--tissue", &missing], "missing.glb"),
        (&["--tissue", &broken], "broken.glb"),
        (&["--out", &file], "cannot make the folder"),
        (&["--set=roots.artery=Exact([(9, 9, 9)])"], "disc with seed 1: "),
    ] {
        let (code, message) = failure(arguments);
        assert_eq!(code, 1, "{arguments:?}: {message}");
        assert!(message.contains(named) && !message.contains('\n'), "{arguments:?}: {message}");
    }
    assert_eq!(fs::read_to_string(&file).expect("a file"), "in the way");
    // A folder has the name of the second organ's file: the first organ's file is whole, and the second's does not
    // exist.
    let out = folder.path("out");
    let run = format!("disc_paper_{}", run_of(&generate(&[])[0]));
    fs::create_dir_all(folder.path(&format!("out/{run}_000002.csv"))).expect("a folder");
    let (code, message) = failure(&["--count=100000", "--threads=2", "--out", &out, "--format=csv", "--json"]);
    assert!(code == 1 && message.contains(&format!("{run}_000002.csv")), "{message}");
    let first = fs::read_to_string(folder.path(&format!("out/{run}_000001.csv"))).expect("the first organ");
    assert!(first.ends_with('\n') && first.lines().count() > 10);
    let names = folder.names("out");
    assert!(names.iter().all(|name| [".csv", ".json", ".ron"].iter().any(|end| name.ends_with(end))), "{names:?}");
    assert!(names.len() < 80, "the batch goes on after a failure");
}

/// A closed pipe.
struct Closed;

impl std::io::Write for Closed {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        Err(std::io::ErrorKind::BrokenPipe.into())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_closed_pipe_stops_the_batch() {
    let arguments = ["generate", "--steps=2", "--count=1000000000000", "--threads=2"];
    let options = command::Options::try_parse_from(arguments).expect("options");
    let failure = command::run(&options, &mut Closed, &AtomicBool::new(false)).expect_err("nobody reads");
    assert_eq!(failure.exit_code(), 1);
    assert!(failure.to_string().contains("standard output"), "{failure}");
}

#[test]
fn people_get_a_line_per_organ() {
    let text = output(&["--count=2"]).expect("organs");
    assert_eq!(text.lines().count(), 2);
    assert!(text.starts_with("disc paper seed 1: arteries "), "{text}");
}
