//! The way of segments from the main world into their buffer on the GPU.
//!
//! A change of the tree queues the chunks that it touched as [`SegmentWrite`]s. Extraction moves the queue, not the bytes,
//! and [`write_segments_to_gpu`] copies them into the buffers by ranges. The buffer asset itself holds no data and changes
//! only to grow, which keeps its contents, by a copy on the GPU.

use crate::synthesis::instances::SegmentInstance;
use bevy::{
    prelude::*,
    render::{
        MainWorld,
        render_asset::RenderAssets,
        renderer::RenderQueue,
        storage::{GpuShaderBuffer, ShaderBuffer},
    },
};

/// Segments on their way to a range of a buffer.
pub(super) struct SegmentWrite {
    /// Keeps the buffer alive until it was written, so that a write can't wait forever for one that is gone.
    pub buffer: Handle<ShaderBuffer>,
    /// Slot of the first segment.
    pub first: usize,
    /// What is written from there on.
    pub segments: Vec<SegmentInstance>,
}

/// Writes that wait: in the main world for extraction, in the render world for their buffer to be there.
#[derive(Resource, Default)]
pub(super) struct SegmentWrites(pub Vec<SegmentWrite>);

/// Moves queued writes to the render world.
pub(super) fn extract_writes(mut main: ResMut<MainWorld>, mut writes: ResMut<SegmentWrites>) {
    let mut queued = main.resource_mut::<SegmentWrites>();
    if !queued.0.is_empty() {
        writes.0.append(&mut queued.0);
    }
}

/// Copies waiting segments into those buffers that have room for them; the others are tried again in the next frame.
pub(super) fn write_segments_to_gpu(
    mut writes: ResMut<SegmentWrites>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    queue: Res<RenderQueue>,
) {
    if writes.0.is_empty() {
        return;
    }
    let mut waiting = Vec::new();
    writes.0.retain(|SegmentWrite { buffer, first, segments }| {
        let bytes: &[u8] = bytemuck::cast_slice(segments);
        let offset = (first * SegmentInstance::SIZE) as u64;
        let room = buffers.get(buffer).filter(|gpu| offset + bytes.len() as u64 <= gpu.buffer.size());
        match room {
            // what was queued earlier is written earlier: a later write may replace parts of it
            Some(gpu) if !waiting.contains(&buffer.id()) => {
                queue.write_buffer(&gpu.buffer, offset, bytes);
                false
            }
            _ => {
                waiting.push(buffer.id());
                true
            }
        }
    });
}
