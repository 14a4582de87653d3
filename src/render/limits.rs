//! The number of segments that a graphics device can draw.

use super::levels::FEWEST_SLOTS;
use crate::synthesis::instances::SegmentInstance;
use bevy::{
    prelude::*,
    render::render_resource::{DownlevelFlags, WgpuLimits},
};

/// Limits of the GPU. The resource exists only if segments are drawn.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource, Clone, Debug)]
pub struct SegmentLimits {
    max_segments: usize,
    segments_per_chunk: usize,
}

impl SegmentLimits {
    /// `None` if the vertex stage can't read storage buffers, or compute shaders can't write them.
    pub(super) fn new(limits: &WgpuLimits, flags: DownlevelFlags, segments_per_chunk: usize) -> Option<Self> {
        let needed = DownlevelFlags::VERTEX_STORAGE | DownlevelFlags::COMPUTE_SHADERS;
        if !flags.contains(needed) || limits.max_storage_buffers_per_shader_stage == 0 {
            return None;
        }
        let bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        // mesh tags and node indices are 32-bit
        let segments = (bytes / SegmentInstance::SIZE as u64).min(1 << 31) as usize;
        let max_segments = segments - segments % segments_per_chunk;
        (max_segments >= FEWEST_SLOTS).then_some(Self { max_segments, segments_per_chunk })
    }

    /// Most segments of one vessel entity that can be drawn: as many as fit in a storage buffer.
    pub fn max_segments(&self) -> usize {
        self.max_segments
    }

    /// Most segments that one chunk entity draws: fewer if their template is very round.
    pub fn segments_per_chunk(&self) -> usize {
        self.segments_per_chunk
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHUNK: usize = 4096;

    #[test]
    fn limits_are_whole_chunks_that_fit_in_a_buffer() {
        let device = WgpuLimits { max_storage_buffer_binding_size: 1 << 20, max_buffer_size: 1 << 30, ..default() };
        let limits = SegmentLimits::new(&device, DownlevelFlags::all(), CHUNK).unwrap();
        assert_eq!(limits.max_segments() % CHUNK, 0);
        let bytes = limits.max_segments() * SegmentInstance::SIZE;
        assert!(bytes <= 1 << 20 && bytes > (1 << 20) - CHUNK * SegmentInstance::SIZE);
    }

    #[test]
    fn devices_that_lack_something_draw_nothing() {
        for lacking in [DownlevelFlags::VERTEX_STORAGE, DownlevelFlags::COMPUTE_SHADERS] {
            assert!(SegmentLimits::new(&WgpuLimits::default(), DownlevelFlags::all() - lacking, CHUNK).is_none());
        }
        let none = WgpuLimits::downlevel_webgl2_defaults();
        assert!(SegmentLimits::new(&none, DownlevelFlags::all(), CHUNK).is_none());
    }
}
