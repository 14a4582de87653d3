//! What lies across the sides of a mesh's triangles.

use super::{
    MeshTopology, TriangleMesh, doubled_normal,
    topology::{EdgeUse, edge_key},
};
use crate::synthesis::pace::{Pace, Stretch};
use bevy_math::{DVec3, Vec3};
use std::num::NonZeroU32;

/// A triangle, and the side on which it is entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Across(NonZeroU32);

impl Across {
    fn new(triangle: u32, side: usize) -> Self {
        // There are at most 2²⁶ triangles.
        Self(NonZeroU32::MIN.saturating_add(triangle << 2 | side as u32))
    }

    pub fn triangle(self) -> u32 {
        (self.0.get() - 1) >> 2
    }

    pub fn side(self) -> usize {
        ((self.0.get() - 1) & 3) as usize
    }
}

/// Unit vector in a triangle's plane, perpendicular to one of its sides, to the inside.
pub(crate) fn inward(corners: [Vec3; 3], side: usize) -> DVec3 {
    let along = corners[(side + 1) % 3].as_dvec3() - corners[side].as_dvec3();
    doubled_normal(corners).cross(along).normalize_or_zero()
}

impl MeshTopology {
    /// What lies across each side of each triangle. Side k runs from corner k to the next.
    ///
    /// Of several triangles at a common edge, it is the one that continues a triangle most straightly.
    pub(super) async fn neighbours(&self, mesh: &TriangleMesh, pace: &Pace) -> Vec<[Option<Across>; 3]> {
        let mut neighbours = vec![[None; 3]; self.triangles.len()];
        let (mut stretch, mut done) = (Stretch::default(), 0);
        for fan in self.fans() {
            let sides = || fan.iter().filter_map(|edge| Some((edge.triangle, self.side_at(edge)?)));
            for (triangle, side) in sides() {
                let inward = inward(mesh.corners(triangle as usize), side);
                let turn = |&(other, side): &(u32, usize)| {
                    if fan.len() == 2 { 0.0 } else { inward.dot(self::inward(mesh.corners(other as usize), side)) }
                };
                let straightest = sides().filter(|&(other, _)| other != triangle);
                let straightest = straightest.min_by(|a, b| turn(a).total_cmp(&turn(b)));
                neighbours[triangle as usize][side] = straightest.map(|(triangle, side)| Across::new(triangle, side));
            }
            done += fan.len();
            if stretch.ends_after(fan.len()) {
                pace.rest(done as f32 / (3 * self.triangles.len()) as f32).await;
            }
        }
        neighbours
    }

    /// The side of a triangle that uses an edge.
    fn side_at(&self, edge: &EdgeUse) -> Option<usize> {
        let corners = self.triangles[edge.triangle as usize]?;
        (0..3).find(|&side| edge_key(corners[side], corners[(side + 1) % 3]) == edge.key)
    }
}
