//! The surface of an organ's mesh as a tissue.

use crate::synthesis::{
    mesh::{
        IndexedMesh, SurfacePoint, TriangleIndex, TriangleMesh, doubled_normal,
        facing::inward_triangles,
        way::{Neighbours, Start, go},
    },
    pace::{Pace, at_once},
    random::{VesselRng, alias_table::AliasTable, many},
    tissue::{
        Derived, Extent, Facet, Tissue, TissuePiece, TissuePoint,
        error::{TissueError, rounding_within},
        pieces,
    },
};
use bevy_math::{DVec3, Vec3, bounding::Aabb3d};
use rand::RngExt;
use std::sync::Arc;

/// Distance from the surface, relative to the longest side of its box, within which a point counts as on it.
pub const SURFACE_TOLERANCE: f32 = 1.0e-5;

/// Most pieces that a surface is cut into, for each square of the reach and each triangle.
const MOST_PIECES: f64 = 8.0;

/// The triangles of a mesh, sampled uniformly by area.
///
/// Points are drawn in constant time and projected through an index over the triangles.
#[derive(Clone, Debug)]
pub struct MeshSurface {
    indexed: IndexedMesh,
    /// Unit normal of every vertex, pointing outwards.
    normals: Vec<Vec3>,
    /// The triangles that make up the surface: none twice, and all with an area.
    faces: Vec<u32>,
    /// Triangles whose corners are clockwise seen from outside.
    inward: Vec<bool>,
    neighbours: Neighbours,
    picks: AliasTable,
    bounds: Aabb3d,
    area: f32,
    tolerance: f32,
    derived: Derived,
}

