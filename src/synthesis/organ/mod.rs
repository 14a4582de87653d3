//! Procedural organ meshes with variation: an organ for any seed, without a file.
//!
//! Every generator takes settings with a seed and returns a value: a closed, outward-oriented
//! [`ShadedMesh`](super::mesh::ShadedMesh) in metres with normals, UVs and vertex colours, and data for a scene (where
//! vessels enter, viewpoints). The anatomy is schematic: shapes and proportions are recognisable at first sight, with
//! dimensions in the human range. It is neither measured from a person nor meant for diagnosis.
//!
//! - [`colon`]: the large intestine with haustra, taeniae coli and a lumen that is open at the rectal end.
//! - [`liver`]: a lobed wedge.

pub mod centre_line;
pub mod colon;
pub mod liver;
mod noise;

pub use colon::{Colon, ColonSettings};
pub use liver::{Liver, LiverSettings};

use bevy_math::Vec3;

/// The points on an organ's surface where vessels enter, for [`RootPlacement::Nearest`].
///
/// [`RootPlacement::Nearest`]: crate::synthesis::roots::RootPlacement::Nearest
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RootSites {
    /// Roots of arteries, in metres.
    pub arterial: Vec<Vec3>,
    /// Roots of veins, in metres: each beside the artery of the same index.
    pub venous: Vec<Vec3>,
}

/// A viewpoint for a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position of the camera, in metres.
    pub eye: Vec3,
    /// Point that it looks at, in metres.
    pub target: Vec3,
    /// Direction that is up in the picture.
    pub up: Vec3,
}

/// A setting with which an organ cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{organ} {name} is {value}; it must be {limits}")]
pub struct OrganSettingsError {
    /// The organ of the setting.
    pub organ: &'static str,
    /// Name of the field.
    pub name: &'static str,
    /// The value found.
    pub value: f32,
    /// Its limits.
    pub limits: &'static str,
}

/// Linear RGB of a colour given as sRGB bytes, with an alpha of 1.
fn linear(srgb: [u8; 3]) -> [f32; 4] {
    let channel = |byte: u8| {
        let value = f32::from(byte) / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { bevy_math::ops::powf((value + 0.055) / 1.055, 2.4) }
    };
    let [red, green, blue] = srgb.map(channel);
    [red, green, blue, 1.0]
}

/// Mixes two colours: `first` at 0, `second` at 1.
fn mix(first: [f32; 4], second: [f32; 4], amount: f32) -> [f32; 4] {
    let amount = amount.clamp(0.0, 1.0);
    std::array::from_fn(|channel| first[channel] + (second[channel] - first[channel]) * amount)
}

/// Smooth step from 0 at `low` to 1 at `high`.
fn smooth_step(low: f32, high: f32, value: f32) -> f32 {
    let share = ((value - low) / (high - low).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
