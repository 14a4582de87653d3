//! A sphere of near-equal triangles, with a chart for each of an icosahedron's twenty faces.
//!
//! In: the number of parts that an edge of the icosahedron is divided in. Out: unit vectors, triangles, and texture
//! coordinates. Texels are near square everywhere, there is no pole, and no chart lies on another.

use bevy_math::{Vec2, Vec3};
use std::collections::BTreeMap;

/// A sphere in triangles. Vertices on borders of charts occur once for each chart.
pub(super) struct Icosphere {
    /// Parts of an edge of the icosahedron.
    pub parts: usize,
    /// Unit vectors, one per vertex.
    pub directions: Vec<Vec3>,
    /// For each vertex, the first with the same direction.
    pub shared: Vec<u32>,
    /// Texture coordinates, one per vertex.
    pub uvs: Vec<Vec2>,
    /// Counter-clockwise seen from outside; in the texture they are not mirrored.
    pub triangles: Vec<[u32; 3]>,
}

/// Rows of charts, and charts in each: they take a rectangle that is nearly square.
const ROWS: usize = 4;
const COLUMNS: usize = 5;
/// Gap beside each chart, as a share of the texture.
const GAP: f32 = 0.005;

impl Icosphere {
    /// Triangles of the icosahedron.
    pub const FACES: usize = ROWS * COLUMNS;

    /// Divides each edge in so many parts, at least one: each face becomes `parts`² triangles.
    pub fn new(parts: usize) -> Self {
        let corners = icosahedron();
        let faces = faces(&corners);
        Self::build(&faces, parts.max(1), |number, weights| {
            mean(faces[number].map(|corner| corners[corner]), weights.map(|weight| weight as f32))
        })
    }

    /// A sphere of other parts, whose vectors lie between those of this one, wherever they have been moved.
    pub fn divided(&self, parts: usize) -> Self {
        let faces = faces(&icosahedron());
        let parts = parts.max(1);
        Self::build(&faces, parts, |number, weights| {
            self.between(number, weights.map(|weight| weight * self.parts), parts)
        })
    }

    /// Makes the vertices face by face. `direction` is that of a vertex of a face, by its shares of the face's corners,
    /// which have the sum `parts`; its length doesn't matter.
    fn build(faces: &[[usize; 3]], parts: usize, direction: impl Fn(usize, [usize; 3]) -> Vec3) -> Self {
        let mut sphere =
            Self { parts, directions: Vec::new(), shared: Vec::new(), uvs: Vec::new(), triangles: Vec::new() };
        let mut first_at = BTreeMap::new();
        for (number, &face) in faces.iter().enumerate() {
            let chart = chart(number);
            sphere.triangles.extend(triangles_of(sphere.directions.len() as u32, parts as u32));
            for (row, column) in (0..=parts).flat_map(|row| (0..=row).map(move |column| (row, column))) {
                let weights = [parts - row, row - column, column];
                let vertex = sphere.directions.len() as u32;
                let owner = border(face, weights).map_or(vertex, |key| *first_at.entry(key).or_insert(vertex));
                sphere.shared.push(owner);
                sphere.directions.push(match owner == vertex {
                    true => direction(number, weights).normalize_or(Vec3::Y),
                    false => sphere.directions[owner as usize],
                });
                let [a, b, c] = weights.map(|weight| weight as f32 / parts as f32);
                sphere.uvs.push(chart[0] * a + chart[1] * b + chart[2] * c);
            }
        }
        sphere
    }

    /// The vector at a place of a face, given by whole shares of its corners with the sum `parts` times those of this
    /// sphere.
    fn between(&self, number: usize, weights: [usize; 3], parts: usize) -> Vec3 {
        // Rows and columns of the grid, as whole numbers and what is left.
        let (down, across) = (weights[1] + weights[2], weights[2]);
        let row = (down / parts).min(self.parts - 1);
        let column = (across / parts).min(row);
        let [down, across] = [down - row * parts, across - column * parts].map(|rest| rest as f32 / parts as f32);
        let first = number * (self.parts + 1) * (self.parts + 2) / 2;
        let at = |row: usize, column: usize| self.directions[first + row * (row + 1) / 2 + column];
        if across <= down {
            mean([at(row, column), at(row + 1, column), at(row + 1, column + 1)], [1.0 - down, down - across, across])
        } else {
            mean([at(row, column), at(row, column + 1), at(row + 1, column + 1)], [1.0 - across, across - down, down])
        }
    }
}

