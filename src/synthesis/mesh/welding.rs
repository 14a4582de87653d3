//! Finds vertices of a mesh at the same position, and makes a mesh with each position once.

use super::TriangleMesh;
use crate::synthesis::pace::{Pace, at_once};
use bevy_math::Vec3;

/// The vertices of a mesh that are at the same position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Welding {
    vertices: Vec<u32>,
    count: usize,
}

impl Welding {
    /// The welded vertex that a vertex of the mesh belongs to. Welded vertices are numbered in order of appearance.
    ///
    /// # Panics
    /// If the mesh has no such vertex.
    pub fn vertex(&self, vertex: u32) -> usize {
        self.vertices[vertex as usize] as usize
    }

    /// Number of different positions.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// An empty entry of the welding table.
const EMPTY: u32 = u32::MAX;

impl TriangleMesh {
    /// Finds vertices at exactly the same position (−0 and 0 are the same).
    pub fn weld(&self) -> Welding {
        at_once(self.weld_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn weld_paced(&self, pace: &Pace) -> Welding {
        let positions = self.positions();
        // Open addressing over at least twice as many slots as vertices: a probe nearly always ends at once.
        let mask = (2 * positions.len()).next_power_of_two() - 1;
        let mut slots = vec![EMPTY; mask + 1];
        let mut firsts: Vec<Vec3> = Vec::with_capacity(positions.len());
        let mut vertices = Vec::with_capacity(positions.len());
        let weld = |vertex: usize| {
            let position = positions[vertex];
            let mut slot = hash(position) as usize & mask;
            let welded = loop {
                match slots[slot] {
                    EMPTY => {
                        slots[slot] = firsts.len() as u32;
                        firsts.push(position);
                        break slots[slot];
                    }
                    candidate if firsts[candidate as usize] == position => break candidate,
                    _ => slot = (slot + 1) & mask,
                }
            };
            vertices.push(welded);
        };
        pace.each(positions.len(), weld).await;
        Welding { vertices, count: firsts.len() }
    }

    /// A copy in which every position occurs once, and no triangle is degenerate or repeats an earlier one.
    ///
    /// Texture coordinates are dropped: a welded vertex of a seam would need several.
    #[must_use]
    pub fn welded(&self) -> Self {
        at_once(self.welded_paced(&Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(crate) async fn welded_paced(&self, pace: &Pace) -> Self {
        let welding = self.weld_paced(&pace.part(0.0..0.3)).await;
        let mut positions = vec![Vec3::ZERO; welding.count()];
        let place = |vertex: usize| positions[welding.vertex(vertex as u32)] = self.positions()[vertex];
        pace.part(0.3..0.4).each(self.positions().len(), place).await;
        let faces = self.faces_paced(&welding, &pace.part(0.4..0.9)).await;
        let corner = |face: usize| self.triangles()[faces[face] as usize].map(|vertex| welding.vertex(vertex) as u32);
        let triangles = pace.part(0.9..1.0).collect(faces.len(), corner).await;
        Self { positions, triangles, uvs: None }
    }

    /// The numbers, in order, of the triangles that make up the surface: those with an area, of which each is there
    /// once. A triangle with the three corners of an earlier one, in any order, is a copy or the other side of it.
    pub(crate) async fn faces_paced(&self, welding: &Welding, pace: &Pace) -> Vec<u32> {
        let mut keys: Vec<([u32; 3], u32)> = Vec::with_capacity(self.triangles().len());
        let enter = |number: usize| {
            if !self.is_degenerate(number) {
                let mut sorted = self.triangles()[number].map(|vertex| welding.vertex(vertex) as u32);
                sorted.sort_unstable();
                keys.push((sorted, number as u32));
            }
        };
        pace.part(0.0..0.3).each(self.triangles().len(), enter).await;
        pace.part(0.3..0.8).sort(&mut keys).await;
        let mut is_face = vec![false; self.triangles().len()];
        let mark = |place: usize| {
            let (corners, number) = keys[place];
            is_face[number as usize] = place == 0 || keys[place - 1].0 != corners;
        };
        pace.part(0.8..0.9).each(keys.len(), mark).await;
        let mut faces = Vec::with_capacity(keys.len());
        let take = |number: usize| {
            if is_face[number] {
                faces.push(number as u32);
            }
        };
        pace.part(0.9..1.0).each(is_face.len(), take).await;
        faces
    }
}

fn hash(position: Vec3) -> u64 {
    // Adding 0 turns −0 into 0.
    let [x, y, z] = (position + Vec3::ZERO).to_array().map(|value| u64::from(value.to_bits()));
    let mixed = (x ^ y.rotate_left(21) ^ z.rotate_left(42)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29) ^ z).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed ^ (mixed >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::mesh::MeshError;

    #[test]
    fn negative_zero_welds() -> Result<(), MeshError> {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(-0.0, 0.0, -0.0), Vec3::Y, Vec3::NEG_X];
        let mesh = TriangleMesh::new(positions, vec![[0, 1, 2], [3, 4, 5]], None)?;
        assert_eq!(mesh.weld().count(), 4);
        assert_eq!(mesh.topology().components().1, 1);
        assert_eq!(mesh.topology().boundary_edges(), 4);
        assert!(!mesh.is_closed());
        Ok(())
    }
}
