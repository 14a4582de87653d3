//! What is seen of all vessels at some texels, and the colour that they have there.

use super::cones::{Cone, Cones};
use super::look::VesselLook;
use super::meeting::{LANES, Lanes, Meetings, Spots, ZERO};
use super::settings::Maps;
use bevy_math::Vec3;

/// What is seen at each of some texels.
#[derive(Debug)]
pub(super) struct Sight {
    /// The networks that are seen at all, in their order.
    layers: Vec<LayerSight>,
    /// Height over the surface, and how it changes along it.
    height: Lanes,
    slope: [Lanes; 3],
    /// How near to the surface a covering vessel comes, which one it is, and the depth of its axis.
    top: Lanes,
    covering: [u32; LANES],
    covering_depth: Lanes,
}

/// The most opaque vessel of a network at each texel.
#[derive(Clone, Copy, Debug)]
struct LayerSight {
    layer: u32,
    /// Share of the surface that lies over the vessel, as far as it can be seen.
    cover: Lanes,
    /// Depth of its axis.
    depth: Lanes,
    /// Its place on the ramp of colours.
    shade: Lanes,
}

impl Default for Sight {
    fn default() -> Self {
        Self {
            layers: Vec::new(),
            height: ZERO,
            slope: [ZERO; 3],
            top: [f32::INFINITY; LANES],
            covering: [u32::MAX; LANES],
            covering_depth: ZERO,
        }
    }
}

impl Sight {
    /// Forgets all.
    pub fn clear(&mut self) {
        let mut layers = std::mem::take(&mut self.layers);
        layers.clear();
        *self = Self { layers, ..Self::default() };
    }

    /// Looks at a segment, with its start from the origin of the texels. `reach` is the distance from its axis up to
    /// which it can be seen. Segments have to come by rising number.
    #[inline]
    pub fn add(
        &mut self,
        (cone, number): (&Cone, u32),
        look: &VesselLook,
        (start, reach): (Vec3, f32),
        spots: &Spots,
        maps: Maps,
    ) {
        let Some(meetings) = Meetings::of(cone, start, reach, look, spots) else { return };
        if (maps.albedo || maps.roughness) && look.strength > 0.0 {
            self.cover(cone, &meetings);
        }
        if (maps.normal || maps.height) && look.bump != 0.0 {
            let (heights, slopes) = meetings.height(cone, look.bump);
            for k in 0..LANES {
                let is_higher = heights[k].abs() > self.height[k].abs();
                self.height[k] = if is_higher { heights[k] } else { self.height[k] };
                for (own, slopes) in self.slope.iter_mut().zip(&slopes) {
                    own[k] = if is_higher { slopes[k] } else { own[k] };
                }
            }
        }
        if maps.id || maps.depth {
            self.stack(number, &meetings);
        }
    }

    /// Keeps the most opaque vessel of a network.
    fn cover(&mut self, cone: &Cone, meetings: &Meetings) {
        let cover = meetings.cover(cone);
        if self.layers.last().is_none_or(|last| last.layer != cone.layer) {
            self.layers.push(LayerSight { layer: cone.layer, cover: ZERO, depth: ZERO, shade: ZERO });
        }
        let Some(last) = self.layers.last_mut() else { return };
        let [start, end] = cone.shade;
        for (k, cover) in cover.into_iter().enumerate() {
            let is_more = cover > last.cover[k];
            let shade = start + (end - start) * meetings.share[k];
            last.cover[k] = if is_more { cover } else { last.cover[k] };
            last.depth[k] = if is_more { meetings.depth[k] } else { last.depth[k] };
            last.shade[k] = if is_more { shade } else { last.shade[k] };
        }
    }

    /// Keeps the vessel that comes nearest to the surface.
    fn stack(&mut self, number: u32, meetings: &Meetings) {
        for k in 0..LANES {
            let (radius, distance) = (meetings.radius[k], meetings.distance[k]);
            if !(meetings.visible[k] > 0.0 && distance <= radius) {
                continue;
            }
            let nearest = meetings.depth[k] - (radius * radius - distance * distance).max(0.0).sqrt();
            if nearest < self.top[k] {
                (self.top[k], self.covering[k], self.covering_depth[k]) = (nearest, number, meetings.depth[k]);
            }
        }
    }

    /// Height over the surface at a texel, and how it changes along it; `None` where nothing raises it.
    pub fn relief(&self, k: usize) -> Option<(f32, Vec3)> {
        (self.height[k] != 0.0).then(|| (self.height[k], Vec3::from_array(self.slope.map(|axis| axis[k]))))
    }

    /// The cone that covers a texel and comes nearest to the surface, and the depth of its axis.
    pub fn covering(&self, k: usize) -> Option<(u32, f32)> {
        (self.covering[k] != u32::MAX).then(|| (self.covering[k], self.covering_depth[k]))
    }

    /// Whether a vessel is seen at a texel.
    pub fn is_seen(&self, k: usize) -> bool {
        self.layers.iter().any(|seen| seen.cover[k] > 0.0)
    }

    /// Colour and roughness of a texel over those of the base: the deepest network first. The vessels' colours are
    /// divided by `filter`.
    pub fn over(&self, k: usize, cones: &Cones, base: (Vec3, f32), filter: Vec3) -> (Vec3, f32) {
        let mut mixed = base;
        let mut last = None;
        while let Some(next) = self.deepest_after(k, last) {
            let seen = &self.layers[next];
            let look = &cones.looks[seen.layer as usize];
            let deep = (seen.depth[k] / look.deepest).clamp(0.0, 1.0);
            let [thin, wide, blue] =
                [look.look.thin_color, look.look.wide_color, look.look.deep_color].map(Vec3::from_array);
            let color = thin.lerp(wide, seen.shade[k]).lerp(blue, deep) / filter.max(Vec3::splat(f32::MIN_POSITIVE));
            let (under, rough) = mixed;
            let cover = seen.cover[k];
            mixed = (under.lerp(color, look.look.strength * cover), rough + (look.look.roughness - rough) * cover);
            last = Some(next);
        }
        mixed
    }

    /// The deepest of the networks seen at a texel that comes after another; of those at one depth, the first.
    fn deepest_after(&self, k: usize, last: Option<usize>) -> Option<usize> {
        let depth = |number: usize| self.layers[number].depth[k];
        let comes_after = |number: &usize| {
            self.layers[*number].cover[k] > 0.0
                && last.is_none_or(|last| (-depth(last), last) < (-depth(*number), *number))
        };
        let deeper = |best: usize, other: usize| if depth(other) > depth(best) { other } else { best };
        (0..self.layers.len()).filter(comes_after).reduce(deeper)
    }
}
