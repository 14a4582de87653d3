//! Holds the source to the rules of the house (`ARCHITECTURE.md`): which room may use which, and what is forbidden.
//!
//! The rules are checked on the text of the source files, after comments, string literals and unit tests have been
//! blanked out. The last tests of this file show that the checks can fail. That optional crates stay behind their
//! features needs no check here: `cargo check --no-default-features` does not build otherwise.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Crates that the pure half may use.
const PURE_CRATES: &[&str] = &[
    "std",
    "core",
    "alloc",
    "bevy_math",
    "rand",
    "rand_chacha",
    "nalgebra",
    "kiddo",
    "thiserror",
    "bytemuck",
    "rayon",
    "serde",
    "ron",
    "gltf",
    "tobj",
];

/// Modules of std that the pure half must not use: clocks, threads, the environment, the network.
const IMPURE_STD: &[&str] = &["time", "thread", "env", "net"];

/// Words that the pure half must not use: collections with random order, generators that differ between platforms or
/// versions, and output.
const IMPURE_WORDS: &[&str] = &[
    "HashMap",
    "HashSet",
    "Instant",
    "SystemTime",
    "StdRng",
    "SmallRng",
    "ThreadRng",
    "OsRng",
    "println",
    "print",
    "eprintln",
    "eprint",
];

/// Functions of std that differ in their last bits between platforms. Those of `bevy_math::ops` are the same
/// everywhere.
const UNPORTABLE_MATHS: &[&str] = &[
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
    "exp", "exp2", "exp_m1", "ln", "ln_1p", "log", "log2", "log10", "powf", "cbrt", "hypot",
];

/// Where a tree may be changed. Every other room takes `&VesselTree`.
const TREE_CHANGERS: &[&str] =
    &["src/synthesis/tree/", "src/synthesis/colonization/", "src/synthesis/murray.rs", "src/synthesis/binding/"];

const MOST_LINES: usize = 600;

/// A source file, prepared for the rules.
struct Source {
    /// Path from the project's root, with `/`.
    path: String,
    /// Its module's path, without `crate`.
    module: Vec<String>,
    lines: usize,
    /// The text without comments and the contents of literals.
    text: String,
    /// The same without unit tests.
    code: String,
}

impl Source {
    fn new(path: &str, text: &str) -> Self {
        let blanked = blank(text);
        let mut module: Vec<String> = path.trim_end_matches(".rs").split('/').skip(1).map(str::to_owned).collect();
        if matches!(module.last().map(String::as_str), Some("mod" | "lib")) {
            module.pop();
        }
        let is_test = module.last().is_some_and(|name| name == "tests");
        let code = if is_test { String::new() } else { without_tests(&blanked) };
        Self { path: path.to_owned(), module, lines: text.lines().count(), text: blanked, code }
    }

    fn is_in(&self, room: &str) -> bool {
        self.module.first().is_some_and(|first| first == room) && self.path.starts_with("src/")
    }

    /// Violations of the rules in this file, one line each.
    fn violations(&self) -> Vec<String> {
        let mut found = Vec::new();
        if self.lines > MOST_LINES {
            found.push(format!("has {} lines; split it by operation", self.lines));
        }
        for (pattern, instead) in [
            ("#[allow(", "use #[expect(.., reason = ..)]"),
            ("#![allow(", "use #![expect(.., reason = ..)]"),
            ("todo!", "finish it"),
            ("unimplemented!", "finish it"),
            ("dbg!", "remove it"),
        ] {
            if self.text.contains(pattern) {
                found.push(format!("holds {pattern}: {instead}"));
            }
        }
        if self.path.starts_with("src/") {
            let paths = paths(&self.code, &self.module);
            self.check_rooms(&paths, &mut found);
            if self.is_in("synthesis") {
                self.check_purity(&paths, &mut found);
            }
        }
        found
    }

