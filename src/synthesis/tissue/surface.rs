//! The surface of an organ's mesh as a tissue.

use super::{
    Extent, Tissue, TissuePoint, draws,
    error::TissueError,
    triangle::{SurfacePoint, TriangleIndex},
};
use crate::synthesis::{mesh::TriangleMesh, rng::VesselRng};
use bevy_math::{Vec3, bounding::Aabb3d};
use rand::RngExt;

/// Distance from the surface, relative to the longest side of its box, within which a point counts as on it.
pub const SURFACE_TOLERANCE: f32 = 1.0e-5;

/// The triangles of a mesh, sampled evenly by area.
///
/// Points are drawn in constant time (Vose, "A linear algorithm for generating random numbers with a given
/// distribution", 1991) and projected through an index over the triangles.
#[derive(Clone, Debug)]
pub struct MeshSurface {
    mesh: TriangleMesh,
    index: TriangleIndex,
    /// Unit normal of every vertex, pointing out of a closed mesh.
    normals: Vec<Vec3>,
    /// −1 where the mesh as a whole faces inwards.
    facing: f32,
    picks: Vec<Pick>,
    bounds: Aabb3d,
    area: f32,
    tolerance: f32,
}

/// An entry of the alias table.
#[derive(Clone, Copy, Debug)]
struct Pick {
    /// Probability of staying with this triangle.
    keep: f32,
    /// The triangle to take otherwise.
    other: u32,
}

impl MeshSurface {
    /// Prepares a mesh.
    ///
    /// Vertices at the same position share a normal. A closed mesh that faces inwards as a whole is taken as facing
    /// outwards, so that vessels stand off it on the outside.
    ///
    /// # Errors
    /// None for a [`TriangleMesh`], which is checked; the result type is that of every tissue.
    pub fn new(mesh: TriangleMesh) -> Result<Self, TissueError> {
        let bounds = mesh.bounds();
        let facing = if mesh.signed_volume() < 0.0 && mesh.is_closed() { -1.0 } else { 1.0 };
        let mut normals = mesh.vertex_normals();
        normals.iter_mut().for_each(|normal| *normal *= facing);
        let areas: Vec<f64> = (0..mesh.triangles().len())
            .map(|triangle| if mesh.is_degenerate(triangle) { 0.0 } else { mesh.triangle_area(triangle) })
            .collect();
        Ok(Self {
            index: TriangleIndex::new(&mesh),
            normals,
            facing,
            picks: alias_table(&areas),
            area: areas.iter().sum::<f64>() as f32,
            tolerance: (bounds.max - bounds.min).max_element() * SURFACE_TOLERANCE,
            bounds,
            mesh,
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The index over the mesh's triangles.
    pub fn index(&self) -> &TriangleIndex {
        &self.index
    }

    /// Unit normal at a point of the mesh: that of the vertices, interpolated; the triangle's own where they cancel out
    /// or point to its other side.
    pub fn normal_at(&self, point: &SurfacePoint) -> Vec3 {
        let own = self.mesh.triangle_normal(point.triangle) * self.facing;
        let corners = self.mesh.triangles()[point.triangle].map(|vertex| self.normals[vertex as usize]);
        let weights = point.barycentric;
        let smooth = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
        match smooth.try_normalize() {
            Some(smooth) if smooth.dot(own) > 0.0 => smooth,
            _ => own,
        }
    }
}

impl MeshSurface {
    /// The point that four even numbers choose: a slot of the table, whether to stay with it, and two in the triangle.
    fn pick(&self, slot: u32, keep: f32, [mut v, mut w]: [f32; 2]) -> Vec3 {
        let pick = self.picks[slot as usize];
        let triangle = if keep < pick.keep { slot } else { pick.other };
        let [a, b, c] = self.mesh.corners(triangle as usize);
        // Evenly over the parallelogram, its far half folded back.
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

    fn extent(&self) -> Extent {
        Extent::Area(self.area)
    }

    fn contains(&self, point: Vec3) -> bool {
        self.index.any_within(point, self.tolerance)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        match self.index.closest(point) {
            Some(found) => TissuePoint { position: found.position, normal: self.normal_at(&found) },
            // Only of a point that is not finite there is no closest.
            None => TissuePoint { position: point, normal: Vec3::ZERO },
        }
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        if self.picks.is_empty() {
            return None;
        }
        let slot = rng.random_range(0..self.picks.len() as u32);
        Some(self.pick(slot, rng.random(), [rng.random(), rng.random()]))
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        let slots = self.picks.len() as u32;
        if slots > 0 {
            draws::draw(rng, count, candidates, |[slot, keep, v, w]| {
                Some(self.pick(draws::below(slot, slots), draws::unit(keep), [draws::unit(v), draws::unit(w)]))
            });
        }
    }
}

/// Vose's table for drawing an index with a probability in proportion to its weight. Empty where no weight is above 0.
fn alias_table(weights: &[f64]) -> Vec<Pick> {
    let total: f64 = weights.iter().sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let mut shares: Vec<f64> = weights.iter().map(|weight| weight / total * weights.len() as f64).collect();
    let (mut small, mut large): (Vec<u32>, Vec<u32>) =
        (0..weights.len() as u32).partition(|&index| shares[index as usize] < 1.0);
    let mut table = vec![Pick { keep: 1.0, other: 0 }; weights.len()];
    let largest = (0..weights.len()).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
    while let Some(under) = small.pop() {
        // What rounding leaves over on either side counts as exactly 1, unless it had no weight at all.
        let Some(&over) = large.last() else {
            if weights[under as usize] == 0.0 {
                table[under as usize] = Pick { keep: 0.0, other: largest as u32 };
            }
            continue;
        };
        table[under as usize] = Pick { keep: shares[under as usize] as f32, other: over };
        shares[over as usize] -= 1.0 - shares[under as usize];
        if shares[over as usize] < 1.0 {
            large.pop();
            small.push(over);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_alias_table_gives_every_weight_its_share() {
        let weights = [0.0, 3.0, 0.0, 1.0, 0.5, 7.5, 1e-12];
        let table = alias_table(&weights);
        let mut shares = [0.0; 7];
        for (index, pick) in table.iter().enumerate() {
            shares[index] += f64::from(pick.keep) / 7.0;
            shares[pick.other as usize] += f64::from(1.0 - pick.keep) / 7.0;
        }
        for (share, weight) in shares.iter().zip(weights) {
            assert!((share - weight / 12.0).abs() < 1e-6, "{shares:?}");
        }
        assert!(alias_table(&[0.0, 0.0]).is_empty());
        assert!(alias_table(&[]).is_empty());
    }
}
