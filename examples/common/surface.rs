//! The surface of the operated organ, which instruments touch and blood falls on, while it breathes.

use bevy::prelude::*;
use bevy_vessels::{
    plugin::triangle_mesh,
    synthesis::mesh::{SurfacePoint, TriangleIndex, TriangleMesh},
};

/// Distance by which the diaphragm pushes the top of an organ, as a share of its height.
const DEPTH: f32 = 0.02;

/// An organ's surface in the world. It is stored at rest; its points move with the breath.
#[derive(Resource)]
pub struct Surface {
    mesh: TriangleMesh,
    index: TriangleIndex,
    /// Lowest and highest point.
    low: f32,
    high: f32,
    /// Filling of the chest, from 0 to 1.
    pub breath: f32,
    /// Initial position of the viewer.
    pub eye: Vec3,
}

impl Surface {
    /// The surface of a mesh at a place, seen from `eye`.
    pub fn new(mesh: &Mesh, place: &Transform, eye: Vec3) -> Result<Self> {
        let mesh = triangle_mesh(mesh)?;
        let positions = mesh.positions().iter().map(|&at| place.transform_point(at)).collect();
        let mesh = TriangleMesh::new(positions, mesh.triangles().to_vec(), None)?;
        let bounds = mesh.bounds();
        Ok(Self { index: TriangleIndex::new(&mesh), low: bounds.min.y, high: bounds.max.y, mesh, breath: 0.0, eye })
    }

    /// The triangles at rest.
    pub fn at_rest(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// A point of the organ, moved by the breath: near the diaphragm it goes down and to the front.
    pub fn breathed(&self, at: Vec3) -> Vec3 {
        at + self.shift(at)
    }

    fn shift(&self, at: Vec3) -> Vec3 {
        let height = (self.high - self.low).max(f32::MIN_POSITIVE);
        let share = ((at.y - self.low) / height).clamp(0.0, 1.0);
        DEPTH * height * self.breath * share * share * Vec3::new(0.0, -1.0, 0.6)
    }

    /// The first point of the surface between two points, and its normal.
    pub fn hit(&self, from: Vec3, to: Vec3) -> Option<(Vec3, Vec3)> {
        let (touched, shift) = self.touch(from, to)?;
        Some((touched.position + shift, self.mesh.triangle_normal(touched.triangle)))
    }

    /// The first point of the surface between two points, at rest, and its movement.
    pub fn touch(&self, from: Vec3, to: Vec3) -> Option<(SurfacePoint, Vec3)> {
        let mut shift = self.shift(to);
        // The breath is the same for all nearby points, so one correction of the guess is enough.
        if let Some(first) = self.index.first_hit(from - shift, to - shift) {
            shift = self.shift(first.position);
        }
        let touched = self.index.first_hit(from - shift, to - shift)?;
        Some((touched, self.shift(touched.position)))
    }

    /// The nearest point of the surface, and its normal.
    pub fn nearest(&self, point: Vec3) -> Option<(Vec3, Vec3)> {
        let near = self.nearest_at_rest(point)?;
        Some((self.breathed(near.position), self.mesh.triangle_normal(near.triangle)))
    }

    /// The point of the surface at rest that is nearest to a point.
    pub fn nearest_at_rest(&self, point: Vec3) -> Option<SurfacePoint> {
        self.index.closest(point - self.shift(point))
    }
}