    /// Which rooms of the crate a room may use.
    fn check_rooms(&self, paths: &[Vec<String>], found: &mut Vec<String>) {
        let rooms: &[&str] = if self.is_in("synthesis") {
            &["synthesis"]
        } else if self.is_in("plugin") {
            &["plugin", "synthesis"]
        } else if self.is_in("render") {
            &["render", "plugin", "synthesis"]
        } else if self.is_in("ui") {
            &["ui", "plugin", "synthesis"]
        } else {
            // lib.rs composes all rooms.
            return;
        };
        for path in paths.iter().filter(|path| path[0] == "crate") {
            let room = path.get(1).map_or("*", String::as_str);
            if !rooms.contains(&room) {
                found.push(format!("uses {}; this room may use {rooms:?} of the crate", path.join("::")));
            }
        }
    }

    fn check_purity(&self, paths: &[Vec<String>], found: &mut Vec<String>) {
        for path in paths.iter().filter(|path| path[0] != "crate") {
            let shown = path.join("::");
            if !PURE_CRATES.contains(&path[0].as_str()) {
                found.push(format!("uses {shown}, which is not of the pure half"));
            } else if path[0] == "std" && path.get(1).is_some_and(|module| IMPURE_STD.contains(&module.as_str())) {
                found.push(format!("uses {shown}, which belongs to the caller"));
            }
        }
        for (at, word) in words(&self.code) {
            let before = self.code[..at].trim_end();
            let after = self.code[at + word.len()..].trim_start();
            if IMPURE_WORDS.contains(&word) && (!word.contains("print") || after.starts_with('!')) {
                found.push(format!("uses {word}"));
            }
            let of_float = before.ends_with('.') || before.ends_with("f32::") || before.ends_with("f64::");
            if of_float && after.starts_with('(') && UNPORTABLE_MATHS.contains(&word) {
                found.push(format!("calls std's {word}; use bevy_math::ops::{word}"));
            }
        }
        if self.code.contains("&mut VesselTree") && !TREE_CHANGERS.iter().any(|place| self.path.starts_with(place)) {
            found.push("changes a tree; a product takes &VesselTree and returns a value".to_owned());
        }
    }
}

/// Replaces comments and the contents of string and character literals with blanks, keeping the lines.
fn blank(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    while at < chars.len() {
        let Some(end) = literal_end(&chars, at) else {
            out.push(chars[at]);
            at += 1;
            continue;
        };
        out.extend(chars[at..end].iter().map(|&c| if c == '\n' { '\n' } else { ' ' }));
        at = end;
    }
    out
}

/// End of the comment or literal that begins at `at`, if there is one.
fn literal_end(chars: &[char], at: usize) -> Option<usize> {
    let rest = &chars[at..];
    let find = |from: usize, what: &str| {
        let what: Vec<char> = what.chars().collect();
        (from..chars.len()).find(|&i| chars[i..].starts_with(&what)).map_or(chars.len(), |i| i + what.len())
    };
    let in_word = at > 0 && (chars[at - 1].is_alphanumeric() || chars[at - 1] == '_');
    match rest {
        ['/', '/', ..] => Some((at..chars.len()).find(|&i| chars[i] == '\n').unwrap_or(chars.len())),
        ['/', '*', ..] => Some(find(at + 2, "*/")),
        ['r', '"' | '#', ..] if !in_word => {
            let hashes = rest[1..].iter().take_while(|&&c| c == '#').count();
            (rest.get(1 + hashes) == Some(&'"')).then(|| find(at + hashes + 2, &format!("\"{}", "#".repeat(hashes))))
        }
        ['"', ..] => {
            let mut i = at + 1;
            while i < chars.len() && chars[i] != '"' {
                i += if chars[i] == '\\' { 2 } else { 1 };
            }
            Some((i + 1).min(chars.len()))
        }
        ['\'', '\\', ..] => Some(find(at + 3, "'")),
        ['\'', _, '\'', ..] => Some(at + 3),
        _ => None,
    }
}

