//! Makes all sides of every seam look the same.
//!
//! Along the border of a chart a sampler interpolates between texels of that chart, and on the other side of the edge
//! between texels of another, which lie at other places of the surface. Both are exact; what lies between them is off
//! by an eighth of the curvature in texels. No choice of samples makes two grids agree on details as small as a texel:
//! vessels have to be smooth along the seam for both to show the same. So where there is a step, the texels that the
//! seam's points see become the mean of what all sides show there: a blur by half a texel, along the seam and nowhere
//! else. A few times are enough for the finest vessels. What is left, mainly where seams meet, is closed by adding to
//! each texel what its points miss: least squares, as in Sylvan, "Fixing texture seams with linear least-squares"
//! (2014). Faint or wide vessels are left as they are.
//!
//! All corners of the charts that meet at a vertex are one point. So the triangles around a pole, where a whole row of
//! the texture is one place, agree too.

use super::atlas::Atlas;
use super::bytes::{normal_bytes, normal_of};
use super::canvas::Canvas;
use super::maps::Level;
use super::marks::Marks;
use super::settings::MapKind;
use super::srgb::Srgb;
use crate::synthesis::pace::Pace;
use bevy_math::{DVec2, Mat3, Quat, Vec3};
use std::ops::Range;

/// Points for a texel along an edge.
const DENSITY: f64 = 4.0;
/// Largest step that is left, in 255ths of the range of values. Between the points it may be a little more.
const SMALL: f32 = 0.75;
/// Most times that texels are changed.
const MOST_SWEEPS: u32 = 512;
/// Of so many of them, the first ones blur, and the others close what is left.
const ROUND: u32 = 64;
const BLURS: u32 = 6;
/// Most times that points which are still open are closed one after the other (Kaczmarz, 1937): few, where charts of a
/// texel or two meet.
const MOST_PROJECTIONS: u32 = 512;
/// Share of the last change that a further one goes on with (Polyak's heavy ball, 1964).
const MOMENTUM: f32 = 0.9;
/// Least volume of a frame that spans space.
const FLATTEST: f32 = 1.0e-4;
/// Difference of weights that counts as none.
const SAME: f32 = 1.0e-3;

/// What a sampler sees at a place of the texture: texels, by their place in a list, and their weights.
#[derive(Clone, Copy, Debug)]
struct View {
    texels: [u32; 4],
    weights: [f32; 4],
    /// The edge that it lies on, and the share of it.
    ends: [u32; 2],
    share: f32,
}

/// The points of all seams of a level, each with a view from every side.
#[derive(Default)]
struct Points {
    views: Vec<View>,
    /// The first view of each point.
    starts: Vec<u32>,
    /// The point of each view.
    points: Vec<u32>,
    /// The texels that are seen.
    texels: Vec<u32>,
    /// The views that see each texel, with their weights, as a list of lists.
    seeing_starts: Vec<u32>,
    seeing: Vec<(u32, f32)>,
}

/// From what a view sees to space, and back.
struct Frame {
    to_space: Mat3,
    from_space: Mat3,
}

/// What is seen by each view, and its mean at each point.
struct Shown {
    means: Vec<Vec3>,
    seen: Vec<Vec3>,
}

