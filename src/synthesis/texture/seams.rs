//! Makes both sides of every seam look the same.
//!
//! Texels of two charts lie at different places of the surface, so what a sampler interpolates between them differs a
//! little along their common edge: the more, the larger the texels are beside the details, and so mainly on small levels.
//! Texels at seams are changed as little as possible so that both sides agree at points half a texel apart (Sylvan,
//! "Fixing texture seams with linear least-squares", 2014), by Kaczmarz' projections (1937): one point after the other,
//! which converges to the nearest picture without seams.

use super::atlas::Seam;
use super::canvas::Canvas;
use super::maps::Level;
use super::mips::normal_of;
use super::paint::normal_bytes;
use super::settings::MapKind;
use super::srgb::Srgb;
use crate::synthesis::pace::{Pace, STRETCH};
use bevy_math::{DVec2, Mat3, Vec3};

/// Points for a texel along an edge.
const DENSITY: f64 = 2.0;
/// Most sweeps over all points.
const MOST_SWEEPS: usize = 60;
/// Largest step, in shares of the range of values, that is left.
const SMALL: f32 = 0.1 / 255.0;
/// Step that counts as none.
const NONE: f32 = 0.2 * SMALL;

/// One side of a point: the texels that are interpolated, by their place in a list, and their weights.
#[derive(Clone, Copy, Debug)]
struct Side {
    texels: [u32; 4],
    weights: [f32; 4],
}

/// A point of a seam.
#[derive(Clone, Copy, Debug)]
struct Point {
    sides: [Side; 2],
    /// The seam, and the share of its edge.
    seam: u32,
    share: f32,
}

/// Points along the seams of a level, and the texels that they see.
struct Points {
    points: Vec<Point>,
    /// Texels, in rising order.
    texels: Vec<u32>,
    /// The points that see each texel, as a list of lists.
    starts: Vec<u32>,
    seeing: Vec<u32>,
}

