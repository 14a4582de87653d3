//! The tissue of an organ: prepared from its assets, shared with other organs, and painted.

use crate::plugin::{
    growth::{
        followed::SourceAssets,
        messages::OrganGrowthError,
        shared::{Prepared, SharedTissue, SharedTissues},
    },
    organ::{
        image::{OrganImage, OrganImageError, tissue_image},
        mesh::{MeshCopy, OrganMeshError, copy_mesh},
    },
};
use crate::synthesis::{
    mesh::{IndexedMesh, TriangleMesh},
    pace::Pace,
    tissue::{PreparedTissue, SourceData, Tissue, TissueError, TissuePaint, TissueSource},
};
use bevy::{
    asset::{Asset, AssetServer, Assets, Handle, LoadState},
    ecs::{
        change_detection::{Res, ResMut},
        system::SystemParam,
    },
    image::Image,
    mesh::{Mesh, Mesh3d},
};
use std::sync::Arc;

/// A prepared tissue with its paint.
#[derive(Clone, Debug)]
pub(crate) struct PaintedTissue {
    base: PreparedTissue,
    #[expect(dead_code, reason = "it keeps the tissue for other organs")]
    shared: Arc<SharedTissue>,
    /// What was painted.
    pub(crate) paint: Arc<TissuePaint>,
    /// What vessels grow on.
    pub(crate) tissue: Arc<dyn Tissue>,
}

impl PaintedTissue {
    /// A shared tissue without paint; `None` until it is ready.
    pub(crate) fn blank(shared: &Arc<SharedTissue>) -> Option<Result<Self, OrganGrowthError>> {
        let blank = |base: PreparedTissue| {
            let (tissue, paint) = (Arc::clone(base.tissue()), Arc::default());
            Self { base, shared: Arc::clone(shared), paint, tissue }
        };
        Some(shared.outcome()?.clone().map(blank))
    }

    /// The mesh that it is made from, if any.
    pub(crate) fn mesh(&self) -> Option<&TriangleMesh> {
        self.base.mesh()
    }

    /// That mesh with an index of its triangles.
    pub(crate) fn canvas(&self) -> Option<&IndexedMesh> {
        self.base.canvas_mesh()
    }

    /// Work of laying other paint over it, in items.
    pub(crate) fn work(&self, paint: &TissuePaint) -> usize {
        if *self.paint == *paint { 0 } else { self.base.painting_work(paint) }
    }

    /// The same tissue with other paint.
    pub(crate) async fn repainted(self, paint: Arc<TissuePaint>, pace: &Pace) -> Result<Self, OrganGrowthError> {
        if *self.paint == *paint {
            return Ok(self);
        }
        let tissue = self.base.painted_paced(&paint, pace).await?;
        Ok(Self { paint, tissue, ..self })
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

    /// The slow part of the preparation. It depends on the copy and the source alone.
    pub(crate) async fn prepare(self, source: TissueSource, pace: Pace) -> Prepared {
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
        Ok(source.prepare_paced(&data, &pace.part(read..1.0)).await?)
    }
}

/// Where meshes, images and the tissues made from them come from.
#[derive(SystemParam)]
pub(crate) struct OrganAssets<'w> {
    tissues: ResMut<'w, SharedTissues>,
    meshes: Res<'w, Assets<Mesh>>,
    images: Option<Res<'w, Assets<Image>>>,
    server: Option<Res<'w, AssetServer>>,
}

/// Tells which assets are being loaded.
#[derive(SystemParam)]
pub(crate) struct AssetsUnderWay<'w> {
    server: Option<Res<'w, AssetServer>>,
}

impl AssetsUnderWay<'_> {
    /// Whether an asset that isn't there is on its way.
    pub(crate) fn is_coming<A: Asset>(&self, handle: &Handle<A>) -> bool {
        self.server.as_ref().is_some_and(|server| server.load_state(handle.id()).is_loading())
    }
}

/// Result of looking up an asset that a tissue is made from.
enum Copied {
    /// A copy.
    Source(SourceCopy),
    /// There is no mesh yet, or it is being loaded.
    NoMeshYet,
    /// The image is being loaded.
    NoImageYet,
}

/// Result of looking for the tissue of an organ.
pub(crate) enum Found {
    /// Another organ has it, or it is being prepared for one.
    Tissue(Arc<SharedTissue>),
    /// It has still to be prepared, from this copy.
    New(Arc<SharedTissue>, SourceCopy),
    /// There is no mesh yet, or it is being loaded.
    NoMeshYet,
    /// The image is being loaded.
    NoImageYet,
}

impl OrganAssets<'_> {
    /// Finds the tissue of an organ, or copies what it is to be made from. If the organ `may_wait`, a tissue that is
    /// being prepared for another one serves.
    pub(crate) fn find(
        &mut self,
        source: &TissueSource,
        mesh: Option<&Mesh3d>,
        image: Option<&OrganImage>,
        may_wait: bool,
    ) -> Result<Found, OrganGrowthError> {
        let shared = self.tissues.get(source, SourceAssets::of(mesh, image));
        if shared.is_ready() || (may_wait && !shared.is_new()) {
            return Ok(Found::Tissue(shared));
        }
        Ok(match self.copy(source, mesh, image)? {
            Copied::Source(copy) => Found::New(shared, copy),
            Copied::NoMeshYet => Found::NoMeshYet,
            Copied::NoImageYet => Found::NoImageYet,
        })
    }

    /// Copies the data that a source needs of an organ.
    fn copy(
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
