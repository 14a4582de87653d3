//! Where the tissue of an organ comes from, as data: what presets, the plugin and the command line hold.

use super::{
    Ball, Cuboid, Disc, Ellipsoid, Mask, MeshVolume, PreparedTissue, Rectangle, Tissue, TissueError, error::finite,
};
use crate::synthesis::{
    mesh::TriangleMesh,
    pace::{Pace, at_once},
};
use bevy_math::{UVec3, Vec3};
use std::sync::Arc;

/// Where the tissue of an organ comes from. The default is the surface of its mesh.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueSource {
    /// From the organ's mesh.
    Mesh(MeshTissue),
    /// From nothing: it is a plain shape.
    Shape(TissueShape),
    /// From an image of it.
    Image(ImageTissue),
}

/// What a source may need of an organ. What it doesn't need may be left out.
#[derive(Clone, Debug, Default)]
pub struct SourceData {
    /// The organ's mesh.
    pub mesh: Option<Arc<TriangleMesh>>,
    /// The organ's image.
    pub image: Option<Arc<TissueImage>>,
}

impl TissueSource {
    /// Makes everything of the tissue that takes long.
    ///
    /// # Errors
    /// [`TissueError::NoMesh`] and [`TissueError::NoImage`] where that is needed and left out; what is wrong with the
    /// settings, or with the organ for this purpose.
    pub fn prepare(&self, data: &SourceData) -> Result<PreparedTissue, TissueError> {
        at_once(self.prepare_paced(data, &Pace::default()))
    }

    /// The same, with rests.
    ///
    /// # Errors
    /// Those of [`prepare`](Self::prepare).
    pub async fn prepare_paced(&self, data: &SourceData, pace: &Pace) -> Result<PreparedTissue, TissueError> {
        let prepared = match self {
            Self::Mesh(mesh) => mesh.prepare_paced(data.mesh.clone().ok_or(TissueError::NoMesh)?, pace).await,
            Self::Shape(shape) => PreparedTissue::new(shape.build()?),
            Self::Image(image) => {
                let mask = image.mask_paced(data.image.as_deref().ok_or(TissueError::NoImage)?, pace).await?;
                PreparedTissue::new(Arc::new(mask))
            }
        };
        pace.rest(1.0).await;
        prepared
    }

    /// How much work it is to [prepare](Self::prepare) the tissue of so many triangles, or pixels of an image, in items.
    pub fn work(&self, items: usize) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.work(items),
            Self::Shape(_) => 0,
            Self::Image(_) => items,
        }
    }

    /// Whether it needs the organ's mesh.
    pub fn needs_mesh(&self) -> bool {
        matches!(self, Self::Mesh(_))
    }

    /// How the image of the organ is read, if it needs one.
    pub fn image(&self) -> Option<&ImageTissue> {
        match self {
            Self::Image(image) => Some(image),
            _ => None,
        }
    }

    /// Where on the organ's mesh vessels grow, if they do.
    pub fn mode(&self) -> Option<TissueMode> {
        match self {
            Self::Mesh(mesh) => Some(mesh.mode),
            _ => None,
        }
    }
}

impl Default for TissueSource {
    fn default() -> Self {
        Self::Mesh(MeshTissue::default())
    }
}

impl From<TissueMode> for TissueSource {
    fn from(mode: TissueMode) -> Self {
        Self::Mesh(MeshTissue::from(mode))
    }
}

impl From<MeshTissue> for TissueSource {
    fn from(mesh: MeshTissue) -> Self {
        Self::Mesh(mesh)
    }
}

impl From<TissueShape> for TissueSource {
    fn from(shape: TissueShape) -> Self {
        Self::Shape(shape)
    }
}

impl From<ImageTissue> for TissueSource {
    fn from(image: ImageTissue) -> Self {
        Self::Image(image)
    }
}

