//! Surfaces about an axis: rings of vertices, as many in each as it is long, joined by triangles.
//!
//! Two rings of different numbers are joined in the order of their angles, so triangles stay near equilateral wherever
//! rings grow or shrink, and a pole is a ring of one vertex.

use crate::synthesis::mesh::ShadedMesh;
use bevy_math::{Vec2, Vec3};
use std::ops::Range;

/// A vertex of a ring: position in metres, texture coordinates, colour.
pub(super) type RingVertex = (Vec3, Vec2, [f32; 4]);

/// Rings that become a mesh. They follow each other so that along × around points out.
#[derive(Default)]
pub(super) struct Rings {
    mesh: ShadedMesh,
    /// For each vertex, the one with the same place and normal.
    shared: Vec<u32>,
    last: Range<u32>,
}

impl Rings {
    /// Adds a ring of vertices that are evenly spread around the axis, from the angle 0 on, and triangles from the ring
    /// before it.
    pub fn add(&mut self, vertices: impl Iterator<Item = RingVertex>) {
        let before = self.last.clone();
        self.last = self.push(vertices);
        self.shared.extend(self.last.clone());
        if !before.is_empty() {
            self.mesh.triangles.extend(joined(before, self.last.clone()));
        }
    }

    /// Repeats the last ring with other texture coordinates: a border between two charts. Colours stay.
    pub fn begin_chart(&mut self, uv: impl Fn(usize) -> Vec2) {
        let owners = self.last.clone();
        let again: Vec<RingVertex> = owners
            .clone()
            .enumerate()
            .map(|(place, owner)| (self.mesh.positions[owner as usize], uv(place), self.mesh.colors[owner as usize]))
            .collect();
        self.last = self.push(again.into_iter());
        self.shared.extend(owners);
    }

    /// Triangles so far.
    pub fn triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// The mesh, with smooth normals.
    pub fn finish(mut self) -> ShadedMesh {
        self.mesh.compute_normals(&self.shared);
        self.mesh
    }

    fn push(&mut self, vertices: impl Iterator<Item = RingVertex>) -> Range<u32> {
        let first = self.mesh.positions.len() as u32;
        for (position, uv, color) in vertices {
            self.mesh.positions.push(position);
            self.mesh.uvs.push(uv);
            self.mesh.colors.push(color);
        }
        first..self.mesh.positions.len() as u32
    }
}

/// Triangles between two rings, by the angles of their vertices. A ring of one vertex is a pole.
fn joined(inner: Range<u32>, outer: Range<u32>) -> Vec<[u32; 3]> {
    let [n, m] = [&inner, &outer].map(|ring| ring.end - ring.start);
    let [inner_at, outer_at] =
        [(inner.start, n), (outer.start, m)].map(|(start, count)| move |place: u32| start + place % count);
    let [inner_sides, outer_sides] = [n, m].map(|count| if count > 1 { count } else { 0 });
    let (mut i, mut j) = (0, 0);
    let mut triangles = Vec::with_capacity((inner_sides + outer_sides) as usize);
    while i < inner_sides || j < outer_sides {
        // The side that ends at the smaller angle.
        let is_outer =
            i == inner_sides || j < outer_sides && u64::from(j + 1) * u64::from(n) <= u64::from(i + 1) * u64::from(m);
        if is_outer {
            triangles.push([inner_at(i), outer_at(j), outer_at(j + 1)]);
            j += 1;
        } else {
            triangles.push([inner_at(i), outer_at(j), inner_at(i + 1)]);
            i += 1;
        }
    }
    triangles
}
