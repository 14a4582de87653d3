//! Catmull–Clark subdivision on half-edges.
//!
//! In: a closed cage of polygons. Out: quads, their vertices in the limit of subdivision, with limit normals.
//!
//! A half-edge is a corner of a face and the edge that leaves it; its twin runs along the same edge in the other face.
//! Each refinement makes one quad for each half-edge, in its place: half-edges 4h to 4h + 3 belong to half-edge h. So the
//! refined twins follow from the old ones, and every step is a loop over arrays. Sources: Catmull & Clark,
//! "Recursively generated B-spline surfaces on arbitrary topological meshes" (1978); Dupuy & Vanhoey, "A halfedge
//! refinement rule for parallel Catmull–Clark subdivision" (2021); limit masks after Halstead, Kass & DeRose, "Efficient,
//! fair interpolation using Catmull–Clark surfaces" (1993).

use super::cage::{Cage, Vertices};
use super::trunks::unit;
use crate::synthesis::pace::Pace;
use bevy_math::{Vec2, Vec3, ops};
use std::f32::consts::TAU;

const NONE: u32 = u32::MAX;
/// More edges than any vertex of a cage has.
const MOST_EDGES: usize = 32;

/// The order of half-edges around faces.
#[derive(Clone, Debug)]
enum Faces {
    /// Every face has four half-edges.
    Quads,
    /// The half-edges after and before each one.
    Polygons { next: Vec<u32>, previous: Vec<u32> },
}

impl Faces {
    fn next(&self, half_edge: u32) -> u32 {
        match self {
            Self::Quads => (half_edge & !3) | ((half_edge + 1) & 3),
            Self::Polygons { next, .. } => next[half_edge as usize],
        }
    }

