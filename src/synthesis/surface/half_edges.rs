//! Catmull–Clark subdivision on half-edges.
//!
//! In: a closed cage of polygons. Out: the same with four times as many faces, all quads.
//!
//! A half-edge is a corner of a face and the edge that leaves it; its twin runs along the same edge in the other face.
//! Each refinement makes one quad for each half-edge, in its place: half-edges 4h to 4h + 3 belong to half-edge h. So the
//! refined twins follow from the old ones, and every step is a loop over arrays. Sources: Catmull & Clark,
//! "Recursively generated B-spline surfaces on arbitrary topological meshes" (1978); Dupuy & Vanhoey, "A halfedge
//! refinement rule for parallel Catmull–Clark subdivision" (2021).

use super::cage::{Cage, Vertices};
use super::direction::unit;
use crate::synthesis::pace::Pace;
use bevy_math::{Vec2, Vec3};

const NONE: u32 = u32::MAX;

/// The order of half-edges around faces.
#[derive(Clone, Debug)]
enum Faces {
    /// Every face has four half-edges.
    Quads,
    /// For each half-edge, how many come before it in its face, and how many come after.
    Polygons(Vec<[u8; 2]>),
}

impl Faces {
    #[inline]
    fn next(&self, half_edge: u32) -> u32 {
        match self {
            Self::Quads => (half_edge & !3) | ((half_edge + 1) & 3),
            Self::Polygons(places) => match places[half_edge as usize] {
                [before, 0] => half_edge - u32::from(before),
                _ => half_edge + 1,
            },
        }
    }

    #[inline]
    fn previous(&self, half_edge: u32) -> u32 {
        match self {
            Self::Quads => (half_edge & !3) | (half_edge.wrapping_sub(1) & 3),
            Self::Polygons(places) => match places[half_edge as usize] {
                [0, after] => half_edge + u32::from(after),
                _ => half_edge - 1,
            },
        }
    }
}

/// A closed mesh as half-edges.
#[derive(Clone, Debug)]
pub(super) struct HalfEdges {
    pub vertices: Vertices,
    /// Vertex at which each half-edge begins.
    pub origins: Vec<u32>,
    /// Texture coordinates of each corner.
    pub uvs: Vec<Vec2>,
    twins: Vec<u32>,
    /// A half-edge of each vertex.
    leaving: Vec<u32>,
    faces: Faces,
    face_starts: Vec<u32>,
}

impl HalfEdges {
    /// The half-edges of a cage. It must be closed and oriented.
    pub async fn of_paced(cage: Cage, pace: &Pace) -> Self {
        let Cage { vertices, starts, corners, uvs } = cage;
        let mut places = Vec::with_capacity(corners.len());
        for face in starts.windows(2) {
            // A cage's faces have four corners or five.
            let count = (face[1] - face[0]) as u8;
            places.extend((0..count).map(|before| [before, count - 1 - before]));
        }
        let faces = Faces::Polygons(places);
        pace.rest(0.5).await;
        let (twins, leaving) = pair(&corners, &faces, vertices.positions.len());
        Self { vertices, origins: corners, uvs, twins, leaving, faces, face_starts: starts }
    }

    /// Number of half-edges.
    pub fn len(&self) -> usize {
        self.twins.len()
    }

    /// The next subdivision.
    pub async fn refined_paced(&self, pace: &Pace) -> Self {
        let split = self.split_paced(&pace.part(0.0..0.5)).await;
        let (radii, nodes) = self.marks_of_split(&pace.part(0.5..0.6)).await;
        let mut refined = self.quads_of(&split, &pace.part(0.6..1.0)).await;
        refined.vertices = Vertices { positions: split.positions, radii, nodes };
        refined
    }

    /// The vertices of the next subdivision.
    pub async fn split_paced(&self, pace: &Pace) -> Split {
        let (old, face_count) = (self.vertices.positions.len(), self.face_starts.len() - 1);
        let numbers = self.edge_numbers();
        pace.rest(0.1).await;
        let mut split = Split {
            positions: Vec::with_capacity(old + face_count + self.len() / 2),
            face_of: vec![0; self.len()],
            face_uvs: Vec::with_capacity(face_count),
            edges: Edges { first: (old + face_count) as u32, numbers },
            first_face: old as u32,
        };
        split.positions.resize(old, Vec3::ZERO);
        pace.part(0.1..0.4).each(face_count, |face| self.push_face_point(face, &mut split)).await;
        let moved = pace.part(0.4..0.7).collect(old, |vertex| self.moved(vertex, &split)).await;
        pace.part(0.7..1.0).each(self.len(), |half_edge| self.push_edge_point(half_edge as u32, &mut split)).await;
        split.positions[..old].copy_from_slice(&moved);
        split
    }