/// Where on an organ vessels grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueMode {
    /// Over its surface.
    #[default]
    Surface,
    /// Through what it encloses.
    Volume,
    /// Over its surface first, then inwards through what it encloses.
    Staged {
        /// Steps on the surface, from the first on.
        surface_steps: u32,
    },
}

/// What to make of an organ's mesh. The default is its surface.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct MeshTissue {
    /// Where vessels grow.
    ///
    /// Default: over the surface.
    pub mode: TissueMode,
    /// Voxels along the longest side of the organ, where its inside is needed.
    ///
    /// Higher values take more memory and time to prepare; the boundary is that of the mesh at any resolution.
    ///
    /// Limits: ≥ 1, and at most 67,108,864 voxels in all. Default: [`Self::DEFAULT_RESOLUTION`].
    pub resolution: u32,
}

impl MeshTissue {
    /// Voxels along the longest side of the organ.
    pub const DEFAULT_RESOLUTION: u32 = MeshVolume::DEFAULT_RESOLUTION;

    /// How much work it is to [prepare](Self::prepare) the tissue of so many triangles, in items: the triangles, and the
    /// voxels where the inside is needed.
    pub fn work(&self, triangles: usize) -> usize {
        let voxels = || (self.resolution as usize).saturating_pow(3);
        match self.mode {
            TissueMode::Surface => triangles,
            TissueMode::Volume | TissueMode::Staged { .. } => triangles.saturating_add(voxels()),
        }
    }

    /// Makes everything of a mesh's tissue that takes long.
    ///
    /// # Errors
    /// What is wrong with the settings, or with the mesh for this purpose: see [`TissueError`].
    pub fn prepare(&self, mesh: impl Into<Arc<TriangleMesh>>) -> Result<PreparedTissue, TissueError> {
        at_once(self.prepare_paced(mesh.into(), &Pace::default()))
    }

    /// The same, with rests.
    ///
    /// # Errors
    /// Those of [`prepare`](Self::prepare).
    pub async fn prepare_paced(&self, mesh: Arc<TriangleMesh>, pace: &Pace) -> Result<PreparedTissue, TissueError> {
        PreparedTissue::of_mesh(mesh, self, pace).await
    }
}

impl From<TissueMode> for MeshTissue {
    fn from(mode: TissueMode) -> Self {
        Self { mode, ..Self::default() }
    }
}

impl Default for MeshTissue {
    fn default() -> Self {
        Self { mode: TissueMode::Surface, resolution: Self::DEFAULT_RESOLUTION }
    }
}

/// A tissue of simple shape, in tissue lengths and the organ's local space. It needs no mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueShape {
    /// A flat disc, which is a surface.
    Disc {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// The direction it faces, of any length but 0. Default in files: z.
        #[cfg_attr(feature = "serialize", serde(default = "upwards"))]
        normal: Vec3,
        /// Its radius. Limits: `> 0`.
        radius: f32,
    },
    /// A flat rectangle, which is a surface. It faces `half_x` × `half_y`.
    Rectangle {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// From the centre to the middle of a side.
        half_x: Vec3,
        /// From the centre to the middle of a neighbouring side, perpendicular to `half_x`.
        half_y: Vec3,
    },
    /// A solid ball.
    Ball {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// Its radius. Limits: `> 0`.
        radius: f32,
    },
    /// A solid box along the axes.
    Cuboid {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// Its full side lengths. Limits: each `> 0`.
        size: Vec3,
    },
    /// A solid ellipsoid along the axes.
    Ellipsoid {
        /// Its centre. Default in files: the origin.
        #[cfg_attr(feature = "serialize", serde(default))]
        center: Vec3,
        /// Its half axes. Limits: each `> 0`.
        half_axes: Vec3,
    },
}

#[cfg(feature = "serialize")]
fn upwards() -> Vec3 {
    Vec3::Z
}

impl TissueShape {
    /// A disc in the plane z = 0 around the origin.
    pub fn disc(radius: f32) -> Self {
        Self::Disc { center: Vec3::ZERO, normal: Vec3::Z, radius }
    }

