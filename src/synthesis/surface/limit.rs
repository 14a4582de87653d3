//! The last subdivision: vertices in the limit of all further ones, with limit normals, as a mesh.
//!
//! In: half-edges. Out: a [`SurfaceMesh`] of quads. The quads' own half-edges are never made: the neighbours of a vertex
//! in a face and on an edge are known from the face's and the edge's own half-edges.
//!
//! Source of the limit masks: Halstead, Kass & `DeRose`, "Efficient, fair interpolation using Catmull–Clark surfaces"
//! (1993).

use super::cage::Vertices;
use super::direction::unit;
use super::half_edges::{Edges, HalfEdges, Split};
use super::mesh::SurfaceMesh;
use crate::synthesis::pace::Pace;
use bevy_math::{Vec2, Vec3, ops};
use std::f32::consts::TAU;

/// More edges than any vertex of a cage has.
const MOST_EDGES: usize = 32;

/// Makes the mesh of the next subdivision. Each array is made as late and dropped as early as can be, so that a large mesh
/// needs hardly more memory than it takes itself.
pub(super) async fn finish(mut half_edges: HalfEdges, origin: Vec3, pace: &Pace) -> SurfaceMesh {
    let mut split = half_edges.split_paced(&pace.part(0.0..0.35)).await;
    half_edges.vertices.positions = Vec::new();
    let mut mesh = SurfaceMesh::default();
    (mesh.positions, mesh.normals) = limits(&half_edges, &split, origin, &pace.part(0.35..0.65)).await;
    (split.positions, split.face_of) = (Vec::new(), Vec::new());
    (mesh.radii, mesh.nodes) = half_edges.marks_of_split(&pace.part(0.65..0.7)).await;
    half_edges.vertices = Vertices::default();
    let charts = Charts::of(&mut half_edges, &mut split, mesh.positions.len(), &pace.part(0.7..0.8)).await;
    let (face_starts, Split { edges, first_face, .. }) = (half_edges.into_face_starts(), split);
    mesh.faces = charts.quads(face_starts, edges, first_face, &pace.part(0.8..0.9)).await;
    (mesh.uvs, mesh.copies) = (charts.uvs, charts.copies);
    mesh.complete();
    pace.rest(1.0).await;
    mesh
}

/// Positions and normals of all vertices, in their order.
async fn limits(half_edges: &HalfEdges, split: &Split, origin: Vec3, pace: &Pace) -> (Vec<Vec3>, Vec<Vec3>) {
    let limits = Limits { half_edges, split, masks: Masks::new() };
    let count = split.positions.len();
    let (mut positions, mut normals) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut push = |(position, normal): (Vec3, Vec3)| {
        positions.push(origin + position);
        normals.push(normal);
    };
    let old = split.first_face as usize;
    pace.part(0.0..0.3).each(old, |vertex| push(limits.of_vertex(vertex))).await;
    pace.part(0.3..0.6).each(half_edges.face_count(), |face| push(limits.of_face(face))).await;
    let edge = |half_edge: usize| {
        let half_edge = half_edge as u32;
        if half_edges.twin(half_edge) > half_edge {
            push(limits.of_edge(half_edge));
        }
    };
    pace.part(0.6..1.0).each(half_edges.len(), edge).await;
    (positions, normals)
}

/// Limits of the vertices of a subdivision.
struct Limits<'a> {
    half_edges: &'a HalfEdges,
    split: &'a Split,
    masks: Masks,
}

/// A neighbour of a vertex: the end of an edge, and the far corner of the face that follows it anticlockwise.
type Neighbour = [Vec3; 2];

