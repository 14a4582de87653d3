//! Segments in the form that a renderer needs: one record of 48 bytes per node.
//!
//! In: a [`VesselTree`], the step in which each node was born and a [`SegmentColors`]. Out: [`SegmentInstance`]s, slot `i`
//! for node `i`, that is, for the segment from its parent to it. A root has no segment, so its slot is
//! [`SegmentInstance::HIDDEN`] and draws nothing. Slots share the nodes' indices, so a growth step rewrites exactly the
//! ranges of nodes that it touched.
//!
//! For cut vessels, [`write_stumps`] writes the remaining pieces, with [`FlatEnds`] beside the gaps.

use crate::synthesis::{
    segment_index::start_radius,
    tree::{NO_PARENT, VesselTree},
};
use bevy_math::{Vec3A, bounding::Aabb3d};
use std::ops::Range;

mod colors;
mod flat_ends;
mod stumps;

pub use crate::synthesis::segment_index::MAX_FLARE;
pub use colors::{SegmentColors, ramp_color};
pub use flat_ends::FlatEnds;
pub use stumps::{write_stumps, write_stumps_of};

/// Length of the round end of a segment beyond its end, in radii. The shader has the same three numbers.
pub(crate) const END_DOME: f32 = 1.0;
/// The same beyond its start, where the dome is shallow.
pub(crate) const START_DOME: f32 = 0.4;
/// Visible depth of the lumen of an open end, in radii.
pub(crate) const LUMEN_DEPTH: f32 = 1.2;

/// One vessel segment: a cone with round ends, in tissue lengths.
///
/// An end at which the vessel was cut is open: flat, with a view into the lumen. Its radius is stored as a negative
/// number. The same holds for an end inside a vessel that was cut nearby, if a round end would be visible in the gap.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SegmentInstance {
    /// Centre of the end towards the root.
    pub start: [f32; 3],
    /// Radius at `start`, negative if that is [open](Self::is_open).
    pub start_radius: f32,
    /// Centre of the end towards the tips.
    pub end: [f32; 3],
    /// Radius at `end`, negative if that is open.
    pub end_radius: f32,
    /// Linear sRGB.
    pub color: [f32; 3],
    /// Growth step in which the segment was born.
    pub birth: f32,
}

impl SegmentInstance {
    /// The slot of a root, or of no node: draws nothing.
    pub const HIDDEN: Self =
        Self { start: [0.0; 3], start_radius: 0.0, end: [0.0; 3], end_radius: 0.0, color: [0.0; 3], birth: 0.0 };

    /// Bytes of one record.
    pub const SIZE: usize = size_of::<Self>();

    /// Whether the segment has a length and a thickness.
    pub fn is_visible(&self) -> bool {
        self.start != self.end && self.radii() != [0.0; 2]
    }

    /// Radii at `start` and `end`, not negative.
    pub fn radii(&self) -> [f32; 2] {
        [self.start_radius.abs(), self.end_radius.abs()]
    }

    /// Whether the vessel is open at `start` and at `end`, with a view into its lumen.
    pub fn is_open(&self) -> [bool; 2] {
        [self.start_radius < 0.0, self.end_radius < 0.0]
    }

    /// The box around the segment, its round ends included.
    pub fn bounds(&self) -> Aabb3d {
        let (start, end) = (Vec3A::from(self.start), Vec3A::from(self.end));
        let [start_radius, end_radius] = self.radii();
        Aabb3d { min: (start - start_radius).min(end - end_radius), max: (start + start_radius).max(end + end_radius) }
    }
}

/// Writes the segments of the nodes in `range` to `out`, and returns the box around the visible ones.
///
/// `birth_steps` has the step of each node; a node past its end counts as born in step 0. Slots of `out` beyond the
/// range are hidden, so a caller that passes whole chunks need not clear them. Returns `None` if nothing is visible.
///
/// # Panics
/// If the range leaves the tree or is longer than `out`.
pub fn write_segments(
    tree: &VesselTree,
    birth_steps: &[u32],
    range: Range<usize>,
    colors: &SegmentColors,
    out: &mut [SegmentInstance],
) -> Option<Aabb3d> {
    let (used, rest) = out.split_at_mut(range.len());
    rest.fill(SegmentInstance::HIDDEN);
    let mut bounds: Option<Aabb3d> = None;
    for (slot, node) in used.iter_mut().zip(range) {
        let birth = birth_steps.get(node).copied().unwrap_or(0);
        *slot = segment_instance(tree, node, birth, colors);
        if slot.is_visible() {
            let own = slot.bounds();
            bounds = Some(bounds.map_or(own, |all| Aabb3d { min: all.min.min(own.min), max: all.max.max(own.max) }));
        }
    }
    bounds
}

/// The box around the visible segments of the nodes in `range`, `None` if there is none.
///
/// # Panics
/// If the range leaves the tree.
pub fn segment_bounds(tree: &VesselTree, range: Range<usize>) -> Option<Aabb3d> {
    let colors = SegmentColors::Uniform([0.0; 3]);
    range
        .map(|node| segment_instance(tree, node, 0, &colors))
        .filter(SegmentInstance::is_visible)
        .map(|segment| segment.bounds())
        .reduce(|a, b| Aabb3d { min: a.min.min(b.min), max: a.max.max(b.max) })
}

