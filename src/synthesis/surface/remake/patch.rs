//! A patch: the outline of tubes within a ball, with a belt of faces to the rest of the mesh.

use super::ball::Ball;
use super::contour::Outline;
use crate::synthesis::mesh::disjoint_sets::DisjointSets;
use bevy_math::Vec3;
use std::collections::BTreeMap;

/// The nearest that a cut comes to a vertex, as a share of the edge that it cuts.
const LEAST_SHARE: f32 = 0.1;

/// The edges of some faces, from corner to corner.
struct Edges {
    sorted: Vec<(u32, u32)>,
}

impl Edges {
    /// The edges of faces, which may repeat their last vertex.
    fn of<'a>(faces: impl Iterator<Item = &'a [u32]>) -> Self {
        let mut sorted: Vec<(u32, u32)> = Vec::new();
        for face in faces {
            let next = |corner: usize| face[(corner + 1) % face.len()];
            sorted.extend((0..face.len()).map(|corner| (face[corner], next(corner))).filter(|(a, b)| a != b));
        }
        sorted.sort_unstable();
        Self { sorted }
    }

    /// Whether no face has an edge the other way round.
    fn is_open(&self, &(a, b): &(u32, u32)) -> bool {
        self.sorted.binary_search(&(b, a)).is_err()
    }

    fn open(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.sorted.iter().copied().filter(|edge| self.is_open(edge))
    }
}

/// The open edges of some faces, and how the faces hang together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Rim {
    /// Loops of vertices at open edges, each in the order of its faces' edges.
    pub loops: Vec<Vec<u32>>,
    /// For each loop, the piece of faces that it belongs to.
    pieces: Vec<usize>,
    /// V − E + F of each piece.
    euler: Vec<i64>,
}

impl Rim {
    /// The rim of some faces; a face may repeat its last vertex. `None` if loops touch each other.
    pub fn of<'a>(faces: impl Iterator<Item = &'a [u32]>) -> Option<Self> {
        let mut firsts = Vec::new();
        let edges = Edges::of(faces.inspect(|face| firsts.push(face[0])));
        let open: Vec<(u32, u32)> = edges.open().collect();
        if open.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return None;
        }
        let mut vertices: Vec<u32> = edges.sorted.iter().map(|edge| edge.0).collect();
        vertices.dedup();
        let number = |vertex: u32| vertices.partition_point(|&other| other < vertex);
        let mut sets = DisjointSets::new(vertices.len());
        edges.sorted.iter().for_each(|&(a, b)| sets.unite(number(a) as u32, number(b) as u32));
        let (pieces, count) = sets.places();
        let mut euler = vec![0; count];
        pieces.iter().for_each(|&piece| euler[piece] += 1);
        firsts.iter().for_each(|&vertex| euler[pieces[number(vertex)]] += 1);
        for edge in edges.sorted.iter().filter(|edge| edge.0 < edge.1 || edges.is_open(edge)) {
            euler[pieces[number(edge.0)]] -= 1;
        }
        let mut rim = Self { euler, ..Self::default() };
        let mut is_done = vec![false; open.len()];
        for first in 0..open.len() {
            let (mut around, mut edge) = (Vec::new(), first);
            while !std::mem::replace(&mut is_done[edge], true) {
                around.push(open[edge].0);
                edge = open.binary_search_by_key(&open[edge].1, |edge| edge.0).ok()?;
            }
            if let Some(&vertex) = around.first() {
                rim.pieces.push(pieces[number(vertex)]);
                rim.loops.push(around);
            }
        }
        Some(rim)
    }

    /// The same with all vertices' numbers raised.
    pub fn numbered_from(mut self, first: u32) -> Self {
        self.loops.iter_mut().flatten().for_each(|vertex| *vertex += first);
        self
    }

    /// For each loop, the nearest of another rim. `None` unless they belong together one by one, and the faces hang
    /// together alike: so one can take the place of the other.
    pub fn matched(&self, other: &Self, position: impl Fn(u32) -> Vec3) -> Option<Vec<usize>> {
        if self.loops.len() != other.loops.len() || self.euler.len() != other.euler.len() {
            return None;
        }
        let middle =
            |around: &Vec<u32>| around.iter().map(|&vertex| position(vertex)).sum::<Vec3>() / around.len() as f32;
        let others: Vec<Vec3> = other.loops.iter().map(middle).collect();
        let mut is_taken = vec![false; others.len()];
        let mut pieces = vec![None; self.euler.len()];
        let mut numbers = Vec::with_capacity(others.len());
        for (around, &piece) in self.loops.iter().zip(&self.pieces) {
            let here = middle(around);
            let distance = |number: usize| others[number].distance_squared(here);
            let nearest = (0..others.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)))?;
            let its = other.pieces[nearest];
            let is_alike = *pieces[piece].get_or_insert(its) == its && self.euler[piece] == other.euler[its];
            if std::mem::replace(&mut is_taken[nearest], true) || !is_alike {
                return None;
            }
            numbers.push(nearest);
        }
        (self.closed_pieces() == other.closed_pieces()).then_some(numbers)
    }

    /// V − E + F of pieces without an open edge, in order.
    fn closed_pieces(&self) -> Vec<i64> {
        let is_closed = |piece: &usize| !self.pieces.contains(piece);
        let mut euler: Vec<i64> = (0..self.euler.len()).filter(is_closed).map(|piece| self.euler[piece]).collect();
        euler.sort_unstable();
        euler
    }
}

