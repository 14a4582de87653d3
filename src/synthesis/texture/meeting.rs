//! Segments as they are seen from texels, eight at a time.
//!
//! A vessel is projected on the plane of the surface along its normal. Its axis has a distance from the texel in that
//! plane, and a depth below it. The distance says how much of the vessel is seen, by the closed forms of
//! [`profile`](super::profile); the depth, how blurred and faint it is.
//!
//! Loops have no branches, so that they work on several texels at a time.

use super::cones::Cone;
use super::gauss::SEEN;
use super::look::VesselLook;
use super::profile::{across, beyond_end};
use bevy_math::Vec3;

/// Texels at a time.
pub(super) const LANES: usize = 8;
/// A number for each of them.
pub(super) type Lanes = [f32; LANES];

/// Zero for each.
pub(super) const ZERO: Lanes = [0.0; LANES];
/// Share of a segment's length, squared, below which its projection is a point: it runs along the normal.
const UPRIGHT: f32 = 1.0e-8;
/// Least blur, in radii: an edge too sharp for any texel.
const SHARPEST: f32 = 1.0e-3;
/// Share of the squared radius below which a texel is on the axis.
const ON_AXIS: f32 = 1.0e-10;

/// Points of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spots {
    /// From the origin of the tile.
    pub at: [Lanes; 3],
    pub normal: [Lanes; 3],
    /// Variance of the blur of the texel: xx, yy, zz, xy, xz, yz.
    pub footprint: [Lanes; 6],
}

impl Spots {
    /// Nowhere near anything.
    pub const NOWHERE: Self = Self { at: [[1.0e15; LANES]; 3], normal: [ZERO; 3], footprint: [ZERO; 6] };
}

/// A segment as it is seen from some points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meetings {
    /// Place on the line of the axis that is nearest to the point in the plane, as a share of the segment, and that
    /// place cut at the ends.
    free: Lanes,
    pub share: Lanes,
    /// From the point to the latter, in the plane.
    offset: [Lanes; 3],
    pub distance: Lanes,
    /// The segment in the plane, and its squared length.
    along: [Lanes; 3],
    length_squared: Lanes,
    pub radius: Lanes,
    /// Depth of the axis.
    pub depth: Lanes,
    /// Standard deviation of all blur, and of that without the texel's; how the latter grows with the radius.
    sigma: Lanes,
    own_blur: Lanes,
    widening_blur: Lanes,
    /// Part that depth and ends leave of the vessel, and how it changes along the axis; 0 where the vessel isn't seen.
    pub visible: Lanes,
    visible_along: Lanes,
}

impl Meetings {
    /// A segment with its start from the origin of the points. `reach` is the distance from the axis up to which it can
    /// be seen there. `None` if it is seen from none.
    pub fn of(cone: &Cone, start: Vec3, reach: f32, look: &VesselLook, spots: &Spots) -> Option<Self> {
        let mut it = Self {
            free: ZERO,
            share: ZERO,
            offset: [ZERO; 3],
            distance: ZERO,
            along: [ZERO; 3],
            length_squared: ZERO,
            radius: ZERO,
            depth: ZERO,
            sigma: ZERO,
            own_blur: ZERO,
            widening_blur: ZERO,
            visible: ZERO,
            visible_along: ZERO,
        };
        let below = it.project(cone, start, reach, spots);
        if !is_any(&it.visible) {
            return None;
        }
        it.sink(cone, look, &below);
        it.blur(look, spots);
        is_any(&it.visible).then_some(it)
    }

    /// Projects the segment. Returns how far its axis is below the surface, less what doesn't count.
    #[inline(always)]
    fn project(&mut self, cone: &Cone, start: Vec3, reach: f32, spots: &Spots) -> Lanes {
        let (along, mut depths) = (cone.along, ZERO);
        let upright = UPRIGHT * along.length_squared();
        let ([px, py, pz], [nx, ny, nz]) = (&spots.at, &spots.normal);
        for k in 0..LANES {
            let (x, y, z) = (start.x - px[k], start.y - py[k], start.z - pz[k]);
            let up = x * nx[k] + y * ny[k] + z * nz[k];
            let rise = along.x * nx[k] + along.y * ny[k] + along.z * nz[k];
            let (x, y, z) = (x - nx[k] * up, y - ny[k] * up, z - nz[k] * up);
            let (ax, ay, az) = (along.x - nx[k] * rise, along.y - ny[k] * rise, along.z - nz[k] * rise);
            let squared = ax * ax + ay * ay + az * az;
            let is_upright = squared <= upright;
            let end = if rise > 0.0 { 1.0 } else { 0.0 };
            let nearest = -(x * ax + y * ay + z * az) / if is_upright { 1.0 } else { squared };
            let free = if is_upright { end } else { nearest };
            let share = if free > 0.0 { free } else { 0.0 };
            let share = if share < 1.0 { share } else { 1.0 };
            let (x, y, z) = (x + ax * share, y + ay * share, z + az * share);
            let distance = x * x + y * y + z * z;
            let below = -(up + rise * share);
            // A straight segment leaves a curved surface.
            let far = below.abs() - cone.chord;
            let far = if far > 0.0 { far } else { 0.0 };
            let is_near = distance <= reach * reach && far < cone.max_depth;
            self.visible[k] = if is_near { 1.0 } else { 0.0 };
            (self.free[k], self.share[k], self.distance[k], self.length_squared[k]) = (free, share, distance, squared);
            (self.offset[0][k], self.offset[1][k], self.offset[2][k]) = (x, y, z);
            (self.along[0][k], self.along[1][k], self.along[2][k]) = (ax, ay, az);
            depths[k] = if below < 0.0 { -far } else { far };
        }
        depths
    }

