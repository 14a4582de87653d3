//! The levels of detail at which segments can be drawn, finest first.
//!
//! In: the settings of the plugin, as a [`Detail`]. Out: [`Level`]s, each with its shape, the goals of its vertices and
//! the size below which it is drawn.

use bevy::math::ops;
use std::f32::consts::PI;

/// The least number of slots in a mesh, for small vessel trees.
pub(super) const FEWEST_SLOTS: usize = 256;
/// The most slots in a mesh: few chunks for the CPU, with meshes small enough to be made in a frame.
const MOST_SLOTS: usize = 4096;
/// Most vertices in a mesh of the finest level, unless [`FEWEST_SLOTS`] very round segments need more.
const MOST_VERTICES: usize = 1 << 17;
/// Sides of the levels below the finest.
const COARSER_SIDES: [u32; 3] = [8, 5, 3];
/// Strides of the levels that leave slots out.
const STRIDES: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Share beyond its threshold at which a slot is gone: it gets thinner up to there. Also in `segments.wgsl`.
const FADE: f32 = 0.25;
/// How round a segment is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) sides: u32,
    pub(super) cap_rings: u32,
}

impl Shape {
    /// Vertices of one segment.
    pub(super) fn vertices(self) -> usize {
        (2 + self.sides * (2 + self.cap_rings)) as usize
    }

    /// The greatest distance between this cross-section's outline and a circle of radius 1.
    fn error(self) -> f32 {
        let reach = corner_reach(self.sides);
        (reach - 1.0).max(1.0 - reach * ops::cos(PI / self.sides as f32))
    }
}

/// One level of detail.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    pub(super) shape: Shape,
    /// The shapes to which the level's vertices slide, one after the other.
    pub(super) goals: Vec<Goal>,
    /// One of about this many slots is in the mesh.
    pub(super) stride: usize,
    /// Radius in pixels below which a chunk may be drawn at this level.
    pub(super) drawn_below: f32,
    /// Width in pixels below which segments drop out. 0: they don't.
    pub(super) least_width: f32,
}

/// A coarser shape that vertices slide to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Goal {
    pub(super) shape: Shape,
    /// Radius in pixels below which vertices have arrived; they set out at twice that. 0: they don't.
    pub(super) slid_below: f32,
}

impl Level {
    /// Whether a slot is in the mesh.
    pub(super) fn keeps(&self, slot: usize) -> bool {
        u64::from(threshold(slot)) * (self.stride as u64) < 1 << 32
    }

    /// The largest share of all segments that may be kept, so that no segment missing in the mesh should be drawn.
    pub(super) fn most_kept(&self) -> f32 {
        if self.stride == 1 { 1.0 } else { 1.0 / (self.stride as f32 * (1.0 + FADE)) }
    }
}

/// The share of kept segments below which a slot drops out, times 2³². `segments.wgsl` computes the same.
fn threshold(slot: usize) -> u32 {
    (slot as u32).wrapping_mul(0x9e37_79b9)
}

/// The checked settings of the plugin, which determine the levels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detail {
    /// The finest shape.
    pub(super) shape: Shape,
    /// See [`SegmentRenderPlugin::tolerance`](super::SegmentRenderPlugin::tolerance).
    pub(super) tolerance: f32,
    /// See [`SegmentRenderPlugin::least_width`](super::SegmentRenderPlugin::least_width).
    pub(super) least_width: f32,
}

impl Detail {
    /// All levels, from the finest.
    pub(super) fn levels(&self) -> Vec<Level> {
        let finest = self.shape;
        let coarser = COARSER_SIDES.into_iter().filter(|&sides| sides < finest.sides);
        let coarser = coarser.map(|sides| Shape { sides, cap_rings: finest.cap_rings.min(u32::from(sides >= 8)) });
        let shapes: Vec<Shape> = std::iter::once(finest).chain(coarser).collect();
        let level = |shape: Shape, stride, drawn_below| {
            let least_width = self.least_width;
            Level { shape, goals: Vec::new(), stride, drawn_below, least_width }
        };
        let mut levels: Vec<Level> =
            shapes.iter().map(|&shape| level(shape, 1, self.tolerance / shape.error())).collect();
        levels[0].drawn_below = f32::INFINITY;
        let last = shapes[shapes.len() - 1];
        levels.extend(STRIDES.map(|stride| level(last, stride, self.dropped_below(stride))));
        for finer in 0..levels.len() - 1 {
            levels[finer + 1].drawn_below = levels[finer + 1].drawn_below.min(levels[finer].drawn_below);
        }
        for finer in 0..shapes.len() {
            let coarser = &levels[finer + 1..shapes.len()];
            let goals = coarser.iter().map(|level| Goal { shape: level.shape, slid_below: level.drawn_below });
            levels[finer].goals = goals.collect();
        }
        levels
    }

