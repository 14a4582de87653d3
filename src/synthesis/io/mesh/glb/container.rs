//! The container of a binary file, and data within text.

use super::super::read::MeshDataError;

/// First bytes of a binary file.
pub(super) const MAGIC: &[u8] = b"glTF";

/// The JSON and the binary chunk of a binary file. Chunks of other kinds are skipped.
pub(super) fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshDataError> {
    let word = |offset: usize| {
        let word = bytes.get(offset..).and_then(<[u8]>::first_chunk);
        word.copied().map(u32::from_le_bytes).ok_or_else(|| MeshDataError::content("it ends within its header"))
    };
    if word(4)? != 2 {
        return Err(MeshDataError::content("it is not of glTF version 2, the only one that is read"));
    }
    // Kind, content and end of the chunk at an offset.
    let chunk = |offset: usize| -> Result<_, MeshDataError> {
        let length = word(offset)? as usize;
        let kind = word(offset + 4)?.to_le_bytes();
        let content = bytes[offset + 8..].get(..length).ok_or_else(|| MeshDataError::content("it is cut short"))?;
        Ok((kind, content, offset + 8 + length))
    };
    let (kind, text, mut next) = chunk(12)?;
    if kind != *b"JSON" {
        return Err(MeshDataError::content("its first chunk is not JSON"));
    }
    while next < bytes.len() {
        let (kind, content, end) = chunk(next)?;
        if kind == *b"BIN\0" {
            return Ok((text, Some(content)));
        }
        next = end;
    }
    Ok((text, None))
}

/// The bytes of base64 text; `None` if it is none.
pub(super) fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    Some(bytes)
}
