//! Runs beside each other: no result takes another's place, what is there is found again, and an end is clean.

use crate::{Folder, ball, failure, files_of, generate, output, run_of, run_until, tetrahedron};
use bevy_vessels::synthesis::{
    io::{SwcReadOptions, load_swc},
    preset::{Preset, PresetName},
};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, SystemTime};

/// Everything that distinguishes one run from another, with names that don't.
#[test]
fn no_run_takes_the_place_of_another() {
    let folder = Folder::new("places");
    let out = folder.path("out");
    for below in ["a", "b"] {
        fs::create_dir_all(folder.path(below)).expect("a folder");
    }
    let organ = ball(&folder, "a/organ.obj", 1.0);
    let other = ball(&folder, "b/organ.obj", 2.0);
    // The same organ once more: only its path differs.
    let copy = folder.path("b/organ.OBJ");
    fs::copy(&organ, &copy).expect("a copy");
    let settings = ["a/own.ron", "b/own.ron"].map(|path| folder.path(path));
    fs::write(&settings[0], PresetName::Paper.ron()).expect("a file");
    fs::write(&settings[1], PresetName::Straight.ron()).expect("a file");
    let runs: [&[&str]; 18] = [
        &["--tissue", &organ],
        &["--tissue", &other],
        &["--tissue", &copy],
        &["--tissue", &organ, "--mode=volume"],
        &["--tissue", &organ, "--mode=staged"],
        &["--tissue", &organ, "--preset=colon"],
        &["--tissue", &organ, "--settings", &settings[0]],
        &["--tissue", &organ, "--settings", &settings[1]],
        &["--tissue", &organ, "--set=arterial.direction_weight=0.9"],
        &["--tissue", &organ, "--set=arterial.direction_weight=0.90001"],
        &["--tissue", &organ, "--steps=13"],
        &["--tissue", &organ, "--samples=301"],
        &["--tissue", &organ, "--lengths=1.5"],
        &["--tissue", &organ, "--no-veins"],
        &["--tissue", &organ, "--unit=mm"],
        &["--tissue", &organ, "--unit=mm", "--flow"],
        &["--tissue", &organ, "--obj-sides=5"],
        &["--tissue", &organ, "--mesh-level=0"],
    ];
    let mut files = BTreeSet::new();
    let mut expected = 0;
    for run in runs {
        let [line] = generate(&[run, &["--seed=7", "--out", &out, "--format=swc,csv"]].concat())
            .try_into()
            .unwrap_or_else(|_| panic!("{run:?}"));
        for file in files_of(&line) {
            expected += 1;
            assert!(files.insert(file.to_owned()), "{run:?} writes over {file}");
            assert!(file.contains(run_of(&line)) && file.contains("_000007"), "{file}");
            if file.ends_with(".swc") {
                // The header has it all.
                let text = fs::read_to_string(file).expect("a file");
                let header: Vec<&str> = text.lines().take_while(|line| line.starts_with('#')).collect();
                let header = header.join("\n");
                for value in run.iter().filter(|value| value.starts_with("--") && value.contains('=')) {
                    let value = value.split_once('=').expect("a value").1;
                    let in_settings = value == "mm" || header.contains(value);
                    assert!(in_settings, "{value} is not in\n{header}");
                }
                assert!(header.contains(run[1]) && header.contains("seed 7"), "{header}");
                assert!(header.contains(env!("CARGO_PKG_VERSION")) && header.contains("mode: "), "{header}");
            }
        }
    }
    // A settings file each, and a report.
    assert_eq!(folder.names("out").len(), expected + 2 * runs.len());
}

#[test]
fn names_keep_letters_of_all_scripts_and_sort_by_seed() {
    let folder = Folder::new("letters");
    let out = folder.path("out");
    let plain = tetrahedron(&folder);
    let mut names = BTreeSet::new();
    for name in ["Nierenäderchen", "肝臓", "печень", "e\u{301}tage 2", "a_b*c?d"] {
        let path = folder.path(&format!("{name}.obj"));
        fs::copy(&plain, &path).expect("a copy");
        let [line] = generate(&["--tissue", &path, "--out", &out]).try_into().expect("one organ");
        let file = Path::new(files_of(&line)[0]).file_name().expect("a name").to_string_lossy().into_owned();
        names.insert(file.split("_surface_").next().expect("a stem").to_owned());
    }
    let expected = ["Nierenäderchen", "肝臓", "печень", "e\u{301}tage-2", "a-b-c-d"].map(str::to_owned);
    assert_eq!(names, expected.into());
    // A name as long as a file system allows.
    let long = folder.path(&format!("{}.obj", "ä".repeat(120)));
    fs::copy(&plain, &long).expect("a copy");
    generate(&["--tissue", &long, "--out", &out]);
    let sorted = Folder::new("sorted");
    generate(&["--seed=8", "--count=4", "--no-veins", "--out", &sorted.path("")]);
    let seeds: Vec<u32> = sorted
        .names("")
        .iter()
        .filter_map(|name| name.strip_suffix("_arterial.swc")?.rsplit('_').next()?.parse().ok())
        .collect();
    assert_eq!(seeds, [8, 9, 10, 11], "{:?}", sorted.names(""));
}