    #[inline]
    fn push_face_point(&self, face: usize, split: &mut Split) {
        let range = self.face_starts[face] as usize..self.face_starts[face + 1] as usize;
        let share = 1.0 / range.len() as f32;
        let (mut sum, mut uv) = (Vec3::ZERO, Vec2::ZERO);
        for half_edge in range {
            sum += self.vertices.positions[self.origins[half_edge] as usize];
            uv += self.uvs[half_edge];
            split.face_of[half_edge] = split.first_face + face as u32;
        }
        split.positions.push(sum * share);
        split.face_uvs.push(uv * share);
    }

    /// Radii and nodes of the vertices of the next subdivision.
    pub async fn marks_of_split(&self, pace: &Pace) -> (Vec<f32>, Vec<u32>) {
        let Vertices { radii: old_radii, nodes: old_nodes, .. } = &self.vertices;
        let count = old_radii.len() + self.face_count() + self.len() / 2;
        let (mut radii, mut nodes) = (Vec::with_capacity(count), Vec::with_capacity(count));
        radii.extend_from_slice(old_radii);
        nodes.extend_from_slice(old_nodes);
        let face = |face: usize| {
            let corners = &self.origins[self.face_starts[face] as usize..self.face_starts[face + 1] as usize];
            let sum: f32 = corners.iter().map(|&corner| old_radii[corner as usize]).sum();
            radii.push(sum * (1.0 / corners.len() as f32));
            nodes.push(old_nodes[corners[0] as usize]);
        };
        pace.part(0.0..0.4).each(self.face_count(), face).await;
        let edge = |half_edge: usize| {
            let twin = self.twins[half_edge] as usize;
            if half_edge < twin {
                let [a, b] = [half_edge, twin].map(|half_edge| self.origins[half_edge] as usize);
                radii.push(0.5 * (old_radii[a] + old_radii[b]));
                nodes.push(old_nodes[a]);
            }
        };
        pace.part(0.4..1.0).each(self.len(), edge).await;
        (radii, nodes)
    }

    /// A number of each half-edge's edge, in the order of the edges' first half-edges.
    fn edge_numbers(&self) -> Vec<u32> {
        let (mut edges, mut count) = (vec![NONE; self.len()], 0);
        for half_edge in 0..self.len() {
            if edges[half_edge] == NONE {
                edges[half_edge] = count;
                edges[self.twins[half_edge] as usize] = count;
                count += 1;
            }
        }
        edges
    }

    /// The half-edges that leave a vertex.
    #[inline]
    pub fn around(&self, vertex: usize) -> impl Iterator<Item = u32> + '_ {
        let first = self.leaving[vertex];
        let mut next = (first != NONE).then_some(first);
        std::iter::from_fn(move || {
            let here = next?;
            let after = self.twins[self.faces.previous(here) as usize];
            next = (after != first).then_some(after);
            Some(here)
        })
    }

    #[inline]
    fn moved(&self, vertex: usize, split: &Split) -> Vec3 {
        let here = self.vertices.positions[vertex];
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for half_edge in self.around(vertex) {
            let end = self.origins[self.next(half_edge) as usize];
            sum += self.vertices.positions[end as usize] + split.position(split.face_of[half_edge as usize]);
            count += 1.0;
        }
        here + (sum - here * (2.0 * count)) / (count * count)
    }

    #[inline]
    fn push_edge_point(&self, half_edge: u32, split: &mut Split) {
        let twin = self.twins[half_edge as usize];
        if twin < half_edge {
            return;
        }
        let (a, b) = (self.origins[half_edge as usize] as usize, self.origins[twin as usize] as usize);
        let face = |half_edge: u32| split.position(split.face_of[half_edge as usize]);
        let faces = face(half_edge) + face(twin);
        let ends = self.vertices.positions[a] + self.vertices.positions[b];
        split.positions.push(0.25 * (ends + faces));
    }

    /// Half-edges of the next subdivision, still without vertices.
    async fn quads_of(&self, split: &Split, pace: &Pace) -> Self {
        let count = self.len();
        let (mut origins, mut twins, mut uvs) =
            (Vec::with_capacity(4 * count), Vec::with_capacity(4 * count), Vec::with_capacity(4 * count));
        let mut leaving = vec![NONE; split.positions.len()];
        let quad = |half_edge: usize| {
            let half_edge = half_edge as u32;
            let (next, previous) = (self.next(half_edge), self.previous(half_edge));
            let [here, after, before] = [half_edge, next, previous].map(|half_edge| half_edge as usize);
            let quad =
                [self.origins[here], split.edges.vertex(half_edge), split.face_of[here], split.edges.vertex(previous)];
            for (corner, vertex) in (4 * half_edge..).zip(quad) {
                if leaving[vertex as usize] == NONE {
                    leaving[vertex as usize] = corner;
                }
            }
            origins.extend_from_slice(&quad);
            let across = self.next(self.twins[here]);
            twins.extend_from_slice(&[4 * across + 3, 4 * next + 2, 4 * previous + 1, 4 * self.twins[before]]);
            let uv = self.uvs[here];
            uvs.extend_from_slice(&[
                uv,
                0.5 * (uv + self.uvs[after]),
                split.face_uv(half_edge),
                0.5 * (self.uvs[before] + uv),
            ]);
        };
        pace.each(count, quad).await;
        let face_starts = (0..=count as u32).map(|face| 4 * face).collect();
        Self { vertices: Vertices::default(), origins, uvs, twins, leaving, faces: Faces::Quads, face_starts }
    }

    /// The half-edge after one around its face.
    #[inline]
    pub fn next(&self, half_edge: u32) -> u32 {
        self.faces.next(half_edge)
    }

    /// The half-edge before one around its face.
    #[inline]
    pub fn previous(&self, half_edge: u32) -> u32 {
        self.faces.previous(half_edge)
    }

    /// The half-edge along the same edge in the other face.
    #[inline]
    pub fn twin(&self, half_edge: u32) -> u32 {
        self.twins[half_edge as usize]
    }

    /// The number of faces.
    pub fn face_count(&self) -> usize {
        self.face_starts.len() - 1
    }

    /// The first half-edge of each face, and at the end their number: all that is left to know once twins are done with.
    pub fn into_face_starts(self) -> Vec<u32> {
        self.face_starts
    }

    /// The half-edges of a face.
    pub fn face(&self, face: usize) -> std::ops::Range<u32> {
        self.face_starts[face]..self.face_starts[face + 1]
    }

    /// Normals of the faces around each vertex, weighted by area: for a cage without subdivision.
    pub fn face_normals(&self) -> Vec<Vec3> {
        (0..self.vertices.positions.len()).map(|vertex| self.mean_normal(vertex)).collect()
    }

    fn mean_normal(&self, vertex: usize) -> Vec3 {
        let here = self.vertices.positions[vertex];
        let sum: Vec3 = self
            .around(vertex)
            .map(|half_edge| {
                let [a, b] = [self.faces.next(half_edge), self.faces.previous(half_edge)]
                    .map(|half_edge| self.vertices.positions[self.origins[half_edge as usize] as usize] - here);
                a.cross(b)
            })
            .sum();
        unit(sum).unwrap_or(Vec3::Z)
    }
}

