//! The hilum of an organ: the floor of its deepest hollow, where its vessels enter.
//!
//! A convex organ has no hollow: between any two of its points there is only organ. Between points of a bean, the way
//! leads past its hollow side. So many midpoints of pairs of samples are looked at, and of those outside, the one furthest
//! from the tissue lies in the mouth of the deepest hollow. The tissue nearest to the middle of the outer midpoints around
//! it is the floor.

use crate::synthesis::{random::Stream, tissue::Tissue};
use bevy_math::Vec3;
use rand::RngExt;

/// Pairs of samples whose midpoints are looked at.
const PAIRS: u32 = 8192;
/// Rounds in which the middle of a hollow is drawn to where its points are densest (mean shift, Fukunaga & Hostetler
/// 1975).
const ROUNDS: u32 = 8;
/// Least depth of a hollow, in equivalent diameters of the tissue: what is less is the roughness of a mesh, or its
/// voxels.
const LEAST_DEPTH: f32 = 0.02;

/// The floor of the deepest hollow; `None` if there is none. `diameter` is the tissue's equivalent one.
pub(super) fn hilum(tissue: &dyn Tissue, samples: &[Vec3], diameter: f32) -> Option<Vec3> {
    if samples.is_empty() {
        return None;
    }
    let mut rng = Stream::Tissue.rng(1);
    let mut outer: Vec<(Vec3, f32)> = Vec::new();
    for _ in 0..PAIRS {
        let [a, b] = [(); 2].map(|()| samples[rng.random_range(0..samples.len())]);
        let middle = a.midpoint(b);
        let closest = tissue.closest_point(middle);
        let way = middle - closest.position;
        // A surface does not contain what it encloses, but its normal faces away from that.
        if way.dot(closest.normal) >= 0.0 && way.length() > LEAST_DEPTH * diameter {
            outer.push((middle, way.length()));
        }
    }
    let &(mouth, depth) = outer.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut middle = mouth;
    for _ in 0..ROUNDS {
        let around = outer.iter().filter(|(point, _)| point.distance(middle) < 2.0 * depth);
        let add = |(sum, weights): (Vec3, f32), &(point, depth): &(Vec3, f32)| (sum + depth * point, weights + depth);
        let (sum, weights) = around.fold((Vec3::ZERO, 0.0), add);
        if weights > 0.0 {
            middle = sum / weights;
        }
    }
    Some(tissue.closest_point(middle).position)
}