    /// Radius and depth, and what these leave of the vessel.
    #[inline(always)]
    fn sink(&mut self, cone: &Cone, look: &VesselLook, below: &Lanes) {
        let limit = 1.0 / (cone.max_depth * cone.max_depth);
        for (k, below) in below.iter().enumerate() {
            let radius = cone.start_radius + cone.widening * self.share[k];
            let above = if *below < 0.0 { *below } else { 0.0 };
            let depth = (below - above) + look.depth * radius;
            // Above the surface it fades by its height, below by its depth.
            let not_above = 1.0 - above * above * limit;
            let left = 1.0 - depth * depth * limit;
            let left = if left > 0.0 { left } else { 0.0 };
            self.visible_along[k] = -2.0 * depth * look.depth * cone.widening * limit * not_above;
            self.visible[k] *= left * not_above;
            (self.radius[k], self.depth[k]) = (radius, depth);
        }
        if cone.fades {
            for k in 0..LANES {
                let (fade, fade_along) = cone.fade(self.share[k]);
                self.visible_along[k] = fade_along * self.visible[k] + fade * self.visible_along[k];
                self.visible[k] *= fade;
            }
        }
    }

    /// How blurred the vessel is, and whether it is seen.
    #[inline(always)]
    fn blur(&mut self, look: &VesselLook, spots: &Spots) {
        let most = VesselLook::MOST_SPREAD - look.blur;
        let most = if most > 0.0 { most } else { 0.0 };
        let mound = if look.bump == 0.0 { 0.0 } else { VesselLook::MOUND };
        let texels = self.texel_blur(spots);
        let mut raised = ZERO;
        for (k, raised) in raised.iter_mut().enumerate() {
            let radius = self.radius[k];
            let (spread, most_spread) = (look.scatter * self.depth[k], most * radius);
            let is_scattered = spread < most_spread;
            let own = look.blur * radius + if is_scattered { spread } else { most_spread };
            let sharpest = SHARPEST * radius;
            let variance = texels[k] + own * own;
            let variance = if variance > sharpest * sharpest { variance } else { sharpest * sharpest };
            self.widening_blur[k] = look.blur + if is_scattered { look.scatter * look.depth } else { most };
            self.own_blur[k] = own;
            self.sigma[k] = variance;
            *raised = variance + mound * mound * radius * radius;
        }
        self.distance = roots(&self.distance);
        self.sigma = roots(&self.sigma);
        for (k, raised) in roots(&raised).into_iter().enumerate() {
            let is_seen = self.distance[k] <= self.radius[k] + SEEN * raised;
            self.visible[k] = if is_seen { self.visible[k] } else { 0.0 };
        }
    }

    /// Variance of the blur of the texels across the vessel.
    #[inline(always)]
    fn texel_blur(&self, spots: &Spots) -> Lanes {
        let ([nx, ny, nz], [xx, yy, zz, xy, xz, yz]) = (&spots.normal, &spots.footprint);
        let mut variance = ZERO;
        for k in 0..LANES {
            // On its axis, at a right angle to it.
            let [ax, ay, az] = [self.along[0][k], self.along[1][k], self.along[2][k]];
            let is_aside = self.distance[k] > ON_AXIS * self.radius[k] * self.radius[k];
            let x = if is_aside { self.offset[0][k] } else { ny[k] * az - nz[k] * ay };
            let y = if is_aside { self.offset[1][k] } else { nz[k] * ax - nx[k] * az };
            let z = if is_aside { self.offset[2][k] } else { nx[k] * ay - ny[k] * ax };
            let length = if is_aside { self.distance[k] } else { self.length_squared[k] };
            let length = if length > f32::MIN_POSITIVE { length } else { f32::MIN_POSITIVE };
            let texel =
                x * (xx[k] * x + 2.0 * (xy[k] * y + xz[k] * z)) + y * (yy[k] * y + 2.0 * yz[k] * z) + zz[k] * z * z;
            let texel = texel / length;
            variance[k] = if texel > 0.0 { texel } else { 0.0 };
        }
        variance
    }

