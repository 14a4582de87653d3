//! The tissue as a domain: how deep a point lies, and whether a segment stays inside.
//!
//! Depths of a mesh are searched for, so the domain keeps some of them, which bound all others. Only where the bounds
//! do not decide, near the border, the mesh is asked.

use super::{depths::Depths, error::CcoError, power::cube_root, settings::CcoSettings};
use crate::synthesis::{
    segment_index::round_cone::RoundCone,
    tissue::{Derived, Extent, Tissue},
};
use bevy_math::{DVec3, Vec3};
use std::sync::Arc;

/// Excess of depth, as a share of what is needed, at which a segment that is traced counts as inside. It is the least
/// step of the trace, too.
const MARGIN: f64 = 0.01;
/// Most diagonals of the tissue between it and the origin: an f32 has some hundred steps along it there.
const FARTHEST: f32 = 65_536.0;
/// Steps along the tissue's diagonal in which what cannot tell distances is asked whether it forbids a vessel.
const STEPS: f64 = 512.0;

/// A tissue with a border.
#[derive(Clone, Debug)]
pub(super) struct Domain {
    tissue: Arc<dyn Tissue>,
    /// 2 for an area, 3 for a volume.
    pub dimension: u32,
    /// Area or volume.
    pub measure: f64,
    /// Lowest corner of a box around the tissue, along [`axes`](Self::axes).
    pub corner: DVec3,
    /// Perpendicular unit vectors, the last of which is an area's normal.
    pub axes: [DVec3; 3],
    /// Sides of that box; the last is 0 for an area.
    pub sides: DVec3,
    /// Distance that vessels keep from the border.
    pub border: f64,
    depths: Option<Arc<Depths>>,
    /// What was derived from the tissue, if it keeps nothing itself.
    pub derived: Derived,
}

