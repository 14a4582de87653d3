//! What is seen of vessels at a point of the surface.
//!
//! Vessels are projected on the plane of the surface along its normal. The axis of a vessel has a distance from the
//! point in that plane, and a depth below it. The distance says how much of the vessel is seen, by the closed forms of
//! [`profile`](super::profile); the depth, how blurred and faint it is.

use super::atlas::Tensor;
use super::cones::{Cone, Cones};
use super::gauss::{Gauss, SEEN};
use super::look::VesselLook;
use super::profile::{across, beyond_end};
use bevy_math::Vec3;
use std::ops::Range;

/// Share of a segment's length, squared, below which its projection is a point: it runs along the normal.
const UPRIGHT: f32 = 1.0e-8;
/// Least blur, in radii: an edge too sharp for any texel.
const SHARPEST: f32 = 1.0e-3;

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceSpot {
    /// Its position from the origin of the vessels that are near.
    pub at: Vec3,
    pub normal: Vec3,
    /// Variance of the blur of the texel.
    pub footprint: Tensor,
}

/// A segment near some points, with its start from their origin.
#[derive(Clone, Debug)]
pub(super) struct Near {
    pub cone: u32,
    start: Vec3,
    /// Square of the distance from the axis up to which it is seen.
    reach_squared: f32,
    /// Columns and rows of texels from which it can be seen.
    columns: Range<i32>,
    rows: Range<i32>,
}

impl Near {
    /// A segment with its start from some origin, in a window of texels from which it is seen within `reach` of its axis.
    pub fn new(cone: u32, start: Vec3, reach: f32, [columns, rows]: [Range<i64>; 2]) -> Self {
        let [columns, rows] = [columns, rows].map(|range| range.start as i32..range.end as i32);
        Self { cone, start, reach_squared: reach * reach, columns, rows }
    }

    /// Whether it can be seen from a row of texels.
    pub fn is_in_row(&self, row: i32) -> bool {
        self.rows.contains(&row)
    }
}

/// What is seen of the vessels of one network.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Depth of the axis, in tissue lengths.
    pub depth: f32,
    /// Opacity.
    pub alpha: f32,
    /// Share of the surface that lies over the vessel.
    pub cover: f32,
    pub color: [f32; 3],
    pub roughness: f32,
}

/// What is seen of all vessels at a point.
#[derive(Debug, Default)]
pub(super) struct Sight {
    /// The most opaque vessel of each network that is seen at all.
    pub seen: Vec<Seen>,
    /// Height over the surface, and how it changes along it.
    pub height: f32,
    pub slope: Vec3,
    /// The cone that covers the point and comes nearest to the surface, and the depth of its axis.
    pub covering: Option<(u32, f32)>,
}

impl Sight {
    /// Looks at a point of a column of texels. `near` are the segments in reach of its row, by rising number.
    pub fn look(&mut self, cones: &Cones, near: &[Near], column: i32, spot: impl FnOnce() -> SurfaceSpot) {
        self.seen.clear();
        (self.height, self.slope, self.covering) = (0.0, Vec3::ZERO, None);
        let mut near = near.iter().filter(|segment| segment.columns.contains(&column)).peekable();
        if near.peek().is_none() {
            return;
        }
        let (spot, gauss, mut layer, mut top) = (spot(), Gauss::table(), u32::MAX, f32::INFINITY);
        for segment in near {
            let cone = &cones.cones[segment.cone as usize];
            let Some(meeting) = Meeting::of(segment, cone, cones, &spot) else { continue };
            let look = &cones.looks[cone.layer as usize].look;
            let (height, slope) = meeting.height(gauss, cone, look.bump);
            if height.abs() > self.height.abs() {
                (self.height, self.slope) = (height, slope);
            }
            if meeting.distance <= meeting.radius {
                let (radius, distance) = (meeting.radius, meeting.distance);
                let nearest = meeting.depth - (radius * radius - distance * distance).max(0.0).sqrt();
                if nearest < top {
                    (top, self.covering) = (nearest, Some((segment.cone, meeting.depth)));
                }
            }
            let cover = meeting.cover(gauss, cone);
            let alpha = look.strength * cover;
            if alpha <= 0.0 {
                continue;
            }
            let mut seen = Seen { depth: meeting.depth, alpha, cover, color: [0.0; 3], roughness: look.roughness };
            match self.seen.last_mut().filter(|_| layer == cone.layer) {
                Some(best) if best.alpha >= alpha => {}
                best => {
                    let deepest = cones.looks[cone.layer as usize].deepest;
                    let deep = (meeting.depth / deepest).clamp(0.0, 1.0);
                    seen.color = std::array::from_fn(|channel| {
                        let [thin, wide] = [look.thin_color[channel], look.wide_color[channel]];
                        let color = thin + (wide - thin) * meeting.shade;
                        color + (look.deep_color[channel] - color) * deep
                    });
                    match best {
                        Some(best) => *best = seen,
                        None => self.seen.push(seen),
                    }
                }
            }
            layer = cone.layer;
        }
    }

