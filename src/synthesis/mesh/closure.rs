//! Whether triangles close a surface.
//!
//! In: positions and triangles. Out: a [`Closure`], the numbers of all that is needed to tell, and of all that is
//! wrong. It goes by vertex numbers alone and welds nothing; for meshes with duplicated vertices see
//! [`topology`](super::topology).

use crate::synthesis::mesh::{disjoint_sets::DisjointSets, triangle_pair::has_area};
use bevy_math::Vec3;

/// What a mesh consists of, and what keeps it from being a closed surface.
///
/// A face is a triangle with three different vertices. Only the edges and vertices of faces count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Closure {
    /// Vertices of faces.
    pub vertices: usize,
    /// Pairs of vertices that are the ends of a side of a face.
    pub edges: usize,
    /// Triangles with three different vertices.
    pub faces: usize,
    /// Parts of the mesh. Faces with a common edge belong to the same part.
    pub components: usize,
    /// Edges with one face.
    pub boundary_edges: usize,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
    /// Edges with several faces, that more of them run along in one direction than in the other.
    pub misoriented_edges: usize,
    /// Vertices at which faces meet that aren't connected across edges of this vertex: the tips of two cones. The ends
    /// of a [non-manifold edge](Self::non_manifold_edges) don't count for that.
    pub non_manifold_vertices: usize,
    /// Triangles that use a vertex twice, have exactly no area, or have a corner that isn't finite. Those with three
    /// different vertices are faces, too.
    pub degenerate_faces: usize,
}

/// A side of a face. Their order puts uses of the same edge side by side.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    /// The lower vertex in the upper half, the higher in the lower half.
    edge: u64,
    /// Its corners at the lower and the higher vertex: three times the face, plus the place in it.
    corners: [u32; 2],
}

impl Side {
    /// Whether the face runs from the lower vertex to the higher.
    fn is_forward(self) -> bool {
        // The place after the last is the first.
        matches!((self.corners[0] % 3, self.corners[1] % 3), (0, 1) | (1, 2) | (2, 0))
    }
}