    /// Share of the surface that lies over the vessel, as far as it can be seen.
    #[inline(always)]
    pub fn cover(&self, cone: &Cone) -> Lanes {
        let mut cover = ZERO;
        if cone.is_end[0] || cone.is_end[1] {
            for (k, cover) in cover.iter_mut().enumerate().filter(|(k, _)| self.visible[*k] > 0.0) {
                *cover = self.visible[k] * self.cover_at_end(cone, k);
            }
            return cover;
        }
        for (k, cover) in cover.iter_mut().enumerate() {
            *cover = self.visible[k] * across(self.distance[k], self.radius[k], self.sigma[k]).value;
        }
        cover
    }

    /// The same near the round end of a vessel, without what makes it invisible.
    fn cover_at_end(&self, cone: &Cone, k: usize) -> f32 {
        let at = |vectors: &[Lanes; 3]| Vec3::from_array(vectors.map(|lanes| lanes[k]));
        let (free, length, sigma) = (self.free[k], self.length_squared[k].sqrt(), self.sigma[k]);
        // Beyond the ends, the distance is that from the axis' line.
        let is_beyond = cone.is_end[0] && free < 0.0 || cone.is_end[1] && free > 1.0;
        let beside = at(&self.offset) + at(&self.along) * (free - self.share[k]);
        let aside = if is_beyond { beside.length() } else { self.distance[k] };
        let mut cover = across(aside, self.radius[k], sigma).value;
        let beyond = [-free * length, (free - 1.0) * length];
        for (end, beyond) in beyond.into_iter().enumerate().filter(|(end, _)| cone.is_end[*end]) {
            let radius = cone.start_radius + cone.widening * end as f32;
            cover -= beyond_end((beyond, aside), radius, sigma);
        }
        cover.max(0.0)
    }

    /// Height over the surface, and how it changes along it.
    #[inline(always)]
    pub fn height(&self, cone: &Cone, bump: f32) -> (Lanes, [Lanes; 3]) {
        let (mut heights, mut slopes, mut sigmas) = (ZERO, [ZERO; 3], ZERO);
        for (k, sigma) in sigmas.iter_mut().enumerate() {
            let mound = VesselLook::MOUND * self.radius[k];
            *sigma = self.sigma[k] * self.sigma[k] + mound * mound;
        }
        let sigmas = roots(&sigmas);
        for k in 0..LANES {
            let (r, mound, sigma) = (self.radius[k], VesselLook::MOUND * self.radius[k], sigmas[k]);
            let covered = across(self.distance[k], r, sigma);
            let scale = bump * self.visible[k];
            heights[k] = scale * r * covered.value;
            let distance = if self.distance[k] > f32::MIN_POSITIVE { self.distance[k] } else { f32::MIN_POSITIVE };
            let toward = -scale * r * covered.by_distance / distance;
            let blur_by_radius = (self.widening_blur[k] * self.own_blur[k] + VesselLook::MOUND * mound) / sigma;
            let by_radius = covered.value + r * (covered.by_radius + covered.by_sigma * blur_by_radius);
            let by_share = scale * by_radius * cone.widening + bump * self.visible_along[k] * r * covered.value;
            let length =
                if self.length_squared[k] > f32::MIN_POSITIVE { self.length_squared[k] } else { f32::MIN_POSITIVE };
            // Beyond the ends nothing changes along the axis.
            let is_within = self.visible[k] > 0.0 && self.free[k] > 0.0 && self.free[k] < 1.0;
            let ahead = if is_within { by_share / length } else { 0.0 };
            for (axis, slope) in slopes.iter_mut().enumerate() {
                slope[k] = self.offset[axis][k] * toward + self.along[axis][k] * ahead;
            }
        }
        (heights, slopes)
    }
}

/// The square root of each. Within a longer loop, compilers take one after the other.
#[inline(never)]
pub(super) fn roots(lanes: &Lanes) -> Lanes {
    let mut roots = ZERO;
    for (root, lane) in roots.iter_mut().zip(lanes) {
        *root = lane.sqrt();
    }
    roots
}

fn is_any(lanes: &Lanes) -> bool {
    lanes.iter().fold(0.0, |sum, lane| sum + lane) > 0.0
}