    /// The color seen over a base, and the roughness over that of the base: the deepest network first.
    pub fn over(&mut self, base: [f32; 3], base_roughness: f32) -> ([f32; 3], f32) {
        // The sort is stable, so networks of one depth stay in their order.
        self.seen.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        self.seen.iter().fold((base, base_roughness), |(color, roughness), seen| {
            let mixed = std::array::from_fn(|k| color[k] + (seen.color[k] - color[k]) * seen.alpha);
            (mixed, roughness + (seen.roughness - roughness) * seen.cover)
        })
    }
}

/// A segment as it is seen from a point.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    /// Share of the axis that is nearest to the point in the plane, before and after it is cut at the ends.
    free: f32,
    share: f32,
    /// From the point to that place, in the plane.
    offset: Vec3,
    distance: f32,
    /// The segment in the plane, and its squared length.
    along: Vec3,
    length_squared: f32,
    radius: f32,
    depth: f32,
    /// Variance of the blur of the texel across the vessel, and standard deviation of all blur.
    sigma: f32,
    /// Blur in radii at the surface and by depth: how the blur without the texel's grows with the radius.
    widening_blur: f32,
    own_blur: f32,
    /// Part that depth and ends leave of the vessel, and how it changes along the axis.
    visible: f32,
    visible_along: f32,
    shade: f32,
}

impl Meeting {
    /// `None` if the segment is not seen.
    fn of(near: &Near, cone: &Cone, cones: &Cones, spot: &SurfaceSpot) -> Option<Self> {
        let to_start = near.start - spot.at;
        let (up, rise) = (to_start.dot(spot.normal), cone.along.dot(spot.normal));
        let (start, along) = (to_start - spot.normal * up, cone.along - spot.normal * rise);
        let length_squared = along.length_squared();
        let is_upright = !(length_squared > UPRIGHT * cone.along.length_squared());
        let free = if is_upright { f32::from(u8::from(rise > 0.0)) } else { -start.dot(along) / length_squared };
        let share = free.clamp(0.0, 1.0);
        let offset = start + along * share;
        let squared = offset.length_squared();
        if squared > near.reach_squared {
            return None;
        }
        let (below, limit, look) = (-(up + rise * share), cone.max_depth, &cones.looks[cone.layer as usize].look);
        // A straight segment leaves a curved surface.
        let below = below.signum() * (below.abs() - cone.chord).max(0.0);
        if !(below.abs() < limit) {
            return None;
        }
        let radius = cone.start_radius + cone.widening * share;
        let depth = below.max(0.0) + look.depth * radius;
        // Above the surface it fades by its height, below by its depth.
        let square = |length: f32| (length / limit) * (length / limit);
        let not_above = 1.0 - square(below.min(0.0));
        let by_depth = (1.0 - square(depth)).max(0.0) * not_above;
        let (fade, fade_along) = fade(cone, share);
        let visible = by_depth * fade;
        if visible <= 0.0 {
            return None;
        }
        let distance = squared.sqrt();
        let across = if distance > 0.0 { offset / distance } else { spot.normal.cross(along).normalize_or_zero() };
        let spread = if look.scatter * depth < VesselLook::MOST_SPREAD * radius - look.blur * radius {
            look.scatter * look.depth
        } else {
            (VesselLook::MOST_SPREAD - look.blur).max(0.0)
        };
        let widening_blur = look.blur + spread;
        let own_blur = look.blur_at(radius, depth);
        let variance = quadratic(&spot.footprint, across).max(0.0) + own_blur * own_blur;
        let sigma = variance.sqrt().max(SHARPEST * radius);
        if distance > radius + SEEN * look.with_mound(sigma, radius) {
            return None;
        }
        let depth_along = -2.0 * depth * look.depth * cone.widening / (limit * limit) * not_above;
        Some(Self {
            free: if is_upright { share } else { free },
            share,
            offset: across * distance,
            distance,
            along,
            length_squared,
            radius,
            depth,
            sigma,
            widening_blur,
            own_blur,
            visible,
            visible_along: fade_along * by_depth + fade * depth_along,
            shade: cone.shade[0] + (cone.shade[1] - cone.shade[0]) * share,
        })
    }

