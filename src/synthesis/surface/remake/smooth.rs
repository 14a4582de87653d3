//! Smooths the crease of an outline, where two tubes meet: marching tetrahedra cut it into teeth.
//!
//! In: an outline and its tubes. Out: the same with its vertices moved: on a tube, away from others, back onto it; along a
//! crease, to the middle of their neighbours. Open edges stay.
//!
//! Source of the smoothing without shrinking: Taubin, "A signal processing approach to fair surface design" (1995).

use super::contour::Outline;
use super::tubes::Cone;
use crate::synthesis::surface::direction::unit;
use bevy_math::Vec3;

/// Length along a tube, in its radii, up to which it is the same part.
const SAME: f32 = 1.5;
/// Rounds of smoothing, and the shares of the way to the middle of the neighbours, there and back, in each.
const ROUNDS: usize = 6;
const THERE: f32 = 0.6;
const BACK: f32 = -0.63;
/// Distance within which another tube is near, in sizes of the tetrahedra.
const NEAR: f32 = 1.2;
/// Cosine of the angle between two tubes' surfaces from which on they make a crease: 35°.
const CREASED: f32 = 0.82;

/// Smooths an outline of tubes, made of tetrahedra of this size. Vertices that are fixed stay.
pub(super) fn smooth(outline: &mut Outline, cones: &[Cone], step: f32, is_fixed: &[bool]) {
    let neighbours = Neighbours::of(outline);
    let mut scratch = outline.positions.clone();
    for share in [THERE, BACK].into_iter().cycle().take(2 * ROUNDS) {
        for (vertex, moved) in scratch.iter_mut().enumerate().filter(|(vertex, _)| !is_fixed[*vertex]) {
            let here = outline.positions[vertex];
            *moved = here + share * (neighbours.middle(vertex, &outline.positions) - here);
        }
        std::mem::swap(&mut outline.positions, &mut scratch);
    }
    for (position, _) in outline.positions.iter_mut().zip(is_fixed).filter(|(_, is_fixed)| !**is_fixed) {
        *position = onto_tube(*position, cones, step).unwrap_or(*position);
    }
}

/// The nearest point on the nearest tube, unless another tube, or another part of its own, makes a crease with it here.
fn onto_tube(point: Vec3, cones: &[Cone], step: f32) -> Option<Vec3> {
    let away = |cone: &Cone| {
        let (distance, share) = cone.distance(point);
        (distance, point - cone.centers[0].lerp(cone.centers[1], share))
    };
    let nearest = cones.iter().min_by(|a, b| a.distance(point).0.total_cmp(&b.distance(point).0))?;
    let (least, out) = away(nearest);
    let out = unit(out)?;
    let goes_on = |other: &Cone| {
        let gap = (other.lengths[0] - nearest.lengths[1]).max(nearest.lengths[0] - other.lengths[1]);
        other.trunk == nearest.trunk && gap < SAME * nearest.radii[0]
    };
    let creases = |other: &Cone| {
        let (distance, its) = away(other);
        distance - least < NEAR * step && unit(its).is_none_or(|its| its.dot(out) < CREASED) && !goes_on(other)
    };
    (!cones.iter().any(creases)).then(|| point - out * least)
}

/// The vertices around each vertex.
struct Neighbours {
    starts: Vec<u32>,
    list: Vec<u32>,
}

impl Neighbours {
    fn of(outline: &Outline) -> Self {
        let mut edges: Vec<[u32; 2]> =
            outline.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]]).collect();
        edges.sort_unstable();
        edges.dedup();
        let count = outline.positions.len() as u32;
        let starts = (0..=count).map(|vertex| edges.partition_point(|edge| edge[0] < vertex) as u32).collect();
        Self { starts, list: edges.into_iter().map(|edge| edge[1]).collect() }
    }

    fn middle(&self, vertex: usize, positions: &[Vec3]) -> Vec3 {
        let around = &self.list[self.starts[vertex] as usize..self.starts[vertex + 1] as usize];
        let sum: Vec3 = around.iter().map(|&other| positions[other as usize]).sum();
        sum / around.len().max(1) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::{
        mesh::{Closure, self_intersections},
        surface::remake::{ball::Ball, contour::outline},
    };

    fn roughness(outline: &Outline) -> f32 {
        let neighbours = Neighbours::of(outline);
        let off = |vertex: usize| neighbours.middle(vertex, &outline.positions).distance(outline.positions[vertex]);
        (0..outline.positions.len()).map(off).fold(0.0, f32::max)
    }

    #[test]
    fn a_crease_loses_its_teeth_and_the_tubes_keep_their_width() {
        let tube =
            |trunk: u32, axis: Vec3| Cone { trunk, lengths: [0.0, 1.0], centers: [-axis, axis], radii: [0.3; 2] };
        // They cross at 30°.
        let cones = [tube(0, Vec3::X), tube(1, Vec3::new(0.866, 0.5, 0.0))];
        let (ball, step) = (Ball { center: Vec3::ZERO, radius: 2.0 }, 0.13);
        let rough = outline(&cones, &ball, step).unwrap();
        let mut smoothed = rough.clone();
        let mut is_fixed = vec![false; rough.positions.len()];
        is_fixed[0] = true;
        smooth(&mut smoothed, &cones, step, &is_fixed);
        assert_eq!(smoothed.positions[0], rough.positions[0]);
        assert!(roughness(&smoothed) < 0.6 * roughness(&rough), "{} {}", roughness(&smoothed), roughness(&rough));
        assert_eq!(Closure::of(&smoothed.positions, &smoothed.triangles).euler(), 2);
        assert!(self_intersections(&smoothed.positions, &smoothed.triangles).is_empty());
        let depth = |point: &Vec3| cones.iter().map(|cone| cone.distance(*point).0).fold(f32::INFINITY, f32::min);
        let mut off: Vec<f32> = smoothed.positions.iter().skip(1).map(|point| depth(point).abs()).collect();
        off.sort_by(f32::total_cmp);
        // Most lie on a tube; those of the crease fill it a little.
        assert!(off[off.len() / 2] < 1e-4 && off[off.len() - 1] < step, "{off:?}");
    }
}
