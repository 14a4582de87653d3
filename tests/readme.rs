//! The README is true: its code, its defaults, its links and its presets.

use bevy_vessels::synthesis::{
    colonization::{ColonizationSettings, SystemSettings},
    preset::PresetName,
};
use std::{fs, path::Path};

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The default in the settings table, as text.
fn default_in_table(readme: &str, setting: &str) -> String {
    let row = format!("| `{setting}`");
    let row = readme.lines().find(|line| line.starts_with(&row)).unwrap_or_else(|| panic!("no row for {setting}"));
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    // Rows of one system have limits before the default, rows of both don't.
    cells[if cells.len() > 5 { 4 } else { 3 }].trim_end_matches('°').to_owned()
}

#[test]
fn the_table_of_settings_has_the_defaults() {
    let readme = read("README.md");
    let ColonizationSettings { steps, samples, idle_steps, confine, stand_off, arterial, venous } =
        ColonizationSettings::default();
    // Destructured, so that no setting can be forgotten here.
    let SystemSettings {
        direction_weight,
        drain_birth_distance,
        node_birth_distance,
        influence_distance,
        kill_distance,
        perception_angle,
        terminal_radius,
        scale_terminal_radius,
        step_length,
        bifurcation_threshold,
        angle_spread: _,
        bifurcation_exponent,
        tissue_growth: _,
        lateral_sprouts,
        root_children,
    } = arterial;
    for (setting, value) in [
        ("steps", steps.to_string()),
        ("samples", samples.to_string()),
        ("idle_steps", idle_steps.to_string()),
        ("confine", confine.to_string()),
        ("stand_off", stand_off.to_string()),
        ("direction_weight", direction_weight.to_string()),
        ("drain_birth_distance", drain_birth_distance.to_string()),
        ("node_birth_distance", node_birth_distance.to_string()),
        ("influence_distance", format!("{influence_distance}, venous {}", venous.influence_distance)),
        ("kill_distance", kill_distance.to_string()),
        ("perception_angle", perception_angle.to_string()),
        ("terminal_radius", terminal_radius.to_string()),
        ("scale_terminal_radius", scale_terminal_radius.to_string()),
        ("step_length", step_length.to_string()),
        ("bifurcation_threshold", bifurcation_threshold.to_string()),
        ("angle_spread", "standard deviation".to_owned()),
        ("bifurcation_exponent", bifurcation_exponent.to_string()),
        ("tissue_growth", "linear, 0.02 a step".to_owned()),
        ("lateral_sprouts", lateral_sprouts.to_string()),
        ("root_children", root_children.to_string()),
    ] {
        assert_eq!(default_in_table(&readme, setting), value, "the README's default of {setting}");
    }
}

#[test]
fn every_preset_is_listed() {
    let readme = read("README.md");
    let presets = readme.split("## Presets").nth(1).expect("a chapter on presets");
    for preset in PresetName::ALL {
        assert!(presets.contains(&format!("`{preset}`")), "the README does not list {preset}");
    }
}

#[test]
fn the_ten_lines_are_the_minimal_example() {
    let readme = read("README.md");
    let code = readme.split("```rust,no_run\n").nth(1).and_then(|rest| rest.split("```").next()).expect("Rust code");
    let example = read("examples/minimal.rs");
    let lines: Vec<&str> = example.lines().skip_while(|line| line.starts_with("//!") || line.is_empty()).collect();
    assert_eq!(code.trim_end(), lines.join("\n").trim_end());
}

#[test]
fn links_lead_somewhere() {
    for page in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"] {
        let text = read(page);
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for target in targets.filter(|target| !target.starts_with("http") && !target.starts_with('#')) {
            let there = Path::new(env!("CARGO_MANIFEST_DIR")).join(target).exists();
            assert!(there, "{page} links to {target}, which is not there");
        }
    }
}

#[test]
fn the_rooms_of_the_architecture_exist() {
    let page = read("ARCHITECTURE.md");
    let walk = page.split("## How to read this code").nth(1).and_then(|rest| rest.split("\n## ").next());
    let names = walk.expect("a walk").split('`').skip(1).step_by(2).filter(|name| name.ends_with(".rs"));
    let sources: Vec<String> = ["src", "examples"].into_iter().flat_map(files).collect();
    for name in names {
        let there = sources.iter().any(|source| source == name || source.ends_with(&format!("/{name}")));
        assert!(there, "the walk through the code passes {name}, which is not there");
    }
}

#[test]
fn every_file_is_in_the_lines_of_its_own_room() {
    let page = read("ARCHITECTURE.md");
    let rooms = page.split("## Rooms").nth(1).and_then(|rest| rest.split("\n## ").next()).expect("a list of rooms");
    let rooms = words_of_rooms(rooms);
    for source in files("src") {
        let file = Path::new(&source).with_extension("");
        let parts: Vec<String> =
            file.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
        let own = rooms.iter().filter(|(room, _)| parts.starts_with(room)).max_by_key(|(room, _)| room.len());
        let (room, words) = own.unwrap_or_else(|| panic!("{source}: ARCHITECTURE.md has no room for it"));
        for part in &parts[room.len()..] {
            let known = matches!(part.as_str(), "mod" | "tests") || words.contains(part);
            assert!(known, "{source}: the lines of {} in ARCHITECTURE.md do not name {part}", room.join("/"));
        }
    }
}

/// The rooms of a listing by their paths, each with the words of its lines. Lines that begin no room continue the last
/// one.
fn words_of_rooms(listing: &str) -> Vec<(Vec<String>, Vec<String>)> {
    /// Columns in which a room may begin; text further in continues a room.
    const DEEPEST: usize = 4;
    let mut open: Vec<(usize, String)> = Vec::new();
    let mut rooms: Vec<(Vec<String>, Vec<String>)> = Vec::new();
    for line in listing.lines() {
        let name = line.split_whitespace().next().unwrap_or_default();
        let name = name.trim_end_matches('/').trim_end_matches(".rs");
        let column = line.len() - line.trim_start().len();
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if is_name && column <= DEEPEST {
            open.retain(|&(outer, _)| outer < column);
            open.push((column, name.to_owned()));
            rooms.push((open.iter().map(|(_, name)| name.clone()).collect(), Vec::new()));
        }
        if let Some((_, words)) = rooms.last_mut() {
            let found = line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
            words.extend(found.map(str::to_owned));
        }
    }
    rooms
}

#[test]
fn a_word_of_another_room_names_no_file() {
    let rooms = words_of_rooms("src/\n  a/      one · two\n          three\n  b       four\n");
    let names = |room: &[(Vec<String>, Vec<String>)], at: usize| (room[at].0.join("/"), room[at].1.join(" "));
    assert_eq!(rooms.len(), 3);
    assert_eq!(names(&rooms, 1), ("src/a".to_owned(), "a one two three".to_owned()));
    assert_eq!(names(&rooms, 2), ("src/b".to_owned(), "b four".to_owned()));
}

/// Every file below a folder of the project, as a path with `/` from the project's root.
fn files(folder: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = fs::read_dir(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let below = |entry: fs::DirEntry| {
        let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() { files(&name) } else { vec![name] }
    };
    entries.flat_map(|entry| below(entry.expect("a folder that can be read"))).collect()
}