/// Makes all sides of the seams of a level look the same.
pub(super) async fn close(level: &mut Level, canvas: &Canvas, atlas: &Atlas, pace: &Pace) {
    let points = Points::of(canvas, atlas, level.size, &pace.part(0.0..0.2)).await;
    if points.views.is_empty() {
        return;
    }
    let srgb = Srgb::tables();
    let plain = |low: Vec3, high: Vec3| 255.0 * (high - low).max_element();
    // What a map cannot hold would be cut off when it is written, and leave a step.
    let unit = |value: Vec3| value.clamp(Vec3::ZERO, Vec3::ONE);
    let share = |number: usize| pace.part(0.2 + 0.2 * number as f32..0.4 + 0.2 * number as f32);
    if let Some(map) = &mut level.maps[MapKind::Albedo as usize] {
        let get = |bytes: &[u8]| Vec3::from_array([bytes[0], bytes[1], bytes[2]].map(|byte| srgb.decode(byte)));
        let step = |low: Vec3, high: Vec3| {
            let [low, high] =
                [low, high].map(|color| Vec3::from_array(color.to_array().map(|value| srgb.scale(value))));
            (high - low).max_element()
        };
        let changed = points.agree((points.values(map, 4, get), unit), &[], step, &share(0)).await;
        points.write((map, 4), &changed, |value| value.to_array().map(|channel| srgb.encode(channel)));
    }
    if let Some(map) = &mut level.maps[MapKind::Normal as usize] {
        let frames = points.frames(canvas);
        let step = |low: Vec3, high: Vec3| 127.5 * (high - low).max_element();
        let changed = points.agree((points.values(map, 4, normal_of), |value| value), &frames, step, &share(1)).await;
        points.write((map, 4), &changed, |value| {
            let [x, y, z, _] = normal_bytes(value.normalize_or(Vec3::Z));
            [x, y, z]
        });
    }
    if let Some(map) = &mut level.maps[MapKind::Height as usize] {
        let get = |bytes: &[u8]| Vec3::splat(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) / 65535.0);
        let changed = points.agree((points.values(map, 2, get), unit), &[], plain, &share(2)).await;
        points.write((map, 2), &changed, |value| ((value.x * 65535.0 + 0.5) as u16).to_le_bytes());
    }
    if let Some(map) = &mut level.maps[MapKind::Roughness as usize] {
        let get = |bytes: &[u8]| Vec3::splat(f32::from(bytes[1]) / 255.0);
        let changed = points.agree((points.values(map, 4, get), unit), &[], plain, &share(3)).await;
        points.write((map, 4), &changed, |value| [255, (value.x * 255.0 + 0.5) as u8]);
    }
}

impl Points {
    async fn of(canvas: &Canvas, atlas: &Atlas, size: usize, pace: &Pace) -> Self {
        let mut points = Self { starts: vec![0], ..Self::default() };
        let view = |[from, to]: [usize; 2], share: f64| {
            let [a, b] = [from, to].map(|vertex| canvas.uvs[vertex].as_dvec2() * size as f64);
            View::of(a.lerp(b, share), size, atlas.repeats, [from as u32, to as u32], share as f32)
        };
        let within = |seam: usize| {
            let sides = atlas.seams[seam].vertices(canvas);
            let length = |[from, to]: [usize; 2]| f64::from(canvas.uvs[from].distance(canvas.uvs[to]));
            let longest = sides.map(length).into_iter().fold(0.0, f64::max);
            let count = (DENSITY * longest * size as f64).ceil() as usize;
            for number in 1..count {
                points.push(sides.map(|side| view(side, number as f64 / count as f64)));
            }
        };
        pace.part(0.0..0.4).each(atlas.seams.len(), within).await;
        for corners in atlas.seam_corners.chunk_by(|a, b| a[0] == b[0]) {
            points.push(corners.iter().map(|&[_, vertex]| view([vertex as usize; 2], 0.0)));
        }
        pace.rest(0.6).await;
        points.list(size);
        pace.rest(1.0).await;
        points
    }

    /// Adds a point, unless all its views are the same.
    fn push(&mut self, views: impl IntoIterator<Item = View>) {
        let first = self.views.len();
        self.views.extend(views);
        let (one, others) = (self.views[first], &self.views[first..]);
        if others.iter().all(|other| other.is_like(&one)) {
            self.views.truncate(first);
        } else {
            self.points.resize(self.views.len(), self.starts.len() as u32 - 1);
            self.starts.push(self.views.len() as u32);
        }
    }

    /// Lists the texels, and who sees them.
    fn list(&mut self, size: usize) {
        let Self { views, texels, seeing_starts, seeing, .. } = self;
        // One more than the place of each texel in the list.
        let mut places = vec![0u32; size * size];
        for texel in views.iter_mut().flat_map(|view| &mut view.texels) {
            let place = &mut places[*texel as usize];
            if *place == 0 {
                texels.push(*texel);
                *place = texels.len() as u32;
            }
            *texel = *place - 1;
        }
        seeing_starts.resize(texels.len() + 1, 0);
        views.iter().flat_map(|view| view.texels).for_each(|texel| seeing_starts[texel as usize + 1] += 1);
        (0..texels.len()).for_each(|texel| seeing_starts[texel + 1] += seeing_starts[texel]);
        seeing.resize(4 * views.len(), (0, 0.0));
        let mut next = seeing_starts.clone();
        for (number, view) in views.iter().enumerate() {
            for (texel, weight) in view.texels.into_iter().zip(view.weights) {
                let place = &mut next[texel as usize];
                seeing[*place as usize] = (number as u32, weight);
                *place += 1;
            }
        }
    }

