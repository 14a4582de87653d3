//! A chunk: a run of slots that one entity draws.

use crate::synthesis::instances::SegmentInstance;
use bevy::{
    math::bounding::{Aabb3d, BoundingVolume},
    prelude::*,
};

/// An entity that draws one chunk of segments. Read-only: its mesh follows its size in the picture.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component, Clone, Debug)]
pub struct SegmentChunk {
    /// Radius of the thickest segment, in the local space of the vessel entity.
    pub(super) thickest: f32,
    /// Slots that its mesh must have.
    pub(super) slots: usize,
    /// Its level of detail.
    pub(super) level: usize,
    /// Level and slots of its present mesh.
    pub(super) drawn: (usize, usize),
}

impl SegmentChunk {
    /// Level of detail, 0 for the finest. Each further one has fewer corners, or fewer segments.
    pub fn level(&self) -> usize {
        self.level
    }
}

/// The extent of a chunk's segments: gives its box and thickness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ChunkContents {
    pub(super) bounds: Option<Aabb3d>,
    pub(super) thickest: f32,
}

impl ChunkContents {
    /// Adds segments. While vessels grow, their old shapes lie within the new ones.
    pub(super) fn add<'a>(&mut self, segments: impl IntoIterator<Item = &'a SegmentInstance>) {
        for segment in segments.into_iter().filter(|segment| segment.is_visible()) {
            let own = segment.bounds();
            self.bounds = Some(self.bounds.map_or(own, |all| all.merge(&own)));
            self.thickest = segment.radii().into_iter().fold(self.thickest, f32::max);
        }
    }
}