/// Removes every `#[cfg(test)] mod … { … }`. Expects blanked text.
fn without_tests(code: &str) -> String {
    let mut out = String::new();
    let mut rest = code;
    while let Some(start) = rest.find("#[cfg(test)]") {
        let (before, tests) = rest.split_at(start);
        out.push_str(before);
        let end = match (tests.find('{'), tests.find(';')) {
            (Some(brace), semicolon) if semicolon.is_none_or(|semicolon| brace < semicolon) => {
                brace + closing_brace(&tests[brace..])
            }
            (_, semicolon) => semicolon.unwrap_or(tests.len() - 1),
        };
        rest = &tests[end + 1..];
    }
    out + rest
}

/// Offset of the brace that closes the one at the start.
fn closing_brace(text: &str) -> usize {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 1 => return at,
            '}' => depth -= 1,
            _ => {}
        }
    }
    text.len() - 1
}

/// Every word of the text, with its offset.
fn words(text: &str) -> Vec<(usize, &str)> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let mut start = None;
    for (at, c) in text.char_indices().chain([(text.len(), ' ')]) {
        match (start, is_word(c)) {
            (None, true) => start = Some(at),
            (Some(from), false) => {
                found.push((from, &text[from..at]));
                start = None;
            }
            _ => {}
        }
    }
    found
}

/// Every path to another crate or room, in `use` and in the code. Paths within the crate begin with `crate`; `self` and
/// `super` are resolved.
fn paths(code: &str, module: &[String]) -> Vec<Vec<String>> {
    let code = without_reflect(code);
    let (uses, rest) = split_uses(&code);
    let mut imported = Vec::new();
    for tree in &uses {
        expand(tree, &[], &mut imported);
    }
    let mut known: Vec<String> = imported.iter().filter_map(|path| path.last().cloned()).collect();
    let all = words(&rest);
    known.extend(all.windows(2).filter(|pair| pair[0].1 == "mod").map(|pair| pair[1].1.to_owned()));
    let mut found: Vec<Vec<String>> = imported.into_iter().filter(|path| !known_module(&path[0], &rest)).collect();
    for (index, &(at, word)) in all.iter().enumerate() {
        let leads = !rest[..at].trim_end().ends_with([':', '.']) && rest[at + word.len()..].starts_with("::");
        // `clippy::…` names a lint.
        let is_crate_or_module =
            word.starts_with(|c: char| c.is_lowercase()) && word != "clippy" && !is_primitive(word);
        let turbofish = rest[at + word.len()..].starts_with("::<");
        if leads && is_crate_or_module && !turbofish && !known.iter().any(|name| name == word) {
            let next = all.get(index + 1).map_or("", |&(_, next)| next);
            let supers = all[index..].iter().take_while(|&&(_, word)| word == "super").count();
            let mut path = vec![word.to_owned(); supers.max(1)];
            path.push(all.get(index + supers.max(1)).map_or(next, |&(_, name)| name).to_owned());
            found.push(path);
        }
    }
    found.into_iter().map(|path| resolve(path, module)).collect()
}

/// Whether a file declares this module itself, so that `use name::…` stays within it.
fn known_module(name: &str, code: &str) -> bool {
    words(code).windows(2).any(|pair| pair[0].1 == "mod" && pair[1].1 == name)
}

fn is_primitive(word: &str) -> bool {
    [
        "f32", "f64", "bool", "char", "str", "u8", "u16", "u32", "u64", "u128", "usize", "i8", "i16", "i32", "i64",
        "isize",
    ]
    .contains(&word)
}

/// `Reflect` may be derived on settings behind the feature that enables Bevy: the only engine path of the pure half.
fn without_reflect(code: &str) -> String {
    let mut out = String::new();
    for line in code.split_inclusive('\n') {
        if line.trim_start().starts_with("#[cfg_attr(") {
            out.push_str(&line.replace("bevy::reflect::", ""));
        } else {
            out.push_str(line);
        }
    }
    out
}

/// Removes the trees of all `use` statements from the code.
fn split_uses(code: &str) -> (Vec<String>, String) {
    let mut uses = Vec::new();
    let mut rest = String::new();
    let mut done = 0;
    for (at, word) in words(code) {
        // `use<'a>` of a return type is no import.
        if word == "use" && at >= done && !code[at + 3..].starts_with('<') {
            let end = code[at..].find(';').map_or(code.len(), |semicolon| at + semicolon);
            uses.push(code[at + 3..end].split_whitespace().collect::<Vec<_>>().join(" "));
            rest.push_str(&code[done..at]);
            done = end;
        }
    }
    rest.push_str(&code[done..]);
    (uses, rest)
}

