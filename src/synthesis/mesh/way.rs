//! Straight ways over the triangles of a mesh.
//!
//! In: a place on a triangle, a direction and a length. Out: the end of the way, and the places before it at which it
//! bends. Within a triangle a way is straight; across an edge it keeps its angle to the edge, as if both triangles lay
//! in one plane (Polthier & Schmies, "Straightest Geodesics on Polyhedral Surfaces", 1998). So it gets round edges of any
//! sharpness, and its length is that along the surface.

use super::{
    MeshTopology, TriangleIndex, TriangleMesh, doubled_normal,
    neighbours::{Across, inward},
};
use crate::synthesis::pace::Pace;
use bevy_math::{DVec3, Vec3};

/// Most edges that a way crosses: more than on any mesh, unless rounding sends it round a vertex for ever.
const MOST_CROSSINGS: usize = 1 << 14;
/// Crossings kept to decide where a way bends. If there are more, every other one speaks for its neighbour.
const CROSSINGS: usize = 32;
/// Widest gap in the surface that a way crosses, as a share of its length.
const GAP: f64 = 0.125;
/// Directions in which the surface may go on beyond a gap: cosine and sine of the turn, the straightest first.
const TURNS: [[f64; 2]; 7] = {
    const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [[1.0, 0.0], [HALF, -HALF], [HALF, HALF], [0.0, -1.0], [0.0, 1.0], [-HALF, -HALF], [-HALF, HALF]]
};

/// What lies across the sides of each triangle of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct Neighbours(Vec<[Option<Across>; 3]>);

impl Neighbours {
    pub async fn new_paced(mesh: &TriangleMesh, topology: &MeshTopology, pace: &Pace) -> Self {
        Self(topology.neighbours(mesh, pace).await)
    }
}

/// The start of a way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    /// A place on a triangle.
    pub position: Vec3,
    /// Its number.
    pub triangle: u32,
    /// Of any length; its part along the triangle counts.
    pub direction: Vec3,
}

/// A place on a way.
#[derive(Clone, Copy, Debug)]
struct Footing {
    position: DVec3,
    triangle: u32,
    /// Unit vector along the triangle.
    heading: DVec3,
    /// The side through which the triangle was entered.
    entered: Option<usize>,
}

/// Goes a `length` over the surface, and calls `arrive` for each place where the way bends, then for its end, with the
/// number of the triangle on which one arrives there.
///
/// A straight line between two of these places is nowhere further than `tolerance` from the way. The way ends early at
/// the border of the surface, unless it goes on within a small part of the way. Without a direction along the triangle,
/// there is no way.
pub(crate) fn go(
    (mesh, index, neighbours): (&TriangleMesh, &TriangleIndex, &Neighbours),
    start: Start,
    length: f32,
    tolerance: f32,
    mut arrive: impl FnMut(Vec3, u32),
) {
    let triangle = start.triangle;
    let Some(heading) = along(mesh, triangle, start.direction.as_dvec3()) else { return };
    let mut at = Footing { position: start.position.as_dvec3(), triangle, heading, entered: None };
    let mut bends = Bends::new(at.position, tolerance.into());
    let mut left = f64::from(length);
    for _ in 0..MOST_CROSSINGS {
        let Some((side, distance)) = exit(mesh, &at).filter(|&(_, distance)| distance < left) else {
            at.position += at.heading * left;
            break;
        };
        at.position += at.heading * distance;
        left -= distance;
        bends.cross(at.position, at.triangle, &mut arrive);
        let gap = GAP * f64::from(length);
        let next = match neighbours.0[at.triangle as usize][side] {
            Some(across) => Some(cross(mesh, &at, side, across)),
            None => hop(mesh, index, &at, side, gap).filter(|next| next.position.distance(at.position) < left),
        };
        let Some(next) = next else { break };
        left -= next.position.distance(at.position);
        at = next;
    }
    bends.cross(at.position, at.triangle, &mut arrive);
    arrive(at.position.as_vec3(), at.triangle);
}

/// The part of a direction along a triangle, at unit length.
fn along(mesh: &TriangleMesh, triangle: u32, direction: DVec3) -> Option<DVec3> {
    let normal = doubled_normal(mesh.corners(triangle as usize)).normalize_or_zero();
    let flat = direction - normal * direction.dot(normal);
    // What is left of a direction along the normal is rounding.
    (flat.length_squared() > 1.0e-10 * direction.length_squared()).then(|| flat.normalize())
}

