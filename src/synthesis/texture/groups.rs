//! Which of some groups of texels a segment can be seen from.

use super::cones::Cone;
use super::gauss::SEEN;
use super::look::VesselLook;
use super::meeting::{LANES, Lanes, Spots, ZERO};
use bevy_math::Vec3;

/// Groups of texels, as many as a group has texels.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    /// The centre of each, from the origin of the tile, and the normal there.
    at: [Lanes; 3],
    normal: [Lanes; 3],
    /// Largest distance of a texel from the centre, at all and along the normal; below 0 where there are no texels.
    radius: Lanes,
    thickness: Lanes,
    /// Largest difference between a normal and that of the centre.
    bend: Lanes,
    /// Largest blur of a texel.
    blur: Lanes,
}

impl Groups {
    /// No texels.
    pub const EMPTY: Self = Self {
        at: [ZERO; 3],
        normal: [ZERO; 3],
        radius: [f32::NEG_INFINITY; LANES],
        thickness: ZERO,
        bend: ZERO,
        blur: ZERO,
    };

    /// Sets a group by its texels that there are; `blur` is the largest of them.
    pub fn set(&mut self, group: usize, spots: &Spots, is_there: &[bool; LANES], blur: f32) {
        let mut share = is_there.map(|is_there| if is_there { 1.0 } else { 0.0 });
        let count: f32 = share.iter().sum();
        if count == 0.0 {
            return;
        }
        share.iter_mut().for_each(|share| *share /= count);
        let mean = |lanes: &Lanes| lanes.iter().zip(share).fold(0.0, |sum, (lane, share)| sum + lane * share);
        let centre = Vec3::from_array(spots.at.each_ref().map(mean));
        let normal = Vec3::from_array(spots.normal.each_ref().map(mean)).normalize_or(Vec3::Z);
        let (mut away, mut along, mut bent) = (ZERO, ZERO, ZERO);
        for axis in 0..3 {
            for k in 0..LANES {
                let from = spots.at[axis][k] - centre[axis];
                let turned = spots.normal[axis][k] - normal[axis];
                away[k] += from * from;
                along[k] += from * normal[axis];
                bent[k] += turned * turned;
            }
        }
        let most = |lanes: &Lanes| {
            lanes.iter().zip(is_there).fold(0.0f32, |most, (lane, is)| if *is { most.max(lane.abs()) } else { most })
        };
        self.radius[group] = most(&away).sqrt();
        self.thickness[group] = most(&along);
        self.bend[group] = most(&bent).sqrt();
        self.blur[group] = blur;
        for axis in 0..3 {
            (self.at[axis][group], self.normal[axis][group]) = (centre[axis], normal[axis]);
        }
    }

    /// For each group, the distance from the axis of a segment up to which it can be seen from there; 0 where it cannot
    /// be seen at all. `start` is where it begins, from the origin of the tile.
    #[inline(always)]
    pub fn reaches(&self, cone: &Cone, start: Vec3, look: &VesselLook) -> Lanes {
        let (along, mut reaches) = (cone.along, ZERO);
        let ([px, py, pz], [nx, ny, nz]) = (&self.at, &self.normal);
        let widest = if cone.widening > 0.0 { cone.start_radius + cone.widening } else { cone.start_radius };
        let most_spread = VesselLook::MOST_SPREAD - look.blur;
        let most_spread = if most_spread > 0.0 { most_spread * widest } else { 0.0 };
        let mound = if look.bump == 0.0 { 0.0 } else { VesselLook::MOUND * widest };
        for k in 0..LANES {
            let (x, y, z) = (start.x - px[k], start.y - py[k], start.z - pz[k]);
            let up = x * nx[k] + y * ny[k] + z * nz[k];
            let rise = along.x * nx[k] + along.y * ny[k] + along.z * nz[k];
            // How deep the axis lies below any of the texels.
            let (one, other) = (-up, -(up + rise));
            let far = cone.far + SEEN * self.blur[k];
            let turned = self.bend[k] * far;
            let slack = self.thickness[k] + turned + cone.chord;
            let low = (if one < other { one } else { other }) - slack;
            let high = (if one < other { other } else { one }) + slack;
            let is_within = low < cone.max_depth && high > -cone.max_depth;
            // From any of the texels, projected along any of the normals, the axis is at most so much nearer.
            let (x, y, z) = (x - nx[k] * up, y - ny[k] * up, z - nz[k] * up);
            let (ax, ay, az) = (along.x - nx[k] * rise, along.y - ny[k] * rise, along.z - nz[k] * rise);
            let squared = ax * ax + ay * ay + az * az;
            let free =
                -(x * ax + y * ay + z * az) / if squared > f32::MIN_POSITIVE { squared } else { f32::MIN_POSITIVE };
            let share = if free > 0.0 { free } else { 0.0 };
            let share = if share < 1.0 { share } else { 1.0 };
            let (x, y, z) = (x + ax * share, y + ay * share, z + az * share);
            let nearer = self.radius[k] + 2.0 * turned;
            let deepest = high - 2.0 * cone.chord;
            let deepest = if deepest > 0.0 { deepest } else { 0.0 };
            let deepest = if deepest < cone.max_depth { deepest } else { cone.max_depth };
            let spread = look.scatter * (deepest + look.depth * widest);
            let own = look.blur * widest + if spread < most_spread { spread } else { most_spread };
            let reach = widest + SEEN * ((own * own + mound * mound).sqrt() + self.blur[k]);
            let room = reach + nearer;
            let is_near = is_within && room > 0.0 && x * x + y * y + z * z <= room * room;
            reaches[k] = if is_near { reach } else { 0.0 };
        }
        reaches
    }
}

