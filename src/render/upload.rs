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

/// Set when the render device was replaced: buffers are new and empty, and everything must be written again.
#[derive(Resource, Default)]
pub(super) struct BuffersLost(pub bool);

/// Moves queued writes to the render world, and the news of a lost device the other way.
pub(super) fn extract_writes(
    mut main: ResMut<MainWorld>,
    mut writes: ResMut<SegmentWrites>,
    mut lost: ResMut<BuffersLost>,
) {
    if lost.0 {
        main.resource_mut::<BuffersLost>().0 = true;
        lost.0 = false;
        writes.0.clear();
    }
    let mut queued = main.resource_mut::<SegmentWrites>();
    if !queued.0.is_empty() {
        writes.0.append(&mut queued.0);
    }
}

/// Runs once for each render device: at the first nothing is written yet, at any later one everything is gone.
pub(super) fn note_new_device(mut lost: ResMut<BuffersLost>, mut devices: Local<u32>) {
    lost.0 = *devices > 0;
    *devices += 1;
}

/// Copies waiting segments into those buffers that exist; the others are tried again in the next frame.
pub(super) fn write_segments_to_gpu(
    mut writes: ResMut<SegmentWrites>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    queue: Res<RenderQueue>,
) {
    if writes.0.is_empty() {
        return;
    }
    writes.0.retain(|write| {
        let bytes: &[u8] = bytemuck::cast_slice(&write.segments);
        let offset = (write.first * SegmentInstance::SIZE) as u64;
        let Some(buffer) = buffers.get(&write.buffer) else { return true };
        if offset + bytes.len() as u64 > buffer.buffer.size() {
            return true;
        }
        queue.write_buffer(&buffer.buffer, offset, bytes);
        false
    });
}
