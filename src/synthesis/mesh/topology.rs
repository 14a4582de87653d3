//! Connectivity of a mesh's triangles, with vertices at the same position welded.

use super::{
    TriangleMesh, Welding,
    triangle_mesh::{doubled_normal, is_degenerate},
};
use crate::synthesis::pace::{Pace, Stretch, at_once};
use std::collections::VecDeque;

/// An edge between two welded vertices, in one of its triangles. Their order puts uses of the same edge side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeUse {
    /// The lower vertex in the upper half, the higher in the lower half.
    pub key: u64,
    /// The triangle.
    pub triangle: u32,
    /// Whether the triangle runs from the lower vertex to the higher.
    forward: bool,
}

/// The welded triangles of a mesh and their edges.
#[derive(Clone, Debug)]
pub struct MeshTopology {
    welding: Welding,
    /// Corners as welded vertices; `None` for a degenerate triangle.
    pub(super) triangles: Vec<Option<[u32; 3]>>,
    /// Every use of every edge, sorted by edge.
    edges: Vec<EdgeUse>,
}

impl TriangleMesh {
    /// The welded edges of the mesh, for all queries about its connectivity.
    pub fn topology(&self) -> MeshTopology {
        at_once(self.topology_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn topology_paced(&self, pace: &Pace) -> MeshTopology {
        let welding = self.weld_paced(&pace.part(0.0..0.2)).await;
        let mut numbers = Vec::with_capacity(self.triangles().len());
        let take = |triangle: usize| {
            if !is_degenerate(self.corners(triangle)) {
                numbers.push(triangle as u32);
            }
        };
        pace.part(0.2..0.25).each(self.triangles().len(), take).await;
        self.topology_of_paced(welding, &numbers, &pace.part(0.25..1.0)).await
    }

    /// The topology of the triangles with these numbers, none of which is degenerate. The others don't count.
    pub(crate) async fn topology_of_paced(&self, welding: Welding, numbers: &[u32], pace: &Pace) -> MeshTopology {
        let mut edges = Vec::with_capacity(3 * numbers.len());
        let mut triangles = vec![None; self.triangles().len()];
        let take = |place: usize| {
            let triangle = numbers[place] as usize;
            let corners = self.triangles()[triangle].map(|vertex| welding.vertex(vertex) as u32);
            triangles[triangle] = Some(corners);
            for side in 0..3 {
                let (from, to) = (corners[side], corners[(side + 1) % 3]);
                edges.push(EdgeUse { key: edge_key(from, to), triangle: triangle as u32, forward: from < to });
            }
        };
        pace.part(0.0..0.1).each(numbers.len(), take).await;
        pace.part(0.1..1.0).sort(&mut edges).await;
        MeshTopology { welding, triangles, edges }
    }

    /// Whether no edge has just one triangle after welding, so that the mesh has an inside.
    ///
    /// For several queries, call [`topology`](Self::topology) once.
    pub fn is_closed(&self) -> bool {
        self.topology().is_closed()
    }
}

impl MeshTopology {
    /// Which vertices are at the same position.
    pub fn welding(&self) -> &Welding {
        &self.welding
    }

    /// Number of triangles without area.
    pub fn degenerate_triangles(&self) -> usize {
        self.triangles.iter().filter(|corners| corners.is_none()).count()
    }

    /// Number of edges.
    pub fn edges(&self) -> usize {
        self.fans().count()
    }

    /// Number of edges with only one triangle: 0 for a closed mesh.
    pub fn boundary_edges(&self) -> usize {
        self.fans().filter(|fan| fan.len() == 1).count()
    }

    /// Number of edges with more than two triangles.
    pub fn non_manifold_edges(&self) -> usize {
        self.fans().filter(|fan| fan.len() > 2).count()
    }

    /// Whether no edge has just one triangle.
    pub fn is_closed(&self) -> bool {
        at_once(self.is_closed_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn is_closed_paced(&self, pace: &Pace) -> bool {
        let (mut stretch, mut done) = (Stretch::default(), 0);
        for fan in self.fans() {
            if fan.len() == 1 {
                return false;
            }
            done += fan.len();
            if stretch.ends_after(fan.len()) {
                pace.rest(done as f32 / self.edges.len() as f32).await;
            }
        }
        true
    }

    /// Which triangles have an edge that triangles use more often in one direction than in the other. `flip` tells
    /// which triangles count as reversed.
    ///
    /// If there is none, every point has an integer winding number, which is the same along every ray.
    pub fn unbalanced(&self, flip: impl Fn(usize) -> bool) -> Vec<bool> {
        at_once(self.unbalanced_paced(flip, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn unbalanced_paced(&self, flip: impl Fn(usize) -> bool, pace: &Pace) -> Vec<bool> {
        let mut unbalanced = vec![false; self.triangles.len()];
        let (mut stretch, mut done) = (Stretch::default(), 0);
        for fan in self.fans() {
            let forward = fan.iter().filter(|edge| edge.forward != flip(edge.triangle as usize)).count();
            if 2 * forward != fan.len() {
                for edge in fan {
                    unbalanced[edge.triangle as usize] = true;
                }
            }
            done += fan.len();
            if stretch.ends_after(fan.len()) {
                pace.rest(done as f32 / self.edges.len() as f32).await;
            }
        }
        unbalanced
    }

    /// Vertices − edges + triangles, for non-degenerate triangles: 2 for a ball, 0 for a torus.
    pub fn euler_characteristic(&self) -> i64 {
        let mut used = vec![false; self.welding.count()];
        for &vertex in self.triangles.iter().flatten().flatten() {
            used[vertex as usize] = true;
        }
        let vertices = used.iter().filter(|&&used| used).count();
        vertices as i64 - self.edges() as i64 + self.triangles.iter().flatten().count() as i64
    }

    /// Numbers the connected parts of the mesh: returns the part of every triangle, `None` if it is degenerate, and the
    /// number of parts. Triangles are connected across shared edges.
    pub fn components(&self) -> (Vec<Option<u32>>, usize) {
        let patches = at_once(self.patches(|_| true, |_, _, _| {}, &Pace::default()));
        (patches.of_triangle, patches.count)
    }

    /// Which triangles are oriented against the surface around them.
    ///
    /// Orientation spreads across edges that exactly two triangles share. Of the two orientations of such a part, the
    /// one of most of its area is kept, so a consistent mesh stays as it is.
    pub fn misoriented(&self, mesh: &TriangleMesh) -> Vec<bool> {
        at_once(self.misoriented_paced(mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn misoriented_paced(&self, mesh: &TriangleMesh, pace: &Pace) -> Vec<bool> {
        let mut flip = vec![false; self.triangles.len()];
        let turn = |from: usize, to: usize, same_way: bool| flip[to] = flip[from] != same_way;
        let patches = self.patches(|fan| fan.len() == 2, turn, &pace.part(0.0..0.8)).await;
        // Area of each part that would be flipped, minus the area that would stay.
        let mut balance = vec![0.0; patches.count];
        let weigh = |triangle: usize| {
            if let Some(patch) = patches.of_triangle[triangle] {
                let area = doubled_normal(mesh.corners(triangle)).length();
                balance[patch as usize] += if flip[triangle] { area } else { -area };
            }
        };
        pace.part(0.8..0.9).each(self.triangles.len(), weigh).await;
        let turn = |triangle: usize| {
            if patches.of_triangle[triangle].is_some_and(|patch| balance[patch as usize] > 0.0) {
                flip[triangle] = !flip[triangle];
            }
        };
        pace.part(0.9..1.0).each(self.triangles.len(), turn).await;
        flip
    }

    /// Parts of the surface joined by edges with exactly two triangles, and whether each part is closed.
    pub(crate) async fn manifold_patches(&self, pace: &Pace) -> (Patches, Vec<bool>) {
        let patches = self.patches(|fan| fan.len() == 2, |_, _, _| {}, &pace.part(0.0..0.8)).await;
        let mut closed = vec![true; patches.count];
        let (pace, mut stretch, mut done) = (pace.part(0.8..1.0), Stretch::default(), 0);
        for fan in self.fans() {
            if let [edge] = fan
                && let Some(patch) = patches.of_triangle[edge.triangle as usize]
            {
                closed[patch as usize] = false;
            }
            done += fan.len();
            if stretch.ends_after(fan.len()) {
                pace.rest(done as f32 / self.edges.len() as f32).await;
            }
        }
        (patches, closed)
    }

    /// The uses of each edge.
    pub(super) fn fans(&self) -> impl Iterator<Item = &[EdgeUse]> {
        self.edges.chunk_by(|a, b| a.key == b.key)
    }

    /// Breadth-first traversal of the triangles, across the edges that `joins` accepts.
    ///
    /// `visit(from, to, same_way)` gets every triangle that is reached, its predecessor, and whether both use their
    /// common edge in the same direction. Neighbours with the same orientation don't.
    async fn patches(
        &self,
        joins: impl Fn(&[EdgeUse]) -> bool,
        mut visit: impl FnMut(usize, usize, bool),
        pace: &Pace,
    ) -> Patches {
        let sides = self.sides(&pace.part(0.0..0.3)).await;
        let pace = pace.part(0.3..1.0);
        let (mut stretch, mut done) = (Stretch::default(), 0);
        let mut of_triangle: Vec<Option<u32>> = vec![None; self.triangles.len()];
        let mut count = 0u32;
        let mut queue = VecDeque::new();
        for seed in 0..self.triangles.len() {
            if self.triangles[seed].is_none() || of_triangle[seed].is_some() {
                continue;
            }
            of_triangle[seed] = Some(count);
            queue.push_back(seed);
            while let Some(from) = queue.pop_front() {
                done += 1;
                if stretch.ends_after(1) {
                    pace.rest(done as f32 / self.triangles.len() as f32).await;
                }
                for (start, end) in sides[from] {
                    let fan = &self.edges[start as usize..end as usize];
                    if !joins(fan) {
                        continue;
                    }
                    let forward = fan.iter().any(|edge| edge.triangle as usize == from && edge.forward);
                    for edge in fan {
                        let to = edge.triangle as usize;
                        if of_triangle[to].is_none() {
                            of_triangle[to] = Some(count);
                            visit(from, to, edge.forward == forward);
                            queue.push_back(to);
                        }
                    }
                }
            }
            count += 1;
        }
        Patches { of_triangle, count: count as usize }
    }

    /// Positions of each triangle's sides in the sorted edges.
    async fn sides(&self, pace: &Pace) -> Vec<[(u32, u32); 3]> {
        let mut sides = vec![[(0u32, 0u32); 3]; self.triangles.len()];
        let mut filled = vec![0u8; self.triangles.len()];
        let (mut stretch, mut start) = (Stretch::default(), 0u32);
        for fan in self.fans() {
            let end = start + fan.len() as u32;
            for edge in fan {
                let triangle = edge.triangle as usize;
                sides[triangle][usize::from(filled[triangle])] = (start, end);
                filled[triangle] += 1;
            }
            start = end;
            if stretch.ends_after(fan.len()) {
                pace.rest(end as f32 / self.edges.len() as f32).await;
            }
        }
        sides
    }
}

/// Both ends of an edge, the lower vertex first.
pub(super) fn edge_key(from: u32, to: u32) -> u64 {
    u64::from(from.min(to)) << 32 | u64::from(from.max(to))
}

/// Parts of a surface.
pub(crate) struct Patches {
    /// The part of every triangle, `None` if it is degenerate.
    pub of_triangle: Vec<Option<u32>>,
    /// Number of parts.
    pub count: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::mesh::MeshError;
    use bevy_math::Vec3;

    /// A tetrahedron in which every triangle has vertices of its own.
    fn soup() -> Result<TriangleMesh, MeshError> {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let positions = faces.iter().flatten().map(|&i: &usize| corners[i]).collect();
        TriangleMesh::new(positions, (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), None)
    }

    #[test]
    fn a_soup_is_closed_once_welded() -> Result<(), MeshError> {
        let topology = soup()?.topology();
        assert_eq!(topology.welding().count(), 4);
        assert_eq!((topology.edges(), topology.boundary_edges(), topology.non_manifold_edges()), (6, 0, 0));
        assert!(topology.is_closed());
        assert_eq!(topology.euler_characteristic(), 2);
        assert_eq!(topology.components().1, 1);
        assert!((soup()?.signed_volume() - 1.0 / 6.0).abs() < 1e-7);
        assert_eq!(soup()?.welded().positions().len(), 4);
        // Normals of the four vertices don't split.
        let normals = soup()?.vertex_normals();
        assert_eq!(normals[0], normals[3]);
        Ok(())
    }

    #[test]
    fn the_odd_triangle_out_is_found() -> Result<(), MeshError> {
        let mesh = soup()?;
        assert_eq!(mesh.topology().misoriented(&mesh), [false; 4]);
        let mesh = mesh.with_flipped(|triangle| triangle == 1);
        assert_eq!(mesh.topology().misoriented(&mesh), [false, true, false, false]);
        let inward = mesh.with_flipped(|triangle| triangle != 1);
        assert_eq!(inward.topology().misoriented(&inward), [false; 4]);
        assert!(inward.signed_volume() < 0.0);
        Ok(())
    }
}