    fn previous(&self, half_edge: u32) -> u32 {
        match self {
            Self::Quads => (half_edge & !3) | (half_edge.wrapping_sub(1) & 3),
            Self::Polygons { previous, .. } => previous[half_edge as usize],
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
        let (mut next, mut previous) = (vec![0; corners.len()], vec![0; corners.len()]);
        for face in starts.windows(2) {
            let (first, end) = (face[0], face[1]);
            for half_edge in first..end {
                let after = if half_edge + 1 == end { first } else { half_edge + 1 };
                next[half_edge as usize] = after;
                previous[after as usize] = half_edge;
            }
        }
        pace.rest(0.5).await;
        let (twins, leaving) = pair(&corners, &next, vertices.positions.len());
        Self {
            vertices,
            origins: corners,
            uvs,
            twins,
            leaving,
            faces: Faces::Polygons { next, previous },
            face_starts: starts,
        }
    }

    /// Number of half-edges.
    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// The next subdivision.
    pub async fn refined_paced(&self, pace: &Pace) -> Self {
        let old = self.vertices.positions.len();
        let face_count = self.face_starts.len() - 1;
        let edges = self.edge_numbers();
        let count = old + face_count + self.len() / 2;
        let mut vertices = Vertices {
            positions: Vec::with_capacity(count),
            radii: Vec::with_capacity(count),
            nodes: Vec::with_capacity(count),
        };
        vertices.positions.resize(old, Vec3::ZERO);
        vertices.radii.extend_from_slice(&self.vertices.radii);
        vertices.nodes.extend_from_slice(&self.vertices.nodes);
        let mut face_of = vec![0; self.len()];
        let mut face_uvs = Vec::with_capacity(face_count);
        for (face, range) in (old as u32..).zip(self.face_starts.windows(2)) {
            let range = range[0] as usize..range[1] as usize;
            let share = 1.0 / range.len() as f32;
            let (mut sum, mut radius, mut uv) = (Vec3::ZERO, 0.0, Vec2::ZERO);
            for half_edge in range.clone() {
                let corner = self.origins[half_edge] as usize;
                sum += self.vertices.positions[corner];
                radius += self.vertices.radii[corner];
                uv += self.uvs[half_edge];
                face_of[half_edge] = face;
            }
            vertices.push(sum * share, radius * share, self.vertices.nodes[self.origins[range.start] as usize]);
            face_uvs.push(uv * share);
        }
        pace.rest(0.3).await;
        let face_points = &vertices.positions[old..];
        let moved = (0..old).map(|vertex| self.moved(vertex, &face_of, face_points)).collect::<Vec<_>>();
        pace.rest(0.5).await;
        self.push_edge_points(&mut vertices, &face_of);
        vertices.positions[..old].copy_from_slice(&moved);
        self.quads_of(vertices, &face_of, &face_uvs, &edges)
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
    fn around(&self, vertex: usize) -> impl Iterator<Item = u32> + '_ {
        let first = self.leaving[vertex];
        let mut next = (first != NONE).then_some(first);
        std::iter::from_fn(move || {
            let here = next?;
            let after = self.twins[self.faces.previous(here) as usize];
            next = (after != first).then_some(after);
            Some(here)
        })
    }

    fn moved(&self, vertex: usize, face_of: &[u32], face_points: &[Vec3]) -> Vec3 {
        let here = self.vertices.positions[vertex];
        let old = self.vertices.positions.len() as u32;
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for half_edge in self.around(vertex) {
            let end = self.origins[self.faces.next(half_edge) as usize];
            sum += self.vertices.positions[end as usize] + face_points[(face_of[half_edge as usize] - old) as usize];
            count += 1.0;
        }
        here + (sum - here * (2.0 * count)) / (count * count)
    }

    fn push_edge_points(&self, vertices: &mut Vertices, face_of: &[u32]) {
        for half_edge in 0..self.len() as u32 {
            let twin = self.twins[half_edge as usize];
            if twin < half_edge {
                continue;
            }
            let [a, b] = [half_edge, twin].map(|half_edge| self.origins[half_edge as usize] as usize);
            let faces = [half_edge, twin].map(|half_edge| vertices.positions[face_of[half_edge as usize] as usize]);
            let ends = self.vertices.positions[a] + self.vertices.positions[b];
            let radius = 0.5 * (self.vertices.radii[a] + self.vertices.radii[b]);
            vertices.push(0.25 * (ends + (faces[0] + faces[1])), radius, self.vertices.nodes[a]);
        }
    }

    fn quads_of(&self, vertices: Vertices, face_of: &[u32], face_uvs: &[Vec2], edges: &[u32]) -> Self {
        let (old, count) = (self.vertices.positions.len() as u32, self.len());
        let first_edge = old + face_uvs.len() as u32;
        let (mut origins, mut twins, mut uvs) =
            (Vec::with_capacity(4 * count), Vec::with_capacity(4 * count), Vec::with_capacity(4 * count));
        let mut leaving = vec![NONE; vertices.positions.len()];
        for half_edge in 0..count as u32 {
            let (next, previous) = (self.faces.next(half_edge), self.faces.previous(half_edge));
            let [here, after, before] = [half_edge, next, previous].map(|half_edge| half_edge as usize);
            let quad = [self.origins[here], first_edge + edges[here], face_of[here], first_edge + edges[before]];
            for (corner, vertex) in quad.into_iter().enumerate() {
                if leaving[vertex as usize] == NONE {
                    leaving[vertex as usize] = 4 * half_edge + corner as u32;
                }
            }
            origins.extend_from_slice(&quad);
            let across = self.faces.next(self.twins[here]);
            twins.extend_from_slice(&[4 * across + 3, 4 * next + 2, 4 * previous + 1, 4 * self.twins[before]]);
            let (uv, face) = (self.uvs[here], face_uvs[(face_of[here] - old) as usize]);
            uvs.extend_from_slice(&[uv, 0.5 * (uv + self.uvs[after]), face, 0.5 * (self.uvs[before] + uv)]);
        }
        let face_starts = (0..=count as u32).map(|face| 4 * face).collect();
        Self { vertices, origins, uvs, twins, leaving, faces: Faces::Quads, face_starts }
    }

    /// Positions and unit normals in the limit of subdivision. All faces must be quads.
    pub async fn limits_paced(&self, pace: &Pace) -> (Vec<Vec3>, Vec<Vec3>) {
        pace.rest(0.0).await;
        let masks = Masks::new();
        (0..self.vertices.positions.len()).map(|vertex| self.limit(vertex, &masks)).unzip()
    }

    fn limit(&self, vertex: usize, masks: &Masks) -> (Vec3, Vec3) {
        let at = |half_edge: u32| self.vertices.positions[self.origins[half_edge as usize] as usize];
        let here = self.vertices.positions[vertex];
        let first = self.leaving[vertex];
        // The ends of the edges and the far corners of the faces around the vertex.
        let mut ring = [[Vec3::ZERO; 2]; MOST_EDGES];
        let (mut half_edge, mut valence) = (first, 0);
        let mut sums = [Vec3::ZERO; 2];
        while valence < MOST_EDGES {
            let [after, far, before] = [1, 2, 3].map(|step| (half_edge & !3) | ((half_edge + step) & 3));
            let neighbours = [at(after) - here, at(far) - here];
            ring[valence] = neighbours;
            sums = [sums[0] + neighbours[0], sums[1] + neighbours[1]];
            valence += 1;
            half_edge = self.twins[before as usize];
            if half_edge == first {
                break;
            }
        }
        let mut tangents = [Vec3::ZERO; 2];
        for (neighbours, weights) in ring[..valence].iter().zip(masks.of(valence)) {
            for side in 0..2 {
                tangents[side] += neighbours[0] * weights[0][side] + neighbours[1] * weights[1][side];
            }
        }
        let n = valence as f32;
        let position = here + (4.0 * sums[0] + sums[1]) / (n * (n + 5.0));
        let normal = tangents[0].cross(tangents[1]).try_normalize();
        (position, normal.unwrap_or_else(|| self.mean_normal(vertex)))
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

    /// Vertices of each face, without end.
    pub fn faces(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.face_starts.windows(2).map(|range| range[0] as usize..range[1] as usize)
    }
}

/// The twin of every half-edge, and the first half-edge of every vertex.
fn pair(origins: &[u32], next: &[u32], vertices: usize) -> (Vec<u32>, Vec<u32>) {
    // Half-edges by their lower vertex: each list is about as long as a vertex has edges.
    let lower = |half_edge: usize| origins[half_edge].min(origins[next[half_edge] as usize]) as usize;
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
        let to = origins[next[half_edge] as usize];
        if leaving[from as usize] == NONE {
            leaving[from as usize] = half_edge as u32;
        }
        let seen = &list[starts[low] as usize..ends[low] as usize];
        let twin = seen.iter().copied().find(|&other| {
            twins[other as usize] == NONE
                && origins[other as usize] == to
                && origins[next[other as usize] as usize] == from
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

/// Weights of the limit tangents, by valence: for each place around a vertex, those of the edge's end and of the face's
/// far corner, for two tangents.
struct Masks {
    by_valence: Vec<Vec<[[f32; 2]; 2]>>,
}

impl Masks {
    fn new() -> Self {
        Self { by_valence: (0..=MOST_EDGES).map(mask).collect() }
    }

    fn of(&self, valence: usize) -> &[[[f32; 2]; 2]] {
        &self.by_valence[valence]
    }
}

fn mask(valence: usize) -> Vec<[[f32; 2]; 2]> {
    let step = TAU / valence.max(1) as f32;
    let weight = 1.0 + ops::cos(step) + ops::cos(0.5 * step) * (2.0 * (9.0 + ops::cos(step))).sqrt();
    let angle = |place: usize| place as f32 * step;
    let weights = |place: usize| {
        // Half-edges around a vertex are met anticlockwise.
        let ((sine, cosine), (next_sine, next_cosine)) = (ops::sin_cos(angle(place)), ops::sin_cos(angle(place + 1)));
        [[weight * cosine, weight * sine], [cosine + next_cosine, sine + next_sine]]
    };
    (0..valence).map(weights).collect()
}
