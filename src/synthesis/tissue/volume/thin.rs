//! Points of a solid that is much thinner than its voxels: a plate, a flap, a wire.
//!
//! Hardly a point of such a voxel is inside. But every point inside has a nearest one on the surface, straight above it.
//! So a place on the surface is drawn, then a depth below it, and the point is kept if no other place is nearer. Where
//! several triangles are equally near within rounding, as from the middle of a wire, each has its share of the point. That
//! is uniform by volume, except that points nearest to a concave edge are missed: a share of the solid that falls with
//! its thickness. How deep to go below a triangle is measured with the largest balls that touch it from inside (Ma, Bae
//! & Choi, "3D medial axis point approximation using nearest neighbors and the normal field", 2012).

use super::solid::{EVEN_STEPS, Solid};
use crate::synthesis::{
    mesh::{doubled_normal, triangle_index::closest_on_triangle},
    pace::{Pace, Stretch},
    random::{VesselRng, alias_table::AliasTable},
    space::bvh::Bounds,
};
use bevy_math::{DVec3, Vec3};
use rand::RngExt;

/// Places at which the surface of a solid is measured; each triangle has at least one of them.
const PROBES: f64 = 8192.0;
/// How much deeper than measured points are drawn.
const DEEPER: f64 = 1.25;
/// Most times that a ball is made smaller; it fits after three to six.
const SHRINKS: usize = 16;
/// Share of a distance that counts as rounding.
const SLACK: f64 = 1.0e-3;
/// Most draws for a sample; from a third to four fifths of them succeed.
const TRIES: u32 = 256;

/// The sides of triangles below which the solid lies.
#[derive(Clone, Debug)]
pub(super) struct Thin {
    sides: Vec<Side>,
    /// Draws a side by its area times depth.
    shares: AliasTable,
    volume: f64,
    /// Distance within which points are rounded.
    rounding: f64,
}

#[derive(Clone, Copy, Debug)]
struct Side {
    triangle: u32,
    /// Unit vector into the solid.
    inward: DVec3,
    area: f64,
    /// Depth to which points are drawn.
    depth: f64,
}

impl Thin {
    /// Measures a solid.
    pub async fn new_paced(solid: &Solid, pace: &Pace) -> Self {
        let largest = solid.bounds.min.abs().max(solid.bounds.max.abs()).max_element();
        let rounding = f64::from(largest * f32::EPSILON);
        let mut thin = Self { sides: Vec::new(), shares: AliasTable::default(), volume: 0.0, rounding };
        let area = |triangle: usize| 0.5 * doubled_normal(solid.corners[triangle]).length();
        let faces = solid.index.triangles();
        let whole = pace.part(0.0..0.1).sum(faces.len(), |face| area(faces[face] as usize)).await;
        let (measuring, mut stretch) = (pace.part(0.1..0.9), Stretch::default());
        for (done, &triangle) in faces.iter().enumerate() {
            let area = area(triangle as usize);
            let probes = (PROBES * area / whole).ceil() as usize;
            let normal = doubled_normal(solid.corners[triangle as usize]).normalize_or_zero();
            for inward in [-normal, normal] {
                let (mut sum, mut deepest) = (0.0, 0.0f64);
                for probe in 1..=probes {
                    let [v, w, part] = (EVEN_STEPS * (probe + done) as f64).fract().to_array();
                    let place = point_of(solid.corners[triangle as usize], [v, w]);
                    let depth = thin.depth_below(solid, place, inward);
                    sum += depth * thin.share(solid, (place + inward * depth * part).as_vec3(), depth * part);
                    deepest = deepest.max(depth);
                    if stretch.ends_after(16) {
                        measuring.rest(done as f32 / faces.len() as f32).await;
                    }
                }
                if deepest > 0.0 {
                    thin.volume += area * sum / probes as f64;
                    thin.sides.push(Side { triangle, inward, area, depth: DEEPER * deepest });
                }
            }
        }
        let sides = &thin.sides;
        let weight = |side: usize| sides[side].area * sides[side].depth;
        thin.shares = AliasTable::new_paced(sides.len(), weight, &pace.part(0.9..1.0)).await;
        thin
    }

    /// Volume of the solid.
    pub fn volume(&self) -> f64 {
        self.volume
    }

    /// A point of the solid.
    pub fn sample(&self, solid: &Solid, rng: &mut VesselRng) -> Option<Vec3> {
        for _ in 0..TRIES {
            let slot = rng.random_range(0..self.shares.len() as u32);
            let side = self.sides[self.shares.pick(slot, rng.random()) as usize];
            let place = point_of(solid.corners[side.triangle as usize], [rng.random(), rng.random()]);
            let depth = side.depth * rng.random::<f64>();
            let point = (place + side.inward * depth).as_vec3();
            let share = self.share(solid, point, depth);
            if share > 0.0 && rng.random::<f64>() < share && solid.contains(point) {
                return Some(point);
            }
        }
        None
    }

    /// Radius of the largest ball inside that touches the surface at a place from one side; 0 if that side is outside.
    fn depth_below(&self, solid: &Solid, place: DVec3, inward: DVec3) -> f64 {
        let [start, reach] = [4.0 * self.rounding, f64::from((solid.bounds.max - solid.bounds.min).length())];
        let [from, to] = [start, reach].map(|depth| (place + inward * depth).as_vec3());
        let Some(across) = solid.index.first_hit(from, to) else { return 0.0 };
        let mut radius = 0.5 * (across.position.as_dvec3() - place).length();
        if !solid.contains((place + inward * radius).as_vec3()) {
            return 0.0;
        }
        for _ in 0..SHRINKS {
            let Some(nearest) = solid.index.closest((place + inward * radius).as_vec3()) else { break };
            let fits = f64::from(nearest.distance_squared).sqrt() >= radius * (1.0 - SLACK) - self.rounding;
            let way = nearest.position.as_dvec3() - place;
            let height = way.dot(inward);
            if fits || !(height > 0.0) {
                break;
            }
            // The ball through both places.
            radius = radius.min(way.length_squared() / (2.0 * height));
        }
        radius
    }

    /// The share that a triangle has in a point so deep below it: 0 if another one is nearer, and a half if one more is as
    /// near.
    fn share(&self, solid: &Solid, point: Vec3, depth: f64) -> f64 {
        let Some(nearest) = solid.index.closest(point) else { return 0.0 };
        let reach = f64::from(nearest.distance_squared).sqrt() * (1.0 + SLACK) + self.rounding;
        if depth > reach {
            return 0.0;
        }
        let (mut as_near, around) = (0u32, Vec3::splat(reach as f32));
        let region = Bounds::around(&[point - around, point + around]);
        solid.index.overlapping(&region, |corners, _| {
            let (weights, on) = closest_on_triangle(point, corners);
            let is_below = weights.min_element() > 0.0 && on.distance(point.as_dvec3()) <= reach;
            as_near += u32::from(is_below);
        });
        if as_near > 0 { 1.0 / f64::from(as_near) } else { 0.0 }
    }
}

/// The point of a triangle for two numbers from 0 to 1, uniform by area.
fn point_of([a, b, c]: [Vec3; 3], [v, w]: [f64; 2]) -> DVec3 {
    let (v, w) = if v + w > 1.0 { (1.0 - v, 1.0 - w) } else { (v, w) };
    let [a, b, c] = [a, b, c].map(|corner| corner.as_dvec3());
    a + (b - a) * v + (c - a) * w
}
