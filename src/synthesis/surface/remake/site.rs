//! The mesh as vessels see it: where on which trunk a face lies, and which faces are near.

use super::ball::Ball;
use super::plan::Plan;
use super::tubes::{self, Cone};
use crate::synthesis::surface::mesh::SurfaceMesh;
use crate::synthesis::tree::NodeId;
use bevy_math::Vec3;
use std::collections::BTreeMap;

/// The way along the vessels by which two faces of one joint may be farther apart than seen from outside, in radii of the
/// widest vessel on the way.
const LOCAL: f32 = 6.0;
/// Distance from a ball up to which a tube's faces are near, in its radii: faces bulge and their corners lie aside.
const NEAR: f32 = 2.0;

/// A place on a trunk: its number, and the length along it.
pub(super) type Place = (u32, f32);

/// A mesh with the plan that it was made by.
pub(super) struct Site<'a> {
    pub mesh: &'a SurfaceMesh,
    pub plan: &'a Plan,
    /// Trunks with the laterals that leave them, in order.
    laterals: Vec<(u32, u32)>,
}

impl<'a> Site<'a> {
    pub fn of(mesh: &'a SurfaceMesh, plan: &'a Plan) -> Self {
        let mouth = |lateral: u32| plan.layout.mouth(lateral).map(|mouth| (mouth.trunk, lateral));
        let mut laterals: Vec<(u32, u32)> = (0..plan.layout.len() as u32).filter_map(mouth).collect();
        laterals.sort_unstable();
        Self { mesh, plan, laterals }
    }

    /// The vertices of a face, each as its original.
    pub fn corners(&self, face: u32) -> [u32; 4] {
        self.mesh.faces[face as usize].map(|vertex| self.mesh.original(vertex))
    }

    /// The triangles of a face, with original vertices.
    pub fn triangles(&self, face: u32) -> impl Iterator<Item = [u32; 3]> + use<> {
        self.mesh.divided(self.corners(face))
    }

    /// Positions of a face's corners.
    pub fn points(&self, face: u32) -> [Vec3; 4] {
        self.mesh.faces[face as usize].map(|vertex| self.mesh.positions[vertex as usize])
    }