/// The vertices of the next subdivision: first the old ones, moved, then one in each face, then one on each edge.
#[derive(Debug)]
pub(super) struct Split {
    pub positions: Vec<Vec3>,
    /// Vertex in the face of each half-edge.
    pub face_of: Vec<u32>,
    /// Texture coordinates of the vertex in each face.
    pub face_uvs: Vec<Vec2>,
    pub edges: Edges,
    pub first_face: u32,
}

impl Split {
    /// Texture coordinates of the vertex in a half-edge's face.
    #[inline]
    pub fn face_uv(&self, half_edge: u32) -> Vec2 {
        self.face_uvs[(self.face_of[half_edge as usize] - self.first_face) as usize]
    }

    /// Position of a vertex.
    #[inline]
    pub fn position(&self, vertex: u32) -> Vec3 {
        self.positions[vertex as usize]
    }
}

/// The vertex on each half-edge's edge.
#[derive(Debug)]
pub(super) struct Edges {
    first: u32,
    numbers: Vec<u32>,
}

impl Edges {
    #[inline]
    pub fn vertex(&self, half_edge: u32) -> u32 {
        self.first + self.numbers[half_edge as usize]
    }

    /// Gives a half-edge another vertex than its twin.
    pub fn set(&mut self, half_edge: u32, vertex: u32) {
        self.numbers[half_edge as usize] = vertex - self.first;
    }
}

/// The twin of every half-edge, and the first half-edge of every vertex.
fn pair(origins: &[u32], faces: &Faces, vertices: usize) -> (Vec<u32>, Vec<u32>) {
    let end = |half_edge: usize| origins[faces.next(half_edge as u32) as usize];
    // Half-edges by their lower vertex: each list is about as long as a vertex has edges.
    let lower = |half_edge: usize| origins[half_edge].min(end(half_edge)) as usize;
    let mut starts = vec![0u32; vertices + 1];
    for half_edge in 0..origins.len() {
        starts[lower(half_edge) + 1] += 1;
    }
    for vertex in 0..vertices {
        starts[vertex + 1] += starts[vertex];
    }
    let mut ends = starts.clone();
    let mut list = vec![0u32; origins.len()];
    let (mut twins, mut leaving) = (vec![NONE; origins.len()], vec![NONE; vertices]);
    for half_edge in 0..origins.len() {
        let (low, from) = (lower(half_edge), origins[half_edge]);
        let to = end(half_edge);
        if leaving[from as usize] == NONE {
            leaving[from as usize] = half_edge as u32;
        }
        let seen = &list[starts[low] as usize..ends[low] as usize];
        let twin = seen.iter().copied().find(|&other| {
            twins[other as usize] == NONE && origins[other as usize] == to && end(other as usize) == from
        });
        if let Some(twin) = twin {
            twins[half_edge] = twin;
            twins[twin as usize] = half_edge as u32;
        }
        list[ends[low] as usize] = half_edge as u32;
        ends[low] += 1;
    }
    (twins, leaving)
}
