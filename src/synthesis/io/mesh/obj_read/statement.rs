//! The statements of a file: lines without comments, joined where they are continued.

use super::super::read::MeshDataError;
use crate::synthesis::io::lines::Lines;
use std::borrow::Cow;

/// Keywords of statements that are read. Only these are continued: a group or a path may end in a backslash, too.
const CONTINUED: [&[u8]; 4] = [b"v", b"vt", b"f", b"fo"];

/// A line that is not empty.
pub(super) struct Statement<'a>(Cow<'a, [u8]>);

impl Statement<'_> {
    /// Its first word.
    pub(super) fn keyword(&self) -> &[u8] {
        words(&self.0).next().unwrap_or_default()
    }

    /// The words after the keyword.
    pub(super) fn words(&self) -> impl Iterator<Item = &[u8]> {
        words(&self.0).skip(1)
    }
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|byte| is_space(*byte)).filter(|word| !word.is_empty())
}

fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\x0b' | b'\x0c')
}

/// Statements, each with the number of its first line.
pub(super) struct Statements<'a> {
    lines: Lines<'a>,
}

impl<'a> Statements<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { lines: Lines::new(text) }
    }

    /// The whole of a statement that begins with this line.
    fn whole(&mut self, line: &'a [u8]) -> Result<Statement<'a>, &'static str> {
        let (mut part, mut is_continued) = significant(line);
        if !is_continued || !CONTINUED.contains(&words(part).next().unwrap_or_default()) {
            return Ok(Statement(Cow::Borrowed(part)));
        }
        let mut joined = part.to_vec();
        while is_continued && let Some((_, line)) = self.lines.next() {
            let had_space = joined.last().is_some_and(|&byte| is_space(byte));
            (part, is_continued) = significant(line);
            // One number in two parts, or two numbers? Either would be a guess.
            if !had_space && part.first().is_some_and(|&byte| !is_space(byte)) {
                return Err("it is continued without a space between the parts; put one before the backslash");
            }
            joined.extend_from_slice(part);
        }
        Ok(Statement(Cow::Owned(joined)))
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = Result<(usize, Statement<'a>), MeshDataError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (number, line) = self.lines.next()?;
            match self.whole(line) {
                Ok(statement) if statement.keyword().is_empty() => {}
                Ok(statement) => return Some(Ok((number, statement))),
                Err(cause) => return Some(Err(MeshDataError::Line { line: number, cause })),
            }
        }
    }
}

/// A line without its comment and its final backslash, and whether it had one. A comment is never continued.
fn significant(line: &[u8]) -> (&[u8], bool) {
    if let Some(end) = line.iter().position(|&byte| byte == b'#') {
        return (&line[..end], false);
    }
    let end = line.iter().rposition(|&byte| !is_space(byte)).map_or(0, |last| last + 1);
    match line[..end].strip_suffix(b"\\") {
        Some(part) => (part, true),
        None => (line, false),
    }
}
