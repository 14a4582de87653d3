//! Limits that settings and errors name.

/// Smallest texture.
pub(super) const LEAST_SIZE: u32 = 16;
/// Largest texture that all GPUs of a desktop take.
pub(super) const MOST_SIZE: u32 = 8192;
/// The most networks in one texture: their numbers plus 1 are bytes.
pub(super) const MOST_LAYERS: usize = 254;
/// Largest absolute texture coordinate. Texels are placed to a hundredth of their size up to it.
pub(super) const MOST_UV: f32 = 16.0;
