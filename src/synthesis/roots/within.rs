//! As many roots as a tissue needs: one in a compact organ, several in a long one.
//!
//! In: a tissue and the distance along it that the vessels of one root reach. Out: roots that together reach all of it.
//! Distances are measured over samples that are joined to their nearest neighbours, as by Tenenbaum, de Silva and
//! Langford, "A Global Geometric Framework for Nonlinear Dimensionality Reduction" (2000), so that the two ends of a
//! bent organ are far apart, and separate parts have their own roots.

use super::{
    RootError,
    spread::{SPREAD_SAMPLES, draw},
};
use crate::synthesis::{
    random::VesselRng,
    tissue::{Tissue, TissuePoint},
    tree::VesselKind,
};
use bevy_math::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::{cmp::Reverse, collections::BinaryHeap, num::NonZeroUsize};

/// Neighbours of each sample: enough to keep a uniformly sampled tissue connected.
const LINKS: NonZeroUsize = NonZeroUsize::new(12).expect("12 is not zero");
/// Largest distance of a link from the tissue, as a share of its length: more than a surface bends away below it, less
/// than the gap between two folds.
const GAP: f32 = 0.15;
/// Distance by which a way along the tissue may miss the other end of a link, as a share of its length.
const MISSED: f32 = 0.25;
/// Points of a link that must be in the tissue, or this near to it.
const BETWEEN: u32 = 5;
/// Cosine of the angle between one normal and the opposite of the other from which two sides face each other, or away
/// from each other.
const FACING: f32 = 0.5;
/// Reach of one of several roots, as a share of that of a single one: a tissue that needs several is narrow, and
/// vessels advance more slowly in a narrow tissue.
const SHARE_OF_SEVERAL: f32 = 0.6;
/// Samples tried as the only root, before there are several.
const TRIES: u32 = 8;
/// One sample in this many may stay out of reach, in corners and bits of tissue too small for a root.
const SPARED: usize = 200;

/// Finds roots such that all tissue is within `way` of one, along the tissue. Vessels perceive tissue within `reach`.
///
/// The seed's first sample is the root if it reaches everything, else the first sample that does. If none does, the
/// first stays, and the sample furthest from all roots is added repeatedly, until all are near enough.
pub(super) fn within(
    tissue: &dyn Tissue,
    kind: VesselKind,
    way: f32,
    reach: f32,
    rng: &mut VesselRng,
) -> Result<Vec<TissuePoint>, RootError> {
    let samples = draw(tissue, SPREAD_SAMPLES, rng);
    if samples.is_empty() {
        return Err(RootError::NoRoom { kind, wanted: 1, found: 0 });
    }
    // A tissue with an entrance has one root, there.
    let place = |&position: &Vec3| TissuePoint { position, ..tissue.closest_point(position) };
    if tissue.entrance().is_some() {
        return Ok(vec![place(&samples[0])]);
    }
    let places: Vec<TissuePoint> = samples.iter().map(place).collect();
    Ok(Web::over(tissue, &places, reach).centers(way).into_iter().map(|center| places[center as usize]).collect())
}

/// Samples, joined to their nearest neighbours.
struct Web {
    /// The neighbours of every sample, with their distances.
    links: Vec<Vec<(u32, f32)>>,
}

impl Web {
    fn over(tissue: &dyn Tissue, samples: &[TissuePoint], reach: f32) -> Self {
        let mut links = vec![Vec::new(); samples.len()];
        for (a, b) in nearest_pairs(samples) {
            let ends = [samples[a as usize], samples[b as usize]];
            if leads_through(tissue, ends) {
                // A vessel keeps its direction for a while, so bends of the surface slow it down. Twice the bend is what the
                // folds of real organs ask for, so that each of their parts is supplied.
                let bend = ends[0].normal.distance(ends[1].normal);
                let length = ends[0].position.distance(ends[1].position) * (1.0 + 2.0 * bend);
                links[a as usize].push((b, length));
                links[b as usize].push((a, length));
            }
        }
        let mut web = Self { links };
        web.part_at_rims(samples, reach);
        web
    }