impl Domain {
    /// A tissue whose vessels may touch its border.
    ///
    /// # Errors
    /// A tissue without an inside, or too far from the origin.
    pub(super) fn new(tissue: Arc<dyn Tissue>) -> Result<Self, CcoError> {
        if tissue.stage(1).is_some() {
            return Err(CcoError::NoInside { tissue: "a tissue in stages" });
        }
        let bounds = tissue.bounds();
        let (min, max) = (Vec3::from(bounds.min), Vec3::from(bounds.max));
        let (distance, size) = (min.abs().max(max.abs()).max_element(), min.distance(max));
        if distance > FARTHEST * size {
            return Err(CcoError::TooFarAway { distance, size });
        }
        let center = 0.5 * (min + max);
        if tissue.depth(center).is_none() {
            return Err(CcoError::NoInside {
                tissue: match tissue.extent() {
                    Extent::Length(_) => "a curve",
                    Extent::Area(_) => "a curved surface, or an area whose border is not known,",
                    Extent::Volume(_) | Extent::Sheet { .. } => "a volume whose border is not known",
                },
            });
        }
        let (dimension, measure, axes) = match tissue.extent() {
            Extent::Length(_) => return Err(CcoError::NoInside { tissue: "a curve" }),
            Extent::Area(area) => {
                let normal = tissue.closest_point(center).normal;
                let (x, y) = normal.any_orthonormal_pair();
                (2, f64::from(area), [x, y, normal].map(|axis| axis.as_dvec3()))
            }
            Extent::Volume(volume) | Extent::Sheet { volume, .. } => (3, f64::from(volume), DVec3::AXES),
        };
        // The box along the axes around all corners of the bounds.
        let corners = (0..8).map(|corner: usize| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] };
            let point = DVec3::new(pick(0).into(), pick(1).into(), pick(2).into());
            DVec3::from_array(axes.map(|axis| axis.dot(point)))
        });
        let (low, high) = corners.fold((DVec3::MAX, DVec3::MIN), |(low, high), at| (low.min(at), high.max(at)));
        let mut sides = high - low;
        let mut low = low;
        if dimension == 2 {
            low.z = center.as_dvec3().dot(axes[2]);
            sides.z = 0.0;
        }
        let corner = axes[0] * low.x + axes[1] * low.y + axes[2] * low.z;
        let depths = tissue.depth_is_searched().then(|| Arc::new(Depths::new(&*tissue, min, max)));
        Ok(Self { tissue, dimension, measure, corner, axes, sides, border: 0.0, depths, derived: Derived::default() })
    }

    pub(super) fn tissue(&self) -> &Arc<dyn Tissue> {
        &self.tissue
    }

    /// Millimetres of a tissue length, if the whole tissue has its physical size.
    pub(super) fn millimetres(&self, settings: &CcoSettings) -> f64 {
        let share = f64::from(settings.perfusion) / self.measure;
        if self.dimension == 2 { share.sqrt() } else { cube_root(share) }
    }

    /// The diagonal of the tissue's box.
    pub(super) fn diagonal(&self) -> f64 {
        self.sides.length()
    }

    /// Density of terminals at a point, from 0 to 1.
    pub(super) fn density(&self, point: DVec3) -> f64 {
        self.tissue.density(point.as_vec3()).into()
    }

    /// Whether that is 1 everywhere.
    pub(super) fn is_uniform(&self) -> bool {
        self.tissue.is_uniform()
    }

    fn searched(&self, point: DVec3) -> f64 {
        self.tissue.depth(point.as_vec3()).map_or(f64::NEG_INFINITY, f64::from)
    }

    /// Bounds of the depth of a point: equal, unless they are on one side of `need`.
    fn depth_bounds(&self, point: DVec3, need: f64) -> [f64; 2] {
        let known = self.depths.as_ref().and_then(|depths| depths.bounds(&*self.tissue, point.as_vec3(), need));
        known.unwrap_or_else(|| [self.searched(point); 2])
    }

    /// Whether a point lies so deep in the tissue, and is not forbidden.
    pub(super) fn holds_point(&self, point: DVec3, radius: f64) -> bool {
        let need = radius + self.border;
        self.depth_bounds(point, need)[0] >= need
            && !self.tissue.no_go().is_some_and(|field| field.forbids(point.as_vec3()))
    }

    /// An upper bound of the depth of a point, and whether it may be reached by the tissue within `reach`.
    pub(super) fn may_be_within(&self, point: DVec3, reach: f64) -> bool {
        match &self.depths {
            Some(depths) => depths.may_be_above(&*self.tissue, point.as_vec3(), -reach),
            None => self.searched(point) >= -reach,
        }
    }

    /// How deep a point lies, at least.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        self.searched(point)
    }

    /// Whether a segment is inside, with its distance from the border, and nowhere forbidden. It may be no wider at its
    /// end than at its start.
    ///
    /// A vessel enters the tissue at its root. So the segment from a root may be nearer to the border, or to what is
    /// forbidden, on its first stretch, twice as long as what is needed.
    pub(super) fn holds(&self, cone: &RoundCone, is_entrance: bool) -> bool {
        self.keeps_in(cone, is_entrance) && !self.forbids(cone, is_entrance)
    }

    /// Whether a segment leads through what is forbidden.
    fn forbids(&self, &RoundCone { start, end, start_radius, .. }: &RoundCone, is_entrance: bool) -> bool {
        let Some(field) = self.tissue.no_go() else { return false };
        let length = start.distance(end);
        let free = if is_entrance { (2.0 * start_radius).min(length) } else { 0.0 };
        let beyond = start.lerp(end, free / length.max(f64::MIN_POSITIVE));
        let is_met = |way: [DVec3; 2], radius: f64| field.forbids_way(way, radius, || self.points_of(way, radius));
        is_met([beyond, end], start_radius) || is_entrance && is_met([start, end], 0.0)
    }

    /// Points of a segment on its axis and, where it is wide, around that: no farther apart than a step along it.
    fn points_of(&self, [from, to]: [DVec3; 2], radius: f64) -> impl Iterator<Item = Vec3> {
        let (way, step) = (to - from, self.diagonal() / STEPS);
        let count = (way.length() / step).ceil().max(1.0);
        let (across, up) = match self.dimension {
            2 => (self.axes[2].cross(way).normalize_or_zero(), DVec3::ZERO),
            _ => way.normalize_or(DVec3::X).any_orthonormal_pair(),
        };
        let around = [across, -across, up, -up].map(|side| side * radius);
        let sides = if 2.0 * radius > step { 4 } else { 0 };
        let along = (0..=count as u32).map(move |at| from + way * (f64::from(at) / count));
        along.flat_map(move |at| {
            let wall = around.into_iter().take(sides).map(move |side| at + side);
            std::iter::once(at).chain(wall).map(|point| point.as_vec3())
        })
    }

    fn keeps_in(&self, cone: &RoundCone, is_entrance: bool) -> bool {
        let &RoundCone { start, end, start_radius, end_radius } = cone;
        let length = start.distance(end);
        let need = |at: f64| self.border + start_radius + (end_radius - start_radius) * (at / length);
        let most = self.border + start_radius;
        // Sphere tracing: as deep as a point lies, so far along the segment nothing can be outside.
        if self.depth_bounds(start.midpoint(end), most + 0.5 * length)[0] >= most + 0.5 * length {
            return true;
        }
        let direction = (end - start) / length.max(f64::MIN_POSITIVE);
        let mut at = if is_entrance { (2.0 * most).min(length) } else { 0.0 };
        while at < length {
            let (point, need) = (start + direction * at, need(at));
            let enough = need * (1.0 + MARGIN);
            let depth = self.depth_bounds(point, enough)[0];
            if depth < enough {
                return false;
            }
            at += depth - need;
        }
        // The end itself is a node, on which other segments rely.
        let enough = (self.border + end_radius) * (1.0 + MARGIN);
        self.depth_bounds(end, enough)[0] >= enough
    }
}
