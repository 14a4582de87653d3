//! Guides: polylines along which large vessels grow before the tissue around them is filled (Rauch & Harders 2021, Fig.
//! 4).

use crate::synthesis::{
    mesh::is_usable,
    pace::{Pace, SHORT_STRETCH, at_once},
    random::VesselRng,
    space::bvh::{Bounds, BoxTree},
    tissue::{
        Extent, Tissue, TissuePoint,
        error::{TissueError, finite, finite_point},
        shape::in_unit_ball,
    },
};
use bevy_math::{
    Vec3,
    bounding::{Aabb3d, BoundingVolume},
};
use rand::RngExt;
use std::{ops::Range, sync::Arc};

/// Pieces that a guide is cut into when it is laid on another tissue.
const PIECES: f32 = 256.0;
/// Cost of laying one of them, in items of other work.
const WORK_OF_PIECE: usize = 8;
/// Most points of a guide.
const MAX_POINTS: usize = 1 << 20;
/// Most tries at a sample.
const TRIES: u32 = 16;
/// Tolerance for a guide's own points, relative to its length.
const TOLERANCE: f32 = 1.0e-5;

/// A polyline with a deviation: the tube around it in which points are drawn.
///
/// Points are drawn uniformly along the line and displaced within a ball of the deviation's radius. A guide laid
/// [over](Self::over) a surface keeps to the surface.
#[derive(Clone, Debug)]
pub struct GuidePath {
    points: Vec<Vec3>,
    /// Length of the line up to each point.
    lengths: Vec<f32>,
    /// Deviation at the beginning and at the end.
    deviations: [f32; 2],
    index: BoxTree,
    base: Option<Arc<dyn Tissue>>,
    /// Distance from the line, besides the deviation, within which the tissue below may lie.
    slack: f32,
}

/// A place on the line.
struct Foot {
    position: Vec3,
    /// Share of the line's length before it.
    share: f32,
    distance: f32,
}