/// Makes both sides of all seams of a level look the same.
pub(super) async fn close(level: &mut Level, canvas: &Canvas, seams: &[Seam], repeats: [bool; 2], pace: &Pace) {
    let points = Points::along(canvas, seams, level.size, repeats, &pace.part(0.0..0.1)).await;
    if points.points.is_empty() {
        return;
    }
    let srgb = Srgb::tables();
    let plain = |_: &Point| [Mat3::IDENTITY; 2];
    let share = |number: usize| 0.1 + 0.225 * number as f32..0.1 + 0.225 * (number + 1) as f32;
    if let Some(map) = &mut level.maps[MapKind::Albedo as usize] {
        let get = |bytes: &[u8]| Vec3::from_array([bytes[0], bytes[1], bytes[2]].map(|byte| srgb.decode(byte)));
        let values = points.values(map, 4, get);
        let closed = points.closed(values, plain, &pace.part(share(0))).await;
        points.write((map, 4), closed, |value| value.to_array().map(|channel| srgb.encode(channel)));
    }
    if let Some(map) = &mut level.maps[MapKind::Normal as usize] {
        let values = points.values(map, 4, normal_of);
        let frames =
            |point: &Point| seams[point.seam as usize].vertices(canvas).map(|ends| frame(canvas, ends, point.share));
        let closed = points.closed(values, frames, &pace.part(share(1))).await;
        points.write((map, 4), closed, |value| {
            let [x, y, z, _] = normal_bytes(value.normalize_or(Vec3::Z));
            [x, y, z]
        });
    }
    if let Some(map) = &mut level.maps[MapKind::Height as usize] {
        let get = |bytes: &[u8]| Vec3::splat(f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) / 65535.0);
        let values = points.values(map, 2, get);
        let closed = points.closed(values, plain, &pace.part(share(2))).await;
        points.write((map, 2), closed, |value| ((value.x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16).to_le_bytes());
    }
    if let Some(map) = &mut level.maps[MapKind::Roughness as usize] {
        let values = points.values(map, 4, |bytes| Vec3::splat(f32::from(bytes[1]) / 255.0));
        let closed = points.closed(values, plain, &pace.part(share(3))).await;
        points.write((map, 4), closed, |value| [255, (value.x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8]);
    }
}

impl Points {
    async fn along(canvas: &Canvas, seams: &[Seam], size: usize, repeats: [bool; 2], pace: &Pace) -> Self {
        let mut points = Vec::new();
        let add = |seam: usize| {
            let ends = seams[seam].ends(canvas).map(|side| side.map(|uv| uv.as_dvec2() * size as f64));
            let longest = ends.map(|[from, to]| from.distance(to)).into_iter().fold(0.0, f64::max);
            let count = ((DENSITY * longest).ceil() as usize).max(1);
            for number in 0..=count {
                let share = number as f64 / count as f64;
                let sides = ends.map(|[from, to]| Side::at(from.lerp(to, share), size, repeats));
                if sides[0].texels != sides[1].texels || sides[0].differs(&sides[1]) {
                    points.push(Point { sides, seam: seam as u32, share: share as f32 });
                }
            }
        };
        pace.part(0.0..0.5).each(seams.len(), add).await;
        let sides = points.iter().flat_map(|point: &Point| point.sides);
        let mut texels: Vec<u32> = sides.flat_map(|side| side.texels).collect();
        texels.sort_unstable();
        texels.dedup();
        for texel in points.iter_mut().flat_map(|point| &mut point.sides).flat_map(|side| &mut side.texels) {
            *texel = texels.partition_point(|other| other < texel) as u32;
        }
        pace.rest(0.8).await;
        let mut points = Self { points, starts: vec![0; texels.len() + 1], texels, seeing: Vec::new() };
        points.list_seeing();
        pace.rest(1.0).await;
        points
    }

    fn list_seeing(&mut self) {
        let Self { points, texels, starts, seeing } = self;
        points.iter().flat_map(Point::texels).for_each(|texel| starts[texel as usize + 1] += 1);
        (0..texels.len()).for_each(|texel| starts[texel + 1] += starts[texel]);
        seeing.resize(8 * points.len(), 0);
        let mut next = starts.clone();
        for (number, point) in points.iter().enumerate() {
            for texel in point.texels() {
                let place = &mut next[texel as usize];
                seeing[*place as usize] = number as u32;
                *place += 1;
            }
        }
    }

    fn values(&self, map: &[u8], bytes: usize, get: impl Fn(&[u8]) -> Vec3) -> Vec<Vec3> {
        self.texels.iter().map(|&texel| get(&map[texel as usize * bytes..][..bytes])).collect()
    }

    /// Writes back what has changed.
    fn write<const N: usize>(
        &self,
        (map, bytes): (&mut [u8], usize),
        values: Option<Vec<Vec3>>,
        put: impl Fn(Vec3) -> [u8; N],
    ) {
        for (&texel, value) in self.texels.iter().zip(values.into_iter().flatten()) {
            map[texel as usize * bytes..][..N].copy_from_slice(&put(value));
        }
    }

    /// The values with which both sides agree, or `None` if they did. `frames` turns the values of either side into ones
    /// that can be compared.
    async fn closed(
        &self,
        mut values: Vec<Vec3>,
        frames: impl Fn(&Point) -> [Mat3; 2],
        pace: &Pace,
    ) -> Option<Vec<Vec3>> {
        let frames: Vec<[Mat3; 2]> = pace.part(0.0..0.1).collect(self.points.len(), |p| frames(&self.points[p])).await;
        let (sweeps, last) = (pace.part(0.1..1.0), self.points.len() - 1);
        // A point whose texels have not changed since it was projected needs no look.
        let mut is_due = vec![true; self.points.len()];
        for sweep in 0..MOST_SWEEPS {
            let mut largest = 0.0f32;
            let mut project = |number: usize| {
                // There and back again, so that no direction is preferred.
                let number = if sweep % 2 == 0 { number } else { last - number };
                if !std::mem::replace(&mut is_due[number], false) {
                    return;
                }
                let point = &self.points[number];
                let step = point.project(&frames[number], &mut values);
                if step > NONE {
                    for texel in point.texels() {
                        let [from, to] = [texel, texel + 1].map(|texel| self.starts[texel as usize] as usize);
                        self.seeing[from..to].iter().for_each(|&other| is_due[other as usize] = true);
                    }
                    is_due[number] = false;
                }
                largest = largest.max(step);
            };
            let shares = sweep as f32 / MOST_SWEEPS as f32..(sweep + 1) as f32 / MOST_SWEEPS as f32;
            sweeps.part(shares).stretches(self.points.len(), STRETCH, |some| some.for_each(&mut project)).await;
            if largest <= SMALL {
                return (sweep > 0).then_some(values);
            }
        }
        Some(values)
    }
}

impl Side {
    /// The texels that are interpolated at a point of the texture, in texels.
    fn at(at: DVec2, size: usize, repeats: [bool; 2]) -> Self {
        let first = (at - 0.5).floor();
        let share = at - 0.5 - first;
        let place = |value: f64, axis: usize| {
            let (value, last) = (value as i64, size as i64 - 1);
            if repeats[axis] { value.rem_euclid(size as i64) } else { value.clamp(0, last) }
        };
        let texel = |right: f64, down: f64| (place(first.y + down, 1) * size as i64 + place(first.x + right, 0)) as u32;
        let (x, y) = (share.x as f32, share.y as f32);
        Self {
            texels: [texel(0.0, 0.0), texel(1.0, 0.0), texel(0.0, 1.0), texel(1.0, 1.0)],
            weights: [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y],
        }
    }

    /// Whether another side sees the same texels otherwise.
    fn differs(&self, other: &Self) -> bool {
        self.weights.iter().zip(other.weights).any(|(a, b)| (a - b).abs() > 1.0e-3)
    }

    fn value(&self, values: &[Vec3]) -> Vec3 {
        self.texels.iter().zip(self.weights).map(|(&texel, weight)| values[texel as usize] * weight).sum()
    }

    fn add(&self, values: &mut [Vec3], change: Vec3) {
        for (&texel, weight) in self.texels.iter().zip(self.weights) {
            values[texel as usize] += change * weight;
        }
    }
}

impl Point {
    /// The texels of both sides.
    fn texels(&self) -> impl Iterator<Item = u32> + use<> {
        self.sides.into_iter().flat_map(|side| side.texels)
    }

    /// Makes both sides agree, with the least change. Returns the largest component of the step that there was.
    fn project(&self, [one, other]: &[Mat3; 2], values: &mut [Vec3]) -> f32 {
        let [first, second] = &self.sides;
        let step = *one * first.value(values) - *other * second.value(values);
        let largest = step.abs().max_element();
        if largest > NONE {
            let squares: f32 = first.weights.iter().chain(&second.weights).map(|weight| weight * weight).sum();
            // The frames are rotations or nearly so, so that their transposes undo them.
            first.add(values, one.transpose() * step * (-1.0 / squares));
            second.add(values, other.transpose() * step * (1.0 / squares));
        }
        largest
    }
}

/// Tangent, bitangent and normal of one side at a share of its edge.
fn frame(canvas: &Canvas, [from, to]: [usize; 2], share: f32) -> Mat3 {
    let normal = canvas.normals[from].lerp(canvas.normals[to], share).normalize_or(Vec3::Z);
    let along = canvas.tangents[from].lerp(canvas.tangents[to], share).truncate();
    let tangent = (along - normal * normal.dot(along)).normalize_or(normal.any_orthonormal_vector());
    let sign = if canvas.tangents[from].w < 0.0 { -1.0 } else { 1.0 };
    Mat3::from_cols(tangent, normal.cross(tangent) * sign, normal)
}
