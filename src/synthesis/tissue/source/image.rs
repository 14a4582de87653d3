//! Tissue from an image of an organ.

use crate::synthesis::{
    pace::{Pace, at_once},
    tissue::{Mask, TissueError, error::finite},
};
use bevy_math::{UVec3, Vec3};

/// An image of an organ: one value for each pixel or voxel.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueImage {
    /// Pixels along each axis. With one layer it is a flat picture, with more a volume.
    pub size: UVec3,
    /// Values along x first, then y, then z. The first row of a flat picture is its top; a volume begins at its lowest
    /// corner.
    pub values: Vec<f32>,
}

/// The channel of a coloured pixel that gives its value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum ImageChannel {
    /// The mean of red, green and blue, which is the value of a grey pixel itself.
    #[default]
    Grey,
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// Opacity.
    Alpha,
}

impl ImageChannel {
    /// The value of a pixel, given red, green, blue and alpha.
    pub fn of(self, [red, green, blue, alpha]: [f32; 4]) -> f32 {
        match self {
            Self::Grey => (red + green + blue) / 3.0,
            Self::Red => red,
            Self::Green => green,
            Self::Blue => blue,
            Self::Alpha => alpha,
        }
    }
}

/// How an image is read as tissue: all pixels or voxels of at least a threshold belong to it.
///
/// A flat picture stands upright, in the plane z = 0 for the default origin, and is a surface; a volume is a solid.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ImageTissue {
    /// Least value of tissue.
    ///
    /// Higher values leave less tissue.
    ///
    /// Units: those of the image; pictures hold 0 to 1. Default: [`Self::DEFAULT_THRESHOLD`].
    pub threshold: f32,
    /// Whether values below the threshold are the tissue instead, as in a black drawing on white.
    ///
    /// Default: false.
    pub inverted: bool,
    /// The channel of a coloured pixel that gives its value.
    ///
    /// Default: the mean of red, green and blue.
    pub channel: ImageChannel,
    /// Size of a pixel or voxel; z is ignored for a flat picture.
    ///
    /// Units: tissue lengths. Limits: each `> 0`. Default: 1.
    pub spacing: Vec3,
    /// The lowest corner of the image, in the organ's local space.
    ///
    /// Units: tissue lengths. Default: the origin.
    pub origin: Vec3,
}

impl ImageTissue {
    /// Default of [`threshold`](Self::threshold): half of full white.
    pub const DEFAULT_THRESHOLD: f32 = 0.5;

    /// The tissue in an image.
    ///
    /// # Errors
    /// A number of values other than one per pixel, or no value that is tissue; a spacing that is not above 0; numbers
    /// that are not finite.
    pub fn mask(&self, image: &TissueImage) -> Result<Mask, TissueError> {
        at_once(self.mask_paced(image, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`mask`](Self::mask).
    pub async fn mask_paced(&self, image: &TissueImage, pace: &Pace) -> Result<Mask, TissueError> {
        let threshold = finite("the threshold of the image", self.threshold)?;
        // NaN is never tissue, inverted or not.
        let is_tissue = |value: f32| if self.inverted { value < threshold } else { value >= threshold };
        let cells = image.values.len();
        let mut inside: Vec<bool> = pace.part(0.0..0.2).collect(cells, |cell| is_tissue(image.values[cell])).await;
        let pace = pace.part(0.2..1.0);
        if image.size.z != 1 {
            return Mask::voxels_paced(image.size, self.spacing, self.origin, &inside, &pace).await;
        }
        upside_down(&mut inside, image.size.x as usize);
        Mask::image_paced(image.size.truncate(), self.spacing.truncate(), self.origin, &inside, &pace).await
    }
}

impl Default for ImageTissue {
    fn default() -> Self {
        Self {
            threshold: Self::DEFAULT_THRESHOLD,
            inverted: false,
            channel: ImageChannel::default(),
            spacing: Vec3::ONE,
            origin: Vec3::ZERO,
        }
    }
}

/// Reverses the rows of a picture. Cells that don't fill a row stay where they are, and cause an error later.
fn upside_down(cells: &mut [bool], width: usize) {
    if width > 0 && cells.len().is_multiple_of(width) {
        let rows = cells.len() / width;
        for row in 0..rows / 2 {
            let (upper, lower) = cells.split_at_mut((rows - 1 - row) * width);
            upper[row * width..][..width].swap_with_slice(&mut lower[..width]);
        }
    }
}
