//! Knots: faces that meet each other though their vessels need not.

use super::site::Site;
use crate::synthesis::mesh::{disjoint_sets::DisjointSets, self_intersections_paced};
use crate::synthesis::pace::Pace;
use crate::synthesis::surface::layout::Stretch;

/// Faces of one joint that meet each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Knot {
    pub faces: Vec<u32>,
}

impl Knot {
    /// Adds the faces of another knot.
    pub fn absorb(&mut self, other: &Self) {
        self.faces.extend(&other.faces);
        self.faces.sort_unstable();
        self.faces.dedup();
    }
}

impl Site<'_> {
    /// All knots in the stretches that may have lacked room.
    pub async fn knots(&self, pace: &Pace) -> Vec<Knot> {
        let faces = self.doubtful_faces();
        let (mut triangles, mut face_of) = (Vec::new(), Vec::new());
        for &face in &faces {
            for triangle in self.triangles(face) {
                triangles.push(triangle);
                face_of.push(face);
            }
        }
        let pairs = self_intersections_paced(&self.mesh.positions, &triangles, pace).await;
        let mut pairs: Vec<[u32; 2]> =
            pairs.iter().map(|pair| pair.map(|triangle| face_of[triangle as usize])).collect();
        pairs.sort_unstable();
        pairs.dedup();
        pairs.retain(|&[a, b]| self.are_local(self.place_of(a), self.place_of(b), 0.0));
        self.joined(&pairs)
    }

    /// The faces in all doubtful stretches, each once, in order.
    fn doubtful_faces(&self) -> Vec<u32> {
        let mut stretches: Vec<(u32, [u32; 2])> =
            self.plan.layout.doubts.iter().map(|doubt| self.rings_in(doubt)).collect();
        stretches.sort_unstable();
        // A trunk with many laterals has stretches that overlap.
        stretches.dedup_by(|next, last| {
            let overlaps = next.0 == last.0 && next.1[0] <= last.1[1];
            if overlaps {
                last.1[1] = last.1[1].max(next.1[1]);
            }
            overlaps
        });
        let faces = |(trunk, rings): (u32, [u32; 2])| self.faces_between(trunk, rings);
        let mut faces: Vec<u32> = stretches.into_iter().flat_map(faces).collect();
        faces.sort_unstable();
        faces
    }

    /// The rings around a stretch, with its trunk.
    fn rings_in(&self, stretch: &Stretch) -> (u32, [u32; 2]) {
        let lengths = self.plan.layout.lengths(stretch.trunk);
        let low = lengths.partition_point(|&length| length <= stretch.from).saturating_sub(1) as u32;
        let high = lengths.partition_point(|&length| length < stretch.to).min(lengths.len() - 1) as u32;
        (stretch.trunk, [low, high.max(low)])
    }

    /// Knots from pairs of faces: those that meet or share a vertex are in one.
    fn joined(&self, pairs: &[[u32; 2]]) -> Vec<Knot> {
        let mut faces: Vec<u32> = pairs.iter().flatten().copied().collect();
        faces.sort_unstable();
        faces.dedup();
        let number = |face: u32| faces.partition_point(|&other| other < face) as u32;
        let mut sets = DisjointSets::new(faces.len());
        pairs.iter().map(|pair| pair.map(number)).for_each(|[a, b]| sets.unite(a, b));
        let uses = (0u32..).zip(&faces).flat_map(|(place, &face)| self.corners(face).map(|vertex| (vertex, place)));
        let mut users: Vec<(u32, u32)> = uses.collect();
        users.sort_unstable();
        users.windows(2).filter(|two| two[0].0 == two[1].0).for_each(|two| sets.unite(two[0].1, two[1].1));
        let (places, count) = sets.places();
        let mut knots = vec![Knot::default(); count];
        for (face, knot) in faces.into_iter().zip(places) {
            knots[knot].faces.push(face);
        }
        knots
    }
}
