//! A source file for the rules: its text without comments, literals and unit tests, and the paths that it names.

use std::collections::BTreeSet;

/// A source file.
pub struct Source {
    /// Path from the project's root, with `/`.
    pub path: String,
    /// Its module's path, without `crate`.
    pub module: Vec<String>,
    pub lines: usize,
    /// The text without comments and the contents of literals.
    pub text: String,
    /// The same without unit tests.
    pub code: String,
    /// Its imports.
    pub uses: Vec<Use>,
    /// The code without imports.
    pub body: String,
    /// Paths in the code, resolved to `crate` or another crate.
    inline: Vec<Vec<String>>,
}

/// One name that a file imports.
pub struct Use {
    /// Begins with `crate` or the name of another crate.
    pub path: Vec<String>,
    /// Its name in the file.
    pub name: String,
    /// Whether others can import it from here.
    pub is_public: bool,
}

impl Source {
    pub fn new(path: &str, text: &str) -> Self {
        let blanked = blank(text);
        let mut module: Vec<String> = path.trim_end_matches(".rs").split('/').skip(1).map(str::to_owned).collect();
        if matches!(module.last().map(String::as_str), Some("mod" | "lib")) {
            module.pop();
        }
        let is_test = module.last().is_some_and(|name| name == "tests");
        let code = if is_test { String::new() } else { without_tests(&blanked) };
        let (statements, body) = split_uses(&without_reflect(&code));
        let modules = declared_modules(&body);
        let uses = imports(&statements, &module, &modules);
        let inline = inline_paths(&body, &module, &modules, &uses);
        Self { path: path.to_owned(), module, lines: text.lines().count(), text: blanked, code, uses, body, inline }
    }

    pub fn is_in(&self, room: &str) -> bool {
        self.module.first().is_some_and(|first| first == room) && self.path.starts_with("src/")
    }

    /// Every path that the file names, in imports or in the code.
    pub fn paths(&self) -> impl Iterator<Item = &[String]> {
        self.uses.iter().map(|import| &import.path[..]).chain(self.inline.iter().map(Vec::as_slice))
    }

    /// The same without pure re-exports.
    pub fn used_paths(&self) -> impl Iterator<Item = &[String]> {
        let named: BTreeSet<&str> = words(&self.body).into_iter().map(|(_, word)| word).collect();
        let is_used = move |import: &&Use| !import.is_public || named.contains(&*import.name);
        let imported = self.uses.iter().filter(is_used).map(|import| &import.path[..]);
        imported.chain(self.inline.iter().map(Vec::as_slice))
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
pub fn words(text: &str) -> Vec<(usize, &str)> {
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

/// The modules that a file declares itself.
pub fn declared_modules(code: &str) -> Vec<String> {
    words(code).windows(2).filter(|pair| pair[0].1 == "mod").map(|pair| pair[1].1.to_owned()).collect()
}

/// All names of the `use` statements of a file.
fn imports(statements: &[Statement], module: &[String], modules: &[String]) -> Vec<Use> {
    let mut found = Vec::new();
    for statement in statements {
        let mut names = Vec::new();
        expand(&statement.tree, &[], &mut names);
        found.extend(names.into_iter().map(|(path, name)| Use {
            path: resolve(path, module, modules),
            name,
            is_public: statement.is_public,
        }));
    }
    found
}

/// Every path in the code that leads to another file or crate.
fn inline_paths(body: &str, module: &[String], modules: &[String], uses: &[Use]) -> Vec<Vec<String>> {
    let all = words(body);
    let mut found = Vec::new();
    for (index, &(at, word)) in all.iter().enumerate() {
        let after = &body[at + word.len()..];
        let leads =
            !body[..at].trim_end().ends_with([':', '.']) && after.starts_with("::") && !after.starts_with("::<");
        if !leads {
            continue;
        }
        let mut path = vec![word.to_owned()];
        for pair in all[index..].windows(2) {
            let between = &body[pair[0].0 + pair[0].1.len()..pair[1].0];
            if between != "::" {
                break;
            }
            path.push(pair[1].1.to_owned());
        }
        // `clippy::…` names a lint. A capitalised name that isn't imported belongs to this file.
        let imported = uses.iter().find(|import| import.name == word);
        let is_crate_or_module =
            word.starts_with(|c: char| c.is_lowercase()) && word != "clippy" && !is_primitive(word);
        if let Some(import) = imported {
            found.push([&import.path, &path[1..]].concat());
        } else if is_crate_or_module {
            found.push(resolve(path, module, modules));
        }
    }
    found
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

/// A `use` statement.
struct Statement {
    tree: String,
    is_public: bool,
}

/// Removes all `use` statements from the code.
fn split_uses(code: &str) -> (Vec<Statement>, String) {
    let mut uses = Vec::new();
    let mut rest = String::new();
    let mut done = 0;
    for (at, word) in words(code) {
        // `use<'a>` of a return type is no import.
        if word == "use" && at >= done && !code[at + 3..].starts_with('<') {
            let end = code[at..].find(';').map_or(code.len(), |semicolon| at + semicolon);
            let before = code[..at].trim_end();
            uses.push(Statement {
                tree: code[at + 3..end].split_whitespace().collect::<Vec<_>>().join(" "),
                is_public: before.ends_with("pub") || before.ends_with(')'),
            });
            rest.push_str(&code[done..at]);
            done = end;
        }
    }
    rest.push_str(&code[done..]);
    (uses, rest)
}

/// Expands the paths of one use tree, each with its local name: `a::{b, c::d as e}` gives `a::b` as `b`, and `a::c::d`
/// as `e`.
fn expand(tree: &str, prefix: &[String], found: &mut Vec<(Vec<String>, String)>) {
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
        let (name, alias) = tree.split_once(" as ").unwrap_or((tree, tree));
        let last: &[String] = if name == "self" && !prefix.is_empty() { &[] } else { &[name.to_owned()] };
        let path = [prefix, last].concat();
        let alias = if alias == "self" { path[path.len() - 1].clone() } else { alias.trim().to_owned() };
        found.push((path, alias));
    }
}

/// Turns a path that begins with `self`, `super` or a module of this file into one that begins with `crate`.
fn resolve(path: Vec<String>, module: &[String], modules: &[String]) -> Vec<String> {
    let is_own = modules.contains(&path[0]);
    if !is_own && !matches!(path[0].as_str(), "self" | "super") {
        return path;
    }
    let supers = path.iter().filter(|segment| *segment == "super").count();
    let base = &module[..module.len().saturating_sub(supers)];
    let rest = path.iter().filter(|segment| !matches!(segment.as_str(), "self" | "super"));
    ["crate".to_owned()].iter().chain(base).chain(rest).cloned().collect()
}