/// The side through which a way leaves a triangle, and the distance to it.
fn exit(mesh: &TriangleMesh, at: &Footing) -> Option<(usize, f64)> {
    let corners = mesh.corners(at.triangle as usize);
    let mut nearest: Option<(usize, f64)> = None;
    for side in (0..3).filter(|&side| at.entered != Some(side)) {
        let inward = inward(corners, side);
        let speed = -at.heading.dot(inward);
        if speed > 0.0 {
            let distance = ((at.position - corners[side].as_dvec3()).dot(inward) / speed).max(0.0);
            if nearest.is_none_or(|(_, least)| distance < least) {
                nearest = Some((side, distance));
            }
        }
    }
    nearest
}

/// The same place on the next triangle, with the same angle to the common edge.
fn cross(mesh: &TriangleMesh, at: &Footing, side: usize, across: Across) -> Footing {
    let outward = -inward(mesh.corners(at.triangle as usize), side);
    let onward = inward(mesh.corners(across.triangle() as usize), across.side());
    let speed = at.heading.dot(outward);
    let heading = (at.heading - outward * speed + onward * speed).normalize_or(at.heading);
    Footing { heading, triangle: across.triangle(), entered: Some(across.side()), ..*at }
}

/// The place where the surface goes on beyond a gap: a crack, or an edge whose triangles don't have the same corners.
fn hop(mesh: &TriangleMesh, index: &TriangleIndex, at: &Footing, side: usize, gap: f64) -> Option<Footing> {
    let corners = mesh.corners(at.triangle as usize);
    let (outward, up) = (-inward(corners, side), doubled_normal(corners).normalize_or_zero());
    let speed = at.heading.dot(outward);
    TURNS.iter().find_map(|&[cos, sin]| {
        let direction = at.heading - outward * speed + (outward * cos + up * sin) * speed;
        let probe = (at.position + direction * gap).as_vec3();
        let found = index.closest_within(probe, 0.5 * gap as f32)?;
        let triangle = found.triangle as u32;
        let heading = along(mesh, triangle, direction).filter(|_| triangle != at.triangle)?;
        Some(Footing { position: found.position.as_dvec3(), triangle, heading, entered: None })
    })
}

/// Decides where a way must bend so that straight lines stay near it.
struct Bends {
    /// The last bend, or the start.
    anchor: DVec3,
    tolerance: f64,
    /// Crossings since then, with the triangles before them.
    crossings: [(DVec3, u32); CROSSINGS],
    count: usize,
}

impl Bends {
    fn new(anchor: DVec3, tolerance: f64) -> Self {
        Self { anchor, tolerance, crossings: [(DVec3::ZERO, 0); CROSSINGS], count: 0 }
    }

    /// Bends the way at the crossings that a straight line to `position` would miss, the farthest first.
    fn cross(&mut self, position: DVec3, triangle: u32, arrive: &mut impl FnMut(Vec3, u32)) {
        while let Some(bend) = self.farthest_from_line_to(position) {
            let (anchor, before) = self.crossings[bend];
            arrive(anchor.as_vec3(), before);
            self.anchor = anchor;
            self.crossings.copy_within(bend + 1..self.count, 0);
            self.count -= bend + 1;
        }
        if self.count == CROSSINGS {
            for place in 0..CROSSINGS / 2 {
                self.crossings[place] = self.crossings[2 * place + 1];
            }
            self.count = CROSSINGS / 2;
        }
        self.crossings[self.count] = (position, triangle);
        self.count += 1;
    }

    /// The crossing farthest from the line to `position`, if it is beyond the tolerance.
    fn farthest_from_line_to(&self, position: DVec3) -> Option<usize> {
        let line = position - self.anchor;
        let (mut farthest, mut most) = (None, self.tolerance * self.tolerance);
        for (place, (crossing, _)) in self.crossings[..self.count].iter().enumerate() {
            let offset = *crossing - self.anchor;
            let share = offset.dot(line) / line.length_squared();
            let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
            let distance = (offset - line * share).length_squared();
            if distance > most {
                (farthest, most) = (Some(place), distance);
            }
        }
        farthest
    }
}