    /// Joins each sample on the rim of a wall to one side of it only. Vessels on one side supply much of the rim of a wall
    /// that is thinner than `reach`, and then little draws them round it.
    fn part_at_rims(&mut self, samples: &[TissuePoint], reach: f32) {
        let normal = |sample: u32| samples[sample as usize].normal;
        for rim in 0..samples.len() {
            let distance = |other: u32| samples[rim].position.distance(samples[other as usize].position);
            let mut near: Vec<u32> = self.links[rim].iter().map(|&(other, _)| other).collect();
            near.retain(|&other| distance(other) < reach);
            near.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
            let Some(&side) = near.first() else { continue };
            near.retain(|&other| normal(side).dot(normal(other)) < -FACING);
            for other in near {
                self.links[rim].retain(|&(linked, _)| linked != other);
                self.links[other as usize].retain(|&(linked, _)| linked != rim as u32);
            }
        }
    }

    fn centers(&self, way: f32) -> Vec<u32> {
        let spared = self.links.len() / SPARED;
        let missed = |distances: &[f32]| distances.iter().filter(|&&distance| distance > way).count();
        let from = |sample| {
            let mut distances = vec![f32::INFINITY; self.links.len()];
            self.approach(sample, &mut distances);
            distances
        };
        let mut distances = from(0);
        if missed(&distances) <= spared {
            return vec![0];
        }
        let tries = TRIES.min(self.links.len() as u32);
        if let Some(center) = (1..tries).find(|&sample| missed(&from(sample)) <= spared) {
            return vec![center];
        }
        let mut chosen = vec![0];
        while distances.iter().filter(|&&distance| distance > SHARE_OF_SEVERAL * way).count() > spared {
            let furthest = furthest(&distances);
            chosen.push(furthest);
            self.approach(furthest, &mut distances);
        }
        chosen
    }

    /// Lowers the distances from the nearest root after adding another root (Dijkstra 1959).
    fn approach(&self, root: u32, distances: &mut [f32]) {
        distances[root as usize] = 0.0;
        // Distances are not negative, so their bits have the same order.
        let mut waiting = BinaryHeap::from([Reverse((0.0f32.to_bits(), root))]);
        while let Some(Reverse((bits, sample))) = waiting.pop() {
            let distance = f32::from_bits(bits);
            if distance > distances[sample as usize] {
                continue;
            }
            for &(other, link) in &self.links[sample as usize] {
                let known = &mut distances[other as usize];
                if distance + link < *known {
                    *known = distance + link;
                    waiting.push(Reverse((known.to_bits(), other)));
                }
            }
        }
    }
}

/// Pairs of each sample and its nearest neighbours, each pair once, in the order of the indices.
fn nearest_pairs(samples: &[TissuePoint]) -> Vec<(u32, u32)> {
    let points: Vec<[f32; 3]> = samples.iter().map(|sample| sample.position.to_array()).collect();
    // Fails only for more points than a u32 can count. Then every sample is a separate piece.
    let Ok(index) = ImmutableKdTree::<f32, 3>::new_from_slice(&points) else { return Vec::new() };
    let mut pairs = Vec::with_capacity(samples.len() * LINKS.get());
    for (sample, point) in points.iter().enumerate() {
        // One more, since the nearest one is the sample itself.
        let nearest = index.query(point).nearest_n::<SquaredEuclidean<f32>>(LINKS.saturating_add(1)).execute();
        let others = nearest.iter().map(|found| found.item).filter(|&other| other != sample as u32);
        pairs.extend(others.map(|other| (other.min(sample as u32), other.max(sample as u32))));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Whether the tissue continues between two of its points, without a gap that vessels would have to cross.
fn leads_through(tissue: &dyn Tissue, [from, to]: [TissuePoint; 2]) -> bool {
    let way = to.position - from.position;
    // Two facing walls, such as those of two folds, may be nearer than samples are, and so may the two sides of one wall.
    let opposite = from.normal.dot(to.normal) < -FACING;
    if opposite && from.normal.dot(way) * to.normal.dot(way) < 0.0 {
        return false;
    }
    let length = way.length();
    let mut end = from;
    tissue.walk(&from, way / length, length, length, &mut |place| end = place);
    if end.position.distance(to.position) > MISSED * length {
        return false;
    }
    let allowed = GAP * length;
    (1..=BETWEEN).map(|step| from.position + way * (step as f32 / (BETWEEN + 1) as f32)).all(|between| {
        tissue.closest_point(between).position.distance_squared(between) <= allowed * allowed
            && !tissue.no_go().is_some_and(|no_go| no_go.forbids(between))
    })
}

/// The furthest sample; of equally far ones, the first.
fn furthest(distances: &[f32]) -> u32 {
    (1..distances.len()).fold(0, |best, index| if distances[index] > distances[best] { index } else { best }) as u32
}