impl Limits<'_> {
    #[inline]
    fn of_vertex(&self, vertex: usize) -> (Vec3, Vec3) {
        let center = self.split.position(vertex as u32);
        let neighbour = |half_edge: u32| {
            let face = self.split.face_of[half_edge as usize];
            [self.split.position(self.split.edges.vertex(half_edge)), self.split.position(face)]
        };
        let mut around = self.half_edges.around(vertex);
        let mut first = [[Vec3::ZERO; 2]; 4];
        for place in &mut first {
            let Some(half_edge) = around.next() else { return self.irregular(center, vertex, neighbour) };
            *place = neighbour(half_edge);
        }
        if around.next().is_some() { self.irregular(center, vertex, neighbour) } else { regular(center, first) }
    }

    fn irregular(&self, center: Vec3, vertex: usize, neighbour: impl Fn(u32) -> Neighbour) -> (Vec3, Vec3) {
        let neighbours: Vec<Neighbour> = self.half_edges.around(vertex).map(neighbour).collect();
        self.limit(center, &neighbours)
    }

    #[inline]
    fn of_face(&self, face: usize) -> (Vec3, Vec3) {
        let center = self.split.position(self.split.first_face + face as u32);
        let range = self.half_edges.face(face);
        let first = range.start;
        let neighbour = |half_edge: u32| {
            let before = if half_edge == first { range.end - 1 } else { half_edge - 1 };
            let corner = self.half_edges.origins[half_edge as usize];
            [self.split.position(self.split.edges.vertex(before)), self.split.position(corner)]
        };
        if range.len() == 4 {
            let neighbours = [neighbour(first), neighbour(first + 1), neighbour(first + 2), neighbour(first + 3)];
            return regular(center, neighbours);
        }
        self.limit(center, &range.clone().map(neighbour).collect::<Vec<_>>())
    }

    #[inline]
    fn of_edge(&self, half_edge: u32) -> (Vec3, Vec3) {
        let (mesh, split) = (self.half_edges, self.split);
        let twin = mesh.twin(half_edge);
        let face = |half_edge: u32| split.position(split.face_of[half_edge as usize]);
        let corner = |half_edge: u32| split.position(mesh.origins[half_edge as usize]);
        let edge = |half_edge: u32| split.position(split.edges.vertex(half_edge));
        let neighbours = [
            [face(half_edge), edge(mesh.previous(half_edge))],
            [corner(half_edge), edge(mesh.next(twin))],
            [face(twin), edge(mesh.previous(twin))],
            [corner(twin), edge(mesh.next(half_edge))],
        ];
        regular(edge(half_edge), neighbours)
    }

    /// The limit at a vertex, and its normal.
    fn limit(&self, center: Vec3, neighbours: &[Neighbour]) -> (Vec3, Vec3) {
        let count = neighbours.len().min(MOST_EDGES);
        let mut sum = Vec3::ZERO;
        let mut tangents = [Vec3::ZERO; 2];
        for (&[end, far], weights) in neighbours.iter().zip(self.masks.of(count)) {
            let (end, far) = (end - center, far - center);
            sum += 4.0 * end + far;
            for side in 0..2 {
                tangents[side] += end * weights[0][side] + far * weights[1][side];
            }
        }
        let n = count as f32;
        (center + sum / (n * (n + 5.0)), normal_of(tangents, center, neighbours))
    }
}

/// The limit at a vertex with four edges: there, the surface is a bicubic B-spline.
#[inline]
fn regular(center: Vec3, neighbours: [Neighbour; 4]) -> (Vec3, Vec3) {
    let [[e0, f0], [e1, f1], [e2, f2], [e3, f3]] = neighbours;
    let ends = (e0 + e2) + (e1 + e3);
    let far = (f0 + f2) + (f1 + f3);
    let position = (16.0 * center + 4.0 * ends + far) / 36.0;
    let (straight, slanted) = (f0 - f2, f1 - f3);
    let tangents = [4.0 * (e0 - e2) + straight - slanted, 4.0 * (e1 - e3) + straight + slanted];
    (position, normal_of(tangents, center, &neighbours))
}

/// The unit normal of two tangents; if they vanish, that of the faces around.
#[inline]
fn normal_of(tangents: [Vec3; 2], center: Vec3, neighbours: &[Neighbour]) -> Vec3 {
    let normal = tangents[0].cross(tangents[1]);
    normal.try_normalize().unwrap_or_else(|| unusual_normal(normal, center, neighbours))
}

/// The same for a normal that has no length, or one too small for its square.
#[cold]
fn unusual_normal(normal: Vec3, center: Vec3, neighbours: &[Neighbour]) -> Vec3 {
    unit(normal).unwrap_or_else(|| fan_normal(center, neighbours))
}

