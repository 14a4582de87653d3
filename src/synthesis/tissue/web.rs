//! Samples of a tissue, joined to their nearest neighbours: distances along the tissue, for all who place something in it.
//!
//! In: a tissue. Out: samples, the same for every seed, and links between those with no gap in between, as by Tenenbaum,
//! de Silva and Langford, "A Global Geometric Framework for Nonlinear Dimensionality Reduction" (2000): so the two ends of a
//! bent organ are far apart, and separate parts are not joined at all.
//!
//! A web takes some tens of milliseconds on the mesh of an organ. A tissue that [keeps](super::Tissue::derived) its own has
//! it made once.

use super::derived::{Derived, Links, Web};
use super::{Tissue, TissuePoint};
use crate::synthesis::pace::{Pace, SHORT_STRETCH, at_once};
use crate::synthesis::random::{Stream, VesselRng};
use bevy_math::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::{num::NonZeroUsize, ops::Range};

/// Number of samples.
pub(crate) const SAMPLES: u32 = 1024;
/// Draws per sample after which a tissue counts as exhausted.
const DRAWS_PER_SAMPLE: u32 = 64;
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
pub(crate) const FACING: f32 = 0.5;

/// Makes what starts of growths need of a tissue, unless it is there.
pub(super) async fn prepare(tissue: &dyn Tissue, derived: &Derived, pace: &Pace) {
    if derived.known_web().is_none() {
        let web = over_paced(tissue, pace).await;
        derived.web(|| web);
    }
    pace.rest(1.0).await;
}

/// The web over a tissue.
pub(crate) fn web<'a>(tissue: &dyn Tissue, derived: &'a Derived) -> &'a Web {
    derived.web(|| at_once(over_paced(tissue, &Pace::default())))
}

async fn over_paced(tissue: &dyn Tissue, pace: &Pace) -> Web {
    let mut samples = Vec::new();
    let mut positions = draw(tissue, SAMPLES, &mut Stream::Tissue.rng(0)).into_iter();
    let count = positions.len();
    let take = |part: Range<usize>| {
        let points = positions.by_ref().take(part.len());
        samples.extend(points.map(|position| TissuePoint { position, ..tissue.closest_point(position) }));
    };
    pace.part(0.0..0.1).stretches(count, SHORT_STRETCH, take).await;
    let pairs = nearest_pairs(&samples, &pace.part(0.1..0.3)).await;
    let mut linked = Vec::with_capacity(pairs.len());
    let link = |part: Range<usize>| {
        for &(a, b) in &pairs[part] {
            let ends = [samples[a as usize], samples[b as usize]];
            if leads_through(tissue, ends) {
                // A vessel keeps its direction for a while, so bends of the surface slow it down. Twice the bend is what
                // the folds of real organs ask for, so that each of their parts is supplied.
                let bend = ends[0].normal.distance(ends[1].normal);
                let length = ends[0].position.distance(ends[1].position) * (1.0 + 2.0 * bend);
                linked.push((a, b, length));
            }
        }
    };
    pace.part(0.3..1.0).stretches(pairs.len(), SHORT_STRETCH, link).await;
    let links = Links::between(samples.len(), &linked);
    let (positions, normals) = samples.iter().map(|sample| (sample.position, sample.normal)).unzip();
    Web { positions, normals, links }
}

/// Samples of the tissue, beginning with its [entrance](Tissue::entrance) if it has one. Fewer than wanted if draws
/// fail.
pub(crate) fn draw(tissue: &dyn Tissue, wanted: u32, rng: &mut VesselRng) -> Vec<Vec3> {
    let draws = (0..wanted * DRAWS_PER_SAMPLE).filter_map(|_| tissue.sample(rng));
    tissue.entrance().into_iter().chain(draws).take(wanted as usize).collect()
}

/// Pairs of each sample and its nearest neighbours, each pair once, in the order of the indices.
async fn nearest_pairs(samples: &[TissuePoint], pace: &Pace) -> Vec<(u32, u32)> {
    let points: Vec<[f32; 3]> = samples.iter().map(|sample| sample.position.to_array()).collect();
    // Fails without points, or for more than a u32 can count. Then every sample is a separate piece.
    let Ok(index) = ImmutableKdTree::<f32, 3>::new_from_slice(&points) else { return Vec::new() };
    let mut pairs = Vec::with_capacity(samples.len() * LINKS.get());
    let find = |part: Range<usize>| {
        for sample in part {
            // One more, since the nearest one is the sample itself.
            let nearest =
                index.query(&points[sample]).nearest_n::<SquaredEuclidean<f32>>(LINKS.saturating_add(1)).execute();
            let others = nearest.iter().map(|found| found.item).filter(|&other| other != sample as u32);
            pairs.extend(others.map(|other| (other.min(sample as u32), other.max(sample as u32))));
        }
    };
    pace.stretches(points.len(), SHORT_STRETCH, find).await;
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
