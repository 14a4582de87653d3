//! Roots chosen by the seed: far from each other, or beside those of another kind.

use super::{RootError, Roots};
use crate::synthesis::{
    random::VesselRng,
    tissue::{
        Tissue, TissuePoint,
        web::{SAMPLES, draw},
    },
    tree::VesselKind,
};
use bevy_math::Vec3;
use rand::RngExt;

/// Least number of samples per spread root.
const SAMPLES_PER_ROOT: u32 = 16;
/// Directions tried for a root beside another.
const DIRECTIONS: u32 = 16;

/// Roots far from each other: of many samples, repeatedly chooses the one furthest from those chosen (Gonzalez,
/// "Clustering to minimize the maximum intercluster distance", 1985).
pub(super) fn spread(
    tissue: &dyn Tissue,
    kind: VesselKind,
    count: u32,
    rng: &mut VesselRng,
) -> Result<Vec<TissuePoint>, RootError> {
    if count > Roots::MAX_SPREAD {
        return Err(RootError::TooMany { kind, count, limit: Roots::MAX_SPREAD });
    }
    let samples = draw(tissue, SAMPLES.max(count * SAMPLES_PER_ROOT), rng);
    let mut distances = vec![f32::INFINITY; samples.len()];
    let mut chosen: Vec<TissuePoint> = Vec::with_capacity(count as usize);
    // Begins with the first sample; of equal distances, the earliest is chosen.
    let mut next = 0;
    while chosen.len() < count as usize {
        if distances.get(next).is_none_or(|&distance| distance == 0.0) {
            return Err(RootError::NoRoom { kind, wanted: count, found: chosen.len() as u32 });
        }
        let root = TissuePoint { position: samples[next], ..tissue.closest_point(samples[next]) };
        chosen.push(root);
        let mut furthest = 0.0;
        for (index, (distance, sample)) in distances.iter_mut().zip(&samples).enumerate() {
            *distance = distance.min(sample.distance_squared(root.position));
            if *distance > furthest {
                (next, furthest) = (index, *distance);
            }
        }
    }
    Ok(chosen)
}

/// A point of the tissue one step length from a root, in the best of several directions. No-go regions are avoided if
/// possible.
pub(super) fn beside(tissue: &dyn Tissue, root: &TissuePoint, step: f32, rng: &mut VesselRng) -> TissuePoint {
    let forbidden = |point: Vec3| tissue.no_go().is_some_and(|no_go| no_go.forbids(point));
    let mut best: Option<(f32, TissuePoint)> = None;
    for _ in 0..DIRECTIONS {
        let direction = tangent(root.normal, rng);
        let point = tissue.closest_point(root.position + direction * step);
        let error = if forbidden(point.position) {
            f32::INFINITY
        } else {
            (point.position.distance(root.position) - step).abs()
        };
        if best.is_none_or(|(least, _)| error < least) {
            best = Some((error, point));
        }
        // Good enough: otherwise rounding, instead of the seed, would choose the direction.
        if error < 0.1 * step {
            break;
        }
    }
    best.map_or(*root, |(_, point)| point)
}

/// A unit vector drawn uniformly from the plane perpendicular to `normal`, or from all directions if that is zero.
fn tangent(normal: Vec3, rng: &mut VesselRng) -> Vec3 {
    let random = |rng: &mut VesselRng| 2.0 * rng.random::<f32>() - 1.0;
    for _ in 0..64 {
        let point = Vec3::new(random(rng), random(rng), random(rng));
        // Within the unit ball, directions are uniform, except for rounding too near its centre. Their projections to a
        // plane through the centre are uniform, too.
        let flat = point - normal * point.dot(normal);
        if point.length_squared() <= 1.0 && flat.length_squared() > 1.0e-4 {
            return flat.normalize();
        }
    }
    Vec3::X
}