#[cfg(test)]
mod tests {
    use super::super::cones::{Cones, Layer};
    use super::super::meeting::Meetings;
    use super::super::settings::BakeSettings;
    use super::*;
    use crate::synthesis::{
        pace::{Pace, at_once},
        random::Stream,
        tree::{NO_PARENT, VesselTree},
    };
    use rand::RngExt;

    #[test]
    fn what_a_group_cannot_see_none_of_its_texels_sees() {
        let mut rng = Stream::Statistics.rng(11);
        let mut random = |scale: f32| Vec3::from_array(std::array::from_fn(|_| rng.random_range(-scale..scale)));
        let (mut positions, mut parents, mut radii) = (Vec::new(), Vec::new(), Vec::new());
        for segment in 0..400u32 {
            // Near a ball of radius 1.
            let start = random(1.0).normalize_or(Vec3::X) * (1.0 - 0.05 * random(1.0).x);
            positions.extend([start, start + random(0.2)]);
            parents.extend([NO_PARENT, 2 * segment]);
            radii.extend([0.03 + random(0.02).x, 0.03 + random(0.02).x]);
        }
        let tree = VesselTree::from_arrays(positions, parents, radii).expect("a tree");
        let mut seen = 0;
        for look in
            [VesselLook::default(), VesselLook { max_depth: 0.3, blur: 1.0, bump: 0.0, ..VesselLook::default() }]
        {
            let layers = [Layer { tree: &tree, look: look.clone() }];
            let cones = at_once(Cones::of(&layers, &BakeSettings::default(), &Pace::default())).expect("cones");
            for _ in 0..200 {
                let (texel, middle) = (0.02, random(1.0).normalize_or(Vec3::X));
                let (mut spots, mut groups) = (Spots::NOWHERE, Groups::EMPTY);
                for k in 0..LANES {
                    let at = (middle + random(2.0 * texel)).normalize_or(Vec3::X);
                    for axis in 0..3 {
                        (spots.at[axis][k], spots.normal[axis][k]) = (at[axis], at[axis]);
                        spots.footprint[axis][k] = 0.25 * texel * texel;
                    }
                }
                groups.set(0, &spots, &[true; LANES], 0.5 * texel * 3.0f32.sqrt());
                for cone in &cones.cones {
                    let reach = groups.reaches(cone, cone.start, &look)[0];
                    let Some(meetings) = Meetings::of(cone, cone.start, 1.0e3, &look, &spots) else { continue };
                    for k in (0..LANES).filter(|&k| meetings.visible[k] > 0.0) {
                        assert!(meetings.distance[k] <= reach, "{} for {reach}", meetings.distance[k]);
                        seen += 1;
                    }
                }
            }
        }
        assert!(seen > 1000, "{seen}");
    }
}
