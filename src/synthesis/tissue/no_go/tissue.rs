//! Any tissue, with a field over it that forbids some of its points.

use super::NoGoField;
use crate::synthesis::{
    random::VesselRng,
    tissue::{Derived, Extent, Tissue, TissueError, TissuePiece, TissuePoint},
};
use bevy_math::{Vec3, bounding::Aabb3d};
use std::sync::Arc;

/// A tissue with no-go regions.
///
/// Its shape and extent stay, but no sample falls into the regions, and generators [place no node
/// there](Tissue::no_go).
#[derive(Clone, Debug)]
pub struct NoGoTissue {
    tissue: Arc<dyn Tissue>,
    field: NoGoField,
    derived: Derived,
}

impl NoGoTissue {
    /// Lays a field over a tissue. Points that the tissue already forbids stay forbidden.
    ///
    /// # Errors
    /// A tissue that changes in stages: lay the field over its stages instead.
    pub fn new(tissue: Arc<dyn Tissue>, field: NoGoField) -> Result<Self, TissueError> {
        if tissue.stage(1).is_some() {
            return Err(TissueError::NoGoOverStages);
        }
        let field = match tissue.no_go() {
            Some(before) => before.clone().or(field),
            None => field,
        };
        Ok(Self { tissue, field, derived: Derived::default() })
    }

    fn allowed(&self, point: Option<Vec3>) -> Option<Vec3> {
        point.filter(|&point| !self.field.forbids(point))
    }
}

impl Tissue for NoGoTissue {
    fn laid_over(&self) -> Option<&dyn Tissue> {
        Some(&*self.tissue)
    }

    fn bounds(&self) -> Aabb3d {
        self.tissue.bounds()
    }

    fn derived(&self) -> Option<&Derived> {
        Some(&self.derived)
    }

    fn extent(&self) -> Extent {
        self.tissue.extent()
    }

    fn contains(&self, point: Vec3) -> bool {
        self.tissue.contains(point)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        self.tissue.closest_point(point)
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        let point = self.tissue.sample(rng);
        self.allowed(point)
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        let first = candidates.len();
        let mut kept = first;
        self.tissue.draw(rng, count, candidates);
        for index in first..candidates.len() {
            if !self.field.forbids(candidates[index]) {
                candidates[kept] = candidates[index];
                kept += 1;
            }
        }
        candidates.truncate(kept);
    }

    fn cut(&self, reach: f32, pieces: &mut Vec<TissuePiece>) -> bool {
        self.tissue.cut(reach, pieces)
    }

    fn point_of(&self, reach: f32, piece: [u32; 2], numbers: [f32; 3]) -> Option<Vec3> {
        self.allowed(self.tissue.point_of(reach, piece, numbers))
    }

    fn entrance(&self) -> Option<Vec3> {
        self.allowed(self.tissue.entrance())
    }

    fn no_go(&self) -> Option<&NoGoField> {
        Some(&self.field)
    }
}
