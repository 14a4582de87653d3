//! Tissue from the mesh of an organ.

use crate::synthesis::{
    mesh::TriangleMesh,
    pace::{Pace, at_once},
    tissue::{MeshSurface, MeshVolume, PreparedTissue, Tissue, TissueError},
};
use std::sync::{Arc, OnceLock};

/// Where on an organ vessels grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum TissueMode {
    /// Over its surface.
    #[default]
    Surface,
    /// Over the inside of a hollow organ's wall: a mesh whose triangles face into the lumen. Vessels are lifted off that
    /// side; as a surface, they would be off the other.
    Lining,
    /// Through its inside.
    Volume,
    /// Over its surface first, then inwards through its inside.
    Staged {
        /// Steps on the surface, from the first on.
        surface_steps: u32,
    },
}

/// The tissue to make from an organ's mesh. The default is its surface.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct MeshTissue {
    /// Where vessels grow.
    ///
    /// Default: over the surface.
    pub mode: TissueMode,
    /// Voxels along the longest side of the organ, if its inside is needed.
    ///
    /// Higher values take more memory and time to prepare; the boundary is that of the mesh at any resolution.
    ///
    /// Limits: ≥ 1, and at most 67,108,864 voxels in all. Default: [`Self::DEFAULT_RESOLUTION`].
    pub resolution: u32,
}

impl MeshTissue {
    /// Voxels along the longest side of the organ.
    pub const DEFAULT_RESOLUTION: u32 = MeshVolume::DEFAULT_RESOLUTION;

    /// Work of [preparing](Self::prepare) the tissue of so many triangles, in items: the triangles, and the voxels if
    /// the inside is needed.
    pub fn work(&self, triangles: usize) -> usize {
        let voxels = || (self.resolution as usize).saturating_pow(3);
        match self.mode {
            TissueMode::Surface | TissueMode::Lining => triangles,
            TissueMode::Volume | TissueMode::Staged { .. } => triangles.saturating_add(voxels()),
        }
    }

    /// Does the slow preparation of a mesh's tissue.
    ///
    /// # Errors
    /// Invalid settings, or a mesh that cannot be used for this: see [`TissueError`].
    pub fn prepare(&self, mesh: impl Into<Arc<TriangleMesh>>) -> Result<PreparedTissue, TissueError> {
        at_once(self.prepare_paced(mesh.into(), &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`prepare`](Self::prepare).
    pub async fn prepare_paced(&self, mesh: Arc<TriangleMesh>, pace: &Pace) -> Result<PreparedTissue, TissueError> {
        let indexed = OnceLock::new();
        let surface = async |pace: Pace| -> Result<Arc<dyn Tissue>, TissueError> {
            let surface = match self.mode {
                TissueMode::Lining => MeshSurface::lining_paced(Arc::clone(&mesh), &pace).await?,
                _ => MeshSurface::new_paced(Arc::clone(&mesh), &pace).await?,
            };
            indexed.get_or_init(|| surface.indexed().clone());
            let surface: Arc<dyn Tissue> = Arc::new(surface);
            Ok(surface)
        };
        let volume = async |pace: Pace| -> Result<Arc<dyn Tissue>, TissueError> {
            let volume: Arc<dyn Tissue> = Arc::new(MeshVolume::new_paced(&mesh, self.resolution, &pace).await?);
            Ok(volume)
        };
        let (stages, last) = match self.mode {
            TissueMode::Surface | TissueMode::Lining => (Vec::new(), surface(pace.part(0.0..0.7)).await?),
            TissueMode::Volume => (Vec::new(), volume(pace.part(0.0..0.7)).await?),
            TissueMode::Staged { surface_steps } => {
                let first = surface(pace.part(0.0..0.15)).await?;
                (vec![(first, surface_steps)], volume(pace.part(0.15..0.7)).await?)
            }
        };
        let prepared = PreparedTissue::of_mesh(mesh, indexed, stages, last)?;
        prepared.derive(&pace.part(0.7..1.0)).await;
        Ok(prepared)
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
