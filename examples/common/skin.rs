//! A net of small cells over an organ's surface, for the blood on it.

use bevy::prelude::*;
use bevy_vessels::synthesis::mesh::{SurfacePoint, TriangleMesh};
use std::collections::HashMap;

/// Distance between neighbouring cells, in world units, and the most parts of an edge, which may limit it.
const SPACING: f32 = 0.0018;
const MOST_PARTS: u32 = 10;

/// Points on the surface at rest, joined by triangles that divide those of the organ.
pub struct Skin {
    /// Positions of the points.
    pub positions: Vec<Vec3>,
    /// Unit normals of the surface at the points.
    pub normals: Vec<Vec3>,
    /// The part of the surface of each point, in square world units.
    pub areas: Vec<f32>,
    /// The triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Parts of an edge.
    parts: u32,
    /// The points of each triangle of the organ, row by row.
    points: Vec<u32>,
    /// Start of the triangles around each point in their list.
    first: Vec<u32>,
    around: Vec<u32>,
}

impl Skin {
    /// Divides a surface.
    pub fn new(surface: &TriangleMesh) -> Self {
        let edge = (surface.area() / surface.triangles().len().max(1) as f64 * 2.3).sqrt() as f32;
        let parts = ((edge / SPACING).ceil() as u32).clamp(1, MOST_PARTS);
        let mut skin = Self {
            positions: Vec::new(),
            normals: Vec::new(),
            areas: Vec::new(),
            triangles: Vec::new(),
            parts,
            points: Vec::new(),
            first: Vec::new(),
            around: Vec::new(),
        };
        skin.divide(surface);
        skin.connect();
        skin
    }

    fn divide(&mut self, surface: &TriangleMesh) {
        let welding = surface.weld();
        let normals = surface.vertex_normals_with(&welding);
        let n = self.parts;
        // Points on edges and corners belong to several triangles: the edge and the position on it identify them.
        let mut shared: HashMap<[u32; 3], u32> = HashMap::new();
        for (number, corners) in surface.triangles().iter().enumerate() {
            let at = surface.corners(number);
            let normals = corners.map(|corner| normals[corner as usize]);
            let welded = corners.map(|corner| welding.vertex(corner) as u32);
            let row = self.points.len();
            for i in 0..=n {
                for j in 0..=n - i {
                    let shares = [i, j, n - i - j];
                    let weights = shares.map(|share| share as f32 / n as f32);
                    let mixed = |of: [Vec3; 3]| of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2];
                    let mut new_one = || {
                        self.positions.push(mixed(at));
                        self.normals.push(mixed(normals).normalize_or(surface.triangle_normal(number)));
                        self.positions.len() as u32 - 1
                    };
                    let point = match border(shares, welded) {
                        Some(key) => *shared.entry(key).or_insert_with(new_one),
                        None => new_one(),
                    };
                    self.points.push(point);
                }
            }
            let point = |i, j| self.points[row + place(n, i, j)];
            for i in 0..n {
                for j in 0..n - i {
                    self.triangles.push([point(i, j), point(i + 1, j), point(i, j + 1)]);
                    if i + j + 2 <= n {
                        self.triangles.push([point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)]);
                    }
                }
            }
        }
    }

    fn connect(&mut self) {
        let mut count = vec![0; self.positions.len() + 1];
        self.areas = vec![0.0; self.positions.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
            for &corner in corners {
                self.areas[corner as usize] += (b - a).cross(c - a).length() / 6.0;
                count[corner as usize + 1] += 1;
            }
        }
        for point in 1..count.len() {
            count[point] += count[point - 1];
        }
        self.first.clone_from(&count);
        self.around = vec![0; self.triangles.len() * 3];
        for (triangle, corners) in self.triangles.iter().enumerate() {
            for &corner in corners {
                self.around[count[corner as usize] as usize] = triangle as u32;
                count[corner as usize] += 1;
            }
        }
    }

    /// The triangles around a point.
    pub fn triangles_around(&self, point: u32) -> impl Iterator<Item = u32> + '_ {
        let [from, to] = [point, point + 1].map(|point| self.first[point as usize] as usize);
        self.around[from..to].iter().copied()
    }

    /// The neighbours of a point, most of them twice: once for each shared triangle.
    pub fn neighbours(&self, point: u32) -> impl Iterator<Item = u32> + '_ {
        let others = move |triangle: u32| self.triangles[triangle as usize].into_iter();
        self.triangles_around(point).flat_map(others).filter(move |&other| other != point)
    }

    /// Distance between two points, in world units.
    pub fn distance(&self, from: u32, to: u32) -> f32 {
        self.positions[from as usize].distance(self.positions[to as usize])
    }

    /// The downhill direction at a point, along the surface. Its length is the steepness: 1 if vertical.
    pub fn downhill(&self, point: u32) -> Vec3 {
        let normal = self.normals[point as usize];
        normal * normal.y - Vec3::Y
    }

    /// The way from a point to its neighbours in a direction. Both other corners of the triangle in that direction take
    /// a share, so that the mean way has the direction, however the triangles lie. `None` at a border.
    pub fn way(&self, point: u32, direction: Vec3) -> Option<Way> {
        let at = self.positions[point as usize];
        self.triangles_around(point).find_map(|triangle| {
            let mut others = self.triangles[triangle as usize].into_iter().filter(|&corner| corner != point);
            let [a, b] = [others.next()?, others.next()?];
            let [to_a, to_b] = [a, b].map(|corner| self.positions[corner as usize] - at);
            // direction = x·to_a + y·to_b, in the plane of the triangle
            let (aa, ab, bb) = (to_a.dot(to_a), to_a.dot(to_b), to_b.dot(to_b));
            let (da, db) = (direction.dot(to_a), direction.dot(to_b));
            let (x, y) = (da * bb - db * ab, db * aa - da * ab);
            let sum = x + y;
            let shares = [x / sum, y / sum];
            let is_there = x >= 0.0 && y >= 0.0 && sum > 0.0;
            is_there.then(|| Way {
                length: (to_a * shares[0] + to_b * shares[1]).length(),
                shares: [(a, shares[0]), (b, shares[1])],
            })
        })
    }

    /// The point nearest to a place on the surface.
    pub fn nearest(&self, place_on: &SurfacePoint) -> u32 {
        let n = self.parts;
        let i = ((place_on.barycentric.x * n as f32).round() as u32).min(n);
        let j = ((place_on.barycentric.y * n as f32).round() as u32).min(n - i);
        let per_triangle = ((n + 1) * (n + 2) / 2) as usize;
        self.points[place_on.triangle * per_triangle + place(n, i, j)]
    }
}

/// A way from a point to two of its neighbours.
pub struct Way {
    /// The neighbours, with the share that goes to each.
    pub shares: [(u32, f32); 2],
    /// Length of the mean way, in world units.
    pub length: f32,
}

/// Place of a point in the rows of a triangle.
fn place(n: u32, i: u32, j: u32) -> usize {
    (i * (n + 1) - i * i.saturating_sub(1) / 2 + j) as usize
}

/// The key of a point on an edge or a corner; `None` inside a triangle.
fn border(shares: [u32; 3], corners: [u32; 3]) -> Option<[u32; 3]> {
    let on: Vec<(u32, u32)> = corners.into_iter().zip(shares).filter(|&(_, share)| share > 0).collect();
    match on[..] {
        [(corner, _)] => Some([corner, corner, 0]),
        [a, b] => {
            let (low, high) = if a.0 < b.0 { (a, b) } else { (b, a) };
            Some([low.0, high.0, high.1])
        }
        _ => None,
    }
}
