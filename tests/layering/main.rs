//! Holds the source to the rules of the house (`ARCHITECTURE.md`): which room may use which, and what is forbidden.
//!
//! The rules are checked on the text of the source files, after comments, string literals and unit tests have been
//! blanked out. Optional crates need no check here: `cargo check --no-default-features` fails if they are used without
//! their features.

mod house;
mod rooms;
mod rules;
mod source;

use source::Source;
use std::{
    fs,
    path::{Path, PathBuf},
};

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Rust file below these folders of the project, in a fixed order.
fn sources(folders: &[&str]) -> Vec<Source> {
    let paths = folders.iter().flat_map(|folder| rust_files(&project().join(folder)));
    paths
        .map(|path| {
            let name =
                path.strip_prefix(project()).expect("a path in the project").to_string_lossy().replace('\\', "/");
            Source::new(&name, &fs::read_to_string(&path).expect("a file that can be read"))
        })
        .collect()
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a folder that can be read").path()).collect();
    paths.sort();
    let expanded = paths.into_iter().flat_map(|path| if path.is_dir() { rust_files(&path) } else { vec![path] });
    expanded.filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect()
}