    /// The faces of a trunk between two rings, with those of its ends if the rings are its first or last.
    pub fn faces_between(&self, trunk: u32, rings: [u32; 2]) -> impl Iterator<Item = u32> + use<'_> {
        let each = self.plan.faces_per_corner;
        self.plan.layout.corners_between(trunk, rings).flat_map(move |corners| corners.start * each..corners.end * each)
    }

    /// The trunk of a face and the rings between which it lies.
    pub fn rings_of(&self, face: u32) -> (u32, [u32; 2]) {
        self.plan.layout.place_of(face / self.plan.faces_per_corner)
    }

    /// The place of a face.
    pub fn place_of(&self, face: u32) -> Place {
        let (trunk, rings) = self.rings_of(face);
        let lengths = self.plan.layout.lengths(trunk);
        let [from, to] = rings.map(|ring| lengths[ring as usize]);
        let middle = self.points(face).iter().sum::<Vec3>() * 0.25 - self.plan.origin;
        let curve = &self.plan.curves[trunk as usize];
        let [a, b] = [from, to].map(|length| curve.at(length).center);
        let share = ((middle - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (trunk, if share.is_finite() { from + share * (to - from) } else { from })
    }

    /// Radius of the vessel at a place.
    pub fn radius_at(&self, (trunk, length): Place) -> f32 {
        self.plan.curves[trunk as usize].radius_at(length)
    }

    /// The node of a place.
    pub fn node_at(&self, (trunk, length): Place) -> NodeId {
        NodeId(self.plan.trunks.nodes(trunk as usize)[self.plan.curves[trunk as usize].place_at(length)])
    }

    /// Whether two places belong to one joint: the way along the vessels from one to the other is hardly longer than a
    /// length.
    pub fn are_local(&self, mut a: Place, mut b: Place, length: f32) -> bool {
        let layout = &self.plan.layout;
        let (mut way, mut widest) = (0.0f32, self.radius_at(a).max(self.radius_at(b)));
        while a.0 != b.0 {
            // A trunk comes after the one that it leaves.
            let upper = if a.0 > b.0 { &mut a } else { &mut b };
            let Some(mouth) = layout.mouth(upper.0) else { return false };
            way += (upper.1 - layout.lengths(upper.0)[0]).max(0.0);
            let lengths = layout.lengths(mouth.trunk);
            let [from, to] = mouth.rings.map(|ring| lengths[ring as usize]);
            *upper = (mouth.trunk, 0.5 * (from + to));
            widest = widest.max(self.radius_at(*upper));
        }
        way + (a.1 - b.1).abs() < length + LOCAL * widest
    }

    /// Faces near a ball on the trunks of some faces, and on those that leave them or that they leave, near the ball.
    pub fn near(&self, ball: &Ball, faces: &[u32]) -> Vec<u32> {
        let mut pending: Vec<u32> = faces.iter().map(|&face| self.rings_of(face).0).collect();
        pending.sort_unstable();
        pending.dedup();
        let mut seen = pending.clone();
        let mut near = Vec::new();
        while let Some(trunk) = pending.pop() {
            let belts = self.belts_near(trunk, ball);
            let mut visit = |trunk: u32| {
                if let Err(place) = seen.binary_search(&trunk) {
                    seen.insert(place, trunk);
                    pending.push(trunk);
                }
            };
            for &(_, lateral) in self.laterals_of(trunk) {
                if self.begins_near(lateral, ball, &belts) {
                    visit(lateral);
                }
            }
            if let Some(mouth) = self.plan.layout.mouth(trunk).filter(|_| !belts.is_empty()) {
                visit(mouth.trunk);
            }
            near.extend(belts.iter().flat_map(|&rings| self.faces_between(trunk, rings)));
        }
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Whether a lateral begins near a ball, given the near belts of the trunk that it leaves.
    fn begins_near(&self, lateral: u32, ball: &Ball, belts: &[[u32; 2]]) -> bool {
        let Some(mouth) = self.plan.layout.mouth(lateral) else { return false };
        if belts.iter().any(|&[low, high]| mouth.rings[0] <= high && low <= mouth.rings[1]) {
            return true;
        }
        // Its opening may lie beside its place.
        let base = self.plan.curves[lateral as usize].at(0.0).center + self.plan.origin;
        let length = self.plan.layout.lengths(mouth.trunk)[mouth.rings[0] as usize];
        ball.height(base) < NEAR * self.radius_at((mouth.trunk, length))
    }

    fn laterals_of(&self, trunk: u32) -> &[(u32, u32)] {
        let first = self.laterals.partition_point(|&(other, _)| other < trunk);
        let end = self.laterals.partition_point(|&(other, _)| other <= trunk);
        &self.laterals[first..end]
    }

    /// The belts of a trunk near a ball, each by the rings around it; neighbours are joined.
    fn belts_near(&self, trunk: u32, ball: &Ball) -> Vec<[u32; 2]> {
        let (lengths, curve) = (self.plan.layout.lengths(trunk), &self.plan.curves[trunk as usize]);
        let center = ball.center - self.plan.origin;
        let mut belts: Vec<[u32; 2]> = Vec::new();
        let mut below = curve.at(lengths[0]);
        for high in 0..lengths.len() as u32 {
            let above = curve.at(lengths[high as usize]);
            let radius = below.radius.max(above.radius);
            let cone =
                Cone { trunk, lengths: [0.0; 2], centers: [below.center, above.center], radii: [NEAR * radius; 2] };
            let low = high.saturating_sub(1);
            if cone.distance(center).0 < ball.radius {
                match belts.last_mut() {
                    Some(last) if last[1] >= low => last[1] = high,
                    _ => belts.push([low, high]),
                }
            }
            below = above;
        }
        belts
    }

    /// The tubes around which some faces lie.
    pub fn tubes(&self, faces: &[u32]) -> Vec<Cone> {
        let mut parts: BTreeMap<u32, [u32; 2]> = BTreeMap::new();
        for &face in faces {
            let (trunk, [low, high]) = self.rings_of(face);
            let part = parts.entry(trunk).or_insert([low, high]);
            *part = [part[0].min(low), part[1].max(high)];
        }
        let mut cones = Vec::new();
        for (trunk, [low, high]) in parts {
            let (lengths, curve) = (self.plan.layout.lengths(trunk), &self.plan.curves[trunk as usize]);
            // A lateral begins on the axis of the trunk that it leaves.
            let from = if low == 0 { 0.0 } else { lengths[low as usize] };
            let to = if high as usize + 1 == lengths.len() { curve.length() } else { lengths[high as usize] };
            tubes::add(&mut cones, trunk, curve, from..to.max(from));
        }
        cones
    }
}
