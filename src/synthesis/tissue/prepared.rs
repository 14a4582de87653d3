//! A tissue with all slow preparation done, so that paint can be laid over it any number of times.

use super::{
    DensityField, DensityTissue, GuidePath, NoGoField, NoGoTissue, Staged, Tissue, TissueError, TissuePaint, web,
};
use crate::synthesis::{
    mesh::{IndexedMesh, TriangleMesh},
    pace::{Pace, at_once},
};
use std::sync::{Arc, OnceLock};

/// A tissue made from its [source](super::TissueSource), without paint. A clone shares all of it.
///
/// The indices, voxels and surfaces of an organ are made once. [`painted`](Self::painted) tissues share them.
#[derive(Clone, Debug)]
pub struct PreparedTissue {
    /// Tissues in force before the last, each for a number of steps.
    stages: Vec<(Arc<dyn Tissue>, u32)>,
    last: Arc<dyn Tissue>,
    /// The tissue without paint.
    plain: Arc<dyn Tissue>,
    /// The mesh for paint on vertices; `None` for tissues that are not made from a mesh.
    canvas: Option<Arc<Canvas>>,
}

/// A mesh that can be painted, indexed when it is first painted on.
#[derive(Debug)]
struct Canvas {
    mesh: Arc<TriangleMesh>,
    indexed: OnceLock<IndexedMesh>,
}

impl Canvas {
    /// Makes the index if there is none yet.
    async fn index(&self, pace: &Pace) {
        if self.indexed.get().is_none() {
            let indexed = IndexedMesh::new_paced(Arc::clone(&self.mesh), pace).await;
            self.indexed.get_or_init(|| indexed);
        }
    }

    fn indexed(&self) -> &IndexedMesh {
        self.indexed.get_or_init(|| IndexedMesh::new(Arc::clone(&self.mesh)))
    }
}

impl PreparedTissue {
    /// A tissue that is not made from a mesh: it takes no density and no painted vertices.
    ///
    /// # Errors
    /// A tissue that changes in stages: paint its stages instead.
    pub fn new(tissue: Arc<dyn Tissue>) -> Result<Self, TissueError> {
        if tissue.stage(1).is_some() {
            return Err(TissueError::PaintOverStages);
        }
        Ok(Self { stages: Vec::new(), last: Arc::clone(&tissue), plain: tissue, canvas: None })
    }

    /// The tissues of a mesh: stages, each for a number of steps, and the last. `indexed` is empty if none of them
    /// needs an index of the triangles.
    ///
    /// # Errors
    /// Tissues that cannot form a [`Staged`] one.
    pub(super) fn of_mesh(
        mesh: Arc<TriangleMesh>,
        indexed: OnceLock<IndexedMesh>,
        stages: Vec<(Arc<dyn Tissue>, u32)>,
        last: Arc<dyn Tissue>,
    ) -> Result<Self, TissueError> {
        let plain = in_stages(stages.clone(), Arc::clone(&last))?;
        Ok(Self { stages, last, plain, canvas: Some(Arc::new(Canvas { mesh, indexed })) })
    }

    /// The tissue without paint.
    pub fn tissue(&self) -> &Arc<dyn Tissue> {
        &self.plain
    }

    /// The mesh that it is made from, with its texture coordinates; `None` for other tissues.
    pub fn mesh(&self) -> Option<&TriangleMesh> {
        self.canvas.as_ref().map(|canvas| &*canvas.mesh)
    }

    /// That mesh with an index of its triangles, to find what a ray or a brush touches. The index is made at the first
    /// call if the tissue itself needs none.
    pub fn canvas_mesh(&self) -> Option<&IndexedMesh> {
        self.canvas.as_deref().map(Canvas::indexed)
    }