impl Closure {
    /// Looks at a mesh. Takes time n log n in the number of triangles.
    ///
    /// # Panics
    /// If a triangle has a vertex that does not exist.
    pub fn of(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let is_face = |&[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
        let is_degenerate = |corners: &&[u32; 3]| !has_area(corners.map(|vertex| positions[vertex as usize]));
        let faces: Vec<[u32; 3]> = triangles.iter().copied().filter(is_face).collect();
        let mut closure = Self {
            faces: faces.len(),
            // A repeated vertex leaves no area.
            degenerate_faces: triangles.iter().filter(is_degenerate).count(),
            ..Self::default()
        };
        let mut sides = sides(&faces);
        sides.sort_unstable();
        // Faces connected across edges, and corners at a vertex connected across edges of that vertex.
        let (mut parts, mut fans) = (DisjointSets::new(faces.len()), DisjointSets::new(3 * faces.len()));
        for uses in sides.chunk_by(|a, b| a.edge == b.edge) {
            closure.count_edge(uses);
            for pair in uses.windows(2) {
                let [a, b] = [pair[0].corners, pair[1].corners];
                parts.unite(a[0] / 3, b[0] / 3);
                fans.unite(a[0], b[0]);
                fans.unite(a[1], b[1]);
            }
        }
        closure.components = parts.firsts().count();
        let mut fans_at = vec![0u32; positions.len()];
        for corner in fans.firsts() {
            fans_at[faces[corner / 3][corner % 3] as usize] += 1;
        }
        closure.vertices = fans_at.iter().filter(|&&fans| fans > 0).count();
        closure.non_manifold_vertices = fans_at.iter().filter(|&&fans| fans > 1).count();
        closure
    }

    /// Counts an edge, given its uses.
    fn count_edge(&mut self, uses: &[Side]) {
        let forward = uses.iter().filter(|side| side.is_forward()).count();
        self.edges += 1;
        self.boundary_edges += usize::from(uses.len() == 1);
        self.non_manifold_edges += usize::from(uses.len() > 2);
        self.misoriented_edges += usize::from(uses.len() > 1 && 2 * forward != uses.len());
    }

    /// Vertices − edges + faces: 2 for a ball, 0 for a torus.
    pub fn euler(&self) -> i64 {
        self.vertices as i64 - self.edges as i64 + self.faces as i64
    }

    /// Whether no edge has just one face. True of a mesh without faces.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Whether faces that meet at an edge agree which side is outside.
    ///
    /// If the mesh is closed as well, every point has an integer winding number.
    pub fn is_oriented(&self) -> bool {
        self.misoriented_edges == 0
    }

    /// Whether the mesh is a surface around each of its vertices and edges, with or without a boundary.
    pub fn is_manifold(&self) -> bool {
        self.non_manifold_edges == 0 && self.non_manifold_vertices == 0
    }

    /// Number of handles of all parts together: 0 for balls, 1 for a torus.
    ///
    /// `None` if the mesh isn't closed or no manifold. A mesh that no choice of directions would make
    /// [oriented](Self::is_oriented) has no handles to count; the result then means nothing, or is `None`.
    pub fn genus(&self) -> Option<usize> {
        // Each part has V − E + F = 2 − 2 g.
        let doubled = 2 * self.components as i64 - self.euler();
        let is_countable = self.is_closed() && self.is_manifold() && doubled % 2 == 0;
        is_countable.then(|| usize::try_from(doubled / 2).ok()).flatten()
    }
}

/// All sides of some faces.
fn sides(faces: &[[u32; 3]]) -> Vec<Side> {
    let mut sides = Vec::with_capacity(3 * faces.len());
    for (face, vertices) in faces.iter().enumerate() {
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let (low, high) = if vertices[from] < vertices[to] { (from, to) } else { (to, from) };
            let edge = u64::from(vertices[low]) << 32 | u64::from(vertices[high]);
            sides.push(Side { edge, corners: [low, high].map(|place| (3 * face + place) as u32) });
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use crate::synthesis::mesh::{
        closure::*,
        test_shapes::{Shape, cube, joined, torus},
    };

    fn closure((positions, triangles): &Shape) -> Closure {
        Closure::of(positions, triangles)
    }

    /// What is closed, oriented and manifold.
    fn properties(closure: Closure) -> [bool; 3] {
        [closure.is_closed(), closure.is_oriented(), closure.is_manifold()]
    }

    #[test]
    fn closed_surfaces_have_their_genus() {
        let of_cube = closure(&cube(Vec3::ZERO));
        let expected = Closure { vertices: 8, edges: 18, faces: 12, components: 1, ..Closure::default() };
        assert_eq!(of_cube, expected);
        assert_eq!((of_cube.euler(), of_cube.genus(), properties(of_cube)), (2, Some(0), [true; 3]));
        let of_torus = closure(&torus(7, 5));
        let expected = Closure { vertices: 35, edges: 105, faces: 70, components: 1, ..Closure::default() };
        assert_eq!(of_torus, expected);
        assert_eq!((of_torus.euler(), of_torus.genus(), properties(of_torus)), (0, Some(1), [true; 3]));
        let both = closure(&joined(joined(torus(7, 5), cube(Vec3::splat(4.0))), cube(Vec3::splat(8.0))));
        assert_eq!((both.components, both.euler(), both.genus(), properties(both)), (3, 4, Some(1), [true; 3]));
        let nothing = Closure::of(&[Vec3::ZERO], &[]);
        assert_eq!((nothing, nothing.genus()), (Closure::default(), Some(0)));
    }

    #[test]
    fn each_defect_is_counted_once() {
        let (positions, triangles) = cube(Vec3::ZERO);
        let mut flipped = triangles.clone();
        flipped[4].swap(0, 1);
        let of_flipped = Closure::of(&positions, &flipped);
        assert_eq!((of_flipped.misoriented_edges, properties(of_flipped)), (3, [true, false, true]));
        assert_eq!(of_flipped.genus(), Some(0));
        let of_open = Closure::of(&positions, &triangles[1..]);
        assert_eq!((of_open.boundary_edges, properties(of_open)), (3, [false, true, true]));
        assert_eq!((of_open.vertices, of_open.euler(), of_open.genus()), (8, 1, None));
        let twice: Vec<[u32; 3]> = triangles.iter().copied().chain([triangles[0]]).collect();
        let of_twice = Closure::of(&positions, &twice);
        assert_eq!((of_twice.non_manifold_edges, of_twice.misoriented_edges), (3, 3));
        assert_eq!(properties(of_twice), [true, false, false]);
        assert_eq!(of_twice.genus(), None);
    }

    #[test]
    fn cubes_joined_at_an_edge_or_a_vertex_are_no_manifold() {
        let at_edge = closure(&joined(cube(Vec3::ZERO), cube(Vec3::new(2.0, 2.0, 0.0))));
        let edges = (at_edge.edges, at_edge.non_manifold_edges, at_edge.non_manifold_vertices, at_edge.components);
        assert_eq!((edges, properties(at_edge)), ((35, 1, 0, 1), [true, true, false]));
        let at_vertex = closure(&joined(cube(Vec3::ZERO), cube(Vec3::splat(2.0))));
        let edges = (at_vertex.edges, at_vertex.non_manifold_edges, at_vertex.non_manifold_vertices);
        assert_eq!((edges, at_vertex.components, at_vertex.vertices), ((36, 0, 1), 2, 15));
        assert_eq!((at_vertex.genus(), properties(at_vertex)), (None, [true, true, false]));
        // Two open fans with a common tip.
        let fans = Closure::of(&[Vec3::ZERO, Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y], &[[0, 1, 2], [0, 3, 4]]);
        assert_eq!((fans.non_manifold_vertices, fans.components, fans.boundary_edges), (1, 2, 6));
    }

    #[test]
    fn triangles_without_an_area_are_counted_apart() {
        let positions = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, Vec3::Y, Vec3::NAN];
        let of = |triangles: &[[u32; 3]]| Closure::of(&positions, triangles);
        // A vertex used twice: no face at all.
        let repeated = of(&[[0, 1, 3], [1, 1, 4], [2, 2, 2]]);
        assert_eq!((repeated.degenerate_faces, repeated.faces, repeated.edges, repeated.vertices), (2, 1, 3, 3));
        // Corners on one line, and one that isn't finite: faces, too.
        let flat = of(&[[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!((flat.degenerate_faces, flat.faces, flat.edges, flat.vertices), (2, 3, 7, 5));
    }

    #[test]
    fn surfaces_with_one_side_have_no_handles() {
        // The projective plane with six vertices: half an icosahedron.
        let plane = [
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 4],
            [0, 4, 5],
            [0, 5, 1],
            [1, 2, 4],
            [2, 3, 5],
            [3, 4, 1],
            [4, 5, 2],
            [5, 1, 3],
        ];
        let positions: Vec<Vec3> = (0..6).map(|i| Vec3::new(i as f32, (i * i) as f32, (i * i * i) as f32)).collect();
        let plane = Closure::of(&positions, &plane);
        assert_eq!((plane.euler(), plane.genus(), plane.non_manifold_edges), (1, None, 0));
        assert!(plane.is_closed() && plane.is_manifold() && !plane.is_oriented());
    }

    #[test]
    fn numbers_of_a_soup_are_those_of_a_slow_twin() {
        // All triangles between six vertices that a bit pattern selects.
        let positions: Vec<Vec3> = (0..6).map(|i| Vec3::new(i as f32, (i * i) as f32, (i * i * i) as f32)).collect();
        let all: Vec<[u32; 3]> =
            (0..6).flat_map(|a| (a + 1..6).flat_map(move |b| (b + 1..6).map(move |c| [a, b, c]))).collect();
        for pattern in (0..1u32 << 20).step_by(257) {
            let triangles: Vec<[u32; 3]> =
                all.iter().enumerate().filter(|(i, _)| pattern >> i & 1 == 1).map(|(_, t)| *t).collect();
            let with = |a: u32, b: u32| triangles.iter().filter(|t| t.contains(&a) && t.contains(&b)).count();
            let uses: Vec<usize> =
                (0..6).flat_map(|a| (a + 1..6).map(move |b| (a, b))).map(|(a, b)| with(a, b)).collect();
            let groups = |members: &[[u32; 3]], vertex: Option<u32>| {
                // Merges groups that share an edge until nothing changes.
                let mut groups: Vec<usize> = (0..members.len()).collect();
                for _ in 0..members.len() {
                    for (i, j) in (0..members.len()).flat_map(|i| (0..members.len()).map(move |j| (i, j))) {
                        let shared =
                            members[i].iter().filter(|v| members[j].contains(v) && Some(**v) != vertex).count();
                        if shared >= if vertex.is_some() { 1 } else { 2 } {
                            groups[i] = groups[i].min(groups[j]);
                        }
                    }
                }
                groups.iter().enumerate().filter(|(i, group)| i == *group).count()
            };
            let fans = (0..6u32).map(|v| {
                let around: Vec<[u32; 3]> = triangles.iter().copied().filter(|t| t.contains(&v)).collect();
                groups(&around, Some(v))
            });
            let found = Closure::of(&positions, &triangles);
            let count = |is_it: fn(usize) -> bool| uses.iter().filter(|&&uses| is_it(uses)).count();
            assert_eq!(found.edges, count(|uses| uses > 0));
            assert_eq!(found.boundary_edges, count(|uses| uses == 1));
            assert_eq!(found.non_manifold_edges, count(|uses| uses > 2));
            assert_eq!(found.components, groups(&triangles, None), "{triangles:?}");
            assert_eq!(found.vertices, fans.clone().filter(|&fans| fans > 0).count());
            assert_eq!(found.non_manifold_vertices, fans.filter(|&fans| fans > 1).count(), "{triangles:?}");
        }
    }
}
