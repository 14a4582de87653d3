//! Procedural organ meshes with variation: an organ for any seed, without a file.
//!
//! Every generator takes settings with a seed and returns a value: closed, outward-oriented meshes
//! ([`ShadedMesh`](super::mesh::ShadedMesh)) in metres with normals, UVs and vertex colours, and data for a scene (where
//! vessels enter, viewpoints). The anatomy is schematic: shapes and proportions are recognisable at first sight, with
//! dimensions in the human range. It is neither measured from a person nor meant for diagnosis.
//!
//! - [`colon`]: the large intestine with haustra, taeniae coli and a lumen that is open at the rectal end.
//! - [`eye`]: the eyeball with sclera, limbus and optic nerve; cornea and iris are meshes of their own.
//! - [`kidney`]: a bean with a sinus behind its hilum, smooth or lobulated.
//! - [`liver`]: a lobed wedge.
//!
//! A hundred different organs are one loop:
//!
//! ```
//! use bevy_vessels::synthesis::organ::KidneySettings;
//!
//! let kidneys = (0..100).map(|seed| KidneySettings { seed, triangles: 2_000, ..Default::default() }.generate());
//! let litres: Vec<f32> = kidneys.map(|kidney| Ok(1e3 * kidney?.mesh.signed_volume())).collect::<Result<_, _>>()?;
//! assert!(litres.iter().all(|litres| (0.07..0.2).contains(litres)));
//! # Ok::<(), bevy_vessels::synthesis::organ::OrganSettingsError>(())
//! ```

mod blob;
pub mod centre_line;
pub mod colon;
pub mod eye;
mod icosphere;
pub mod kidney;
pub mod liver;
mod noise;
mod rings;
mod star;

pub use colon::{Colon, ColonSettings};
pub use eye::{Eye, EyeSettings, IrisColor};
pub use kidney::{Kidney, KidneySettings};
pub use liver::{Liver, LiverSettings};

use bevy_math::Vec3;
use std::ops::RangeInclusive;

/// The points on an organ's surface where vessels enter: of each kind, none if the organ has no such vessels.
///
/// [`RootPlacements`](crate::synthesis::roots::RootPlacements) are made from them, and put roots there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RootSites {
    /// Roots of arteries, in metres.
    pub arterial: Vec<Vec3>,
    /// Roots of veins, in metres: each beside the artery of the same index, where an organ's veins run beside its
    /// arteries. The liver's leave elsewhere.
    pub venous: Vec<Vec3>,
    /// Roots of portal veins, in metres.
    pub portal: Vec<Vec3>,
    /// Roots of ducts, in metres.
    pub ductal: Vec<Vec3>,
}

/// The side of the body that a paired organ belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum Laterality {
    /// The patient's left: right in a picture from the front.
    #[default]
    Left,
    /// The patient's right.
    Right,
}

impl Laterality {
    /// The direction along x, from the organ towards the middle of the body: −1 on the left, 1 on the right.
    fn medial(self) -> f32 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }
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

/// A check of an organ's settings against their limits: name, value, range, and the range in words.
fn limits(
    organ: &'static str,
) -> impl Fn(&'static str, f32, RangeInclusive<f32>, &'static str) -> Result<(), OrganSettingsError> {
    move |name, value, range, limits| match range.contains(&value) {
        true => Ok(()),
        false => Err(OrganSettingsError { organ, name, value, limits }),
    }
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
pub(crate) fn smooth_step(low: f32, high: f32, value: f32) -> f32 {
    let share = ((value - low) / (high - low).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
