//! Staged tissues: first along guides, then over the surface, then through the volume (Rauch & Harders 2021, Fig. 3 and 4).

use super::{Extent, NoGoField, Tissue, TissuePoint, error::TissueError};
use crate::synthesis::random::VesselRng;
use bevy_math::{
    Vec3,
    bounding::{Aabb3d, BoundingVolume},
};
use std::sync::Arc;

/// Tissues in force one after the other.
///
/// Growth uses the one [in force](trait@Tissue#method.at_step) at each step. As a whole, a staged tissue contains all
/// points of its stages. Its extent, its no-go regions and its samples are those of its last stage, which stays in
/// force and to which settings are fitted.
#[derive(Clone, Debug)]
pub struct Staged {
    /// Each with its last step.
    stages: Vec<(Arc<dyn Tissue>, u32)>,
    last: Arc<dyn Tissue>,
}

impl Staged {
    /// Each of `stages` is in force for its number of steps, then `last` for the rest. A stage of 0 steps is never in
    /// force.
    ///
    /// # Errors
    /// A tissue among them that is staged itself.
    pub fn new(stages: Vec<(Arc<dyn Tissue>, u32)>, last: Arc<dyn Tissue>) -> Result<Self, TissueError> {
        if stages.iter().map(|(tissue, _)| tissue).chain([&last]).any(|tissue| tissue.stage(1).is_some()) {
            return Err(TissueError::StagesWithinStages);
        }
        let mut end = 0u32;
        let until = |(tissue, steps): (Arc<dyn Tissue>, u32)| {
            end = end.saturating_add(steps);
            (tissue, end)
        };
        Ok(Self { stages: stages.into_iter().map(until).collect(), last })
    }

    /// All stages, the last included.
    fn all(&self) -> impl Iterator<Item = &dyn Tissue> {
        self.stages.iter().map(|(tissue, _)| &**tissue).chain([&*self.last])
    }
}

impl Tissue for Staged {
    fn bounds(&self) -> Aabb3d {
        self.all().fold(self.last.bounds(), |bounds, stage| bounds.merge(&stage.bounds()))
    }

    fn extent(&self) -> Extent {
        self.last.extent()
    }

    fn contains(&self, point: Vec3) -> bool {
        self.all().any(|stage| stage.contains(point))
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        let distance = |found: &TissuePoint| found.position.distance_squared(point);
        // Of equally near points, the first with the normal of a surface is used.
        self.all().map(|stage| stage.closest_point(point)).fold(self.last.closest_point(point), |best, found| {
            if distance(&found) < distance(&best) || distance(&found) == distance(&best) && best.normal == Vec3::ZERO {
                found
            } else {
                best
            }
        })
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        self.last.sample(rng)
    }

    fn entrance(&self) -> Option<Vec3> {
        self.all().find_map(|stage| stage.entrance())
    }

    fn no_go(&self) -> Option<&NoGoField> {
        self.last.no_go()
    }

    fn stage(&self, step: u32) -> Option<&dyn Tissue> {
        let stage = self.stages.iter().find(|(_, until)| step <= *until).map_or(&self.last, |(tissue, _)| tissue);
        Some(&**stage)
    }
}