/// An outline as far as it lies within a ball, without the walls of voids: pieces that have no open edge, unless all of
/// it lies in the ball.
pub(super) fn within(outline: Outline, ball: &Ball) -> Outline {
    let Outline { mut positions, triangles } = outline;
    // Above zero beyond the ball.
    let heights: Vec<f32> = positions.iter().map(|&point| ball.height(point)).collect();
    let is_beyond = |vertex: u32| heights[vertex as usize] > 0.0;
    let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut kept = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let count = triangle.iter().filter(|&&vertex| is_beyond(vertex)).count();
        if count == 0 {
            kept.push(triangle);
        }
        if !(1..3).contains(&count) {
            continue;
        }
        let mut middle = |inside: u32, outside: u32| {
            *middles.entry((inside, outside)).or_insert_with(|| {
                let [a, b] = [inside, outside].map(|vertex| heights[vertex as usize]);
                let share = (a / (a - b)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
                positions.push(positions[inside as usize].lerp(positions[outside as usize], share));
                (positions.len() - 1) as u32
            })
        };
        let is_odd = |corner: &usize| is_beyond(triangle[*corner]) == (count == 1);
        let odd = (0..3).find(is_odd).unwrap_or(0);
        let [a, b, c] = [0, 1, 2].map(|step| triangle[(odd + step) % 3]);
        if count == 1 {
            let [ab, ac] = [middle(b, a), middle(c, a)];
            kept.extend([[ab, b, c], [ab, c, ac]]);
        } else {
            let [ab, ac] = [middle(a, b), middle(a, c)];
            kept.push([a, ab, ac]);
        }
    }
    let triangles = without_voids(kept, &positions);
    compact(&positions, triangles)
}

/// The triangles of pieces that have an open edge; if there are none, those of the outermost piece.
fn without_voids(triangles: Vec<[u32; 3]>, positions: &[Vec3]) -> Vec<[u32; 3]> {
    let mut sets = DisjointSets::new(positions.len());
    for &[a, b, c] in &triangles {
        sets.unite(a, b);
        sets.unite(a, c);
    }
    let mut stays = vec![false; positions.len()];
    for (vertex, _) in Edges::of(triangles.iter().map(|triangle| &triangle[..])).open() {
        stays[sets.first(vertex) as usize] = true;
    }
    if !stays.contains(&true) {
        let outermost = triangles
            .iter()
            .flatten()
            .max_by(|&&a, &&b| positions[a as usize].x.total_cmp(&positions[b as usize].x).then(b.cmp(&a)));
        if let Some(&vertex) = outermost {
            stays[sets.first(vertex) as usize] = true;
        }
    }
    triangles.into_iter().filter(|&[a, ..]| stays[sets.first(a) as usize]).collect()
}

/// Without vertices that no triangle has.
fn compact(positions: &[Vec3], mut triangles: Vec<[u32; 3]>) -> Outline {
    let mut numbers = vec![u32::MAX; positions.len()];
    let mut used = Vec::with_capacity(positions.len());
    for corner in triangles.iter_mut().flatten() {
        let number = &mut numbers[*corner as usize];
        if *number == u32::MAX {
            *number = used.len() as u32;
            used.push(positions[*corner as usize]);
        }
        *corner = *number;
    }
    Outline { positions: used, triangles }
}

