//! The first hit of a ray, on whole segments and on the remaining parts of cut ones.
//!
//! In: a ray, and segments in any order. Out: the [`Place`] that it hits first. An index gives the segments in its way;
//! those that no index holds are tested one by one.

use crate::synthesis::{
    segment_index::round_cone::RoundCone,
    space::packed_boxes::Ray,
    tree::{NodeId, Place, VesselTree},
};
use bevy_math::{DVec3, Vec3};

/// Share of its distance by which a ball is widened against a ray.
const ROOM: f64 = 1.0e-14;

/// A ray through the segments of a tree, with the first hit so far.
#[derive(Clone, Debug)]
pub struct RayCast {
    from: DVec3,
    /// Unit vector.
    direction: DVec3,
    /// The same for boxes.
    pub(super) ray: Ray,
    pub(super) found: Found,
}

impl RayCast {
    /// A ray that goes no farther than `reach`, which may be infinite. `direction` may have any length.
    ///
    /// `None` if `from` or `direction` isn't finite, `direction` is zero, or `reach` is negative or NaN. Units: tissue
    /// lengths.
    pub fn new(from: Vec3, direction: Vec3, reach: f32) -> Option<Self> {
        let unit = direction.as_dvec3().try_normalize()?;
        if !(from.is_finite() && direction.is_finite() && reach >= 0.0) {
            return None;
        }
        let ray = Ray::new(from, unit.as_vec3());
        Some(Self { from: from.as_dvec3(), direction: unit, ray, found: Found::up_to(reach.into()) })
    }

    /// The place that the ray hit first, and its distance along the ray.
    pub fn found(&self) -> Option<(Place, f32)> {
        self.found.place.map(|place| (place, self.found.least as f32))
    }

    /// Tests the ray against the remaining parts of a segment: `pieces`, each between two shares of the way from the
    /// parent's node. A piece is round at the segment's ends, and flat at cuts.
    pub fn meet(&mut self, tree: &VesselTree, node: NodeId, pieces: impl IntoIterator<Item = [f32; 2]>) {
        let Some(cone) = RoundCone::of(tree, node.0) else { return };
        for piece in pieces {
            let hit = match piece {
                [0.0, 1.0] => cone.hit(self.from, self.direction),
                piece => cone.hit_piece(self.from, self.direction, piece.map(f64::from)),
            };
            if let Some((distance, along)) = hit {
                self.found.offer(node.0, along, distance);
            }
        }
    }

    /// Whether the ray may meet a segment nearer than its present hit: a quick test by the ball around the segment,
    /// without false negatives.
    ///
    /// # Panics
    /// If the node is not in the tree.
    pub fn may_meet(&self, tree: &VesselTree, node: NodeId) -> bool {
        RoundCone::of(tree, node.0).is_some_and(|cone| {
            let (center, radius) = cone.ball_around();
            self.is_near(center, radius)
        })
    }

    /// The same for anything within a ball, in tissue lengths.
    pub fn may_meet_ball(&self, center: Vec3, radius: f32) -> bool {
        self.is_near(center.as_dvec3(), f64::from(radius) * (1.0 + f64::from(f32::EPSILON)))
    }

    /// Whether the ray may share a point with a ball.
    fn is_near(&self, center: DVec3, radius: f64) -> bool {
        let to_center = center - self.from;
        let along = to_center.dot(self.direction).clamp(0.0, self.found.least);
        // Margin for rounding, in proportion to the segment's distance.
        let radius = radius + ROOM * to_center.abs().max_element();
        to_center.distance_squared(self.direction * along) <= radius * radius
    }
}

/// The best place so far.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub least: f64,
    pub place: Option<Place>,
}

impl Found {
    pub fn up_to(limit: f64) -> Self {
        Self { least: limit, place: None }
    }

    pub fn offer(&mut self, node: u32, along: f64, distance: f64) {
        let better = match self.place {
            None => distance <= self.least,
            Some(place) => distance < self.least || (distance == self.least && node < place.node.0),
        };
        if better {
            self.least = distance;
            self.place = Some(Place::new(NodeId(node), along as f32));
        }
    }
}
