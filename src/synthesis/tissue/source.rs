//! What to make of an organ's mesh, as data: what the plugin and the command line pass on.

use crate::synthesis::tissue::{
    DensityField, DensityTissue, GuidePath, MeshSurface, MeshVolume, Staged, Tissue, TissueError,
};
use crate::synthesis::{
    mesh::TriangleMesh,
    pace::{Pace, at_once},
};
use bevy_math::Vec3;
use std::sync::Arc;

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

/// A line along which large vessels are led.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Guide {
    /// Its points in order. They are brought to the nearest points of the tissue. A root that is put automatically is put
    /// at the first.
    ///
    /// Units: tissue lengths, in the organ's local space. Limits: at least 2.
    pub points: Vec<Vec3>,
    /// How far from the line attraction points are drawn.
    ///
    /// Higher values make for more vessels along the guide, and more wayward ones.
    ///
    /// Units: tissue lengths. Limits: ≥ 0. Default: 0.
    pub deviation: f32,
    /// Steps for which attraction points are drawn along this guide only. Guides follow each other.
    ///
    /// Too few leave the guide's end without a vessel: about its length over the step length is right.
    ///
    /// Default: [`Self::DEFAULT_STEPS`].
    pub steps: u32,
}

impl Guide {
    /// Steps along a guide.
    pub const DEFAULT_STEPS: u32 = 20;
}

impl Default for Guide {
    fn default() -> Self {
        Self { points: Vec::new(), deviation: 0.0, steps: Self::DEFAULT_STEPS }
    }
}

/// What to make of an organ's mesh. The default is its surface.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct TissueSettings {
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
    /// Lines along which large vessels are led before the rest grows. They keep to the surface, or to the inside where
    /// vessels grow through it from the start.
    ///
    /// Default: none.
    pub guides: Vec<Guide>,
    /// Probability, 0 to 1, with which attraction points are kept, at every vertex of the mesh; guides are not concerned.
    ///
    /// Default: 1 everywhere.
    pub density: Option<Vec<f32>>,
}

impl TissueSettings {
    /// Voxels along the longest side of the organ.
    pub const DEFAULT_RESOLUTION: u32 = MeshVolume::DEFAULT_RESOLUTION;

    /// How much work it is to [build](Self::build) the tissue of so many triangles, in items: the triangles, and the voxels
    /// where the inside is needed.
    pub fn work(&self, triangles: usize) -> usize {
        let voxels = || (self.resolution as usize).saturating_pow(3);
        match self.mode {
            TissueMode::Surface => triangles,
            TissueMode::Volume | TissueMode::Staged { .. } => triangles.saturating_add(voxels()),
        }
    }

    /// Makes the tissue of an organ's mesh.
    ///
    /// # Errors
    /// What is wrong with the settings, or with the mesh for this purpose: see [`TissueError`].
    pub fn build(&self, mesh: &TriangleMesh) -> Result<Arc<dyn Tissue>, TissueError> {
        at_once(self.build_paced(mesh, &Pace::default()))
    }

    /// The same, with rests.
    ///
    /// # Errors
    /// Those of [`build`](Self::build).
    pub async fn build_paced(&self, mesh: &TriangleMesh, _pace: &Pace) -> Result<Arc<dyn Tissue>, TissueError> {
        let field = self.density.as_ref().map(|values| DensityField::on_vertices(mesh, values)).transpose()?;
        let thinned = |tissue: Arc<dyn Tissue>| -> Result<Arc<dyn Tissue>, TissueError> {
            Ok(match &field {
                Some(field) => Arc::new(DensityTissue::new(tissue, field.clone())?),
                None => tissue,
            })
        };
        let surface = || MeshSurface::new(mesh.clone()).map(|surface| Arc::new(surface) as Arc<dyn Tissue>);
        let volume = || MeshVolume::new(mesh, self.resolution).map(|volume| Arc::new(volume) as Arc<dyn Tissue>);
        // What guides are laid on, what follows them, and what goes on.
        let (base, stages, last) = match self.mode {
            TissueMode::Surface => {
                let surface = surface()?;
                (surface.clone(), Vec::new(), thinned(surface)?)
            }
            TissueMode::Volume => {
                let volume = volume()?;
                (volume.clone(), Vec::new(), thinned(volume)?)
            }
            TissueMode::Staged { surface_steps } => {
                let surface = surface()?;
                (surface.clone(), vec![(thinned(surface)?, surface_steps)], thinned(volume()?)?)
            }
        };
        let mut all: Vec<(Arc<dyn Tissue>, u32)> = Vec::with_capacity(self.guides.len() + stages.len());
        for guide in &self.guides {
            let path = GuidePath::new(guide.points.clone(), guide.deviation)?.over(base.clone())?;
            all.push((Arc::new(path), guide.steps));
        }
        all.extend(stages);
        if all.is_empty() {
            return Ok(last);
        }
        Ok(Arc::new(Staged::new(all, last)?))
    }
}

impl Default for TissueSettings {
    fn default() -> Self {
        Self { mode: TissueMode::Surface, resolution: Self::DEFAULT_RESOLUTION, guides: Vec::new(), density: None }
    }
}