impl MeshSurface {
    /// Prepares a mesh.
    ///
    /// Vertices at the same position share a normal. A triangle that repeats another one counts once, also with its
    /// other side. A shell that faces inwards is treated as facing outwards, so that vessels are lifted off its outside.
    ///
    /// # Errors
    /// A mesh so far from the origin that its coordinates hold too little of its shape.
    pub fn new(mesh: impl Into<Arc<TriangleMesh>>) -> Result<Self, TissueError> {
        at_once(Self::new_paced(mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(mesh: impl Into<Arc<TriangleMesh>>, pace: &Pace) -> Result<Self, TissueError> {
        Self::facing_paced(mesh.into(), true, pace).await
    }

    /// Prepares a mesh whose triangles face the side on which vessels lie, such as the lining of a hollow organ.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub fn lining(mesh: impl Into<Arc<TriangleMesh>>) -> Result<Self, TissueError> {
        at_once(Self::lining_paced(mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn lining_paced(mesh: impl Into<Arc<TriangleMesh>>, pace: &Pace) -> Result<Self, TissueError> {
        Self::facing_paced(mesh.into(), false, pace).await
    }

    /// Prepares a mesh, with its shells turned outwards or as they are.
    async fn facing_paced(mesh: Arc<TriangleMesh>, outwards: bool, pace: &Pace) -> Result<Self, TissueError> {
        let bounds = mesh.bounds_paced(&pace.part(0.0..0.02)).await;
        let rounding = rounding_within(&bounds)?;
        let welding = mesh.weld_paced(&pace.part(0.02..0.07)).await;
        let faces = mesh.faces_paced(&welding, &pace.part(0.07..0.15)).await;
        let indexed = IndexedMesh::of_paced(Arc::clone(&mesh), &faces, &pace.part(0.15..0.45)).await;
        let topology = mesh.topology_of_paced(welding, &faces, &pace.part(0.45..0.55)).await;
        let inward = if outwards {
            inward_triangles(&mesh, &topology, indexed.index(), &pace.part(0.55..0.75)).await
        } else {
            vec![false; mesh.triangles().len()]
        };
        let neighbours = Neighbours::new_paced(&mesh, &topology, &pace.part(0.75..0.8)).await;
        let mut areas = vec![0.0; mesh.triangles().len()];
        let measure = |face: usize| areas[faces[face] as usize] = mesh.triangle_area(faces[face] as usize);
        pace.part(0.8..0.82).each(faces.len(), measure).await;
        // Twice the area along the normal, as for the mesh itself; nothing for triangles that are no faces.
        let normal = |triangle: usize| match (areas[triangle] > 0.0, inward[triangle]) {
            (false, _) => DVec3::ZERO,
            (true, false) => doubled_normal(mesh.corners(triangle)),
            (true, true) => -doubled_normal(mesh.corners(triangle)),
        };
        let normals = mesh.vertex_normals_paced(topology.welding(), normal, &pace.part(0.82..0.9)).await;
        Ok(Self {
            normals,
            faces,
            inward,
            neighbours,
            area: pace.part(0.9..0.91).sum(areas.len(), |triangle| areas[triangle]).await as f32,
            picks: AliasTable::new_paced(areas.len(), |triangle| areas[triangle], &pace.part(0.91..1.0)).await,
            tolerance: ((bounds.max - bounds.min).max_element() * SURFACE_TOLERANCE).max(rounding),
            bounds,
            indexed,
            derived: Derived::default(),
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        self.indexed.mesh()
    }

    /// The index over the mesh's triangles.
    pub fn index(&self) -> &TriangleIndex {
        self.indexed.index()
    }

    /// The mesh with its index, for sharing.
    pub fn indexed(&self) -> &IndexedMesh {
        &self.indexed
    }

    /// Unit normal at a point of the mesh: that of the vertices, interpolated; the triangle's own if those cancel out
    /// or point to its other side.
    pub fn normal_at(&self, point: &SurfacePoint) -> Vec3 {
        let own = self.triangle_normal(point.triangle);
        let corners = self.mesh().triangles()[point.triangle].map(|vertex| self.normals[vertex as usize]);
        let weights = point.barycentric;
        let smooth = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
        match smooth.try_normalize() {
            Some(smooth) if smooth.dot(own) > 0.0 => smooth,
            _ => own,
        }
    }
}

impl MeshSurface {
    /// Unit normal of a triangle, outwards.
    fn triangle_normal(&self, triangle: usize) -> Vec3 {
        let normal = self.mesh().triangle_normal(triangle);
        if self.inward[triangle] { -normal } else { normal }
    }

    /// Number of parts into which a triangle's sides are cut so that no small triangle exceeds `reach`.
    fn parts(&self, triangle: usize, reach: f32) -> u32 {
        let [a, b, c] = self.mesh().corners(triangle);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        // A triangle reaches at most two thirds of its median from its centre, which is less than this share of a side.
        pieces::parts(longest, 1.5 * reach)
    }

    fn tissue_point(&self, point: &SurfacePoint) -> TissuePoint {
        let facet = Facet { number: point.triangle as u32, normal: self.triangle_normal(point.triangle) };
        TissuePoint { position: point.position, normal: self.normal_at(point), facet: Some(facet) }
    }

    /// The point chosen by four uniform numbers: one for a slot of the table, one for keeping it, and two in the
    /// triangle.
    fn pick(&self, slot: u32, keep: f32, numbers: [f32; 2]) -> Vec3 {
        let triangle = self.picks.pick(slot, keep) as usize;
        let [a, b, c] = self.mesh().corners(triangle);
        let [mut v, mut w] = numbers;
        // Uniform over the parallelogram, with its far half folded back.
        if v + w > 1.0 {
            (v, w) = (1.0 - v, 1.0 - w);
        }
        a + (b - a) * v + (c - a) * w
    }
}

impl Tissue for MeshSurface {
    fn bounds(&self) -> Aabb3d {
        self.bounds
    }

    fn derived(&self) -> Option<&Derived> {
        Some(&self.derived)
    }

    fn extent(&self) -> Extent {
        Extent::Area(self.area)
    }

    fn contains(&self, point: Vec3) -> bool {
        self.index().any_within(point, self.tolerance)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        match self.index().closest(point) {
            Some(found) => self.tissue_point(&found),
            // Only a point that is not finite has no closest one.
            None => TissuePoint::new(point, Vec3::ZERO),
        }
    }

    fn has_facets(&self) -> bool {
        true
    }

    fn walk(
        &self,
        from: &TissuePoint,
        direction: Vec3,
        length: f32,
        tolerance: f32,
        arrive: &mut dyn FnMut(TissuePoint),
    ) {
        let Some(facet) = from.facet else {
            arrive(self.closest_point(from.position + direction * length));
            return;
        };
        let start = Start { position: from.position, triangle: facet.number, direction };
        let mesh = (self.mesh(), self.index(), &self.neighbours);
        go(mesh, start, length, tolerance, |position, triangle| {
            arrive(self.tissue_point(&SurfacePoint::on(self.mesh(), triangle as usize, position)));
        });
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        if self.picks.len() == 0 {
            return None;
        }
        let slot = rng.random_range(0..self.picks.len() as u32);
        Some(self.pick(slot, rng.random(), [rng.random(), rng.random()]))
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        let slots = self.picks.len() as u32;
        if slots > 0 {
            many::draw(rng, count, candidates, |[slot, keep, v, w]| {
                (true, self.pick(many::below(slot, slots), many::unit(keep), [many::unit(v), many::unit(w)]))
            });
        }
    }

    /// Triangles whose sides are too long for `reach` are cut into k² equal ones, by lines along their sides. A surface of
    /// long thin triangles would take far more of these than its area asks for, and is not cut.
    fn cut(&self, reach: f32, pieces: &mut Vec<TissuePiece>) -> bool {
        let squares = |&face: &u32| f64::from(self.parts(face as usize, reach)).powi(2);
        let asked = f64::from(self.area / (reach * reach)) + self.faces.len() as f64;
        if self.faces.iter().map(squares).sum::<f64>() > MOST_PIECES * asked {
            return false;
        }
        for &face in &self.faces {
            let (triangle, side) = (face as usize, self.triangle_normal(face as usize));
            let [a, b, c] = self.mesh().corners(triangle);
            let parts = self.parts(triangle, reach);
            let measure = self.mesh().triangle_area(triangle) as f32 / (parts * parts) as f32;
            for part in 0..parts * parts {
                let corners = small_triangle(part, parts).map(|[v, w]| a + (b - a) * v + (c - a) * w);
                let center = (corners[0] + corners[1] + corners[2]) / 3.0;
                let reach = corners.iter().map(|corner| corner.distance(center)).fold(0.0, f32::max);
                pieces.push(TissuePiece { center, reach, measure, side, id: [face, part] });
            }
        }
        true
    }

    fn point_of(&self, reach: f32, [triangle, part]: [u32; 2], [v, w, _]: [f32; 3]) -> Option<Vec3> {
        let [a, b, c] = self.mesh().corners(triangle as usize);
        let [p, q, r] = small_triangle(part, self.parts(triangle as usize, reach));
        let (v, w) = if v + w > 1.0 { (1.0 - v, 1.0 - w) } else { (v, w) };
        let [v, w] = [0, 1].map(|axis| p[axis] + (q[axis] - p[axis]) * v + (r[axis] - p[axis]) * w);
        Some(a + (b - a) * v + (c - a) * w)
    }
}

/// Corners of one of the n² equal parts of a triangle, as shares of the edges from its first corner to the others.
///
/// Row by row from the first side: row i has 2(n − i) − 1 parts, alternately upright and upside down.
fn small_triangle(part: u32, parts: u32) -> [[f32; 2]; 3] {
    let (mut row, mut left) = (0, part);
    while left >= 2 * (parts - row) - 1 {
        left -= 2 * (parts - row) - 1;
        row += 1;
    }
    let at = |column: u32, row: u32| [column as f32 / parts as f32, row as f32 / parts as f32];
    let column = left / 2;
    if left % 2 == 0 {
        [at(column, row), at(column + 1, row), at(column, row + 1)]
    } else {
        [at(column + 1, row + 1), at(column, row + 1), at(column + 1, row)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_triangles_fill_the_large_one() {
        for parts in [1, 2, 5] {
            let mut hits = 0;
            for probe in 0..200 {
                let (v, w) = (probe as f32 * 0.618_034 % 1.0, probe as f32 * 0.754_878 % 1.0);
                let inside = |part: u32| {
                    let [p, q, r] = small_triangle(part, parts).map(bevy_math::Vec2::from);
                    let point = bevy_math::Vec2::new(v, w);
                    let side = |a: bevy_math::Vec2, b: bevy_math::Vec2| (b - a).perp_dot(point - a);
                    side(p, q) >= 0.0 && side(q, r) >= 0.0 && side(r, p) >= 0.0
                };
                let found = (0..parts * parts).filter(|&part| inside(part)).count();
                assert_eq!(found, usize::from(v + w < 1.0), "{parts} parts, ({v}, {w})");
                hits += found;
            }
            assert!(hits > 50);
        }
    }
}
