//! The lines of text files: what is read, whatever ends them and in which encoding, and what is written as comments.

/// Text of two bytes a letter, which no reader takes.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Utf16;

impl Utf16 {
    /// What messages say about it.
    pub(super) const CAUSE: &str = "it is UTF-16 text; save it as UTF-8 or ASCII";
}

/// The text after its byte order mark, if it has one. Its bytes may be of any encoding that holds ASCII.
pub(super) fn text(bytes: &[u8]) -> Result<&[u8], Utf16> {
    match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Err(Utf16),
        // ASCII letters in UTF-16 without a mark.
        &[a, b, c, d, ..] if (a == 0) != (b == 0) && (a == 0) == (c == 0) && (b == 0) == (d == 0) => Err(Utf16),
        [0xef, 0xbb, 0xbf, rest @ ..] => Ok(rest),
        _ => Ok(bytes),
    }
}

/// Lines without their ends, numbered from 1. A line ends in LF, CR LF or CR.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { rest: text, number: 0 }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(self.rest.len());
        let (line, after) = self.rest.split_at(end);
        self.rest = after.strip_prefix(b"\r\n").or_else(|| after.get(1..)).unwrap_or_default();
        self.number += 1;
        Some((self.number, line))
    }
}

/// A user's comments as lines that no format takes for data: each on one line, those without a letter left out.
pub(super) fn comment_lines(comments: &[String]) -> impl Iterator<Item = String> + '_ {
    comments.iter().flat_map(|comment| comment.split(['\n', '\r'])).map(one_line).filter(|line| !line.is_empty())
}

/// A text on one line: control characters, line breaks among them, become spaces.
///
/// A backslash would join the line to the next one in OBJ; it becomes a slash.
pub(super) fn one_line(text: &str) -> String {
    let plain = |letter: char| match letter {
        '\\' => '/',
        // Unicode's own line breaks are not control characters.
        '\u{2028}' | '\u{2029}' => ' ',
        letter if letter.is_control() => ' ',
        letter => letter,
    };
    text.chars().map(plain).collect::<String>().trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_any_way() {
        let lines: Vec<_> = Lines::new(b"a\nb\r\nc\rd\r\r\ne\n").collect();
        let expected: [(usize, &[u8]); 6] = [(1, b"a"), (2, b"b"), (3, b"c"), (4, b"d"), (5, b""), (6, b"e")];
        assert_eq!(lines, expected);
        assert_eq!(Lines::new(b"").count(), 0);
        assert_eq!(Lines::new(b"a").collect::<Vec<_>>(), [(1, &b"a"[..])]);
    }

    #[test]
    fn comments_stay_on_their_lines() {
        let comments = ["seed 7\r\npreset \"liver\"\n\n".to_owned(), "path C:\\x\\\t\u{0}\rv 0 0 0".to_owned()];
        let lines: Vec<String> = comment_lines(&comments).collect();
        assert_eq!(lines, ["seed 7", "preset \"liver\"", "path C:/x/", "v 0 0 0"]);
    }

    #[test]
    fn encodings_are_told_apart() {
        assert_eq!(text(b"\xef\xbb\xbfv 1"), Ok(&b"v 1"[..]));
        assert_eq!(text(b"v \xb5"), Ok(&b"v \xb5"[..]));
        for wide in [&b"\xff\xfev\0"[..], b"\xfe\xff\0v", b"v\0 \0", b"\0v\0 "] {
            assert_eq!(text(wide), Err(Utf16));
        }
        for other in [&b""[..], b"v", b"\0\0\0\0", b"\0\x01\x02\x03", b"v 1 "] {
            assert_eq!(text(other), Ok(other));
        }
    }
}