    /// A ball around the origin.
    pub fn ball(radius: f32) -> Self {
        Self::Ball { center: Vec3::ZERO, radius }
    }

    /// A box around the origin, of these full side lengths.
    pub fn cuboid(size: Vec3) -> Self {
        Self::Cuboid { center: Vec3::ZERO, size }
    }

    /// The shape as a tissue.
    ///
    /// # Errors
    /// A coordinate that is not finite, a size that is not above 0, sides of a rectangle that are not perpendicular.
    pub fn build(&self) -> Result<Arc<dyn Tissue>, TissueError> {
        Ok(match *self {
            Self::Disc { center, normal, radius } => Arc::new(Disc::new(center, normal, radius)?),
            Self::Rectangle { center, half_x, half_y } => Arc::new(Rectangle::new(center, half_x, half_y)?),
            Self::Ball { center, radius } => Arc::new(Ball::new(center, radius)?),
            Self::Cuboid { center, size } => Arc::new(Cuboid::new(center, size)?),
            Self::Ellipsoid { center, half_axes } => Arc::new(Ellipsoid::new(center, half_axes)?),
        })
    }
}

/// An image of an organ: one value for each pixel or voxel.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueImage {
    /// Pixels along each axis. With one layer it is a flat picture, with more a volume.
    pub size: UVec3,
    /// Values along x first, then y, then z. The first row of a flat picture is its top; a volume begins at its lowest
    /// corner.
    pub values: Vec<f32>,
}

/// Which number of a coloured pixel is its value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum ImageChannel {
    /// The mean of red, green and blue: that of a grey picture itself.
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

/// How an image is read as tissue: every pixel or voxel of at least a threshold belongs to it.
///
/// A flat picture stands upright, in the plane z = 0 unless the origin says otherwise, and is a surface; a volume is a solid.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct ImageTissue {
    /// Least value of what is tissue.
    ///
    /// Higher values leave less tissue.
    ///
    /// Units: those of the image; pictures hold 0 to 1. Default: [`Self::DEFAULT_THRESHOLD`].
    pub threshold: f32,
    /// Whether what is below the threshold is the tissue, as in a drawing in black on white.
    ///
    /// Default: false.
    pub inverted: bool,
    /// Which number of a coloured pixel is its value.
    ///
    /// Default: the mean of red, green and blue.
    pub channel: ImageChannel,
    /// Size of a pixel or voxel; z is of no account for a flat picture.
    ///
    /// Units: tissue lengths. Limits: each `> 0`. Default: 1.
    pub spacing: Vec3,
    /// The lowest corner of the image, in the organ's local space.
    ///
    /// Units: tissue lengths. Default: the origin.
    pub origin: Vec3,
}

impl ImageTissue {
    /// Least value of what is tissue: half of full white.
    pub const DEFAULT_THRESHOLD: f32 = 0.5;

    /// The tissue in an image.
    ///
    /// # Errors
    /// Values that are not one per pixel, or none that is tissue; a spacing that is not above 0; numbers that are not finite.
    pub fn mask(&self, image: &TissueImage) -> Result<Mask, TissueError> {
        at_once(self.mask_paced(image, &Pace::default()))
    }

    /// The same, with rests.
    ///
    /// # Errors
    /// Those of [`mask`](Self::mask).
    pub async fn mask_paced(&self, image: &TissueImage, pace: &Pace) -> Result<Mask, TissueError> {
        let threshold = finite("the threshold of the image", self.threshold)?;
        // What is no number is no tissue either way.
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

/// Puts the first row of a picture last. Cells that don't fill a row are left where they are, for others to complain of.
fn upside_down(cells: &mut [bool], width: usize) {
    if width > 0 && cells.len().is_multiple_of(width) {
        let rows = cells.len() / width;
        for row in 0..rows / 2 {
            let (upper, lower) = cells.split_at_mut((rows - 1 - row) * width);
            upper[row * width..][..width].swap_with_slice(&mut lower[..width]);
        }
    }
}