#[test]
fn a_run_says_how_to_grow_it_again() {
    let folder = Folder::new("again");
    let out = folder.path("out");
    let organ = ball(&folder, "organ.obj", 3.0);
    let changes = ["--lengths=1.5", "--set=arterial.direction_weight=0.8", "--mode=volume", "--no-veins"];
    let grow = |more: &[&str]| generate(&[&["--tissue", &organ, "--seed=4", "--out", &out], more].concat());
    let [line] = grow(&changes).try_into().expect("one organ");
    let settings = folder.path(&format!("out/organ_volume_paper_{}.ron", run_of(&line)));
    let text = fs::read_to_string(&settings).expect("settings");
    assert!(Preset::from_ron(&text).is_ok_and(|preset| !preset.fit), "lengths are the organ's");
    assert!(text.contains(&organ) && text.contains(env!("CARGO_PKG_VERSION")), "{text}");
    // Without the steps and samples of all commands here, too.
    let all = ["--json", "--tissue", &organ, "--seed=4", "--settings", &settings];
    let again: Value = serde_json::from_str(&crate::run(&all).expect("an organ")).expect("JSON");
    assert_eq!(again["hash"], line["hash"]);
    // A file that somebody changed is not this run's.
    fs::write(&settings, text + " ").expect("a file");
    let (code, message) = failure(&[&["--tissue", &organ, "--seed=4", "--out", &out][..], &changes].concat());
    assert!(code == 1 && message.contains(&settings) && message.contains("--out"), "{message}");
}

#[test]
fn organs_that_are_there_are_skipped() {
    let folder = Folder::new("resume");
    let out = folder.path("");
    let run = |more: &[&str]| {
        let arguments = ["--json", "--steps=12", "--samples=300", "--count=4", "--out", &out, "--resume"];
        let (text, summary) = run_until(&AtomicBool::new(false), &[&arguments[..], more].concat()).expect("organs");
        let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        (lines, summary.resumed)
    };
    let (first, resumed) = run(&[]);
    assert_eq!((first.len(), resumed), (4, 0));
    let (second, resumed) = run(&[]);
    assert_eq!(resumed, 4);
    assert_eq!(second, first, "reported as they were, times included");
    // More organs, and other ones in between.
    assert_eq!(run(&["--count=6"]).1, 4);
    assert_eq!(run(&["--count=6", "--shard=1/2"]).1, 3);
    // A lost file, and a report that a killed run left half written.
    fs::remove_file(files_of(&first[1])[1]).expect("a file");
    let report = files_of(&first[2])[0].replace("_arterial.swc", ".json");
    fs::write(&report, "{\"tissue\":\"di").expect("a file");
    let (third, resumed) = run(&[]);
    assert_eq!(resumed, 2);
    let hashes = |lines: &[Value]| lines.iter().map(|line| line["hash"].clone()).collect::<Vec<_>>();
    assert_eq!(hashes(&third), hashes(&first));
    assert!(Path::new(files_of(&first[1])[1]).exists());
    // Another format or figure of the same run has to be made; then it is there.
    assert_eq!((run(&["--format=csv,swc"]).1, run(&["--format=csv"]).1), (0, 4));
    assert_eq!((run(&["--mesh"]).1, run(&["--mesh"]).1, run(&[]).1), (0, 4, 4));
    // Other settings are another run.
    assert_eq!(run(&["--steps=13"]).1, 0);
}

#[test]
fn an_interrupted_run_leaves_whole_organs_and_goes_on() {
    let folder = Folder::new("interrupted");
    let out = folder.path("");
    let stop = AtomicBool::new(true);
    let arguments = ["--steps=12", "--samples=300", "--count=9", "--threads=2", "--out", &out];
    let Err(failure) = run_until(&stop, &arguments) else { panic!("it goes on") };
    assert_eq!(failure.exit_code(), 130);
    assert!(failure.to_string().contains("--resume"), "{failure}");
    let names = folder.names("");
    assert!(names.iter().all(|name| name.ends_with(".ron")), "{names:?}");
    assert_eq!(output(&[&arguments[2..], &["--resume"]].concat()).expect("organs").lines().count(), 9);
}

