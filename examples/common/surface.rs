//! The surface of the organ that is operated on: what instruments touch and blood falls on, while it breathes.

use bevy::prelude::*;
use bevy_vessels::{
    plugin::triangle_mesh,
    synthesis::mesh::{SurfacePoint, TriangleIndex, TriangleMesh},
};

/// How far the diaphragm pushes the top of an organ, as a share of its height.
const DEPTH: f32 = 0.02;

/// An organ's surface in the world. It is known at rest; points of it move with the breath.
#[derive(Resource)]
pub struct Surface {
    mesh: TriangleMesh,
    index: TriangleIndex,
    /// Lowest and highest point.
    low: f32,
    high: f32,
    /// How far the chest is filled, from 0 to 1.
    pub breath: f32,
    /// From where the organ is looked at first.
    pub eye: Vec3,
}

impl Surface {
    /// The surface of a mesh at a place, looked at from somewhere.
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

    /// Where the breath moves a point of the organ: what is near the diaphragm goes down and to the front.
    pub fn breathed(&self, at: Vec3) -> Vec3 {
        at + self.shift(at)
    }

    fn shift(&self, at: Vec3) -> Vec3 {
        let height = (self.high - self.low).max(f32::MIN_POSITIVE);
        let share = ((at.y - self.low) / height).clamp(0.0, 1.0);
        DEPTH * height * self.breath * share * share * Vec3::new(0.0, -1.0, 0.6)
    }

    /// Where a way first meets the surface, and the normal there.
    pub fn hit(&self, from: Vec3, to: Vec3) -> Option<(Vec3, Vec3)> {
        let (touched, shift) = self.touch(from, to)?;
        Some((touched.position + shift, self.mesh.triangle_normal(touched.triangle)))
    }

    /// What a way first meets, at rest, and how far that has moved.
    pub fn touch(&self, from: Vec3, to: Vec3) -> Option<(SurfacePoint, Vec3)> {
        let mut shift = self.shift(to);
        // The breath is the same for all that is near: where it was guessed for another place, once more is enough.
        if let Some(first) = self.index.first_hit(from - shift, to - shift) {
            shift = self.shift(first.position);
        }
        let touched = self.index.first_hit(from - shift, to - shift)?;
        Some((touched, self.shift(touched.position)))
    }

    /// The nearest point of the surface, and the normal there.
    pub fn nearest(&self, point: Vec3) -> Option<(Vec3, Vec3)> {
        let near = self.nearest_at_rest(point)?;
        Some((self.breathed(near.position), self.mesh.triangle_normal(near.triangle)))
    }

    /// What of the surface at rest is nearest to a point.
    pub fn nearest_at_rest(&self, point: Vec3) -> Option<SurfacePoint> {
        self.index.closest(point - self.shift(point))
    }
}
