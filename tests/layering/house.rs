//! The files of `src` as a graph of uses. A path is followed through re-exports to the file that defines its item, so
//! that a `mod.rs` that only re-exports its children's items adds no circles.

use crate::source::Source;
use std::collections::{BTreeMap, BTreeSet};

/// More re-exports than this in a row form a circle.
const MOST_REEXPORTS: usize = 16;

/// The files of `src`.
pub struct House {
    pub sources: Vec<Source>,
    /// For each file, the others that it uses.
    pub uses: Vec<BTreeSet<usize>>,
}

impl House {
    pub fn new(sources: Vec<Source>) -> Self {
        let modules: BTreeMap<&[String], usize> =
            sources.iter().enumerate().map(|(index, source)| (&source.module[..], index)).collect();
        let uses = sources
            .iter()
            .enumerate()
            .map(|(index, source)| {
                let definers = source.used_paths().filter_map(|path| definer(&sources, &modules, path, 0));
                definers.filter(|&definer| definer != index).collect()
            })
            .collect();
        Self { sources, uses }
    }

    /// Groups of files, each of which uses all others of its group, directly or indirectly.
    pub fn circles(&self) -> Vec<Vec<usize>> {
        let reached: Vec<BTreeSet<usize>> = (0..self.sources.len()).map(|from| self.reached_from(from)).collect();
        let mut circles: Vec<Vec<usize>> = Vec::new();
        for from in 0..self.sources.len() {
            if reached[from].contains(&from) && !circles.iter().any(|circle| circle.contains(&from)) {
                circles.push(reached[from].iter().copied().filter(|&to| reached[to].contains(&from)).collect());
            }
        }
        circles
    }

    fn reached_from(&self, from: usize) -> BTreeSet<usize> {
        let mut reached = BTreeSet::new();
        let mut open = vec![from];
        while let Some(at) = open.pop() {
            open.extend(self.uses[at].iter().copied().filter(|&next| reached.insert(next)));
        }
        reached
    }

    /// The uses within a group of files, one line each.
    pub fn describe(&self, group: &[usize]) -> String {
        let mut lines = String::new();
        for &from in group {
            let used: Vec<&str> =
                group.iter().filter(|to| self.uses[from].contains(to)).map(|&to| &self.sources[to].path[..]).collect();
            lines += &format!("  {} uses {}\n", self.sources[from].path, used.join(", "));
        }
        lines
    }
}

/// The file that defines the item of a path. `None` for other crates and for whole modules.
fn definer(
    sources: &[Source],
    modules: &BTreeMap<&[String], usize>,
    path: &[String],
    reexports: usize,
) -> Option<usize> {
    if path[0] != "crate" || reexports > MOST_REEXPORTS {
        return None;
    }
    // The longest part of the path with a file is its module.
    let end = (1..=path.len()).rev().find(|&end| modules.contains_key(&path[1..end]))?;
    let name = path.get(end)?;
    let file = modules[&path[1..end]];
    let import = sources[file].uses.iter().find(|import| import.name == *name && import.path != path[..=end]);
    match import {
        Some(import) => definer(sources, modules, &[&import.path, &path[end + 1..]].concat(), reexports + 1),
        None => Some(file),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn house(files: &[(&str, &str)]) -> House {
        House::new(files.iter().map(|(path, text)| Source::new(path, text)).collect())
    }

    /// The circles by the paths of their files.
    fn circles(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let house = house(files);
        let named = |circle: Vec<usize>| circle.iter().map(|&file| house.sources[file].path.clone()).collect();
        house.circles().into_iter().map(named).collect()
    }

    #[test]
    fn two_files_that_use_each_other_are_a_circle() {
        let files = [
            ("src/lib.rs", "pub mod a; mod b;"),
            ("src/a.rs", "use crate::b::B; pub struct A(B);"),
            ("src/b.rs", "pub struct B; fn f() -> crate::a::A { todo() }"),
        ];
        assert_eq!(circles(&files), [["src/a.rs", "src/b.rs"]]);
    }

    #[test]
    fn a_circle_is_found_through_re_exports_aliases_and_imported_modules() {
        let files = [
            ("src/lib.rs", "mod a; mod b;"),
            ("src/a/mod.rs", "mod inner; mod other; pub use inner::Item as Thing; pub(crate) use other::f;"),
            ("src/a/inner.rs", "use super::super::b; pub struct Item; fn g() { b::h() }"),
            ("src/a/other.rs", "pub fn f() {}"),
            ("src/b.rs", "use super::a::{self, Thing as T}; pub fn h(_: T) { a::f() }"),
        ];
        assert_eq!(circles(&files), [["src/a/inner.rs", "src/b.rs"]]);
    }

    #[test]
    fn a_file_that_defines_what_its_children_use_must_not_use_them() {
        let hands_on = ("src/a/mod.rs", "mod child; pub use child::Child; pub struct Parent;");
        let uses = ("src/a/mod.rs", "mod child; pub use child::Child; pub struct Parent(Child);");
        let calls = ("src/a/mod.rs", "mod child; pub struct Parent; fn f() { child::f() }");
        let child = ("src/a/child.rs", "use super::Parent; pub struct Child; pub fn f() -> Parent {}");
        assert!(circles(&[hands_on, child]).is_empty());
        for parent in [uses, calls] {
            assert_eq!(circles(&[parent, child]), [["src/a/mod.rs", "src/a/child.rs"]]);
        }
    }

    #[test]
    fn unit_tests_and_other_crates_are_no_part_of_a_circle() {
        let files = [
            ("src/a.rs", "pub struct A; use bevy::b::B; #[cfg(test)] mod tests { use crate::b::B; }"),
            ("src/b.rs", "use crate::a::A; pub struct B; // use crate::a::A;"),
        ];
        assert!(circles(&files).is_empty());
    }
}
