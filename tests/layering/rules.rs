//! Rules for single files. The last tests show that the checks can fail.

use crate::{
    rooms::parts_below,
    source::{Source, declared_modules, words},
    sources,
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
    "earcut",
    "uvunwrap",
    "image",
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
const TREE_CHANGERS: &[&str] = &["src/synthesis/tree/", "src/synthesis/colonization/", "src/synthesis/binding/"];

const MOST_LINES: usize = 600;

impl Source {
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
            self.check_parts(&mut found);
            if self.is_in("synthesis") {
                self.check_purity(&mut found);
            }
        }
        found
    }

    /// The parts of the crate that a part may use. Items at the crate's top are excluded: `lib.rs` composes all parts.
    fn check_parts(&self, found: &mut Vec<String>) {
        let Some(part) = self.module.first() else { return };
        let rooms = parts_below(part);
        for path in self.paths().filter(|path| path[0] == "crate") {
            let room = path.get(1).map_or("*", String::as_str);
            if !rooms.contains(&room) {
                found.push(format!("uses {}; {part} may use {rooms:?} of the crate", path.join("::")));
            }
        }
    }

    fn check_purity(&self, found: &mut Vec<String>) {
        for path in self.paths().filter(|path| path[0] != "crate") {
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

#[test]
fn every_file_keeps_the_rules_of_the_house() {
    let files = sources(&["src", "examples", "tests", "benches"]);
    assert!(files.len() > 20, "only {} files found", files.len());
    let mut report = String::new();
    // The rules contain the patterns that they look for.
    for file in files.iter().filter(|file| !file.path.starts_with("tests/layering/")) {
        for violation in file.violations() {
            report += &format!("{} {violation}\n", file.path);
        }
    }
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
    assert_keeps("src/synthesis/tree/murray.rs", "pub fn f(tree: &mut VesselTree) {}");
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

#[test]
fn the_prelude_has_thirty_names_at_most() {
    let files = sources(&["src"]);
    let crate_root = files.iter().find(|file| file.path == "src/lib.rs").expect("a crate root");
    let names: Vec<&str> =
        crate_root.uses.iter().filter(|import| import.is_public).map(|import| &*import.name).collect();
    assert!((1..=30).contains(&names.len()), "{} names in the prelude: {names:?}", names.len());
}

/// Files without a parent: the compiler begins with them.
fn is_root(path: &str) -> bool {
    let parts: Vec<&str> = path.split('/').collect();
    matches!(parts[..], ["src", "lib.rs"] | ["tests" | "examples" | "benches", _] | ["tests", _, "main.rs"])
}

/// Files that no file beside or above them declares: they are never compiled, and their tests never run.
fn undeclared(files: &[Source]) -> Vec<&str> {
    let is_declared = |file: &Source| {
        let module = file.path.trim_end_matches(".rs").trim_end_matches("/mod");
        let (folder, name) = module.rsplit_once('/').unwrap_or(("", module));
        let is_above = |other: &&Source| {
            let place = other.path.rsplit_once('/').map_or("", |(place, _)| place);
            other.path != file.path && format!("{folder}/").starts_with(&format!("{place}/"))
        };
        let declares = |other: &Source| declared_modules(&other.text).iter().any(|module| module == name);
        files.iter().filter(is_above).any(declares)
    };
    files.iter().filter(|file| !is_root(&file.path) && !is_declared(file)).map(|file| &*file.path).collect()
}

#[test]
fn every_file_is_compiled() {
    let files = sources(&["src", "examples", "tests", "benches"]);
    let lost = undeclared(&files);
    assert!(lost.is_empty(), "no file declares {lost:?}");
}

#[test]
fn the_checks_find_a_file_that_is_not_compiled() {
    let file = Source::new;
    let files = [
        file("tests/plugin/main.rs", "mod a; // mod lost;"),
        file("tests/plugin/a.rs", ""),
        file("tests/plugin/lost.rs", ""),
        file("tests/tree.rs", "mod common;"),
        file("tests/common/mod.rs", ""),
    ];
    assert_eq!(undeclared(&files), ["tests/plugin/lost.rs"]);
}