    /// Radius in pixels below which all slots but one of `stride` have width zero.
    fn dropped_below(&self, stride: usize) -> f32 {
        0.5 * self.least_width / (stride as f32 * (1.0 + FADE))
    }

    /// Slots of a full chunk: a power of two.
    pub(super) fn slots(&self) -> usize {
        let most = (MOST_VERTICES / self.shape.vertices()).clamp(FEWEST_SLOTS, MOST_SLOTS);
        1 << most.ilog2()
    }
}

/// Distance of a regular polygon's corners from its centre, for a mean width of 2.
///
/// The mean width of a convex figure is its perimeter over π (Cauchy).
pub(super) fn corner_reach(sides: u32) -> f32 {
    let half_turn = PI / sides as f32;
    half_turn / ops::sin(half_turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DETAIL: Detail = Detail { shape: Shape { sides: 8, cap_rings: 1 }, tolerance: 0.25, least_width: 1.0 };

    #[test]
    fn levels_get_coarser_one_by_one() {
        for shape in [(3, 0), (4, 0), (8, 1), (64, 16)].map(|(sides, cap_rings)| Shape { sides, cap_rings }) {
            let levels = Detail { shape, ..DETAIL }.levels();
            assert_eq!((levels[0].shape, levels[0].drawn_below), (shape, f32::INFINITY));
            for pair in levels.windows(2) {
                assert!(pair[0].drawn_below > pair[1].drawn_below, "{pair:?}");
                if pair[0].shape != pair[1].shape {
                    assert_eq!(pair[0].goals[0], Goal { shape: pair[1].shape, slid_below: pair[1].drawn_below });
                    assert_eq!(pair[0].goals[1..], pair[1].goals, "from there on they go together");
                }
                // vertices set out at twice the size at which they arrive, and not before they reached the previous
                // goal
                assert!(pair[0].goals.windows(2).all(|goals| 2.0 * goals[1].slid_below <= goals[0].slid_below));
                let [fine, coarse] = [0, 1].map(|i| pair[i].shape.vertices() * 1000 / pair[i].stride);
                assert!(coarse < fine, "{pair:?}");
            }
        }
    }

    #[test]
    fn outlines_differ_from_circles_by_the_tolerance_at_most() {
        for level in DETAIL.levels().iter().skip(1).filter(|level| level.stride == 1) {
            let corner = corner_reach(level.shape.sides);
            let edge = corner * ops::cos(PI / level.shape.sides as f32);
            for distance in [corner, edge] {
                assert!((distance - 1.0).abs() * level.drawn_below <= DETAIL.tolerance * 1.001);
            }
        }
    }

    #[test]
    fn full_chunks_have_room_for_a_power_of_two() {
        assert_eq!(DETAIL.slots(), 4096);
        let round = Detail { shape: Shape { sides: 64, cap_rings: 16 }, ..DETAIL };
        assert_eq!(round.slots(), FEWEST_SLOTS);
        let rounder = Detail { shape: Shape { sides: 16, cap_rings: 1 }, ..DETAIL };
        assert_eq!(rounder.slots(), 2048);
    }

    #[test]
    fn what_is_kept_is_spread_evenly() {
        for level in DETAIL.levels() {
            for (first, step) in [(0, 1), (1, 2), (100, 3)] {
                let slots = 1024;
                let kept = (0..slots).filter(|slot| level.keeps(first + step * slot)).count();
                let expected = slots / level.stride;
                assert!(kept.abs_diff(expected) <= 4 + expected / 8, "{kept} of {slots}, not {expected}");
            }
        }
    }
}
