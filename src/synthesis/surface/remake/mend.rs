//! Mends one knot: finds a ball around it in which the outline of the tubes can take the place of the faces.

use super::ball::Ball;
use super::contour::{self, Outline};
use super::graft::Graft;
use super::knots::Knot;
use super::patch::{Rim, belt, within};
use super::site::Site;
use super::smooth::smooth;
use crate::synthesis::mesh::self_intersections;
use bevy_math::Vec3;
use std::collections::BTreeMap;

/// Room around the faces of a knot, in radii of its thinnest tube.
const ROOM: f32 = 0.5;
/// Balls that are tried, each so many times as wide as the one before.
const TRIES: usize = 9;
const WIDER: f32 = 1.35;
/// The most faces that a patch replaces: more are a thicket, in which vessels run through each other.
pub(super) const MOST_FACES: usize = 1024;
/// Tries that share a list of near faces.
const SHARED: usize = 2;
/// The size of a patch's tetrahedra, in radii of its thinnest tube.
const CELL: f32 = 0.45;
/// The same at most: of a thinner tube, tetrahedra of this size might miss parts.
const COARSEST: f32 = 0.75;
/// The most steps of a lattice along one axis.
const MOST_STEPS: f32 = 56.0;
/// Room between a patch and the faces that stay, in sizes of its tetrahedra.
const GAP: f32 = 0.6;

/// What came of a try.
pub(super) enum Outcome {
    Mended(Graft),
    /// It needs faces that another knot has taken.
    Meets(u32),
    /// The tubes of the joint run through each other.
    Left,
}

impl Site<'_> {
    /// Mends a knot, without the faces that others have taken.
    pub fn mend(&self, knot: &Knot, is_taken: impl Fn(u32) -> bool) -> Outcome {
        let core = Ball::around(knot.faces.iter().flat_map(|&face| self.points(face)));
        let thinnest = knot.faces.iter().map(|&face| self.radius_at(self.place_of(face))).fold(f32::INFINITY, f32::min);
        let mut ball = Ball { radius: core.radius + ROOM * thinnest, ..core };
        let mut near = Vec::new();
        for number in 0..TRIES {
            if number % SHARED == 0 {
                near = self.near(&ball.scaled(WIDER.powi(SHARED as i32 - 1)), &knot.faces);
            }
            let within = self.reached(&ball, &near, &knot.faces);
            if let Some(&face) = within.iter().find(|&&face| is_taken(face)) {
                return Outcome::Meets(face);
            }
            if within.len() > MOST_FACES {
                break;
            }
            if let Some(graft) = self.graft(&ball, &near, within) {
                return Outcome::Mended(graft);
            }
            ball = ball.scaled(WIDER);
        }
        Outcome::Left
    }

    /// The faces of one joint that reach into a ball, and some that are its.
    fn reached(&self, ball: &Ball, near: &[u32], own: &[u32]) -> Vec<u32> {
        let middle = self.place_of(own[own.len() / 2]);
        let reaches = |face: u32| {
            let [a, b, c, d] = self.points(face);
            ball.meets([a, b, c]) || ball.meets([a, c, d])
        };
        // One answer for all faces of a belt.
        let mut is_local: BTreeMap<(u32, u32), bool> = BTreeMap::new();
        let mut reached: Vec<u32> = near.iter().copied().filter(|&face| reaches(face)).collect();
        reached.retain(|&face| {
            let (trunk, [low, high]) = self.rings_of(face);
            let lengths = self.plan.layout.lengths(trunk);
            let length = lengths[low as usize].midpoint(lengths[high as usize]);
            *is_local.entry((trunk, low)).or_insert_with(|| self.are_local((trunk, length), middle, 2.0 * ball.radius))
        });
        reached.extend(own);
        reached.sort_unstable();
        reached.dedup();
        reached
    }

    /// The outline of the tubes in place of the faces within a ball; `None` if it doesn't fit or meets itself.
    fn graft(&self, ball: &Ball, near: &[u32], faces: Vec<u32>) -> Option<Graft> {
        let corners: Vec<[u32; 4]> = faces.iter().map(|&face| self.corners(face)).collect();
        let rim = Rim::of(corners.iter().map(|face| &face[..]))?;
        let cones = self.tubes(&faces);
        let local = Ball { center: ball.center - self.plan.origin, ..*ball };
        let in_reach = cones.iter().filter(|cone| cone.distance(local.center).0 < local.radius);
        let thinnest = in_reach.flat_map(|cone| cone.radii).fold(f32::INFINITY, f32::min);
        // As fine as the lattice's memory allows.
        let step = (CELL * thinnest).max(2.0 * ball.radius / MOST_STEPS);
        if step > COARSEST * thinnest {
            return None;
        }
        let inner = Ball { radius: ball.radius - GAP * step, ..local };
        if !(inner.radius > step) {
            return None;
        }
        let patch = within(contour::outline(&cones, &inner, step)?, &inner);
        let patch_rim = Rim::of(patch.triangles.iter().map(|triangle| &triangle[..]))?;
        // New vertices are numbered from the mesh's own on.
        let first = self.mesh.unique() as u32;
        let patch_rim = patch_rim.numbered_from(first);
        let place = |outline: &Outline| -> Vec<Vec3> {
            outline.positions.iter().map(|&position| position + self.plan.origin).collect()
        };
        let mut positions = place(&patch);
        let position = |positions: &[Vec3], vertex: u32| match vertex.checked_sub(first) {
            None => self.mesh.positions[vertex as usize],
            Some(new) => positions[new as usize],
        };
        let numbers = rim.matched(&patch_rim, |vertex| position(&positions, vertex))?;
        let mut triangles: Vec<[u32; 3]> =
            patch.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)).collect();
        for (outer, &inner) in rim.loops.iter().zip(&numbers) {
            belt([outer, &patch_rim.loops[inner]], |vertex| position(&positions, vertex), &mut triangles);
        }
        // With the faces that stay around it.
        let mut all = triangles.clone();
        let mut edge: Vec<u32> = rim.loops.iter().flatten().copied().collect();
        edge.sort_unstable();
        let stays = |face: &u32| faces.binary_search(face).is_err();
        let is_beside = |face: &u32| self.corners(*face).iter().any(|vertex| edge.binary_search(vertex).is_ok());
        all.extend(near.iter().filter(|face| stays(face) && is_beside(face)).flat_map(|&face| self.triangles(face)));
        if any_meet(&all, |vertex| position(&positions, vertex)) {
            return None;
        }
        let mut is_fixed = vec![false; patch.positions.len()];
        patch_rim.loops.iter().flatten().for_each(|&vertex| is_fixed[(vertex - first) as usize] = true);
        let mut smoothed = patch;
        smooth(&mut smoothed, &cones, step, &is_fixed);
        let smoothed = place(&smoothed);
        // In a narrow crease, smoothing may push one side through the other.
        if !any_meet(&all, |vertex| position(&smoothed, vertex)) {
            positions = smoothed;
        }
        Some(Graft { faces, positions, triangles, cones })
    }
}

/// Whether any of some triangles meet.
fn any_meet(triangles: &[[u32; 3]], position: impl Fn(u32) -> Vec3) -> bool {
    let mut vertices: Vec<u32> = triangles.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let number = |vertex: u32| vertices.partition_point(|&other| other < vertex) as u32;
    let numbered: Vec<[u32; 3]> = triangles.iter().map(|triangle| triangle.map(number)).collect();
    let positions: Vec<Vec3> = vertices.iter().map(|&vertex| position(vertex)).collect();
    !self_intersections(&positions, &numbered).is_empty()
}