    /// Share of the surface that lies over the vessel, as far as it can be seen.
    fn cover(&self, gauss: &Gauss, cone: &Cone) -> f32 {
        if !(cone.is_end[0] || cone.is_end[1]) {
            return self.visible * across(gauss, self.distance, self.radius, self.sigma).value;
        }
        let length = self.length_squared.sqrt();
        // Beyond the ends, the distance is that from the axis' line.
        let beside = self.offset + self.along * (self.free - self.share);
        let beyond = [-self.free * length, (self.free - 1.0) * length];
        let aside = if cone.is_end[0] && self.free < 0.0 || cone.is_end[1] && self.free > 1.0 {
            beside.length()
        } else {
            self.distance
        };
        let mut cover = across(gauss, aside, self.radius, self.sigma).value;
        for (end, beyond) in beyond.into_iter().enumerate().filter(|(end, _)| cone.is_end[*end]) {
            let radius = cone.start_radius + cone.widening * end as f32;
            cover -= beyond_end(gauss, (beyond, aside), radius, self.sigma);
        }
        self.visible * cover.max(0.0)
    }

    /// Height over the surface, and how it changes along it.
    fn height(&self, gauss: &Gauss, cone: &Cone, bump: f32) -> (f32, Vec3) {
        if bump == 0.0 {
            return (0.0, Vec3::ZERO);
        }
        let (r, mound) = (self.radius, VesselLook::MOUND * self.radius);
        let sigma = (self.sigma * self.sigma + mound * mound).sqrt();
        let covered = across(gauss, self.distance, r, sigma);
        let scale = bump * self.visible;
        let height = scale * r * covered.value;
        let toward = if self.distance > 0.0 { self.offset / self.distance } else { Vec3::ZERO };
        let mut slope = toward * (-scale * r * covered.by_distance);
        if self.free > 0.0 && self.free < 1.0 && self.length_squared > 0.0 {
            let blur_by_radius = (self.widening_blur * self.own_blur + VesselLook::MOUND * mound) / sigma;
            let by_radius = covered.value + r * (covered.by_radius + covered.by_sigma * blur_by_radius);
            let by_share = scale * by_radius * cone.widening + bump * self.visible_along * r * covered.value;
            slope += self.along * (by_share / self.length_squared);
        }
        (height, slope)
    }
}

/// How much ends leave of a vessel at a share of its axis, and how that changes along it.
fn fade(cone: &Cone, share: f32) -> (f32, f32) {
    let smooth = |[start, end]: [f32; 2]| {
        if start >= 1.0 && end >= 1.0 {
            return (1.0, 0.0);
        }
        let at = start + (end - start) * share;
        if at >= 1.0 {
            return (1.0, 0.0);
        }
        (at * at * (3.0 - 2.0 * at), 6.0 * at * (1.0 - at) * (end - start))
    };
    let ((tip, tip_along), (root, root_along)) = (smooth(cone.to_tip), smooth(cone.to_root));
    (tip * root, tip_along * root + tip * root_along)
}

/// A symmetric tensor's value in a direction.
pub(super) fn quadratic([xx, yy, zz, xy, xz, yz]: &Tensor, v: Vec3) -> f32 {
    v.x * (xx * v.x + 2.0 * (xy * v.y + xz * v.z)) + v.y * (yy * v.y + 2.0 * yz * v.z) + zz * v.z * v.z
}
