//! Maps as PNG: the first level.

use crate::synthesis::texture::{BakedMap, MapKind, TexelFormat};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use std::io::{self, Write};

/// Writes the first level of a map as PNG: colours, normals and roughness as RGB, ids as RGBA, heights and depths as grey
/// of 16 bits.
///
/// # Errors
/// Those of `out`.
pub fn write_png(out: &mut dyn Write, map: &BakedMap) -> io::Result<()> {
    let texels = map.levels.first().map_or(&[][..], Vec::as_slice);
    let native = |bytes: &[u8]| u16::from_le_bytes([bytes[0], bytes[1]]).to_ne_bytes();
    let (bytes, color): (Vec<u8>, _) = match map.kind.format() {
        TexelFormat::R16Unorm => (texels.chunks_exact(2).flat_map(native).collect(), ExtendedColorType::L16),
        _ if map.kind == MapKind::Id => (texels.to_vec(), ExtendedColorType::Rgba8),
        // The alpha is 255 throughout.
        _ => {
            (texels.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect(), ExtendedColorType::Rgb8)
        }
    };
    PngEncoder::new(out).write_image(&bytes, map.size, map.size, color).map_err(io::Error::other)
}