/// Expands the paths of one use tree: `a::{b, c::d as e}` gives `a::b` and `a::c::d`.
fn expand(tree: &str, prefix: &[String], found: &mut Vec<Vec<String>>) {
    let tree = tree.trim().trim_start_matches("::");
    if let Some(group) = tree.strip_prefix('{') {
        let mut depth = 0;
        let inner = &group[..group.len().saturating_sub(1)];
        let parts = inner.split(|c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        });
        for part in parts.filter(|part| !part.trim().is_empty()) {
            expand(part, prefix, found);
        }
    } else if let Some((first, rest)) = tree.split_once("::") {
        expand(rest, &[prefix, &[first.trim().to_owned()]].concat(), found);
    } else {
        let name = tree.split(" as ").next().unwrap_or(tree).trim();
        let last: &[String] = if name == "self" && !prefix.is_empty() { &[] } else { &[name.to_owned()] };
        found.push([prefix, last].concat());
    }
}

/// Turns a path that begins with `self` or `super` into one that begins with `crate`.
fn resolve(path: Vec<String>, module: &[String]) -> Vec<String> {
    if !matches!(path[0].as_str(), "self" | "super") {
        return path;
    }
    let supers = path.iter().filter(|segment| *segment == "super").count();
    let base = &module[..module.len().saturating_sub(supers)];
    let rest = path.iter().filter(|segment| !matches!(segment.as_str(), "self" | "super"));
    ["crate".to_owned()].iter().chain(base).chain(rest).cloned().collect()
}

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Rust file below a folder of the project, in a fixed order.
fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a folder that can be read").path()).collect();
    paths.sort();
    let expanded = paths.into_iter().flat_map(|path| if path.is_dir() { rust_files(&path) } else { vec![path] });
    expanded.filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect()
}

#[test]
fn every_file_keeps_the_rules_of_the_house() {
    let mut report = String::new();
    let mut files = 0;
    for path in ["src", "examples", "tests", "benches"].iter().flat_map(|folder| rust_files(&project().join(folder))) {
        let name = path.strip_prefix(project()).unwrap().to_string_lossy().replace('\\', "/");
        // This file contains the patterns that it looks for.
        if name == "tests/layering.rs" {
            continue;
        }
        files += 1;
        for violation in Source::new(&name, &fs::read_to_string(&path).unwrap()).violations() {
            report += &format!("{name} {violation}\n");
        }
    }
    assert!(files > 20, "only {files} files found below {}", project().display());
    assert!(report.is_empty(), "\n{report}");
}

fn violations(path: &str, text: &str) -> String {
    Source::new(path, text).violations().join("\n")
}

/// Asserts that a file with this text breaks a rule, and that the message says what.
fn assert_breaks(path: &str, text: &str, message: &str) {
    let found = violations(path, text);
    assert!(found.contains(message), "{path} with `{text}` should break a rule: {message:?} is not in {found:?}");
}

fn assert_keeps(path: &str, text: &str) {
    assert_eq!(violations(path, text), "", "{path} with `{text}` keeps the rules");
}