/// The mean normal of the faces around a vertex, weighted by area: for one whose limit tangents vanish.
fn fan_normal(center: Vec3, neighbours: &[Neighbour]) -> Vec3 {
    let next = neighbours.iter().cycle().skip(1);
    let sum: Vec3 = neighbours.iter().zip(next).map(|(a, b)| (a[0] - center).cross(b[0] - center)).sum();
    unit(sum).unwrap_or(Vec3::Z)
}

/// Weights of the limit tangents, by valence: for each place around a vertex, those of the edge's end and of the
/// face's far corner.
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

/// Vertices with their texture coordinates. A vertex with several is copied.
struct Charts {
    uvs: Vec<Vec2>,
    copies: Vec<u32>,
    /// Vertex of each half-edge's corner.
    corners: Vec<u32>,
}

impl Charts {
    /// Takes the place of the half-edges' origins, and gives edges of a seam two vertices.
    async fn of(mesh: &mut HalfEdges, split: &mut Split, unique: usize, pace: &Pace) -> Self {
        let mut charts = Self {
            uvs: Vec::with_capacity(unique + unique / 4),
            copies: Vec::new(),
            corners: std::mem::take(&mut mesh.origins),
        };
        charts.uvs.resize(split.first_face as usize, Vec2::ZERO);
        charts.uvs.append(&mut split.face_uvs);
        let middle = |half_edge: u32| {
            let next = mesh.next(half_edge);
            0.5 * (mesh.uvs[half_edge as usize] + mesh.uvs[next as usize])
        };
        let firsts = |half_edge: &u32| mesh.twin(*half_edge) > *half_edge;
        charts.uvs.extend((0..mesh.len() as u32).filter(firsts).map(middle));
        pace.rest(0.3).await;
        pace.part(0.3..0.7).each(split.first_face as usize, |vertex| charts.add_vertex(mesh, vertex)).await;
        let edge = |half_edge: usize| {
            let half_edge = half_edge as u32;
            let twin = mesh.twin(half_edge);
            if twin < half_edge && middle(half_edge) != middle(twin) {
                let copy = charts.copy(split.edges.vertex(half_edge), middle(half_edge));
                split.edges.set(half_edge, copy);
            }
        };
        pace.part(0.7..1.0).each(mesh.len(), edge).await;
        charts
    }

    /// Gives the corners around a vertex the vertex itself or copies of it.
    fn add_vertex(&mut self, mesh: &HalfEdges, vertex: usize) {
        let mut first = None;
        let own = self.copies.len();
        for half_edge in mesh.around(vertex) {
            let uv = mesh.uvs[half_edge as usize];
            let is_first = *first.get_or_insert(uv) == uv;
            self.corners[half_edge as usize] = if is_first {
                vertex as u32
            } else {
                let unique = self.uvs.len() - self.copies.len();
                let same = (own..self.copies.len()).map(|copy| unique + copy).find(|&copy| self.uvs[copy] == uv);
                same.map_or_else(|| self.copy(vertex as u32, uv), |copy| copy as u32)
            };
        }
        self.uvs[vertex] = first.unwrap_or_default();
    }

    fn copy(&mut self, original: u32, uv: Vec2) -> u32 {
        self.uvs.push(uv);
        self.copies.push(original);
        (self.uvs.len() - 1) as u32
    }

    /// The quads, one in the place of each half-edge, given the first half-edge of each face.
    async fn quads(&self, face_starts: Vec<u32>, edges: Edges, first_face: u32, pace: &Pace) -> Vec<[u32; 4]> {
        let mut quads = Vec::with_capacity(self.corners.len());
        let add = |face: usize| {
            let range = face_starts[face]..face_starts[face + 1];
            let mut before = edges.vertex(range.end - 1);
            for half_edge in range {
                let edge = edges.vertex(half_edge);
                quads.push([self.corners[half_edge as usize], edge, first_face + face as u32, before]);
                before = edge;
            }
        };
        pace.each(face_starts.len() - 1, add).await;
        quads
    }
}
