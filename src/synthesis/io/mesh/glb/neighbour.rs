//! Files of data that a glTF file names. It may name only those in its own folder and below.

use super::super::read::MeshDataError;
use std::path::{Component, Path, PathBuf};

/// The path of a file that a URI names, found from the folder of the glTF file, without links.
///
/// # Errors
/// A URI or a link that leads out of the folder; no such file.
pub(super) fn find(folder: &Path, uri: &str) -> Result<PathBuf, MeshDataError> {
    let elsewhere =
        || MeshDataError::content("it names a file of data that is not in its own folder or below; put it there");
    let path = folder.join(relative(uri).ok_or_else(elsewhere)?);
    let found = folder.canonicalize().and_then(|folder| Ok((folder, path.canonicalize()?)));
    match found {
        Ok((folder, found)) if found.starts_with(&folder) => Ok(found),
        Ok(_) => Err(elsewhere()),
        Err(source) => Err(MeshDataError::Data { path, source }),
    }
}

/// A URI as a path that goes down only.
fn relative(uri: &str) -> Option<PathBuf> {
    let text = decode_percent(uri)?;
    // A colon stands after a scheme, such as file, or a drive. Control characters would change what messages show.
    if text.is_empty() || text.contains(|letter: char| letter == ':' || letter.is_control()) {
        return None;
    }
    let path = PathBuf::from(text);
    let goes_down = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    goes_down.then_some(path)
}

/// The text of a URI.
fn decode_percent(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let code = after.get(..2).filter(|code| code.iter().all(u8::is_ascii_hexdigit));
        let code = code.and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_go_down_only() {
        let path = |uri: &str| relative(uri).map(|path| path.display().to_string());
        assert_eq!(path("a%20b%2.bin%").as_deref(), Some("a b%2.bin%"));
        assert_eq!(path("./data/a.bin").as_deref(), Some("./data/a.bin"));
        assert_eq!(path("%+1.bin").as_deref(), Some("%+1.bin"));
        for uri in [
            "",
            "/dev/zero",
            "../a.bin",
            "a/../../b.bin",
            "%2e%2e/a.bin",
            "%2Fetc",
            "file:a",
            "http://a/b",
            "a%00",
            "%ff",
        ] {
            assert_eq!(path(uri), None, "{uri}");
        }
    }
}
