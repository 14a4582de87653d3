//! What a user chooses of a bake.

use super::error::BakeError;
use super::limits;

/// What is baked, how large, and over what.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct BakeSettings {
    /// Width and height of the textures. Twice the size takes four times the memory, and shows vessels half as wide.
    ///
    /// Units: texels. Limits: a power of two from [`Self::LEAST_SIZE`] to [`Self::MOST_SIZE`].
    /// Default: [`Self::DEFAULT_SIZE`].
    pub size: u32,
    /// The maps to make.
    ///
    /// Default: albedo and normal.
    pub maps: Maps,
    /// Colour of the surface between the vessels, linear sRGB, where no base image is given.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_BASE_COLOR`], that of mucosa.
    pub base_color: [f32; 3],
    /// Perceptual roughness of the surface between the vessels.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_BASE_ROUGHNESS`].
    pub base_roughness: f32,
}

/// A choice of maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Maps {
    /// [`MapKind::Albedo`].
    pub albedo: bool,
    /// [`MapKind::Normal`].
    pub normal: bool,
    /// [`MapKind::Height`].
    pub height: bool,
    /// [`MapKind::Roughness`].
    pub roughness: bool,
    /// [`MapKind::Id`].
    pub id: bool,
    /// [`MapKind::Depth`].
    pub depth: bool,
}

/// A kind of map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MapKind {
    /// Colour: sRGB with an alpha of 255.
    Albedo,
    /// Normals in the space of the mesh's tangents, as glTF has them: green points up in the picture.
    Normal,
    /// Height over the surface, from [`BakeReport::height_range`](super::BakeReport::height_range).
    Height,
    /// Perceptual roughness in green and metal (none) in blue, as glTF packs them; red is 255.
    Roughness,
    /// The vessel at each texel: the number of its node in the lowest three bytes, the lowest first, and that of its
    /// network plus 1 in the fourth. All 0 where there is none. Of several vessels it is the one that comes nearest to
    /// the surface.
    Id,
    /// Depth of that vessel's axis below the surface, as a share of
    /// [`BakeReport::depth_range`](super::BakeReport::depth_range). 65535 where there is none.
    Depth,
}

impl MapKind {
    /// All kinds.
    pub const ALL: [Self; 6] = [Self::Albedo, Self::Normal, Self::Height, Self::Roughness, Self::Id, Self::Depth];

    /// The name in lower case, as in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Height => "height",
            Self::Roughness => "roughness",
            Self::Id => "id",
            Self::Depth => "depth",
        }
    }
}

impl Maps {
    /// None.
    pub const NONE: Self =
        Self { albedo: false, normal: false, height: false, roughness: false, id: false, depth: false };

    /// Whether a map is among them.
    pub fn has(self, kind: MapKind) -> bool {
        match kind {
            MapKind::Albedo => self.albedo,
            MapKind::Normal => self.normal,
            MapKind::Height => self.height,
            MapKind::Roughness => self.roughness,
            MapKind::Id => self.id,
            MapKind::Depth => self.depth,
        }
    }

    /// These maps and another one.
    #[must_use]
    pub fn with(mut self, kind: MapKind) -> Self {
        *match kind {
            MapKind::Albedo => &mut self.albedo,
            MapKind::Normal => &mut self.normal,
            MapKind::Height => &mut self.height,
            MapKind::Roughness => &mut self.roughness,
            MapKind::Id => &mut self.id,
            MapKind::Depth => &mut self.depth,
        } = true;
        self
    }
}

impl Default for Maps {
    fn default() -> Self {
        Self { albedo: true, normal: true, ..Self::NONE }
    }
}

impl FromIterator<MapKind> for Maps {
    fn from_iter<I: IntoIterator<Item = MapKind>>(kinds: I) -> Self {
        kinds.into_iter().fold(Self::NONE, Self::with)
    }
}

impl BakeSettings {
    /// Smallest texture.
    pub const LEAST_SIZE: u32 = limits::LEAST_SIZE;
    /// Largest texture that all GPUs of a desktop take.
    pub const MOST_SIZE: u32 = limits::MOST_SIZE;
    /// The most networks in one texture.
    pub const MOST_LAYERS: usize = limits::MOST_LAYERS;
    /// A texture of an organ that fills the screen.
    pub const DEFAULT_SIZE: u32 = 2048;
    /// Salmon, (220, 150, 125) in sRGB: mucosa in white light.
    pub const DEFAULT_BASE_COLOR: [f32; 3] = [0.716, 0.305, 0.205];
    /// Wet, with a relief too fine for the texels.
    pub const DEFAULT_BASE_ROUGHNESS: f32 = 0.45;

    /// Checks all settings.
    ///
    /// # Errors
    /// The first value out of its limits.
    pub fn validate(&self) -> Result<(), BakeError> {
        if !(Self::LEAST_SIZE..=Self::MOST_SIZE).contains(&self.size) || !self.size.is_power_of_two() {
            return Err(BakeError::Size { size: self.size });
        }
        if self.maps == Maps::NONE {
            return Err(BakeError::NoMaps);
        }
        let within = |name, value: f32, limits| match (0.0..=1.0).contains(&value) {
            true => Ok(()),
            false => Err(BakeError::Setting { name, value, limits }),
        };
        self.base_color.into_iter().try_for_each(|channel| within("base_color", channel, "0 to 1 in each channel"))?;
        within("base_roughness", self.base_roughness, "0 to 1")
    }
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self {
            size: Self::DEFAULT_SIZE,
            maps: Maps::default(),
            base_color: Self::DEFAULT_BASE_COLOR,
            base_roughness: Self::DEFAULT_BASE_ROUGHNESS,
        }
    }
}

/// A picture for the surface between the vessels. It covers the whole texture, at any size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BaseImage {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) rgba: Vec<u8>,
}

impl BaseImage {
    /// A picture of sRGB colours, four bytes a texel, the upper row first. Its alpha is ignored.
    ///
    /// # Errors
    /// A number of bytes that is not that of the size, or a size of 0.
    pub fn new(width: u32, height: u32, rgba: Vec<u8>) -> Result<Self, BakeError> {
        let texels = u64::from(width) * u64::from(height);
        if texels == 0 || texels * 4 != rgba.len() as u64 {
            return Err(BakeError::BaseImage { width, height, bytes: rgba.len() });
        }
        Ok(Self { width, height, rgba })
    }
}
