//! The maps that come out, level by level.

use super::settings::MapKind;

/// How the bytes of a texel are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// Four bytes; red, green and blue are sRGB.
    Rgba8Srgb,
    /// Four bytes from 0 to 1.
    Rgba8Unorm,
    /// Two bytes, the lower first, from 0 to 1.
    R16Unorm,
    /// Four bytes that are numbers, for comparison only.
    Rgba8Uint,
}

impl TexelFormat {
    /// Bytes of a texel.
    pub fn bytes(self) -> usize {
        match self {
            Self::R16Unorm => 2,
            Self::Rgba8Srgb | Self::Rgba8Unorm | Self::Rgba8Uint => 4,
        }
    }
}

impl MapKind {
    /// The format of its texels.
    pub fn format(self) -> TexelFormat {
        match self {
            Self::Albedo => TexelFormat::Rgba8Srgb,
            Self::Normal | Self::Roughness => TexelFormat::Rgba8Unorm,
            Self::Height | Self::Depth => TexelFormat::R16Unorm,
            Self::Id => TexelFormat::Rgba8Uint,
        }
    }

    /// Whether its values can be averaged, so that it has smaller levels.
    pub fn has_levels(self) -> bool {
        !matches!(self, Self::Id | Self::Depth)
    }
}

/// A texture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BakedMap {
    /// What it shows.
    pub kind: MapKind,
    /// Width and height of the first level. Each further level is half as wide.
    pub size: u32,
    /// The texels of each level, row by row, the upper row first, in the [format](MapKind::format) of the kind: down to
    /// a single texel, or one level of a map whose values cannot be averaged.
    pub levels: Vec<Vec<u8>>,
}

/// The texels of one level of all maps.
#[derive(Clone, Debug, Default)]
pub(super) struct Level {
    pub size: usize,
    /// How much of each texel lies within charts: 0 where nothing is known, [`BESIDE`](super::paint::BESIDE) beside
    /// them.
    pub coverage: Vec<u8>,
    /// Bytes of each kind of map that is made.
    pub maps: [Option<Vec<u8>>; MapKind::ALL.len()],
}

impl Level {
    /// The kinds of maps that are made, with their bytes.
    pub fn made(&mut self) -> impl Iterator<Item = (MapKind, &mut Vec<u8>)> {
        MapKind::ALL.into_iter().zip(&mut self.maps).filter_map(|(kind, map)| Some((kind, map.as_mut()?)))
    }
}