    fn values(&self, map: &[u8], bytes: usize, get: impl Fn(&[u8]) -> Vec3) -> Vec<Vec3> {
        self.texels.iter().map(|&texel| get(&map[texel as usize * bytes..][..bytes])).collect()
    }

    /// Writes the texels that have changed.
    fn write<const N: usize>(
        &self,
        (map, bytes): (&mut [u8], usize),
        changed: &[(u32, Vec3)],
        put: impl Fn(Vec3) -> [u8; N],
    ) {
        for &(texel, value) in changed {
            map[self.texels[texel as usize] as usize * bytes..][..N].copy_from_slice(&put(value));
        }
    }

    /// Changes texels until all sides agree. Returns those that have changed. `frames` turn what each view sees into
    /// what can be compared; without any, it can be as it is. `step` measures the step between the least and the
    /// greatest that a point shows. `held` is the value nearest to one that a map can hold.
    async fn agree(
        &self,
        (mut values, held): (Vec<Vec3>, impl Fn(Vec3) -> Vec3),
        frames: &[Frame],
        step: impl Fn(Vec3, Vec3) -> f32,
        pace: &Pace,
    ) -> Vec<(u32, Vec3)> {
        let count = self.starts.len() - 1;
        let mut shown = Shown { means: vec![Vec3::ZERO; count], seen: vec![Vec3::ZERO; self.views.len()] };
        let (mut open, mut point) = (Vec::new(), 0);
        let look = |_: usize| {
            if shown.look(self, point, &values, frames, &step) > SMALL {
                open.push(point);
            }
            point += 1;
        };
        pace.part(0.0..0.5).each(count, look).await;
        let (mut texel_marks, mut point_marks) = (Marks::of(self.texels.len()), Marks::of(count));
        let mut changes = vec![(0, Vec3::ZERO); self.texels.len()];
        let (mut has_changed, mut changed) = (vec![false; self.texels.len()], Vec::new());
        for sweep in 0..MOST_SWEEPS {
            if open.is_empty() {
                break;
            }
            texel_marks.clear();
            for texel in open.iter().flat_map(|&point| self.views_of(point)).flat_map(|view| self.views[view].texels) {
                texel_marks.add(texel);
            }
            point_marks.clear();
            for &texel in &texel_marks.marked {
                let (value, last) = (&mut values[texel as usize], &mut changes[texel as usize]);
                if sweep % ROUND < BLURS {
                    *value = self.mean(texel, frames, |view| shown.means[self.points[view] as usize]);
                } else {
                    let missing = |view: usize| shown.means[self.points[view] as usize] - shown.seen[view];
                    let goes_on = if last.0 + 1 == sweep { MOMENTUM * last.1 } else { Vec3::ZERO };
                    let next = held(*value + self.mean(texel, frames, missing) + goes_on);
                    *last = (sweep, next - *value);
                    *value = next;
                }
                self.seeing(texel).iter().for_each(|&(view, _)| point_marks.add(self.points[view as usize]));
                if !std::mem::replace(&mut has_changed[texel as usize], true) {
                    changed.push(texel);
                }
            }
            open.clear();
            let is_open = |point: &u32| shown.look(self, *point, &values, frames, &step) > SMALL;
            open.extend(point_marks.marked.iter().copied().filter(is_open));
            pace.rest(1.0 - 0.5 / (sweep + 2) as f32).await;
        }
        for _ in 0..MOST_PROJECTIONS {
            if open.is_empty() {
                break;
            }
            point_marks.clear();
            for &point in &open {
                shown.look(self, point, &values, frames, &step);
                for view in self.views_of(point) {
                    let missing = shown.means[point as usize] - shown.seen[view];
                    let missing = frames.get(view).map_or(missing, |frame| frame.from_space * missing);
                    let View { texels, weights, .. } = &self.views[view];
                    let squared: f32 = weights.iter().map(|weight| weight * weight).sum();
                    for (&texel, weight) in texels.iter().zip(weights) {
                        let value = &mut values[texel as usize];
                        *value = held(*value + missing * (weight / squared));
                        self.seeing(texel).iter().for_each(|&(view, _)| point_marks.add(self.points[view as usize]));
                        if !std::mem::replace(&mut has_changed[texel as usize], true) {
                            changed.push(texel);
                        }
                    }
                }
            }
            open.clear();
            let is_open = |point: &u32| shown.look(self, *point, &values, frames, &step) > SMALL;
            open.extend(point_marks.marked.iter().copied().filter(is_open));
        }
        changed.into_iter().map(|texel| (texel, values[texel as usize])).collect()
    }

