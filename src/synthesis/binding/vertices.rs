//! An organ's vertices with normals, measured again for every pose.
//!
//! In: a [`TriangleMesh`], then positions of its vertices. Out: a [`Vertex`] for each. Normals are the mean over the
//! triangles around a position, weighted by area, as in [`TriangleMesh::vertex_normals`]; here they are computed in f32
//! and gathered vertex by vertex, so that threads share the work and the result doesn't depend on their number.

use crate::synthesis::mesh::{TriangleMesh, Welding, unit};
use crate::synthesis::{pace::Pace, parallel};
use bevy_math::{Vec3, Vec3A};

/// Share of the summed areas below which the sum of their normals is rounding. Areas are f32 here, so it is more than that
/// of a mesh at rest, whose areas are f64.
const CANCELLED_SHARE: f64 = 1.0e-5;

/// Fewest triangles, vertices, or groups of four nodes, worth handing to another thread.
pub(super) const WORTH_SHARING: usize = 2048;

/// A vertex of a deformed organ. Position and normal are stored together, since nodes read both at random vertices.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    pub position: Vec3A,
    /// Unit length, or zero if the triangles around have no area or cancel out.
    pub normal: Vec3A,
}

/// Data for measuring vertices, with scratch space.
#[derive(Clone, Debug)]
pub(super) struct Vertices {
    triangles: Vec<[u32; 3]>,
    welding: Welding,
    /// Range in `around` of each welded vertex's triangles.
    ranges: Vec<[u32; 2]>,
    /// The triangles around each welded vertex.
    around: Vec<u32>,
    /// Twice the area of each triangle, along its normal, in units that depend on the pose.
    areas: Vec<Vec3A>,
    /// Normal of each welded vertex.
    normals: Vec<Vec3A>,
}

impl Vertices {
    pub async fn new(mesh: &TriangleMesh, pace: &Pace) -> Self {
        let welding = mesh.weld_paced(&pace.part(0.0..0.5)).await;
        let triangles = mesh.triangles().to_vec();
        let mut ranges = vec![[0; 2]; welding.count()];
        let count = |triangle: usize| {
            for corner in triangles[triangle] {
                ranges[welding.vertex(corner)][1] += 1;
            }
        };
        pace.part(0.5..0.7).each(triangles.len(), count).await;
        let mut end = 0;
        for range in &mut ranges {
            let count = range[1];
            *range = [end; 2];
            end += count;
        }
        let mut around = vec![0; 3 * triangles.len()];
        let enter = |triangle: usize| {
            for corner in triangles[triangle] {
                let [_, end] = &mut ranges[welding.vertex(corner)];
                around[*end as usize] = triangle as u32;
                *end += 1;
            }
        };
        pace.part(0.7..1.0).each(triangles.len(), enter).await;
        let areas = vec![Vec3A::ZERO; triangles.len()];
        let normals = vec![Vec3A::ZERO; welding.count()];
        Self { triangles, welding, ranges, around, areas, normals }
    }

    /// Measures all vertices at finite positions, one for each vertex of the mesh. Returns the power of two that brings
    /// their coordinates near 1.
    pub fn measure(&mut self, positions: &[Vec3], vertices: &mut Vec<Vertex>) -> f32 {
        // The scale keeps products within f32 at any size of the organ.
        let scale = scale_to_one(positions);
        let area = |_, corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| Vec3A::from(positions[corner as usize]) * scale);
            (b - a).cross(c - a)
        };
        parallel::map_all(&self.triangles, &mut self.areas, WORTH_SHARING, area);
        let (around, areas) = (&self.around, &self.areas);
        let normal = |_, &[from, to]: &[u32; 2]| {
            let areas = around[from as usize..to as usize].iter().map(|&triangle| areas[triangle as usize]);
            // In f64, where no square of an area vanishes.
            let sum = areas.clone().sum::<Vec3A>().as_dvec3();
            let weight: f64 = areas.map(|area| area.as_dvec3().length()).sum();
            // What is left where areas cancel out is rounding.
            if sum.length() > CANCELLED_SHARE * weight { Vec3A::from(unit(sum)) } else { Vec3A::ZERO }
        };
        parallel::map_all(&self.ranges, &mut self.normals, WORTH_SHARING, normal);
        let (welding, normals) = (&self.welding, &self.normals);
        vertices.resize(positions.len(), Vertex::default());
        parallel::map_all(positions, vertices, WORTH_SHARING, |vertex, &position| Vertex {
            position: position.into(),
            normal: normals[welding.vertex(vertex as u32)],
        });
        scale
    }
}