#[test]
fn the_checks_find_a_use_of_the_wrong_room() {
    let pure = "src/synthesis/tree/sweep.rs";
    assert_breaks(pure, "use bevy::prelude::*;", "bevy::prelude");
    assert_breaks(pure, "use std::fmt; use wgpu;", "wgpu");
    assert_breaks(pure, "fn f() { bevy::log::info() }", "bevy::log");
    assert_breaks(pure, "#[derive(bevy::reflect::Reflect)] struct S;", "bevy::reflect");
    assert_breaks(pure, "use crate::plugin::GrowthPlugin;", "crate::plugin");
    assert_breaks(pure, "use crate::{synthesis::murray, render::Look};", "crate::render");
    assert_breaks(pure, "fn f() { crate::render::f() }", "crate::render");
    assert_breaks(pure, "use super::super::super::plugin::X;", "crate::plugin");
    assert_breaks(pure, "fn f() { super::super::super::plugin::f() }", "crate::plugin");
    assert_breaks("src/plugin/growth.rs", "use crate::render::Look;", "crate::render");
    assert_breaks("src/plugin/growth.rs", "use super::super::ui::Panel;", "crate::ui");
    assert_breaks("src/plugin/mod.rs", "use crate::VesselPlugin;", "crate::VesselPlugin");
    assert_breaks("src/render/mod.rs", "use crate::{prelude::*};", "crate::prelude");
    assert_breaks("src/render/mod.rs", "use crate::ui::Panel;", "crate::ui");
    assert_keeps(pure, "use super::{VesselTree, super::rng::Stream as S}; use bevy_math::{Vec3, ops}; use std::fmt;");
    assert_keeps(pure, "mod a; pub use a::B; fn f() { a::g(); ops::h(); ops } use bevy_math::ops;");
    assert_keeps(pure, "#[cfg_attr(feature = \"plugin\", derive(bevy::reflect::Reflect))] struct S;");
    assert_keeps(
        pure,
        "// use bevy::x;\n/* crate::plugin::f() */ const S: &str = \"bevy::y \\\" dbg!\"; fn f<'a>() {}",
    );
    assert_keeps(pure, "fn f() { parse::<f32>(); f32::max(1.0, 2.0); self::g(); Self::h() }");
    assert_keeps("src/render/mod.rs", "use crate::plugin::Vessels; use bevy::prelude::*;");
}

#[test]
fn the_checks_find_impurity() {
    let pure = "src/synthesis/tissue/shape.rs";
    assert_breaks(pure, "use std::collections::HashMap;", "HashMap");
    assert_breaks(pure, "use std::{fmt, time::Instant};", "std::time");
    assert_breaks(pure, "fn f() { std::time::Instant::now(); }", "std::time");
    assert_breaks(pure, "fn f() { println!(\"here\"); }", "println");
    assert_breaks(pure, "fn f(x: f32) -> f32 { x.sin() }", "ops::sin");
    assert_breaks(pure, "fn f(x: f32) -> f32 { x\n    .powf(2.0) }", "ops::powf");
    assert_breaks(pure, "fn f(x: f32) -> f32 { f32::acos(x) }", "ops::acos");
    assert_breaks(pure, "use rand::rngs::StdRng;", "StdRng");
    assert_breaks(pure, "pub fn f(tree: &mut VesselTree) {}", "changes a tree");
    assert_keeps("src/synthesis/murray.rs", "pub fn f(tree: &mut VesselTree) {}");
    assert_keeps("src/plugin/growth.rs", "use std::{time::Instant, collections::HashMap}; fn f() { 1f32.sin(); }");
    assert_keeps(pure, "fn f(x: f32) -> f32 { ops::sin(x).sqrt() }\nuse bevy_math::ops;");
    assert_keeps(pure, "#[cfg(test)]\nmod tests { use std::time::Instant; fn f() { 1f32.sin(); } }\nfn g() {}");
    assert_keeps("src/synthesis/tissue/tests.rs", "use std::collections::HashSet;");
    assert_breaks(pure, "#[cfg(test)]\nmod tests { fn f() {} }\nfn g() { 1f32.sin(); }", "ops::sin");
}

#[test]
fn the_checks_find_what_no_file_may_hold() {
    for path in ["src/lib.rs", "examples/colon.rs", "tests/tree.rs"] {
        assert_breaks(path, "#[allow(dead_code)] fn f() {}", "expect");
        assert_breaks(path, "fn f() { todo!() }", "finish");
        assert_breaks(path, "fn f() { dbg!(1); }", "remove");
        assert_breaks(path, &"\n".repeat(MOST_LINES + 1), "split");
        assert_keeps(path, &"\n".repeat(MOST_LINES));
    }
}
