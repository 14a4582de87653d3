//! Samples of a tissue, joined to their nearest neighbours: distances along the tissue, for all who place something in it.
//!
//! In: a tissue. Out: samples, the same for every seed, and links between those with no gap in between, as by Tenenbaum,
//! de Silva and Langford, "A Global Geometric Framework for Nonlinear Dimensionality Reduction" (2000): so the two ends of a
//! bent organ are far apart, and separate parts are not joined at all.
//!
//! A web takes some tens of milliseconds on the mesh of an organ. A tissue that [keeps](super::Tissue::derived) its own has
//! it made once.

use super::{Tissue, TissuePoint};
use crate::synthesis::pace::{Pace, SHORT_STRETCH, at_once};
use crate::synthesis::random::{Stream, VesselRng};
use bevy_math::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::{
    num::NonZeroUsize,
    ops::Range,
    sync::{Arc, OnceLock},
};

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

/// What is derived from a tissue, made when it is first needed. A clone shares it.
#[derive(Clone, Debug, Default)]
pub struct Derived(Arc<Kept>);

#[derive(Debug, Default)]
struct Kept {
    web: OnceLock<Web>,
    hilum: OnceLock<(f32, Option<TissuePoint>)>,
}

impl Derived {
    /// Makes what starts of growths need, unless it is there.
    pub(super) async fn prepare(&self, tissue: &dyn Tissue, pace: &Pace) {
        if self.0.web.get().is_none() {
            let web = Web::over_paced(tissue, pace).await;
            self.0.web.get_or_init(|| web);
        }
        pace.rest(1.0).await;
    }

    /// The web over the tissue that this belongs to.
    pub(crate) fn web(&self, tissue: &dyn Tissue) -> &Web {
        self.0.web.get_or_init(|| at_once(Web::over_paced(tissue, &Pace::default())))
    }

    /// The floor of the tissue's deepest hollow, in a tissue of this diameter: what `find` gives, if it is not known.
    pub(crate) fn hilum(&self, diameter: f32, find: impl Fn() -> Option<TissuePoint>) -> Option<TissuePoint> {
        let &(of, floor) = self.0.hilum.get_or_init(|| (diameter, find()));
        // A stage may be part of tissues of different sizes.
        if of == diameter { floor } else { find() }
    }
}

/// Samples, joined to their nearest neighbours.
#[derive(Debug)]
pub(crate) struct Web {
    /// The samples; the first is the tissue's entrance, if it has one. Fewer than [`SAMPLES`] if draws fail.
    pub samples: Vec<TissuePoint>,
    pub links: Links,
}

/// The links of every sample.
#[derive(Clone, Debug)]
pub(crate) struct Links {
    starts: Vec<u32>,
    links: Vec<Link>,
}

/// A link from a sample to another one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub to: u32,
    /// How far vessels must grow.
    pub length: f32,
}

impl Links {
    /// Links between pairs of samples, each pair once, with a length.
    fn between(samples: usize, pairs: &[(u32, u32, f32)]) -> Self {
        let mut starts = vec![0; samples + 1];
        for &(a, b, _) in pairs {
            starts[a as usize + 1] += 1;
            starts[b as usize + 1] += 1;
        }
        for sample in 1..starts.len() {
            starts[sample] += starts[sample - 1];
        }
        let mut ends = starts.clone();
        let mut links = vec![Link { to: 0, length: 0.0 }; 2 * pairs.len()];
        for &(a, b, length) in pairs {
            for (from, to) in [(a, b), (b, a)] {
                let place = &mut ends[from as usize];
                links[*place as usize] = Link { to, length };
                *place += 1;
            }
        }
        Self { starts, links }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The links of a sample. Those of infinite length are cut.
    pub fn of(&self, sample: u32) -> &[Link] {
        &self.links[self.starts[sample as usize] as usize..self.starts[sample as usize + 1] as usize]
    }

    /// Cuts the link between two samples.
    pub fn cut(&mut self, a: u32, b: u32) {
        for (from, to) in [(a, b), (b, a)] {
            let own = self.starts[from as usize] as usize..self.starts[from as usize + 1] as usize;
            self.links[own].iter_mut().filter(|link| link.to == to).for_each(|link| link.length = f32::INFINITY);
        }
    }
}

impl Web {
    async fn over_paced(tissue: &dyn Tissue, pace: &Pace) -> Self {
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
        Self { samples, links }
    }
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