/// Triangles between two loops that run the same way round: the edges of the first keep their direction, those of the
/// second are met from the other side. Of all ways to join them from their nearest vertices on, the one with the shortest
/// edges in sum.
///
/// Source: Fuchs, Kedem & Uselton, "Optimal surface reconstruction from planar contours" (1977).
pub(super) fn belt([first, second]: [&[u32]; 2], position: impl Fn(u32) -> Vec3, triangles: &mut Vec<[u32; 3]>) {
    let places = |around: &[u32]| -> Vec<Vec3> { around.iter().map(|&vertex| position(vertex)).collect() };
    let [a, b] = [places(first), places(second)];
    let nearest = |place: usize| {
        (0..b.len()).min_by(|&p, &q| a[place].distance_squared(b[p]).total_cmp(&a[place].distance_squared(b[q])))
    };
    let start = (0..a.len())
        .filter_map(|place| nearest(place).map(|other| [place, other]))
        .min_by(|p, q| a[p[0]].distance_squared(b[p[1]]).total_cmp(&a[q[0]].distance_squared(b[q[1]])));
    let Some([from, to]) = start else { return };
    let at = |i: usize, j: usize| [(from + i) % a.len(), (to + j) % b.len()];
    // The least length of edges up to each pair, and whether the step to it was along the first loop.
    let columns = b.len() + 1;
    let mut best = vec![(f32::INFINITY, false); (a.len() + 1) * columns];
    best[0].0 = 0.0;
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            let [p, q] = at(i, j);
            let edge = a[p].distance(b[q]);
            let along_first = if i > 0 { best[(i - 1) * columns + j].0 } else { f32::INFINITY };
            let along_second = if j > 0 { best[i * columns + j - 1].0 } else { f32::INFINITY };
            if i + j > 0 {
                best[i * columns + j] = (along_first.min(along_second) + edge, along_first <= along_second);
            }
        }
    }
    let (mut i, mut j) = (a.len(), b.len());
    while i + j > 0 {
        let [p, q] = at(i, j);
        if best[i * columns + j].1 {
            i -= 1;
            triangles.push([first[at(i, j)[0]], first[p], second[q]]);
        } else {
            j -= 1;
            triangles.push([second[q], second[at(i, j)[1]], first[p]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of vertices, and its faces with another one.
    fn ring(count: u32, height: f32) -> Vec<Vec3> {
        let angle = |step: u32| std::f32::consts::TAU * step as f32 / count as f32;
        (0..count).map(|step| Vec3::new(angle(step).cos(), angle(step).sin(), height)).collect()
    }

    #[test]
    fn a_belt_between_rings_of_other_numbers_closes_and_goes_the_shortest_way() {
        let positions = [ring(5, 0.0), ring(23, 0.4)].concat();
        let (first, second): (Vec<u32>, Vec<u32>) = ((0..5).collect(), (5..28).collect());
        let mut triangles = Vec::new();
        belt([&first, &second], |vertex| positions[vertex as usize], &mut triangles);
        assert_eq!(triangles.len(), 28);
        let rim = Rim::of(triangles.iter().map(|triangle| &triangle[..])).unwrap();
        // A belt has two rims and hangs together as a ring.
        assert_eq!((rim.loops.len(), &rim.euler[..]), (2, &[0][..]));
        let longest = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).map(|(a, b)| {
            let [a, b] = [a, b].map(|vertex: u32| positions[vertex as usize]);
            a.distance(b)
        });
        assert!(longest.fold(0.0, f32::max) < 1.3, "no edge leads across");
    }

    #[test]
    fn a_rim_tells_a_disc_from_a_handle_and_refuses_loops_that_touch() {
        let disc = [[0u32, 1, 2], [0, 2, 3]];
        let rim = Rim::of(disc.iter().map(|face| &face[..])).unwrap();
        assert_eq!((rim.loops, &rim.euler[..]), (vec![vec![0, 1, 2, 3]], &[1][..]));
        let tetrahedron = [[0u32, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
        let ball = Rim::of(tetrahedron.iter().map(|face| &face[..])).unwrap();
        assert_eq!((ball.loops.len(), ball.closed_pieces()), (0, vec![2]));
        // A closed piece with a handle cannot take its place: seven vertices, each joined with all others.
        let torus =
            (0..7u32).flat_map(|at| [[at, at + 1, at + 3], [at, at + 3, at + 2]]).map(|face| face.map(|at| at % 7));
        let torus: Vec<[u32; 3]> = torus.collect();
        let torus = Rim::of(torus.iter().map(|face| &face[..])).unwrap();
        assert_eq!((torus.loops.len(), torus.closed_pieces()), (0, vec![0]));
        assert_eq!(ball.matched(&torus, |_| Vec3::ZERO), None);
        assert_eq!(ball.matched(&ball, |_| Vec3::ZERO), Some(Vec::new()));
        let touching = [[0u32, 1, 2], [0, 3, 4]];
        assert!(Rim::of(touching.iter().map(|face| &face[..])).is_none());
        let two = [[0u32, 1, 2], [3, 4, 5]];
        let two = Rim::of(two.iter().map(|face| &face[..])).unwrap();
        assert_eq!((two.loops.len(), &two.euler[..]), (2, &[1, 1][..]));
    }

    #[test]
    fn a_ball_cuts_an_outline_and_drops_the_walls_of_voids() {
        // A square across the ball's surface, and a tetrahedron within.
        let positions: Vec<Vec3> = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.5, 0.0]]
            .into_iter()
            .chain([[0.0, 0.0, 0.5], [0.1, 0.0, 0.5], [0.0, 0.1, 0.5], [0.0, 0.0, 0.6]])
            .map(Vec3::from)
            .collect();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 5, 7], [5, 6, 7], [6, 4, 7]];
        let cut = within(Outline { positions, triangles }, &Ball { center: Vec3::ZERO, radius: 1.0 });
        assert!(cut.positions.iter().all(|point| point.z == 0.0 && point.length() < 1.2), "{:?}", cut.positions);
        assert_eq!(cut.triangles.len(), 3);
    }
}
