//! Sources of tissue, as data for presets, the plugin and the command line.

mod image;
mod mesh;
mod shape;

pub use image::{ImageChannel, ImageTissue, TissueImage};
pub use mesh::{MeshTissue, TissueMode};
pub use shape::TissueShape;

use super::{PreparedTissue, TissueError};
use crate::synthesis::{
    mesh::TriangleMesh,
    pace::{Pace, at_once},
};
use std::sync::Arc;

/// The source of an organ's tissue. The default is the surface of its mesh.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueSource {
    /// From the organ's mesh.
    Mesh(MeshTissue),
    /// A plain shape, without other data.
    Shape(TissueShape),
    /// From an image of the organ.
    Image(ImageTissue),
}

/// The data of an organ that a source may need. Data that it doesn't need may be left out.
#[derive(Clone, Debug, Default)]
pub struct SourceData {
    /// The organ's mesh.
    pub mesh: Option<Arc<TriangleMesh>>,
    /// The organ's image.
    pub image: Option<Arc<TissueImage>>,
}

impl TissueSource {
    /// Does the slow preparation of the tissue.
    ///
    /// # Errors
    /// [`TissueError::NoMesh`] and [`TissueError::NoImage`] if that is needed but left out; invalid settings; an organ
    /// that cannot be used for this.
    pub fn prepare(&self, data: &SourceData) -> Result<PreparedTissue, TissueError> {
        at_once(self.prepare_paced(data, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
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

    /// Work of [preparing](Self::prepare) the tissue of so many triangles, or pixels of an image, in items.
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
