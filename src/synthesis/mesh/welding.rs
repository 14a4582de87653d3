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
        let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(self.triangles().len());
        let take = |triangle: usize| {
            if !self.is_degenerate(triangle) {
                triangles.push(self.triangles()[triangle].map(|vertex| welding.vertex(vertex) as u32));
            }
        };
        pace.part(0.4..0.6).each(self.triangles().len(), take).await;
        let triangles = without_repeats(triangles, &pace.part(0.6..1.0)).await;
        Self { positions, triangles, uvs: None }
    }
}

/// Drops triangles with the same three vertices as an earlier one, in any order.
async fn without_repeats(triangles: Vec<[u32; 3]>, pace: &Pace) -> Vec<[u32; 3]> {
    let key = |number: usize| {
        let mut sorted = triangles[number];
        sorted.sort_unstable();
        (sorted, number as u32)
    };
    let mut keys: Vec<([u32; 3], u32)> = pace.part(0.0..0.2).collect(triangles.len(), key).await;
    pace.part(0.2..0.8).sort(&mut keys).await;
    let mut is_repeat = vec![false; triangles.len()];
    let compare = |pair: usize| {
        let [(first, _), (second, number)] = [keys[pair], keys[pair + 1]];
        is_repeat[number as usize] = first == second;
    };
    pace.part(0.8..0.9).each(keys.len().saturating_sub(1), compare).await;
    let mut kept = Vec::with_capacity(triangles.len());
    let keep = |number: usize| {
        if !is_repeat[number] {
            kept.push(triangles[number]);
        }
    };
    pace.part(0.9..1.0).each(triangles.len(), keep).await;
    kept
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
