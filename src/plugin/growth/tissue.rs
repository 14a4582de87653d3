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

/// A tissue that has been prepared, with the paint that lies on it.
#[derive(Clone, Debug)]
pub(crate) struct PaintedTissue {
    base: PreparedTissue,
    /// What was painted.
    pub(crate) paint: Arc<TissuePaint>,
    /// What vessels grow on.
    pub(crate) tissue: Arc<dyn Tissue>,
}

/// A tissue, or why there is none.
pub(crate) type Painted = Result<PaintedTissue, OrganGrowthError>;

impl PaintedTissue {
    async fn new(base: PreparedTissue, paint: Arc<TissuePaint>, pace: &Pace) -> Painted {
        let tissue = base.painted_paced(&paint, pace).await?;
        Ok(Self { base, paint, tissue })
    }

    /// The mesh that it is made of, if it is.
    pub(crate) fn mesh(&self) -> Option<&TriangleMesh> {
        self.base.mesh()
    }

    /// How much work it is to lay other paint over it, in items.
    pub(crate) fn work(&self, paint: &TissuePaint) -> usize {
        self.base.painting_work(paint)
    }

    /// The same tissue with other paint.
    pub(crate) async fn repainted(self, paint: Arc<TissuePaint>, pace: Pace) -> Painted {
        Self::new(self.base, paint, &pace).await
    }
}

/// What is copied of an organ's assets, so that copying is all that the frame has to wait for.
pub(crate) enum SourceCopy {
    Mesh(MeshCopy),
    Image(Box<Image>),
    Nothing,
}

impl SourceCopy {
    /// How much work it is to make a source's tissue of it, in items.
    pub(crate) fn work(&self, source: &TissueSource) -> usize {
        source.work(match self {
            Self::Mesh(mesh) => mesh.triangles.len(),
            Self::Image(image) => image.data.as_ref().map_or(0, Vec::len),
            Self::Nothing => 0,
        })
    }

    /// The slow part of the preparation: a function of what was copied, and nothing else.
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

/// What came of looking for an asset that a tissue is made of.
pub(crate) enum Copied {
    /// Here it is.
    Source(SourceCopy),
    /// There is no mesh yet, or it is being loaded.
    NoMeshYet,
    /// The image is being loaded.
    NoImageYet,
}

impl OrganAssets<'_> {
    /// A copy of what a source needs of an organ.
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

    /// Why an asset that isn't there will not come.
    fn expect<A: Asset>(&self, handle: &Handle<A>) -> Result<(), String> {
        match self.server.as_ref().map(|server| server.load_state(handle.id())) {
            Some(LoadState::Failed(error)) => Err(error.to_string()),
            _ => Ok(()),
        }
    }
}
