//! Where a lateral that leaves flat is clear of its trunk.
//!
//! In: both curves. Out: the places on both from which on they are apart. Within the trunk and half within, the lateral
//! has no surface of its own: a twig at 3° parts from its trunk 20 radii from their joint.

use super::curve::Curve;

/// Height of a lateral's axis above its trunk's surface at which it is clear of it, in its radii.
pub(super) const CLEAR: f32 = 1.25;
/// Radius of a trunk's cage, in radii of the trunk.
const CAGE: f32 = 1.08;
/// The least step along the lateral, in its radii.
const LEAST_STEP: f32 = 0.25;
/// The most steps: a vessel that runs on beside its trunk for longer never parts.
const MOST_STEPS: usize = 4096;

/// Where a lateral parts from its trunk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parting {
    /// Length along the trunk.
    pub on_trunk: f32,
    /// Length along the lateral.
    pub on_lateral: f32,
    /// Whether it is clear there; otherwise it ends before it is.
    pub is_clear: bool,
    /// Whether its axis ends within the trunk.
    pub ends_within: bool,
}

impl Parting {
    /// The first place from which on a lateral is clear of its trunk, given the joint's length along the trunk; for one
    /// that ends before, a place near its end.
    pub fn find(trunk: &Curve, joint: f32, lateral: &Curve) -> Self {
        let end = lateral.length();
        let (mut on_trunk, mut on_lateral) = (joint, 0.0f32);
        for _ in 0..MOST_STEPS {
            let here = lateral.at(on_lateral);
            on_trunk = trunk.foot(here.center, on_trunk);
            let station = trunk.at(on_trunk);
            let distance = here.center.distance(station.center);
            let lacks = CAGE * station.radius + CLEAR * here.radius - distance;
            if lacks <= 0.0 {
                return Self { on_trunk, on_lateral, is_clear: true, ends_within: false };
            }
            if on_lateral >= end {
                let ends_within = distance < station.radius;
                let last = (end - here.radius).max(0.5 * end);
                let on_trunk = trunk.foot(lateral.at(last).center, on_trunk);
                return Self { on_trunk, on_lateral: last, is_clear: false, ends_within };
            }
            // The distance grows by no more than the length.
            on_lateral = (on_lateral + lacks.max(LEAST_STEP * here.radius)).min(end);
        }
        Self { on_trunk, on_lateral, is_clear: false, ends_within: false }
    }
}