/// The record of one node.
pub(crate) fn segment_instance(tree: &VesselTree, node: usize, birth: u32, colors: &SegmentColors) -> SegmentInstance {
    let parent = tree.parents()[node];
    if parent == NO_PARENT {
        return SegmentInstance::HIDDEN;
    }
    let parent = parent as usize;
    let radius = tree.radii()[node];
    SegmentInstance {
        start: tree.positions()[parent].to_array(),
        start_radius: start_radius(tree, node),
        end: tree.positions()[node].to_array(),
        end_radius: radius,
        color: colors.color(radius, birth, node),
        birth: birth as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_math::Vec3;

    const WHITE: SegmentColors = SegmentColors::Uniform([1.0, 1.0, 1.0]);

    /// A trunk of two segments, a daughter nearly as thick and a thin side branch.
    fn tree() -> VesselTree {
        let positions =
            [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, Vec3::new(3.0, 1.0, 0.0), Vec3::new(2.0, -1.0, 0.5)].to_vec();
        let parents = vec![NO_PARENT, 0, 1, 2, 2];
        VesselTree::from_arrays(positions, parents, vec![0.4, 0.4, 0.4, 0.35, 0.1]).unwrap()
    }

    #[test]
    fn record_has_the_layout_the_shader_reads() {
        assert_eq!(SegmentInstance::SIZE, 48);
        let floats: [f32; 12] = bytemuck::cast(SegmentInstance {
            start: [1.0, 2.0, 3.0],
            start_radius: 4.0,
            end: [5.0, 6.0, 7.0],
            end_radius: 8.0,
            color: [9.0, 10.0, 11.0],
            birth: 12.0,
        });
        assert_eq!(floats, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0]);
        assert_eq!(SegmentInstance::HIDDEN, bytemuck::Zeroable::zeroed());
    }

    #[test]
    fn open_ends_are_as_wide_as_closed_ones() {
        let closed =
            SegmentInstance { start_radius: 0.5, end: [2.0, 0.0, 0.0], end_radius: 0.25, ..Default::default() };
        let open = SegmentInstance { start_radius: -0.5, end_radius: -0.25, ..closed };
        assert_eq!((open.bounds(), open.radii(), open.is_visible()), (closed.bounds(), [0.5, 0.25], true));
        assert_eq!((closed.is_open(), open.is_open()), ([false; 2], [true; 2]));
        assert!(!SegmentInstance { start_radius: -0.0, end_radius: -0.0, ..closed }.is_visible());
    }

    #[test]
    fn slots_share_node_indices_and_roots_are_hidden() {
        let tree = tree();
        let mut out = [SegmentInstance::HIDDEN; 8];
        out[6].start_radius = 7.0;
        write_segments(&tree, &[0, 1, 2, 3, 4], 0..5, &WHITE, &mut out);
        assert_eq!(out[0], SegmentInstance::HIDDEN);
        assert_eq!((out[3].start, out[3].end), ([2.0, 0.0, 0.0], [3.0, 1.0, 0.0]));
        assert_eq!((out[4].end_radius, out[4].birth), (0.1, 4.0));
        assert!(out[5..].iter().all(|slot| *slot == SegmentInstance::HIDDEN), "the rest of a chunk is cleared");
        assert!(out[1..5].iter().all(SegmentInstance::is_visible) && !out[0].is_visible());
    }

    #[test]
    fn partial_range_equals_the_same_part_of_the_whole() {
        let tree = tree();
        let mut whole = [SegmentInstance::HIDDEN; 5];
        let mut part = [SegmentInstance::HIDDEN; 2];
        write_segments(&tree, &[], 0..5, &WHITE, &mut whole);
        let bounds = write_segments(&tree, &[], 2..4, &WHITE, &mut part);
        assert_eq!(part, whole[2..4]);
        assert_eq!(bounds, segment_bounds(&tree, 2..4));
    }

    #[test]
    fn vessels_taper_and_side_branches_do_not_become_thorns() {
        let tree = tree();
        let mut out = [SegmentInstance::HIDDEN; 5];
        write_segments(&tree, &[], 0..5, &WHITE, &mut out);
        assert_eq!(out[3].start_radius, 0.4, "the main daughter begins as wide as its parent ends");
        assert_eq!(out[4].start_radius, MAX_FLARE * 0.1);
        for (node, parent) in tree.segments() {
            assert!(out[node].start_radius <= tree.radii()[parent], "hidden in the parent's round end: no gap, no rim");
        }
    }

    #[test]
    fn bounds_hold_every_segment_with_its_radius() {
        let tree = tree();
        let bounds = segment_bounds(&tree, 0..5).unwrap();
        assert_eq!(bounds.min, Vec3A::new(-0.4, -1.1, -0.4));
        assert_eq!(bounds.max, Vec3A::new(3.35, 1.35, 0.6));
        assert_eq!(segment_bounds(&tree, 0..1), None, "a root alone has no extent");
        assert_eq!(segment_bounds(&tree, 0..0), None);
    }
}