    /// The mean of something over the views that see a texel, as that texel has it.
    fn mean(&self, texel: u32, frames: &[Frame], of: impl Fn(usize) -> Vec3) -> Vec3 {
        let (sum, weight) = self.seeing(texel).iter().fold((Vec3::ZERO, 0.0), |(sum, weight), &(view, own)| {
            let value = of(view as usize);
            let value = frames.get(view as usize).map_or(value, |frame| frame.from_space * value);
            (sum + own * value, weight + own)
        });
        sum / weight.max(f32::MIN_POSITIVE)
    }

    fn views_of(&self, point: u32) -> Range<usize> {
        self.starts[point as usize] as usize..self.starts[point as usize + 1] as usize
    }

    fn seeing(&self, texel: u32) -> &[(u32, f32)] {
        let [from, to] = [texel, texel + 1].map(|texel| self.seeing_starts[texel as usize] as usize);
        &self.seeing[from..to]
    }

    /// For each view, the tangents as a renderer interpolates them, turned so that all views of a point have one
    /// normal. So at a sharp edge the relief runs on, as if the surface were laid flat.
    fn frames(&self, canvas: &Canvas) -> Vec<Frame> {
        let mut frames = Vec::with_capacity(self.views.len());
        for point in 0..self.starts.len() - 1 {
            let views = &self.views[self.views_of(point as u32)];
            let normal = |view: &View| {
                let [from, to] = view.ends.map(|vertex| canvas.normals[vertex as usize]);
                from.lerp(to, view.share)
            };
            let sum: Vec3 = views.iter().map(normal).sum();
            frames.extend(views.iter().map(|view| {
                let [from, to] = view.ends.map(|vertex| canvas.tangents[vertex as usize]);
                let (own, tangent) = (normal(view), from.lerp(to, view.share));
                let along = tangent.truncate();
                let unit = own.normalize_or(Vec3::Z);
                let turn = Mat3::from_quat(Quat::from_rotation_arc(unit, sum.normalize_or(unit)));
                let to_space = turn * Mat3::from_cols(along, own.cross(along) * tangent.w, own);
                let is_flat = !(to_space.determinant().abs() > FLATTEST);
                let to_space = if is_flat { Mat3::IDENTITY } else { to_space };
                Frame { to_space, from_space: to_space.inverse() }
            }));
        }
        frames
    }
}

impl Shown {
    /// Looks at a point again. Returns the step between its views.
    fn look(
        &mut self,
        points: &Points,
        point: u32,
        values: &[Vec3],
        frames: &[Frame],
        step: &impl Fn(Vec3, Vec3) -> f32,
    ) -> f32 {
        let views = points.views_of(point);
        let (count, mut sum) = (views.len() as f32, Vec3::ZERO);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for number in views {
            let View { texels, weights, .. } = &points.views[number];
            let seen = (0..4).fold(Vec3::ZERO, |sum, k| sum + values[texels[k] as usize] * weights[k]);
            let seen = frames.get(number).map_or(seen, |frame| (frame.to_space * seen).normalize_or(Vec3::Z));
            self.seen[number] = seen;
            (sum, low, high) = (sum + seen, low.min(seen), high.max(seen));
        }
        self.means[point as usize] = sum / count;
        step(low, high)
    }
}

impl View {
    fn of(at: DVec2, size: usize, repeats: [bool; 2], ends: [u32; 2], share: f32) -> Self {
        let first = (at - 0.5).floor();
        let part = at - 0.5 - first;
        let place = |value: f64, axis: usize| {
            let (value, last) = (value as i64, size as i64 - 1);
            if repeats[axis] { value.rem_euclid(size as i64) } else { value.clamp(0, last) }
        };
        let texel = |right: f64, down: f64| (place(first.y + down, 1) * size as i64 + place(first.x + right, 0)) as u32;
        let (x, y) = (part.x as f32, part.y as f32);
        Self {
            texels: [texel(0.0, 0.0), texel(1.0, 0.0), texel(0.0, 1.0), texel(1.0, 1.0)],
            weights: [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y],
            ends,
            share,
        }
    }

    /// Whether another one sees the same texels with the same weights.
    fn is_like(&self, other: &Self) -> bool {
        self.texels == other.texels && self.weights.iter().zip(other.weights).all(|(a, b)| (a - b).abs() < SAME)
    }
}