#[test]
fn leftovers_of_killed_runs_are_removed() {
    let folder = Folder::new("leftovers");
    let [old, new] = [".disc_paper_1.swc.123-4.tmp", ".disc_paper_1.swc.123-5.tmp"].map(|name| folder.path(name));
    for path in [&old, &new] {
        fs::write(path, "half").expect("a file");
    }
    let yesterday = SystemTime::now() - Duration::from_secs(86_400);
    fs::File::options().write(true).open(&old).and_then(|file| file.set_modified(yesterday)).expect("an older file");
    generate(&["--out", &folder.path("")]);
    assert!(!Path::new(&old).exists() && Path::new(&new).exists(), "what may be under way stays");
}

#[test]
fn the_unit_is_noted_and_swc_is_in_micrometres() {
    let folder = Folder::new("unit");
    let grow = |out: &str, more: &[&str]| {
        let out = folder.path(out);
        generate(&[&["--out", &out, "--format=swc,obj,csv,glb,off"], more].concat()).remove(0)
    };
    let (plain, with) = (grow("plain", &[]), grow("with", &["--unit=cm"]));
    assert_eq!((&plain["unit"], &with["unit"]), (&Value::Null, &"cm".into()));
    assert_eq!(plain["hash"], with["hash"], "growth knows no unit");
    let tree = |line: &Value| load_swc(files_of(line)[0], &SwcReadOptions::default()).expect("a tree");
    for (plain, with) in tree(&plain).positions().iter().zip(tree(&with).positions()) {
        assert!(with.distance(1e4 * *plain) < 0.01, "{plain} cm is {with} µm");
    }
    let text = |line: &Value, file: usize| {
        String::from_utf8_lossy(&fs::read(files_of(line)[file]).expect("a file")).into_owned()
    };
    let vertices =
        |text: &str| text.lines().filter(|line| line.starts_with("v ")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(vertices(&text(&plain, 2)), vertices(&text(&with, 2)), "other files are in tissue lengths");
    assert_eq!(text(&plain, 3), text(&with, 3));
    assert!(text(&plain, 0).contains("# unit: that of the tissue"));
    for (file, note) in
        [(0, "# unit: um;"), (2, "# a tissue length is 1 cm"), (4, "\"metres_per_unit\":0.01"), (5, "unit: 0.01 m")]
    {
        assert!(text(&with, file).contains(note), "{note} is not in file {file}");
    }
}

#[test]
fn tables_have_the_flow_if_asked_for() {
    let folder = Folder::new("flow");
    let out = folder.path("");
    let [line] = generate(&["--unit=cm", "--flow", "--format=csv", "--out", &out]).try_into().expect("one organ");
    let text = fs::read_to_string(files_of(&line)[0]).expect("a table");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|&other| other == name).expect("a column");
    for (kind, sign) in [("arterial", 1.0), ("venous", -1.0)] {
        let of_kind = rows.iter().filter(|row| row[0] == kind);
        let from_roots = of_kind.filter(|row| row[column("level")] == "0" && row[column("parent")] == "0");
        let sum: f64 = from_roots.map(|row| row[column("flow_ml_per_min")].parse::<f64>().expect("a number")).sum();
        let inflow = line[kind]["inflow_ml_per_min"].as_f64().expect("a flow");
        assert!(inflow * sign > 0.0, "{kind} flow is {inflow}");
        assert!((sum / inflow - 1.0).abs() < 1e-6, "{sum} in the table, {inflow} in all");
    }
    let [without] = generate(&["--unit=cm"]).try_into().expect("one organ");
    assert!(without["arterial"].get("inflow_ml_per_min").is_none());
}

#[test]
fn orders_add_up_to_the_tree() {
    let [line] = generate(&["--steps=40", "--samples=1000"]).try_into().expect("one organ");
    for kind in ["arterial", "venous"] {
        let measures = &line[kind];
        let orders = measures["strahler"].as_array().expect("a list");
        assert_eq!(orders.len() as u64, measures["strahler_orders"].as_u64().expect("a number"));
        assert_eq!(orders[0]["streams"], measures["leaves"], "every leaf is a stream of the first order");
        let length = |order: &Value| {
            order["streams"].as_f64().expect("a number") * order["mean_length"].as_f64().expect("a length")
        };
        let total = measures["total_length"].as_f64().expect("a length");
        assert!((orders.iter().map(length).sum::<f64>() / total - 1.0).abs() < 1e-9);
        let wider = |pair: &[Value]| pair[1]["mean_diameter"].as_f64() > pair[0]["mean_diameter"].as_f64();
        assert!(orders.windows(2).all(wider));
    }
}

