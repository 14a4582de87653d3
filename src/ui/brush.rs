//! The brush: what one touch does to paint, and its mirror images.

use crate::synthesis::{mesh::TriangleMesh, tissue::NoGo};
use bevy::math::Vec3;

/// The brush that paints on organs, and what all painting tools share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brush {
    /// Its radius, as a share of the diagonal of the organ's box.
    ///
    /// Limits: 0.002 to 0.5. Default: 0.04.
    pub radius: f32,
    /// How far one touch moves the density towards [`density`](Self::density), in the middle of the brush.
    ///
    /// Limits: 0 to 1. Default: 0.5.
    pub strength: f32,
    /// The density that is painted: the share of attraction points that stay. 0: no new vessels; 1: as without paint.
    ///
    /// Limits: 0 to 1. Default: 0.
    pub density: f32,
    /// Whether tools take away what they paint otherwise: density goes back to 1, no-go regions, guides and roots go.
    ///
    /// Default: false.
    pub erases: bool,
    /// Whether every touch is repeated at its mirror image, across the plane through the middle of the organ's box that
    /// is perpendicular to x, y and z.
    ///
    /// Default: none.
    pub mirror: [bool; 3],
}

impl Default for Brush {
    fn default() -> Self {
        Self { radius: 0.04, strength: 0.5, density: 0.0, erases: false, mirror: [false; 3] }
    }
}

impl Brush {
    /// A point and its mirror images, in an order of its own for each choice of mirrors.
    pub(super) fn images(&self, point: Vec3, middle: Vec3) -> Vec<Vec3> {
        let mut images = vec![point];
        for axis in (0..3).filter(|&axis| self.mirror[axis]) {
            for index in 0..images.len() {
                let mut image = images[index];
                image[axis] = 2.0 * middle[axis] - image[axis];
                images.push(image);
            }
        }
        images
    }

    /// Moves the density of the vertices near some points. Paint that is back at 1 everywhere is none.
    ///
    /// A vertex that several points reach is moved once, by the nearest.
    pub(super) fn dab_density(&self, density: &mut Option<Vec<f32>>, mesh: &TriangleMesh, points: &[Vec3], reach: f32) {
        let target = if self.erases { 1.0 } else { self.density };
        let vertices = mesh.positions().len();
        let mut values =
            density.take().filter(|values| values.len() == vertices).unwrap_or_else(|| vec![1.0; vertices]);
        for (value, &vertex) in values.iter_mut().zip(mesh.positions()) {
            let strongest = points.iter().map(|&point| falloff(vertex.distance(point) / reach)).fold(0.0, f32::max);
            *value += self.strength * strongest * (target - *value);
            // What is left of erased paint counts for nothing.
            if self.erases && *value > 0.999 {
                *value = 1.0;
            }
        }
        *density = values.iter().any(|&value| value != 1.0).then_some(values);
    }

    /// Forbids the vertices near some points, or frees them.
    pub(super) fn dab_no_go(&self, no_go: &mut NoGo, mesh: &TriangleMesh, points: &[Vec3], reach: f32) {
        let vertices = mesh.positions().len();
        let painted = no_go.vertices.take().filter(|painted| painted.len() == vertices);
        let mut painted = painted.unwrap_or_else(|| vec![false; vertices]);
        for (painted, &vertex) in painted.iter_mut().zip(mesh.positions()) {
            if points.iter().any(|&point| vertex.distance_squared(point) <= reach * reach) {
                *painted = !self.erases;
            }
        }
        no_go.vertices = painted.contains(&true).then_some(painted);
        if self.erases {
            no_go.regions.retain(|region| !points.iter().any(|&point| region.contains(point)));
        }
    }
}

/// How much of a touch arrives at a distance, as a share of the brush's radius: all in the middle, nothing at the rim.
fn falloff(distance: f32) -> f32 {
    let inside = (1.0 - distance * distance).max(0.0);
    inside * inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::tissue::NoGoRegion;

    /// A square of 11 × 11 vertices, one apart, around the origin.
    fn square() -> TriangleMesh {
        let positions = (0..121).map(|i| Vec3::new((i % 11) as f32 - 5.0, (i / 11) as f32 - 5.0, 0.0)).collect();
        let cell = |i: u32| [[i, i + 1, i + 11], [i + 1, i + 12, i + 11]];
        let cells = (0..110).filter(|i| i % 11 != 10).flat_map(cell).collect();
        TriangleMesh::new(positions, cells, None).expect("a square")
    }

    fn at(mesh: &TriangleMesh, point: Vec3) -> usize {
        mesh.positions().iter().position(|&vertex| vertex == point).expect("a vertex")
    }

    #[test]
    fn a_touch_thins_the_middle_most_and_erasing_leaves_no_paint() {
        let (mesh, mut brush) = (square(), Brush::default());
        let mut density = None;
        brush.dab_density(&mut density, &mesh, &[Vec3::ZERO], 2.5);
        let values = density.clone().expect("paint");
        assert_eq!(values[at(&mesh, Vec3::ZERO)], 0.5, "the strength");
        assert!(values[at(&mesh, Vec3::X)] > 0.5 && values[at(&mesh, 2.0 * Vec3::X)] < 1.0);
        assert_eq!(values[at(&mesh, 3.0 * Vec3::X)], 1.0, "out of reach");
        brush.erases = true;
        for _ in 0..200 {
            brush.dab_density(&mut density, &mesh, &[Vec3::ZERO], 2.6);
        }
        assert_eq!(density, None);
    }

    #[test]
    fn mirror_images_are_painted_alike_and_a_touch_on_the_plane_counts_once() {
        let mesh = square();
        let brush = Brush { mirror: [true, true, false], ..Brush::default() };
        let images = brush.images(Vec3::new(3.0, 2.0, 0.0), Vec3::ZERO);
        assert_eq!(images.len(), 4);
        let mut density = None;
        brush.dab_density(&mut density, &mesh, &images, 1.5);
        let values = density.take().expect("paint");
        for image in images {
            assert_eq!(values[at(&mesh, image)], 0.5);
        }
        brush.dab_density(&mut density, &mesh, &brush.images(Vec3::ZERO, Vec3::ZERO), 1.5);
        assert_eq!(density.expect("paint")[at(&mesh, Vec3::ZERO)], 0.5, "not four times");
    }

    #[test]
    fn forbidden_vertices_are_freed_again_and_so_are_regions_under_the_eraser() {
        let mesh = square();
        let mut no_go = NoGo { regions: vec![NoGoRegion::Ball { center: Vec3::X, radius: 0.5 }], ..NoGo::default() };
        let mut brush = Brush::default();
        brush.dab_no_go(&mut no_go, &mesh, &[Vec3::ZERO], 1.0);
        let painted = no_go.vertices.clone().expect("paint");
        assert_eq!(painted.iter().filter(|&&painted| painted).count(), 5);
        brush.erases = true;
        brush.dab_no_go(&mut no_go, &mesh, &[Vec3::ZERO, Vec3::X], 1.0);
        assert!(no_go.is_empty() && no_go.vertices.is_none());
    }

    #[test]
    fn paint_of_another_mesh_is_replaced() {
        let (mesh, brush) = (square(), Brush::default());
        let mut density = Some(vec![0.0; 7]);
        brush.dab_density(&mut density, &mesh, &[Vec3::ZERO], 1.0);
        assert_eq!(density.expect("paint").len(), mesh.positions().len());
    }
}
