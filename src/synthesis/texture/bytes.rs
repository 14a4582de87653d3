//! Values of texels as bytes.

use super::settings::{BakeSettings, BaseImage, MapKind, Maps};
use super::srgb::Srgb;
use bevy_math::{Vec2, Vec3};

/// 16 bits for a depth where there is no vessel.
const NO_DEPTH: u16 = u16::MAX;

/// Bytes of the maps that are made, or of some rows of them.
#[derive(Debug, Default)]
pub(super) struct MapBytes<'a> {
    pub made: Maps,
    maps: [Option<&'a mut [u8]>; MapKind::ALL.len()],
}

impl<'a> MapBytes<'a> {
    /// With another map.
    pub fn put(&mut self, kind: MapKind, bytes: &'a mut [u8]) {
        self.made = self.made.with(kind);
        self.maps[kind as usize] = Some(bytes);
    }

    /// Whether a map is among them.
    pub fn has(&self, kind: MapKind) -> bool {
        self.made.has(kind)
    }

    /// Writes to a texel of a map, if that is made.
    fn set(&mut self, kind: MapKind, texel: usize, first: usize, bytes: &[u8]) {
        if let Some(map) = &mut self.maps[kind as usize] {
            map[texel * kind.format().bytes() + first..][..bytes.len()].copy_from_slice(bytes);
        }
    }

    /// Sets a colour, in linear light.
    pub fn set_albedo(&mut self, texel: usize, color: Vec3) {
        if self.has(MapKind::Albedo) {
            self.set(MapKind::Albedo, texel, 0, &color_bytes(color));
        }
    }

    /// Sets a normal in the space of the tangents.
    pub fn set_normal(&mut self, texel: usize, normal: Vec3) {
        self.set(MapKind::Normal, texel, 0, &normal_bytes(normal));
    }

    /// Sets a height, of some range.
    pub fn set_height(&mut self, texel: usize, height: f32, range: [f32; 2]) {
        self.set(MapKind::Height, texel, 0, &height_bytes(height, range));
    }

    /// Sets a roughness.
    pub fn set_roughness(&mut self, texel: usize, roughness: f32) {
        self.set(MapKind::Roughness, texel, 1, &[unit_byte(roughness)]);
    }

    /// Sets the number of a vessel.
    pub fn set_id(&mut self, texel: usize, id: u32) {
        self.set(MapKind::Id, texel, 0, &id.to_le_bytes());
    }

    /// Sets a depth, as a share of the deepest.
    pub fn set_depth(&mut self, texel: usize, share: f32) {
        // One less than the value that stands for no vessel.
        let value = (share.clamp(0.0, 1.0) * f32::from(NO_DEPTH - 1) + 0.5) as u16;
        self.set(MapKind::Depth, texel, 0, &value.to_le_bytes());
    }
}

/// The colour, height, normal … of a texel before any vessel.
pub(super) fn blank(kind: MapKind, settings: &BakeSettings, range: [f32; 2]) -> Vec<u8> {
    match kind {
        MapKind::Albedo => {
            let [red, green, blue] = color_bytes(settings.base_color.into());
            vec![red, green, blue, 255]
        }
        MapKind::Normal => vec![128, 128, 255, 255],
        MapKind::Height => height_bytes(0.0, range).to_vec(),
        MapKind::Roughness => vec![255, unit_byte(settings.base_roughness), 0, 255],
        MapKind::Id => vec![0; 4],
        MapKind::Depth => NO_DEPTH.to_le_bytes().to_vec(),
    }
}

fn unit_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

fn color_bytes(color: Vec3) -> [u8; 3] {
    color.to_array().map(|channel| Srgb::tables().encode(channel))
}

fn height_bytes(value: f32, [low, high]: [f32; 2]) -> [u8; 2] {
    let value = if high > low { ((value - low) / (high - low) * 65535.0 + 0.5) as u16 } else { 0 };
    value.to_le_bytes()
}

/// A normal as bytes.
pub(super) fn normal_bytes(normal: Vec3) -> [u8; 4] {
    let [x, y, z] = (normal * 127.5 + 128.0).to_array().map(|value| value as u8);
    [x, y, z, 255]
}

/// The unit normal that bytes stand for.
pub(super) fn normal_of(bytes: &[u8]) -> Vec3 {
    let component = |byte: u8| (f32::from(byte) - 127.5) / 127.5;
    // 128 stands for 0.
    let centred = |byte: u8| if byte == 128 { 0.0 } else { component(byte) };
    Vec3::new(centred(bytes[0]), centred(bytes[1]), component(bytes[2])).normalize_or(Vec3::Z)
}

impl BaseImage {
    /// Linear colour at a point of the texture, between the four nearest texels.
    pub(super) fn at(&self, uv: Vec2) -> Vec3 {
        let srgb = Srgb::tables();
        let place = |share: f32, count: u32| {
            let at = (share * count as f32 - 0.5).clamp(0.0, (count - 1) as f32);
            let first = at as usize;
            (first, (first + 1).min(count as usize - 1), at - first as f32)
        };
        let (left, right, x) = place(uv.x, self.width);
        let (upper, lower, y) = place(uv.y, self.height);
        let at = |column: usize, row: usize| {
            let first = 4 * (row * self.width as usize + column);
            Vec3::from_array(std::array::from_fn(|channel| srgb.decode(self.rgba[first + channel])))
        };
        let along = |row: usize| {
            let start = at(left, row);
            start + (at(right, row) - start) * x
        };
        along(upper) + (along(lower) - along(upper)) * y
    }
}