#[test]
fn a_batch_has_a_summary() {
    let folder = Folder::new("summary");
    let out = folder.path("");
    let arguments = ["--json", "--steps=12", "--samples=300", "--seed=3", "--count=5", "--out", &out, "--format=csv"];
    let (text, summary) = run_until(&AtomicBool::new(false), &arguments).expect("organs");
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let name = format!("disc_paper_{}_000003-000007_summary.json", run_of(&lines[0]));
    let file: Value = serde_json::from_str(&fs::read_to_string(folder.path(&name)).expect("a summary")).expect("JSON");
    assert_eq!((&file["organs"], &file["resumed"]), (&5.into(), &0.into()));
    let values: Vec<f64> = lines.iter().map(|line| line["venous"]["nodes"].as_f64().expect("a number")).collect();
    let mean = values.iter().sum::<f64>() / 5.0;
    let deviation = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 5.0).sqrt();
    let figures = &file["figures"]["venous.nodes"];
    let figure = |name: &str| figures[name].as_f64().expect("a number");
    assert!((figure("mean") - mean).abs() < 1e-9 && (figure("standard_deviation") - deviation).abs() < 1e-9);
    assert_eq!(figure("minimum"), values.iter().copied().fold(f64::INFINITY, f64::min));
    assert_eq!(figure("maximum"), values.iter().copied().fold(0.0, f64::max));
    assert_eq!(file["figures"]["arterial.strahler.1.streams"]["count"], 5);
    assert!(file["figures"].get("seed").is_none());
    let shown = summary.to_string();
    assert!(shown.starts_with("5 organs, 0 of them there before, in "), "{shown}");
    assert!(shown.contains("\n  venous nodes: ") && shown.contains("coverage"), "{shown}");
    // A share of the organs has a summary of its own.
    run_until(&AtomicBool::new(false), &[&arguments[..], &["--shard=1/2"]].concat()).expect("organs");
    assert!(folder.names("").iter().any(|name| name.ends_with("_000003-000007_1-of-2_summary.json")));
}

#[test]
fn sides_of_round_cones_are_chosen() {
    let folder = Folder::new("sides");
    let out = folder.path("");
    let size = |sides: &str| {
        let line = generate(&["--format=obj", "--out", &out, sides]).remove(0);
        fs::metadata(files_of(&line)[0]).expect("a file").len()
    };
    assert_eq!(size("--obj-sides=8"), size("--mesh"), "the default");
    assert!(2 * size("--obj-sides=3") < size("--obj-sides=8"));
}

/// Set for the process that may start few threads.
const LIMITED: &str = "BEVY_VESSELS_TEST_FEW_THREADS";

/// Threads that ask for more memory than the process may have are refused.
#[test]
#[cfg(target_os = "linux")]
fn as_many_threads_work_as_the_system_allows() {
    if std::env::var_os(LIMITED).is_some() {
        let (text, _) = run_until(
            &AtomicBool::new(false),
            &["--tissue=ball", "--steps=12", "--samples=300", "--count=40", "--threads=1000"],
        )
        .unwrap_or_else(|failure| panic!("{failure}"));
        assert_eq!(text.lines().count(), 40);
        return;
    }
    let test = std::env::current_exe().expect("this test");
    // Kilobytes of address space for stacks of a gigabyte: for some, and for none.
    for (space, started) in [(6_000_000, "only "), (900_000, "only 0 ")] {
        let found = Command::new("sh")
            .args(["-c", &format!("ulimit -v {space} && exec \"$0\" \"$@\"")])
            .arg(&test)
            .args(["--exact", "runs::as_many_threads_work_as_the_system_allows", "--nocapture", "--test-threads=1"])
            .env(LIMITED, "1")
            .env("RUST_MIN_STACK", (1 << 30).to_string())
            .stdin(Stdio::null())
            .output()
            .expect("a shell");
        let messages = String::from_utf8_lossy(&found.stderr);
        assert!(found.status.success(), "{}\n{messages}", String::from_utf8_lossy(&found.stdout));
        assert!(messages.contains("threads can be started") && messages.contains(started), "{messages}");
    }
}
