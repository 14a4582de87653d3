//! The cage: polygons around a tree, whose subdivision is the surface.
//!
//! In: rings. Out: belts of faces between them, with texture coordinates.

use super::rings::Ring;
use super::spline::Station;
use bevy_math::{Vec2, Vec3};
use std::f32::consts::TAU;

/// What every vertex carries.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    pub positions: Vec<Vec3>,
    pub radii: Vec<f32>,
    pub nodes: Vec<u32>,
}

impl Vertices {
    #[inline]
    pub fn push(&mut self, position: Vec3, radius: f32, node: u32) -> u32 {
        self.positions.push(position);
        self.radii.push(radius);
        self.nodes.push(node);
        (self.positions.len() - 1) as u32
    }
}

/// Polygons around a tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Cage {
    pub vertices: Vertices,
    /// First corner of each face, and at the end the number of corners.
    pub starts: Vec<u32>,
    /// Vertex of each corner, anticlockwise around each face seen from outside.
    pub corners: Vec<u32>,
    /// Texture coordinates of each corner.
    pub uvs: Vec<Vec2>,
}

impl Cage {
    #[inline]
    pub fn face<const N: usize>(&mut self, corners: [u32; N], uvs: [Vec2; N]) {
        self.corners.extend_from_slice(&corners);
        self.uvs.extend_from_slice(&uvs);
        self.starts.push(self.corners.len() as u32);
    }

    /// Removes vertices without a face: those within wide openings.
    pub fn drop_unused(&mut self) {
        let mut numbers = vec![u32::MAX; self.vertices.positions.len()];
        for &corner in &self.corners {
            numbers[corner as usize] = 0;
        }
        let mut count = 0;
        for (vertex, number) in numbers.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
            *number = count;
            let kept = count as usize;
            self.vertices.positions[kept] = self.vertices.positions[vertex];
            self.vertices.radii[kept] = self.vertices.radii[vertex];
            self.vertices.nodes[kept] = self.vertices.nodes[vertex];
            count += 1;
        }
        self.vertices.positions.truncate(count as usize);
        self.vertices.radii.truncate(count as usize);
        self.vertices.nodes.truncate(count as usize);
        self.corners.iter_mut().for_each(|corner| *corner = numbers[*corner as usize]);
    }

    /// Faces between two rings, by columns of the ring with more sides.
    pub fn belt(&mut self, rings: &[Ring], bases: &[u32], is_open: impl Fn(u32, u32) -> bool) {
        let [low, high] = [&rings[0], &rings[1]];
        let sides = low.sides.max(high.sides);
        let uv = |ring: &Ring, line: u32| uv_of(&ring.station, ring.length, line, ring.sides);
        let vertex = |ring: usize, line: u32| bases[ring] + line % rings[ring].sides;
        if low.sides == high.sides {
            for column in (0..sides).filter(|&column| !is_open(column, sides)) {
                let next = column + 1;
                self.face(
                    [vertex(0, column), vertex(0, next), vertex(1, next), vertex(1, column)],
                    [uv(low, column), uv(low, next), uv(high, next), uv(high, column)],
                );
            }
            return;
        }
        for column in 0..sides / 2 {
            let [first, middle, last, next] = [2 * column, 2 * column + 1, 2 * column + 2, column + 1];
            if low.sides < high.sides {
                self.face(
                    [vertex(0, column), vertex(0, next), vertex(1, last), vertex(1, middle), vertex(1, first)],
                    [uv(low, column), uv(low, next), uv(high, last), uv(high, middle), uv(high, first)],
                );
            } else {
                self.face(
                    [vertex(0, first), vertex(0, middle), vertex(0, last), vertex(1, next), vertex(1, column)],
                    [uv(low, first), uv(low, middle), uv(low, last), uv(high, next), uv(high, column)],
                );
            }
        }
    }

    /// Faces from the edge of a hole to the first ring of the lateral.
    pub fn sleeve(&mut self, edge: &[u32], ring: &Ring, base: u32) {
        let sides = ring.sides;
        let below = |cage: &Self, line: u32| {
            let (from, to) = (edge[(line % sides) as usize], base + line % sides);
            let [from, to] = [from, to].map(|vertex| cage.vertices.positions[vertex as usize]);
            uv_of(&ring.station, ring.length - from.distance(to), line, sides)
        };
        for line in 0..sides {
            let next = line + 1;
            let corners = [edge[line as usize], edge[(next % sides) as usize], base + next % sides, base + line];
            let uv = |line: u32| uv_of(&ring.station, ring.length, line, sides);
            let uvs = [below(self, line), below(self, next), uv(next), uv(line)];
            self.face(corners, uvs);
        }
    }
}

/// Texture coordinates of a ring's line: the length of the arc from the side opposite to the seam, and the length along.
pub(super) fn uv_of(station: &Station, length: f32, line: u32, sides: u32) -> Vec2 {
    Vec2::new((line as f32 / sides as f32 - 0.5) * TAU * station.radius, length)
}
