//! The tissue of an organ: prepared from its assets, and painted.

use crate::plugin::{
    growth::messages::OrganGrowthError,
    organ::{
        image::{OrganImage, OrganImageError, tissue_image},
        mesh::{MeshCopy, OrganMeshError, copy_mesh},
    },
};
use crate::synthesis::{
    mesh::TriangleMesh,
    pace::Pace,
    tissue::{PreparedTissue, SourceData, Tissue, TissueError, TissuePaint, TissueSource},
};
use bevy::{
    asset::{Asset, AssetServer, Assets, Handle, LoadState},
    ecs::{change_detection::Res, system::SystemParam},
    image::Image,
    mesh::{Mesh, Mesh3d},
};
use std::sync::Arc;

/// A prepared tissue with its paint.
#[derive(Clone, Debug)]
pub(crate) struct PaintedTissue {
    base: PreparedTissue,
    /// What was painted.
    pub(crate) paint: Arc<TissuePaint>,
    /// What vessels grow on.
    pub(crate) tissue: Arc<dyn Tissue>,
}

/// A painted tissue, or the reason why there is none.
pub(crate) type Painted = Result<PaintedTissue, OrganGrowthError>;

impl PaintedTissue {
    async fn new(base: PreparedTissue, paint: Arc<TissuePaint>, pace: &Pace) -> Painted {
        let tissue = base.painted_paced(&paint, pace).await?;
        Ok(Self { base, paint, tissue })
    }

    /// The mesh that it is made from, if any.
    pub(crate) fn mesh(&self) -> Option<&TriangleMesh> {
        self.base.mesh()
    }

    /// Work of laying other paint over it, in items.
    pub(crate) fn work(&self, paint: &TissuePaint) -> usize {
        self.base.painting_work(paint)
    }

    /// The same tissue with other paint.
    pub(crate) async fn repainted(self, paint: Arc<TissuePaint>, pace: Pace) -> Painted {
        Self::new(self.base, paint, &pace).await
    }
}

/// The copied part of an organ's assets. Copying is the only work that the frame waits for.
pub(crate) enum SourceCopy {
    Mesh(MeshCopy),
    Image(Box<Image>),
    Nothing,
}

impl SourceCopy {
    /// Work of making a source's tissue from it, in items.
    pub(crate) fn work(&self, source: &TissueSource) -> usize {
        source.work(match self {
            Self::Mesh(mesh) => mesh.triangles.len(),
            Self::Image(image) => image.data.as_ref().map_or(0, Vec::len),
            Self::Nothing => 0,
        })
    }

    /// The slow part of the preparation. It depends on the copy and the arguments alone.
    pub(crate) async fn prepare(self, source: TissueSource, paint: Arc<TissuePaint>, pace: Pace) -> Painted {
        let mut data = SourceData::default();
        let read = match (self, source.image()) {
            (Self::Mesh(mesh), _) => {
                data.mesh = Some(Arc::new(mesh.check(&pace.part(0.0..0.05)).await?));
                0.05
            }
            (Self::Image(image), Some(settings)) => {
                let image = tissue_image(&image, settings.channel, &pace.part(0.0..0.5)).await?;
                data.image = Some(Arc::new(image));
                0.5
            }
            _ => 0.0,
        };
        let prepared = source.prepare_paced(&data, &pace.part(read..0.9)).await?;
        PaintedTissue::new(prepared, paint, &pace.part(0.9..1.0)).await
    }
}

/// Where meshes and images come from.
#[derive(SystemParam)]
pub(crate) struct OrganAssets<'w> {
    meshes: Res<'w, Assets<Mesh>>,
    images: Option<Res<'w, Assets<Image>>>,
    server: Option<Res<'w, AssetServer>>,
}

/// Result of looking up an asset that a tissue is made from.
pub(crate) enum Copied {
    /// A copy.
    Source(SourceCopy),
    /// There is no mesh yet, or it is being loaded.
    NoMeshYet,
    /// The image is being loaded.
    NoImageYet,
}

impl OrganAssets<'_> {
    /// Copies the data that a source needs of an organ.
    pub(crate) fn copy(
        &self,
        source: &TissueSource,
        mesh: Option<&Mesh3d>,
        image: Option<&OrganImage>,
    ) -> Result<Copied, OrganGrowthError> {
        if source.needs_mesh() {
            return Ok(self.copy_mesh(mesh)?.map_or(Copied::NoMeshYet, |mesh| Copied::Source(SourceCopy::Mesh(mesh))));
        }
        if source.image().is_some() {
            let image = self.copy_image(image.ok_or(TissueError::NoImage)?)?;
            return Ok(image.map_or(Copied::NoImageYet, |image| Copied::Source(SourceCopy::Image(Box::new(image)))));
        }
        Ok(Copied::Source(SourceCopy::Nothing))
    }

    fn copy_mesh(&self, mesh: Option<&Mesh3d>) -> Result<Option<MeshCopy>, OrganMeshError> {
        let Some(mesh) = mesh else { return Ok(None) };
        match self.meshes.get(mesh.id()) {
            Some(mesh) => copy_mesh(mesh).map(Some),
            None => self.expect(mesh).map(|()| None).map_err(|reason| OrganMeshError::NotLoaded { reason }),
        }
    }

    fn copy_image(&self, image: &OrganImage) -> Result<Option<Image>, OrganImageError> {
        let Some(images) = &self.images else {
            let reason = "the app has no image assets: add DefaultPlugins, or ImagePlugin".to_owned();
            return Err(OrganImageError::NotLoaded { reason });
        };
        match images.get(image.id()) {
            Some(image) if image.data.is_none() => Err(OrganImageError::OnGpuOnly),
            Some(image) => Ok(Some(image.clone())),
            None => self.expect(image).map(|()| None).map_err(|reason| OrganImageError::NotLoaded { reason }),
        }
    }

    /// Fails if an asset that isn't there will never be loaded.
    fn expect<A: Asset>(&self, handle: &Handle<A>) -> Result<(), String> {
        match self.server.as_ref().map(|server| server.load_state(handle.id())) {
            Some(LoadState::Failed(error)) => Err(error.to_string()),
            _ => Ok(()),
        }
    }
}
