//! Knots: faces that meet each other though their vessels need not.

use super::sets::Sets;
use super::site::Site;
use crate::synthesis::mesh::self_intersections_paced;
use crate::synthesis::pace::Pace;

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

    fn doubtful_faces(&self) -> Vec<u32> {
        let mut faces: Vec<u32> = Vec::new();
        for doubt in &self.plan.layout.doubts {
            let lengths = self.plan.layout.lengths(doubt.trunk);
            let low = lengths.partition_point(|&length| length <= doubt.from).saturating_sub(1) as u32;
            let high = lengths.partition_point(|&length| length < doubt.to).min(lengths.len() - 1) as u32;
            faces.extend(self.faces_between(doubt.trunk, [low, high.max(low)]));
        }
        faces.sort_unstable();
        faces.dedup();
        faces
    }

    /// Knots from pairs of faces: those that meet or share a vertex are in one.
    fn joined(&self, pairs: &[[u32; 2]]) -> Vec<Knot> {
        let mut faces: Vec<u32> = pairs.iter().flatten().copied().collect();
        faces.sort_unstable();
        faces.dedup();
        let number = |face: u32| faces.partition_point(|&other| other < face);
        let mut links: Vec<[usize; 2]> = pairs.iter().map(|pair| pair.map(number)).collect();
        let mut users: Vec<(u32, usize)> =
            (0..faces.len()).flat_map(|face| self.corners(faces[face]).map(|vertex| (vertex, face))).collect();
        users.sort_unstable();
        links.extend(users.windows(2).filter(|two| two[0].0 == two[1].0).map(|two| [two[0].1, two[1].1]));
        let mut sets = Sets::new(faces.len());
        links.into_iter().for_each(|[a, b]| sets.join(a, b));
        let numbers = sets.numbers();
        let mut knots = vec![Knot::default(); numbers.iter().max().map_or(0, |last| last + 1)];
        for (face, knot) in faces.into_iter().zip(numbers) {
            knots[knot].faces.push(face);
        }
        knots
    }
}
