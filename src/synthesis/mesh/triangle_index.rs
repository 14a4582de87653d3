//! Queries of single triangles, and an index over the triangles of a mesh.

use crate::synthesis::mesh::TriangleMesh;
use crate::synthesis::pace::{Pace, at_once};
use crate::synthesis::space::bvh::{Bounds, BoxTree};
use bevy_math::{DVec3, Vec3};

/// A point on a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Its position.
    pub position: Vec3,
    /// Number of the triangle in the mesh.
    pub triangle: usize,
    /// Weights of the triangle's three corners; they sum to 1.
    pub barycentric: Vec3,
    /// Squared distance from the query point; for a hit, from the start of the segment.
    pub distance_squared: f32,
}

impl SurfacePoint {
    /// The point of a triangle nearest to `point`.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub(crate) fn on(mesh: &TriangleMesh, triangle: usize, point: Vec3) -> Self {
        Self::of(mesh.corners(triangle), triangle, point)
    }

    /// The point of a triangle with these corners nearest to `point`.
    pub(crate) fn of(corners: [Vec3; 3], triangle: usize, point: Vec3) -> Self {
        let (weights, position) = closest_on_triangle(point, corners);
        let distance_squared = (position - point.as_dvec3()).length_squared() as f32;
        Self { position: position.as_vec3(), triangle, barycentric: weights.as_vec3(), distance_squared }
    }
}

/// Index over the triangles of a mesh, without degenerate ones and without copies of another.
#[derive(Clone, Debug, Default)]
pub struct TriangleIndex {
    tree: BoxTree,
    /// Corners of each slot of the tree.
    corners: Vec<[Vec3; 3]>,
    /// Number of each slot's triangle in the mesh.
    triangles: Vec<u32>,
}

