//! As many roots as a tissue needs: one in a compact organ, several in a long one.
//!
//! In: the [web](crate::synthesis::tissue) over a tissue, and the distance along it that the vessels of one root reach. Out:
//! roots that together reach all of it. The web is the same for all seeds: the seed chooses where the search begins.

use super::RootError;
use crate::synthesis::{
    random::VesselRng,
    tissue::{
        Links, Tissue, TissuePoint, Web,
        web::{FACING, SAMPLES, draw},
    },
    tree::VesselKind,
};
use std::{cmp::Reverse, collections::BinaryHeap};

/// Reach of one of several roots, as a share of that of a single one: a tissue that needs several is narrow, and
/// vessels advance more slowly in a narrow tissue.
const SHARE_OF_SEVERAL: f32 = 0.6;
/// Samples tried as the only root, before there are several.
const TRIES: u32 = 8;
/// One sample in this many may stay out of reach, in corners and bits of tissue too small for a root.
const SPARED: usize = 200;

/// Finds roots such that all tissue is within `way` of one, along the tissue. Vessels perceive tissue within `reach`.
///
/// The seed's first sample is the root if it reaches everything, else the first sample of the web after it that does. If
/// none does, the first stays, and the sample furthest from all roots is added repeatedly, until all are near enough.
pub(super) fn within(
    (tissue, web): (&dyn Tissue, &Web),
    kind: VesselKind,
    way: f32,
    reach: f32,
    rng: &mut VesselRng,
) -> Result<Vec<TissuePoint>, RootError> {
    let Some((own, start)) = draw(tissue, SAMPLES, rng).first().and_then(|&own| {
        let own = TissuePoint { position: own, ..tissue.closest_point(own) };
        Some((own, nearest(web, &own)?))
    }) else {
        return Err(RootError::NoRoom { kind, wanted: 1, found: 0 });
    };
    let place = |center: u32| {
        let position = web.positions[center as usize];
        if center == start { own } else { TissuePoint { position, ..tissue.closest_point(position) } }
    };
    let centers = Ways { links: parted_at_rims(web, reach) }.centers(start, way);
    Ok(centers.into_iter().map(place).collect())
}

/// The sample of a web that is nearest to a point, if possible on the same side of a wall.
fn nearest(web: &Web, point: &TissuePoint) -> Option<u32> {
    let key = |sample: u32| {
        let (position, normal) = (web.positions[sample as usize], web.normals[sample as usize]);
        (normal.dot(point.normal) < 0.0, position.distance_squared(point.position))
    };
    (0..web.positions.len() as u32).min_by(|&a, &b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    })
}

/// The links of a web, with each sample on the rim of a wall joined to one side of it only. Vessels on one side supply much
/// of the rim of a wall that is thinner than `reach`, and then little draws them round it.
fn parted_at_rims(web: &Web, reach: f32) -> Links {
    let mut links = web.links.clone();
    let position = |sample: u32| web.positions[sample as usize];
    let normal = |sample: u32| web.normals[sample as usize];
    let mut others = Vec::new();
    for rim in 0..links.len() as u32 {
        let near = links
            .of(rim)
            .iter()
            .filter(|link| link.length.is_finite())
            .map(|link| (position(rim).distance(position(link.to)), link.to));
        let near = near.filter(|&(distance, _)| distance < reach);
        let Some((_, side)) = near.clone().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) else { continue };
        let is_behind = |other: u32| normal(side).dot(normal(other)) < -FACING;
        others.clear();
        others.extend(near.map(|(_, other)| other).filter(|&other| is_behind(other)));
        others.iter().for_each(|&other| links.cut(rim, other));
    }
    links
}

/// The ways along a tissue.
struct Ways {
    links: Links,
}

impl Ways {
    fn centers(&self, start: u32, way: f32) -> Vec<u32> {
        let count = self.links.len() as u32;
        let spared = self.links.len() / SPARED;
        let missed = |distances: &[f32]| distances.iter().filter(|&&distance| distance > way).count();
        let from = |sample, limit| {
            let mut distances = vec![f32::INFINITY; self.links.len()];
            self.approach(sample, &mut distances, limit);
            distances
        };
        let mut distances = from(start, f32::INFINITY);
        if missed(&distances) <= spared {
            return vec![start];
        }
        // From another sample, nothing is nearer by more than the way to that sample.
        let surely_misses = |sample: u32| {
            let gain = distances[sample as usize];
            distances.iter().filter(|&&distance| distance - gain > way).count() > spared
        };
        let mut tries = (1..TRIES.min(count)).map(|offset| (start + offset) % count);
        let reaches_all = |&sample: &u32| !surely_misses(sample) && missed(&from(sample, way)) <= spared;
        if let Some(center) = tries.find(reaches_all) {
            return vec![center];
        }
        let mut chosen = vec![start];
        while distances.iter().filter(|&&distance| distance > SHARE_OF_SEVERAL * way).count() > spared {
            let furthest = furthest(&distances);
            chosen.push(furthest);
            self.approach(furthest, &mut distances, f32::INFINITY);
        }
        chosen
    }

    /// Lowers the distances from the nearest root after adding another root (Dijkstra 1959). Those above a limit stay.
    fn approach(&self, root: u32, distances: &mut [f32], limit: f32) {
        distances[root as usize] = 0.0;
        // Distances are not negative, so their bits have the same order.
        let mut waiting = BinaryHeap::from([Reverse((0.0f32.to_bits(), root))]);
        while let Some(Reverse((bits, sample))) = waiting.pop() {
            let distance = f32::from_bits(bits);
            if distance > distances[sample as usize] {
                continue;
            }
            for link in self.links.of(sample) {
                let (known, length) = (&mut distances[link.to as usize], distance + link.length);
                if length < *known && length <= limit {
                    *known = length;
                    waiting.push(Reverse((known.to_bits(), link.to)));
                }
            }
        }
    }
}

/// The furthest sample; of equally far ones, the first.
fn furthest(distances: &[f32]) -> u32 {
    (1..distances.len()).fold(0, |best, index| if distances[index] > distances[best] { index } else { best }) as u32
}