impl GuidePath {
    /// A guide along `points`, with this `deviation` over its whole length.
    ///
    /// # Errors
    /// Fewer than two points, points that all coincide, coordinates that are not finite, a deviation below 0.
    pub fn new(points: Vec<Vec3>, deviation: f32) -> Result<Self, TissueError> {
        at_once(Self::new_paced(points, deviation, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(points: Vec<Vec3>, deviation: f32, pace: &Pace) -> Result<Self, TissueError> {
        Self::build(points, [check_deviation(deviation)?; 2], pace).await
    }

    /// Work of laying a guide of so many points [over](Self::over) a tissue, in items. Each piece takes two searches
    /// for the nearest point.
    pub(super) fn work(points: usize) -> usize {
        WORK_OF_PIECE * (points + PIECES as usize)
    }

    /// The same guide with a deviation that changes linearly to this value at its end.
    ///
    /// # Errors
    /// A deviation that is below 0 or not finite.
    pub fn with_end_deviation(mut self, deviation: f32) -> Result<Self, TissueError> {
        self.deviations[1] = check_deviation(deviation)?;
        Ok(self)
    }

    /// The same guide laid on another tissue: it follows the tissue's nearest points, and so do the points drawn from it.
    ///
    /// # Errors
    /// A guide whose points all move to one point.
    pub fn over(self, base: Arc<dyn Tissue>) -> Result<Self, TissueError> {
        at_once(self.over_paced(base, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`over`](Self::over).
    pub async fn over_paced(self, base: Arc<dyn Tissue>, pace: &Pace) -> Result<Self, TissueError> {
        let (laying, building, measuring) = (pace.part(0.0..0.4), pace.part(0.4..0.6), pace.part(0.6..1.0));
        let spacing = self.length() / PIECES;
        let mut points = vec![base.closest_point(self.points[0]).position];
        for (number, pair) in self.points.windows(2).enumerate() {
            let pieces = (pair[0].distance(pair[1]) / spacing).ceil().max(1.0);
            for piece in 1..=pieces as u32 {
                points.push(base.closest_point(pair[0].lerp(pair[1], piece as f32 / pieces)).position);
                if points.len().is_multiple_of(SHORT_STRETCH) {
                    laying.rest(number as f32 / self.points.len() as f32).await;
                }
            }
        }
        let mut laid = Self::build(points, self.deviations, &building).await?;
        let mut widest = 0.0f32;
        let measure = |gaps: Range<usize>| {
            for gap in gaps {
                let middle = laid.points[gap].midpoint(laid.points[gap + 1]);
                widest = widest.max(base.closest_point(middle).position.distance(middle));
            }
        };
        measuring.stretches(laid.points.len() - 1, SHORT_STRETCH, measure).await;
        laid.slack = 2.0 * widest;
        laid.base = Some(base);
        Ok(laid)
    }

    async fn build(points: Vec<Vec3>, deviations: [f32; 2], pace: &Pace) -> Result<Self, TissueError> {
        if points.len() < 2 || points.len() > MAX_POINTS {
            return Err(TissueError::GuidePoints { points: points.len(), limit: MAX_POINTS });
        }
        if let Some(bad) = pace.part(0.0..0.1).find(points.len(), |point| !is_usable(points[point])).await {
            finite_point("a point of a guide", points[bad])?;
        }
        let mut length = 0.0;
        let mut lengths = vec![0.0];
        let measure = |segment: usize| {
            length += points[segment].distance(points[segment + 1]);
            lengths.push(length);
        };
        pace.part(0.1..0.2).each(points.len() - 1, measure).await;
        if !(length > 0.0 && length.is_finite()) {
            return Err(TissueError::GuideLength { length });
        }
        let around = |segment: usize| Bounds::around(&points[segment..segment + 2]);
        let index = BoxTree::new_paced(points.len() - 1, around, &pace.part(0.2..1.0)).await;
        Ok(Self { points, lengths, deviations, index, base: None, slack: 0.0 })
    }

    /// Length of the line.
    pub fn length(&self) -> f32 {
        self.lengths[self.lengths.len() - 1]
    }

    fn deviation(&self, share: f32) -> f32 {
        self.deviations[0] + (self.deviations[1] - self.deviations[0]) * share
    }

    /// Largest distance from the line of a point at a foot.
    fn reach(&self, foot: &Foot) -> f32 {
        self.deviation(foot.share) + self.slack + TOLERANCE * self.length()
    }

    /// The nearest place on the line. `None` for a point that is not finite.
    fn foot(&self, point: Vec3) -> Option<Foot> {
        let mut found: Option<(f32, usize, f32)> = None;
        self.index.nearest(point, f32::INFINITY, |slot, best| {
            let segment = self.index.order()[slot] as usize;
            let (from, to) = (self.points[segment], self.points[segment + 1]);
            let along = to - from;
            let squared = along.length_squared();
            let part = if squared > 0.0 { ((point - from).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
            let distance = (from + along * part).distance_squared(point);
            if distance < best || found.is_none() {
                found = Some((distance, segment, part));
                return distance;
            }
            best
        });
        let (distance, segment, part) = found.filter(|_| point.is_finite())?;
        let length = self.lengths[segment] + (self.lengths[segment + 1] - self.lengths[segment]) * part;
        Some(Foot {
            position: self.points[segment].lerp(self.points[segment + 1], part),
            share: length / self.length(),
            distance: distance.sqrt(),
        })
    }

    /// The place at a length along the line.
    fn at(&self, length: f32) -> Vec3 {
        let segment = self.lengths.partition_point(|&before| before <= length).clamp(1, self.points.len() - 1) - 1;
        let (before, after) = (self.lengths[segment], self.lengths[segment + 1]);
        let part = if after > before { (length - before) / (after - before) } else { 0.0 };
        self.points[segment].lerp(self.points[segment + 1], part.clamp(0.0, 1.0))
    }

    fn on_base(&self, point: Vec3) -> TissuePoint {
        match &self.base {
            Some(base) => base.closest_point(point),
            None => TissuePoint::new(point, Vec3::ZERO),
        }
    }
}

impl Tissue for GuidePath {
    fn bounds(&self) -> Aabb3d {
        let line = Bounds::around(&self.points);
        let widest = self.deviations[0].max(self.deviations[1]) + self.slack;
        Aabb3d { min: line.min, max: line.max }.grow(bevy_math::Vec3A::splat(widest))
    }

    fn extent(&self) -> Extent {
        Extent::Length(self.length())
    }

    /// Whether the point is within the deviation of the line, and on the tissue that the guide is laid on.
    fn contains(&self, point: Vec3) -> bool {
        self.foot(point).is_some_and(|foot| foot.distance <= self.reach(&foot))
            && self.base.as_ref().is_none_or(|base| base.contains(point))
    }

    /// The nearest point of the tube around the line; if it tapers, from the nearest place on the line.
    fn closest_point(&self, point: Vec3) -> TissuePoint {
        let Some(foot) = self.foot(point) else { return TissuePoint::new(point, Vec3::ZERO) };
        let offset = (point - foot.position).clamp_length_max(self.deviation(foot.share));
        let found = self.on_base(foot.position + offset);
        // If the tissue below bends away, the line itself is always near enough.
        if self.contains(found.position) { found } else { self.on_base(foot.position) }
    }

    fn has_facets(&self) -> bool {
        self.base.as_ref().is_some_and(|base| base.has_facets())
    }

    /// Towards the point of the tube nearest to the straight end, along the tissue that the guide is laid on.
    fn walk(
        &self,
        from: &TissuePoint,
        direction: Vec3,
        length: f32,
        tolerance: f32,
        arrive: &mut dyn FnMut(TissuePoint),
    ) {
        let end = self.closest_point(from.position + direction * length);
        let Some(base) = self.base.as_ref().filter(|_| from.facet.is_some()) else { return arrive(end) };
        let (direction, length) = (end.position - from.position).normalize_and_length();
        let mut last = None;
        base.walk(from, direction, length, tolerance, &mut |place| {
            last.replace(place).into_iter().for_each(&mut *arrive);
        });
        last.map(|place| self.closest_point(place.position)).into_iter().for_each(arrive);
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        (0..TRIES).find_map(|_| {
            let length = rng.random::<f32>() * self.length();
            let displacement = in_unit_ball(rng)? * self.deviation(length / self.length());
            let point = self.on_base(self.at(length) + displacement).position;
            self.contains(point).then_some(point)
        })
    }

    fn entrance(&self) -> Option<Vec3> {
        Some(self.points[0])
    }
}

fn check_deviation(deviation: f32) -> Result<f32, TissueError> {
    if finite("the deviation of a guide", deviation)? < 0.0 {
        return Err(TissueError::Negative { what: "the deviation of a guide", value: deviation });
    }
    Ok(deviation)
}