/// Triangles between the rows of a face's vertices, the first row being one vertex.
fn triangles_of(first: u32, parts: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..parts).flat_map(move |row| {
        let (above, below) = (first + row * (row + 1) / 2, first + (row + 1) * (row + 2) / 2);
        let upright = (0..=row).map(move |column| [above + column, below + column, below + column + 1]);
        let inverted = (0..row).map(move |column| [above + column, below + column + 1, above + column + 1]);
        upright.chain(inverted)
    })
}

/// What names a vertex on the border of a face: the corners that have a share of it, with these shares. `None` within.
fn border(face: [usize; 3], weights: [usize; 3]) -> Option<[(usize, usize); 2]> {
    let mut parts: Vec<(usize, usize)> = face.into_iter().zip(weights).filter(|&(_, weight)| weight > 0).collect();
    parts.sort_unstable();
    match parts[..] {
        [only] => Some([only, only]),
        [low, high] => Some([low, high]),
        _ => None,
    }
}

fn mean([a, b, c]: [Vec3; 3], weights: [f32; 3]) -> Vec3 {
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// Corners of a face's chart, counter-clockwise in the picture, where v points down. In a row, charts stand on a side and
/// on a corner in turn.
fn chart(number: usize) -> [Vec2; 3] {
    let (row, column) = (number / COLUMNS, number % COLUMNS);
    let side = (1.0 - (COLUMNS + 1) as f32 * GAP) / (0.5 * (COLUMNS + 1) as f32);
    let height = (1.0 - (ROWS + 1) as f32 * GAP) / ROWS as f32;
    let left = GAP + column as f32 * (0.5 * side + GAP);
    let top = GAP + row as f32 * (height + GAP);
    let [upper, lower] = [top, top + height];
    let at = |x: f32, v: f32| Vec2::new(left + x * side, v);
    if column % 2 == 0 {
        [at(0.5, upper), at(0.0, lower), at(1.0, lower)]
    } else {
        [at(0.5, lower), at(1.0, upper), at(0.0, upper)]
    }
}

/// An icosahedron's vertices, as unit vectors.
fn icosahedron() -> Vec<Vec3> {
    let golden = 0.5 * (1.0 + 5.0f32.sqrt());
    [[0.0, 1.0, golden], [0.0, -1.0, golden], [0.0, 1.0, -golden], [0.0, -1.0, -golden]]
        .iter()
        .flat_map(|&[a, b, c]| [Vec3::new(a, b, c), Vec3::new(b, c, a), Vec3::new(c, a, b)])
        .map(Vec3::normalize)
        .collect()
}

/// The 20 triples of neighbours among an icosahedron's vertices, turned outward.
fn faces(points: &[Vec3]) -> Vec<[usize; 3]> {
    let near = |a: usize, b: usize| points[a].distance_squared(points[b]) < 1.2;
    let mut faces = Vec::with_capacity(Icosphere::FACES);
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            for c in b + 1..points.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = points[a].dot(points[b].cross(points[c])) > 0.0;
                    faces.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::mesh::{Closure, self_intersections};

    #[test]
    fn a_sphere_is_closed_and_its_charts_lie_apart() {
        for parts in [1, 2, 3, 8, 17] {
            let sphere = Icosphere::new(parts);
            assert_eq!(sphere.triangles.len(), Icosphere::FACES * parts * parts);
            let welded: Vec<[u32; 3]> =
                sphere.triangles.iter().map(|corners| corners.map(|corner| sphere.shared[corner as usize])).collect();
            let closure = Closure::of(&sphere.directions, &welded);
            assert!(closure.is_closed() && closure.is_oriented() && closure.euler() == 2, "{parts}: {closure:?}");
            assert_eq!(closure.vertices, 10 * parts * parts + 2);
            let flat: Vec<Vec3> = sphere.uvs.iter().map(|uv| uv.extend(0.0)).collect();
            assert_eq!(self_intersections(&flat, &sphere.triangles), [[0; 2]; 0], "{parts}");
            for corners in &sphere.triangles {
                let [a, b, c] = corners.map(|corner| sphere.directions[corner as usize]);
                assert!((b - a).cross(c - a).dot(a) > 0.0, "{parts}: a triangle faces in");
                let [a, b, c] = corners.map(|corner| sphere.uvs[corner as usize]);
                assert!((b - a).perp_dot(c - a) < 0.0, "{parts}: a triangle is mirrored in the texture");
                assert!([a, b, c].iter().all(|uv| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()));
            }
        }
    }
}
