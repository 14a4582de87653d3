//! The allowed uses: the pictures of `ARCHITECTURE.md` as tables, and their check.

use crate::{house::House, project, sources};
use std::{collections::BTreeSet, fs};

/// The parts of the crate, each with the parts that it uses.
const PARTS: &str = "
 ui             plugin  synthesis
 render         plugin  synthesis
 plugin         synthesis
 synthesis
";

/// Floors of the pure half, the highest first. A room uses the floors below it, and on its own floor the rooms to its left.
const FLOORS: &str = "
 products       haemodynamics  wound  instances  surface  texture  recipe  binding  io
 makers         growth  colonization  cco  generator  preset
 input          mesh  organ  tree  segment_index  tissue  roots
 ground         units  pace  exponential  random  parallel  space
";

/// Rooms of the plugin, in the order of the data, each with the rooms that it uses. All of them may use the ground.
const PLUGIN: &str = "
 ground         order  lineage  announcer  job
 organ
 vessels
 growth         organ  vessels
 surgery        vessels  growth
 circulation    organ  vessels  growth  surgery
 deformation    organ  vessels  growth
 surface        organ  vessels  growth
 texture        organ  vessels  growth
 scene          vessels  growth
";

/// Files of `render`, each with those that it uses.
const RENDER: &str = "
 levels
 limits         levels
 chunk
 template       levels
 material       template
 upload
 stumps         levels
 detail         levels  chunk  template
 buffer         levels  chunk  material  stumps
 segments       levels  limits  chunk  material  upload  detail  buffer
 surfaces       chunk  material  buffer
 textures
 take_over      chunk  buffer
";

/// Files of `ui`, each with those that it uses.
const UI: &str = "
 brush
 state          brush
 widgets
 sketch
 history
 growth         widgets
 organ          widgets
 preset
 statistics     widgets
 products
 focus          state
 pointer        focus
 surgery        state  widgets  pointer
 stroke         brush  state
 painting       brush  state  pointer  stroke
 overlay        state  painting
 knob           sketch
 colonization   widgets  knob
 optimisation   knob
 generator      widgets  sketch  knob  colonization  optimisation
 panel          state  sketch  history  growth  organ  preset  statistics  products  surgery  painting  knob  generator
";

/// A table: the name of each row, with its entries.
type Table = Vec<(&'static str, Vec<&'static str>)>;

fn table(text: &'static str) -> Table {
    text.lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?, words.collect()))
        })
        .collect()
}

/// The parts of the crate that a part may use, itself among them.
pub fn parts_below(part: &str) -> Vec<&'static str> {
    let row = table(PARTS).into_iter().find(|row| row.0 == part);
    row.map_or_else(Vec::new, |(name, below)| [vec![name], below].concat())
}

/// All rooms of a part with rooms.
fn rooms(part: &str) -> Option<BTreeSet<&'static str>> {
    match part {
        "synthesis" => Some(table(FLOORS).into_iter().flat_map(|row| row.1).collect()),
        "plugin" => Some(
            table(PLUGIN).into_iter().flat_map(|row| if row.0 == "ground" { row.1 } else { vec![row.0] }).collect(),
        ),
        "render" | "ui" => Some(table(files(part)).into_iter().map(|row| row.0).collect()),
        _ => None,
    }
}

/// The table of a part that has files for rooms.
fn files(part: &str) -> &'static str {
    if part == "ui" { UI } else { RENDER }
}

/// Whether a room of a part may use another one.
fn may_use(part: &str, room: &str, used: &str) -> bool {
    match part {
        "synthesis" => {
            let floors = table(FLOORS);
            let place = |room: &str| {
                floors.iter().enumerate().find_map(|(floor, row)| {
                    let at = row.1.iter().position(|name| *name == room)?;
                    Some((floor, at))
                })
            };
            // Floors are counted from above, rooms from the left.
            let (Some((floor, at)), Some((used_floor, used_at))) = (place(room), place(used)) else { return false };
            used_floor > floor || (used_floor == floor && used_at < at)
        }
        "plugin" => {
            let rows = table(PLUGIN);
            let ground = &rows[0].1;
            let place = |room: &str| ground.iter().position(|name| *name == room);
            match (place(room), place(used)) {
                (Some(at), Some(used_at)) => used_at < at,
                (None, Some(_)) => true,
                _ => rows.iter().any(|row| row.0 == room && row.1.contains(&used)),
            }
        }
        _ => table(files(part)).iter().any(|row| row.0 == room && row.1.contains(&used)),
    }
}

/// Uses of a room that the tables don't allow, one line each.
fn forbidden_uses(house: &House) -> String {
    let mut found = String::new();
    for (from, uses) in house.sources.iter().zip(&house.uses) {
        // The first file of a part composes its rooms.
        let [part, room, ..] = &from.module[..] else { continue };
        for to in uses.iter().map(|&to| &house.sources[to]) {
            let [used_part, used, ..] = &to.module[..] else { continue };
            if part == used_part && room != used && !may_use(part, room, used) {
                found += &format!("{} uses {}: {part} has no way from {room} to {used}\n", from.path, to.path);
            }
        }
    }
    found
}

fn house() -> House {
    House::new(sources(&["src"]))
}

#[test]
fn rooms_use_what_their_rows_name() {
    let found = forbidden_uses(&house());
    assert!(found.is_empty(), "\n{found}");
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let house = house();
    let circles: Vec<String> = house.circles().iter().map(|circle| house.describe(circle)).collect();
    assert!(circles.is_empty(), "\n{}", circles.join("\n"));
}

#[test]
fn every_room_has_its_row_and_every_row_its_room() {
    let house = house();
    for part in ["synthesis", "plugin", "render", "ui"] {
        let built: BTreeSet<&str> = house
            .sources
            .iter()
            .filter(|source| source.is_in(part))
            .filter_map(|source| Some(&**source.module.get(1)?))
            .collect();
        assert_eq!(Some(built), rooms(part), "rooms of {part} in the source, and in the table");
    }
}

#[test]
fn the_tables_are_the_pictures_of_the_architecture() {
    let page = fs::read_to_string(project().join("ARCHITECTURE.md")).unwrap();
    for table in [PARTS, FLOORS, PLUGIN, RENDER, UI] {
        assert!(page.contains(table), "ARCHITECTURE.md lacks this table, letter for letter:\n{table}");
    }
}

#[test]
fn the_checks_find_a_use_that_no_row_names() {
    let plugin = |used: &'static str| {
        let text = format!("use crate::plugin::{used}::Thing;");
        let files = [("src/plugin/surgery/a.rs", text), (used, "pub struct Thing;".to_owned())];
        let path = |name: &str| if name.contains('/') { name.to_owned() } else { format!("src/plugin/{name}.rs") };
        House::new(files.iter().map(|(name, text)| crate::source::Source::new(&path(name), text)).collect())
    };
    assert!(forbidden_uses(&plugin("circulation")).contains("from surgery to circulation"));
    assert!(forbidden_uses(&plugin("vessels")).is_empty());
    assert!(forbidden_uses(&plugin("job")).is_empty());
    assert!(may_use("synthesis", "wound", "haemodynamics") && !may_use("synthesis", "haemodynamics", "wound"));
    assert!(may_use("synthesis", "io", "space") && !may_use("synthesis", "space", "io"));
    assert!(may_use("plugin", "job", "order") && !may_use("plugin", "order", "job"));
    assert!(!may_use("plugin", "job", "organ") && !may_use("render", "levels", "detail"));
}