impl TriangleIndex {
    /// Indexes a mesh. Degenerate triangles are left out, and so are repeated ones.
    pub fn new(mesh: &TriangleMesh) -> Self {
        at_once(Self::new_paced(mesh, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn new_paced(mesh: &TriangleMesh, pace: &Pace) -> Self {
        let welding = mesh.weld_paced(&pace.part(0.0..0.1)).await;
        let faces = mesh.faces_paced(&welding, &pace.part(0.1..0.3)).await;
        Self::of_paced(mesh, &faces, &pace.part(0.3..1.0)).await
    }

    /// Indexes the triangles of a mesh with these numbers, which must be its [faces](TriangleMesh::faces_paced).
    pub(crate) async fn of_paced(mesh: &TriangleMesh, numbers: &[u32], pace: &Pace) -> Self {
        let bounds = |id: usize| Bounds::around(&mesh.corners(numbers[id] as usize));
        let tree = BoxTree::new_paced(numbers.len(), bounds, &pace.part(0.0..0.9)).await;
        let (order, number) = (tree.order(), |slot: usize| numbers[tree.order()[slot] as usize]);
        let triangles: Vec<u32> = pace.part(0.9..0.92).collect(order.len(), number).await;
        let corner = |slot: usize| mesh.corners(triangles[slot] as usize);
        let corners = pace.part(0.92..1.0).collect(triangles.len(), corner).await;
        Self { tree, corners, triangles }
    }

    /// The point of the mesh nearest to `point`; `None` if that is not finite.
    ///
    /// Of equally near triangles, the first in the mesh is returned.
    pub fn closest(&self, point: Vec3) -> Option<SurfacePoint> {
        self.closest_within(point, f32::INFINITY)
    }

    /// The point of the mesh nearest to `point`, if it is at most `radius` away.
    pub fn closest_within(&self, point: Vec3, radius: f32) -> Option<SurfacePoint> {
        self.closest_of(point, radius, |_| true)
    }

    /// The same, of the triangles that `accepts` their number.
    pub(crate) fn closest_of(&self, point: Vec3, radius: f32, accepts: impl Fn(usize) -> bool) -> Option<SurfacePoint> {
        let mut found: Option<SurfacePoint> = None;
        if !point.is_finite() {
            return None;
        }
        self.tree.nearest(point, radius * radius, |slot, best| {
            // Most triangles of a leaf are farther than the best, which their boxes show.
            if Bounds::around(&self.corners[slot]).distance_squared(point.into()) > best {
                return best;
            }
            let (weights, position) = closest_on_triangle(point, self.corners[slot]);
            let distance_squared = (position - point.as_dvec3()).length_squared() as f32;
            let triangle = self.triangles[slot] as usize;
            let nearer = match found {
                None => distance_squared <= best,
                Some(found) => (distance_squared, triangle) < (best, found.triangle),
            };
            if !(nearer && accepts(triangle)) {
                return best;
            }
            let (position, barycentric) = (position.as_vec3(), weights.as_vec3());
            found = Some(SurfacePoint { position, triangle, barycentric, distance_squared });
            distance_squared
        });
        found
    }

    /// Numbers of the indexed triangles in the mesh, in no particular order.
    pub(crate) fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// Whether any point of the mesh is at most `radius` away.
    pub fn any_within(&self, point: Vec3, radius: f32) -> bool {
        let mut found = false;
        if point.is_finite() {
            // A limit below every distance ends the search.
            self.tree.nearest(point, radius * radius, |slot, best| {
                let (_, position) = closest_on_triangle(point, self.corners[slot]);
                found |= (position - point.as_dvec3()).length_squared() <= f64::from(radius) * f64::from(radius);
                if found { -1.0 } else { best }
            });
        }
        found
    }

    /// The first point at which the segment between two points hits the mesh, from either side.
    pub fn first_hit(&self, from: Vec3, to: Vec3) -> Option<SurfacePoint> {
        let mut found: Option<SurfacePoint> = None;
        if !(from.is_finite() && to.is_finite()) {
            return None;
        }
        self.tree.along(from, to, |slot, limit| {
            let Some((share, weights)) = hit_triangle(from, to, self.corners[slot]) else { return limit };
            let triangle = self.triangles[slot] as usize;
            let nearer = match found {
                None => share <= limit,
                Some(found) => (share, triangle) < (limit, found.triangle),
            };
            if !nearer {
                return limit;
            }
            let position = at(self.corners[slot], weights).as_vec3();
            let distance_squared = position.distance_squared(from);
            found = Some(SurfacePoint { position, triangle, barycentric: weights.as_vec3(), distance_squared });
            share
        });
        found
    }

    /// Visits the corners and numbers of all triangles whose box meets `region`.
    pub(crate) fn overlapping(&self, region: &Bounds, mut visit: impl FnMut([Vec3; 3], usize)) {
        self.tree.overlapping(region, |slot| {
            visit(self.corners[slot], self.triangles[slot] as usize);
            true
        });
    }
}

/// The point of a triangle with given corner weights.
fn at([a, b, c]: [Vec3; 3], weights: DVec3) -> DVec3 {
    // As an offset from one corner, so that rounding is relative to the triangle's size.
    a.as_dvec3() + (b.as_dvec3() - a.as_dvec3()) * weights.y + (c.as_dvec3() - a.as_dvec3()) * weights.z
}

/// Corner weights and position of the triangle's point nearest to `point`.
///
/// By the regions of Ericson, "Real-Time Collision Detection" (2005), section 5.1.5; in f64, for slivers.
pub(crate) fn closest_on_triangle(point: Vec3, corners: [Vec3; 3]) -> (DVec3, DVec3) {
    let weights = closest_weights(point.as_dvec3(), corners.map(|corner| corner.as_dvec3()));
    (weights, at(corners, weights))
}

fn closest_weights(point: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let (ap, bp, cp) = (point - a, point - b, point - c);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return DVec3::X;
    }
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return DVec3::Y;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = d1 / (d1 - d3);
        return DVec3::new(1.0 - share, share, 0.0);
    }
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return DVec3::Z;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = d2 / (d2 - d6);
        return DVec3::new(1.0 - share, 0.0, share);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return DVec3::new(0.0, 1.0 - share, share);
    }
    let (v, w) = (vb / (va + vb + vc), vc / (va + vb + vc));
    DVec3::new(1.0 - v - w, v, w)
}

/// The point at which a segment hits a triangle: share of the way, 0 to 1, and corner weights. Also `None` if the
/// segment lies in the triangle's plane.
///
/// Möller & Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection" (1997), in f64.
fn hit_triangle(from: Vec3, to: Vec3, corners: [Vec3; 3]) -> Option<(f32, DVec3)> {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let (along, start) = (to.as_dvec3() - from.as_dvec3(), from.as_dvec3() - a);
    let (ab, ac) = (b - a, c - a);
    let across = along.cross(ac);
    let determinant = ab.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let v = start.dot(across) / determinant;
    let upright = start.cross(ab);
    let w = along.dot(upright) / determinant;
    let share = ac.dot(upright) / determinant;
    let hit = v >= 0.0 && w >= 0.0 && v + w <= 1.0 && (0.0..=1.0).contains(&share);
    hit.then_some((share as f32, DVec3::new(1.0 - v - w, v, w)))
}
