//! Maps as KTX2: uncompressed, with all levels, as GPUs take them.
//!
//! "KTX File Format Specification", version 2.0 (Khronos 2020).

use crate::synthesis::texture::{BakedMap, TexelFormat};
use std::io::{self, Write};

/// The bytes that every file begins with.
const IDENTIFIER: [u8; 12] = *b"\xABKTX 20\xBB\r\n\x1A\n";
/// Bytes of the header with the index, before the list of levels.
const HEADER: usize = 80;
/// Bytes of an entry in the list of levels.
const ENTRY: usize = 24;
/// Number of the alpha channel, and the mark of one that is linear in a format that is not.
const ALPHA: u8 = 15;
const LINEAR: u8 = 1 << 4;

impl TexelFormat {
    /// Its number in Vulkan.
    fn vulkan(self) -> u32 {
        match self {
            Self::Rgba8Unorm => 37,
            Self::Rgba8Uint => 41,
            Self::Rgba8Srgb => 43,
            Self::R16Unorm => 70,
        }
    }
}

/// Writes a map as KTX2, uncompressed, with all its levels.
///
/// # Errors
/// Those of `out`.
pub fn write_ktx2(out: &mut dyn Write, map: &BakedMap) -> io::Result<()> {
    let format = map.kind.format();
    let (descriptor, values) = (descriptor(format), values());
    let described = HEADER + ENTRY * map.levels.len();
    let valued = described + descriptor.len();
    let component = if format == TexelFormat::R16Unorm { 2 } else { 1 };
    let mut head: Vec<u8> = IDENTIFIER.to_vec();
    let numbers = [format.vulkan(), component, map.size, map.size, 0, 0, 1, map.levels.len() as u32, 0];
    let index = [described, descriptor.len(), valued, values.len()].map(|value| value as u32);
    head.extend(numbers.into_iter().chain(index).flat_map(u32::to_le_bytes));
    // There is no data of a compression.
    head.extend([0; 16]);
    // The smallest level comes first in the file, the largest in the list.
    let mut at = valued + values.len();
    let mut places = Vec::with_capacity(map.levels.len());
    for level in map.levels.iter().rev() {
        at = at.next_multiple_of(4);
        places.push((at, level.len()));
        at += level.len();
    }
    for &(at, length) in places.iter().rev() {
        head.extend([at, length, length].into_iter().flat_map(|value| (value as u64).to_le_bytes()));
    }
    head.extend(descriptor);
    head.extend(values);
    out.write_all(&head)?;
    let mut written = head.len();
    for (level, (at, length)) in map.levels.iter().rev().zip(places) {
        out.write_all(&[0; 4][..at - written])?;
        out.write_all(level)?;
        written = at + length;
    }
    Ok(())
}

/// The data format descriptor, with its length.
///
/// "Khronos Data Format Specification", version 1.3, section 5: a basic block.
fn descriptor(format: TexelFormat) -> Vec<u8> {
    let (transfer, upper) = match format {
        TexelFormat::Rgba8Srgb => (2, 255),
        TexelFormat::Rgba8Unorm => (1, 255),
        TexelFormat::Rgba8Uint => (1, 1),
        TexelFormat::R16Unorm => (1, 65_535u32),
    };
    let (channels, bits): (&[u8], u16) = match format {
        TexelFormat::R16Unorm => (&[0], 16),
        _ => (&[0, 1, 2, ALPHA], 8),
    };
    let block = 24 + 16 * channels.len() as u16;
    let mut bytes = u32::from(block + 4).to_le_bytes().to_vec();
    // Khronos' own basic block, version 2.
    bytes.extend(0u32.to_le_bytes());
    bytes.extend(2u16.to_le_bytes());
    bytes.extend(block.to_le_bytes());
    // Red, green, blue with the primaries of BT.709; one texel a block, all bytes in one plane.
    bytes.extend([1, 1, transfer, 0, 0, 0, 0, 0, format.bytes() as u8, 0, 0, 0, 0, 0, 0, 0]);
    for (number, &channel) in (0u16..).zip(channels) {
        let is_linear = format == TexelFormat::Rgba8Srgb && channel == ALPHA;
        bytes.extend((number * bits).to_le_bytes());
        bytes.extend([bits as u8 - 1, channel | if is_linear { LINEAR } else { 0 }, 0, 0, 0, 0]);
        bytes.extend(0u32.to_le_bytes());
        bytes.extend(upper.to_le_bytes());
    }
    bytes
}

/// The list of keys and values: that the first row is the upper one, and who wrote the file.
fn values() -> Vec<u8> {
    let mut bytes = Vec::new();
    let writer = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));
    for (key, value) in [("KTXorientation", "rd"), ("KTXwriter", writer)] {
        let pair = format!("{key}\0{value}\0");
        bytes.extend((pair.len() as u32).to_le_bytes());
        bytes.extend(pair.bytes());
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    bytes
}