    /// The tissue with paint laid over it. Nothing is prepared again. With blank paint, this is the
    /// [`tissue`](Self::tissue) itself.
    ///
    /// If the mesh's surface is not part of the tissue, the first paint on its vertices makes an index of its
    /// triangles.
    ///
    /// # Errors
    /// Invalid paint: see [`TissueError`].
    pub fn painted(&self, paint: &TissuePaint) -> Result<Arc<dyn Tissue>, TissueError> {
        at_once(self.painted_paced(paint, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`painted`](Self::painted).
    pub async fn painted_paced(&self, paint: &TissuePaint, pace: &Pace) -> Result<Arc<dyn Tissue>, TissueError> {
        if paint.is_blank() {
            pace.rest(1.0).await;
            return Ok(Arc::clone(&self.plain));
        }
        if let (Some(canvas), true) = (&self.canvas, paint.is_on_vertices()) {
            canvas.index(&pace.part(0.0..0.4)).await;
        }
        let density = match &paint.density {
            Some(values) => {
                let canvas = self.canvas("the density")?;
                Some(DensityField::on_indexed_paced(canvas, values, &pace.part(0.4..0.45)).await?)
            }
            None => None,
        };
        let no_go = paint.no_go.field(|| self.canvas("a no-go region"), &pace.part(0.45..0.5)).await?;
        let laid = |tissue: &Arc<dyn Tissue>| guarded(thinned(Arc::clone(tissue), density.as_ref())?, no_go.as_ref());
        // Guides lie on the first stage.
        let base = self.stages.first().map_or(&self.last, |(first, _)| first);
        let mut stages = Vec::with_capacity(paint.guides.len() + self.stages.len());
        let (pace, deriving) = (pace.part(0.5..0.7), pace.part(0.7..1.0));
        for (number, guide) in paint.guides.iter().enumerate() {
            let share = 1.0 / paint.guides.len() as f32;
            let pace = pace.part(number as f32 * share..(number + 1) as f32 * share);
            let path = GuidePath::new_paced(guide.points.clone(), guide.deviation, &pace.part(0.0..0.1)).await?;
            let path = path.over_paced(Arc::clone(base), &pace.part(0.1..1.0)).await?;
            stages.push((guarded(Arc::new(path), no_go.as_ref())?, guide.steps));
        }
        for (stage, steps) in &self.stages {
            stages.push((laid(stage)?, *steps));
        }
        let painted = in_stages(stages, laid(&self.last)?)?;
        derive(&*painted, &deriving).await;
        Ok(painted)
    }

    /// Derives what starts of growths need, as [paced](crate::synthesis::pace) work, so that none of them has to.
    pub(super) async fn derive(&self, pace: &Pace) {
        derive(&*self.plain, pace).await;
    }

    /// Work of laying this paint over the tissue, in items: that of the [paint](TissuePaint::work), and triangles if
    /// their index has still to be made.
    pub fn painting_work(&self, paint: &TissuePaint) -> usize {
        let is_bare = |canvas: &&Arc<Canvas>| paint.is_on_vertices() && canvas.indexed.get().is_none();
        let triangles = self.canvas.as_ref().filter(is_bare).map_or(0, |canvas| canvas.mesh.triangles().len());
        triangles + paint.work()
    }

    fn canvas(&self, what: &'static str) -> Result<&IndexedMesh, TissueError> {
        self.canvas.as_deref().map(Canvas::indexed).ok_or(TissueError::NoVertices { what })
    }
}

fn thinned(tissue: Arc<dyn Tissue>, density: Option<&DensityField>) -> Result<Arc<dyn Tissue>, TissueError> {
    Ok(match density {
        Some(field) => Arc::new(DensityTissue::new(tissue, field.clone())?),
        None => tissue,
    })
}

async fn derive(tissue: &dyn Tissue, pace: &Pace) {
    let first = tissue.at_step(1);
    if let Some(derived) = first.derived().filter(|_| first.entrance().is_none()) {
        web::prepare(first, derived, pace).await;
    }
    pace.rest(1.0).await;
}

fn guarded(tissue: Arc<dyn Tissue>, no_go: Option<&NoGoField>) -> Result<Arc<dyn Tissue>, TissueError> {
    Ok(match no_go {
        Some(field) => Arc::new(NoGoTissue::new(tissue, field.clone())?),
        None => tissue,
    })
}

fn in_stages(stages: Vec<(Arc<dyn Tissue>, u32)>, last: Arc<dyn Tissue>) -> Result<Arc<dyn Tissue>, TissueError> {
    if stages.is_empty() { Ok(last) } else { Ok(Arc::new(Staged::new(stages, last)?)) }
}
