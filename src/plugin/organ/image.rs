//! From a Bevy image to the values of a tissue.

use crate::synthesis::{
    pace::{Pace, Stretch},
    tissue::{ImageChannel, TissueImage},
};
use bevy::{
    asset::Handle,
    color::{Color, ColorToComponents},
    ecs::{component::Component, reflect::ReflectComponent},
    image::{Image, TextureAccessError, TextureFormatPixelInfo},
    math::UVec3,
    prelude::{Deref, DerefMut},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// The image that an organ's tissue is read from, if its [`Vasculature`](crate::plugin::Vasculature) has
/// [`TissueSource::Image`](crate::synthesis::tissue::TissueSource::Image) as tissue. The organ needs no mesh then.
///
/// Pictures become flat tissues; 3-D textures, and 2-D ones with several layers, become solids. The image must be
/// uncompressed, and keep its data in main memory (`RenderAssetUsages::MAIN_WORLD`).
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Deref, DerefMut, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct OrganImage(pub Handle<Image>);

/// Why an image cannot be an organ.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrganImageError {
    /// The file is missing or broken.
    #[error("the image asset was not loaded ({reason}); check its path")]
    NotLoaded {
        /// The asset server's error.
        reason: String,
    },
    /// Bevy has moved the data to the graphics card.
    #[error(
        "the image's data are on the graphics card only; create or load it with \
         RenderAssetUsages::MAIN_WORLD | RenderAssetUsages::RENDER_WORLD"
    )]
    OnGpuOnly,
    /// There is no pixel.
    #[error("the image has {} × {} × {} pixels; it needs at least one", size.x, size.y, size.z)]
    Empty {
        /// Pixels along each axis.
        size: UVec3,
    },
    /// There are fewer pixels than the image's size requires.
    #[error(
        "the image has {bytes} bytes, but {} × {} × {} pixels of its format take {expected}; give it all of them",
        size.x, size.y, size.z
    )]
    Incomplete {
        /// Pixels along each axis.
        size: UVec3,
        /// Bytes found.
        bytes: usize,
        /// Bytes required.
        expected: usize,
    },
    /// The pixels cannot be read.
    #[error(
        "the image's pixels cannot be read ({reason}); use an uncompressed format such as R8Unorm or Rgba8UnormSrgb"
    )]
    Unreadable {
        /// Bevy's error.
        reason: String,
    },
}

/// Reads one channel of an image, with pauses. Values are as stored, 0 to 1 in most formats: sRGB values are not made
/// linear.
pub(crate) async fn tissue_image(
    image: &Image,
    channel: ImageChannel,
    pace: &Pace,
) -> Result<TissueImage, OrganImageError> {
    let size = UVec3::new(image.width(), image.height(), image.texture_descriptor.size.depth_or_array_layers);
    check_size(image, size)?;
    let rows = size.y as usize * size.z as usize;
    let (mut values, mut stretch) = (Vec::with_capacity(rows * size.x as usize), Stretch::default());
    for row in 0..rows {
        let (y, z) = (row as u32 % size.y, row as u32 / size.y);
        for x in 0..size.x {
            values.push(channel.of(stored(color_at(image, UVec3::new(x, y, z))?)));
            if stretch.ends_after(1) {
                pace.rest(row as f32 / rows as f32).await;
            }
        }
    }
    pace.rest(1.0).await;
    Ok(TissueImage { size, values })
}

/// Checks that an image has at least one pixel, and as many as its size requires.
fn check_size(image: &Image, size: UVec3) -> Result<(), OrganImageError> {
    let pixels = size.to_array().into_iter().fold(1, |pixels: usize, side| pixels.saturating_mul(side as usize));
    if pixels == 0 {
        return Err(OrganImageError::Empty { size });
    }
    let bytes = image.data.as_ref().ok_or(OrganImageError::OnGpuOnly)?.len();
    let expected = pixels.saturating_mul(image.texture_descriptor.format.pixel_size().map_err(unreadable)?);
    if bytes < expected {
        return Err(OrganImageError::Incomplete { size, bytes, expected });
    }
    Ok(())
}

fn color_at(image: &Image, at: UVec3) -> Result<Color, OrganImageError> {
    let color = match image.get_color_at_3d(at.x, at.y, at.z) {
        // Bevy returns this for a flat picture.
        Err(TextureAccessError::WrongDimension) => image.get_color_at(at.x, at.y),
        other => other,
    };
    color.map_err(unreadable)
}

fn unreadable(error: TextureAccessError) -> OrganImageError {
    match error {
        TextureAccessError::Uninitialized => OrganImageError::OnGpuOnly,
        other => OrganImageError::Unreadable { reason: other.to_string() },
    }
}

/// Red, green, blue and alpha as the image stores them.
fn stored(color: Color) -> [f32; 4] {
    match color {
        Color::Srgba(color) => color.to_f32_array(),
        other => other.to_linear().to_f32_array(),
    }
}

#[cfg(test)]
mod tests {
    use crate::plugin::organ::image::*;
    use crate::synthesis::pace::at_once;
    use bevy::asset::RenderAssetUsages;
    use bevy::image::Image;

    /// The plugin's features don't enable the descriptor's types, so the format is that of a default image.
    fn two_pixels() -> Image {
        let mut image = Image::default();
        image.texture_descriptor.size.width = 2;
        image.data = Some(vec![255, 0, 51, 255, 0, 102, 0, 0]);
        image.asset_usage = RenderAssetUsages::MAIN_WORLD;
        image
    }

    fn read(image: &Image, channel: ImageChannel) -> Result<TissueImage, OrganImageError> {
        at_once(tissue_image(image, channel, &Pace::default()))
    }

    #[test]
    fn values_are_as_they_are_stored() {
        let image = two_pixels();
        let alpha = read(&image, ImageChannel::Alpha).expect("readable");
        assert_eq!((alpha.size, alpha.values), (UVec3::new(2, 1, 1), vec![1.0, 0.0]));
        let green = read(&image, ImageChannel::Green).expect("readable");
        assert_eq!(green.values, [0.0, 0.4]);
    }

    #[test]
    fn images_without_all_their_pixels_are_refused() {
        let mut image = two_pixels();
        image.texture_descriptor.size.height = 3;
        let error = read(&image, ImageChannel::Grey).err();
        assert!(matches!(error, Some(OrganImageError::Incomplete { bytes: 8, expected: 24, .. })), "{error:?}");
        image.texture_descriptor.size.height = 0;
        assert!(matches!(read(&image, ImageChannel::Grey), Err(OrganImageError::Empty { .. })));
    }

    #[test]
    fn data_on_the_graphics_card_are_named() {
        let image = Image { data: None, ..two_pixels() };
        let error = read(&image, ImageChannel::Grey).err();
        assert!(error.is_some_and(|error| error.to_string().contains("MAIN_WORLD")));
    }
}