/// A power of two that brings the largest coordinate to between 1 and 4.
fn scale_to_one(positions: &[Vec3]) -> f32 {
    const EXPONENT: u32 = f32::INFINITY.to_bits();
    let largest = positions.iter().fold(Vec3::ZERO, |largest, position| largest.max(position.abs())).max_element();
    // The negated exponent, kept from becoming that of 0 or of infinity.
    let inverse = (2 * 1.0f32.to_bits()).saturating_sub(largest.to_bits() & EXPONENT);
    f32::from_bits(inverse.clamp(f32::MIN_POSITIVE.to_bits(), f32::MAX.to_bits() & EXPONENT))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::pace::at_once;
    use bevy_math::Quat;

    /// A fan around a tip, every triangle with corners of its own.
    fn fan(size: f32) -> TriangleMesh {
        let rim = |k: u8| Quat::from_rotation_z(f32::from(k)) * Vec3::new(1.0, 0.0, -0.5);
        let positions: Vec<Vec3> = (0..6).flat_map(|k| [Vec3::ZERO, rim(k), rim(k + 1)]).map(|p| p * size).collect();
        let triangles = (0..6).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        TriangleMesh::new(positions, triangles, None).expect("a mesh")
    }

    #[test]
    fn normals_are_those_of_the_mesh_at_any_size() {
        for size in [1.0e-9, 1.0e-3, 1.0, 7.0e8] {
            let mesh = fan(size);
            let mut vertices = Vec::new();
            at_once(Vertices::new(&mesh, &Pace::default())).measure(mesh.positions(), &mut vertices);
            for (vertex, expected) in vertices.iter().zip(mesh.vertex_normals()) {
                assert!((Vec3::from(vertex.normal) - expected).length() < 1.0e-6, "size {size}: {}", vertex.normal);
            }
        }
    }

    /// Sums of opposite areas are rounding, which is no direction.
    #[test]
    fn both_sides_of_a_sheet_leave_no_normal() {
        let at = |k: u32| Vec3::new((k % 7) as f32 * 0.37, (k / 7) as f32 * 0.23, ((k * k) as f32 * 0.7).sin() * 0.1);
        let positions: Vec<Vec3> = (0..49).map(at).collect();
        let front = (0..36).map(|k| k + k / 6).flat_map(|k| [[k, k + 1, k + 7], [k + 1, k + 8, k + 7]]);
        let triangles: Vec<[u32; 3]> = front.flat_map(|[a, b, c]| [[a, b, c], [c, b, a]]).collect();
        let mesh = TriangleMesh::new(positions, triangles, None).expect("a mesh");
        let mut vertices = Vec::new();
        at_once(Vertices::new(&mesh, &Pace::default())).measure(mesh.positions(), &mut vertices);
        assert!(vertices.iter().all(|vertex| vertex.normal == Vec3A::ZERO));
        assert!(mesh.vertex_normals().iter().all(|normal| *normal == Vec3::ZERO));
    }

    #[test]
    fn any_finite_coordinate_is_brought_near_one() {
        for largest in [0.0, f32::from_bits(1), f32::MIN_POSITIVE, 0.7, 1.0, 3.9, 1.0e9, f32::MAX] {
            let scale = scale_to_one(&[Vec3::new(0.0, -largest, 0.5 * largest)]);
            assert!(scale.is_normal() && scale.to_bits().trailing_zeros() >= 23, "{largest}: {scale}");
            let scaled = largest * scale;
            assert!(scaled < 4.0 && (largest < f32::MIN_POSITIVE || scaled >= 0.5), "{largest}: {scaled}");
        }
    }
}
