//! Uploads segments from the main world into their buffer on the GPU.
//!
//! A change of the tree queues exactly the segments that it touched as a [`SegmentWrite`]. Extraction moves the queue,
//! not the bytes, and [`write_segments_to_gpu`] copies them into the buffers: a single run of slots directly, scattered
//! ones by a compute shader, since thousands of small copies would cost more than they save. The buffer asset itself
//! holds no data. It changes only to grow, and keeps its contents by a copy on the GPU.

use crate::synthesis::instances::SegmentInstance;
use bevy::{
    asset::load_embedded_asset,
    prelude::*,
    render::{
        MainWorld,
        render_asset::RenderAssets,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, Buffer, BufferInitDescriptor,
            BufferUsages, CachedComputePipelineId, CommandEncoderDescriptor, ComputePassDescriptor, ComputePipeline,
            ComputePipelineDescriptor, PipelineCache, ShaderStages,
            binding_types::{storage_buffer_read_only_sized, storage_buffer_sized},
        },
        renderer::{RenderDevice, RenderQueue},
        storage::{GpuShaderBuffer, ShaderBuffer},
    },
};
use std::ops::Range;

/// Segments on their way to slots of a buffer.
#[derive(Debug)]
pub(super) struct SegmentWrite {
    /// Keeps the buffer alive until it was written, so that a write never waits for a dropped buffer.
    buffer: Handle<ShaderBuffer>,
    /// Their slots, each once.
    slots: Vec<u32>,
    segments: Vec<SegmentInstance>,
}

impl SegmentWrite {
    /// Most segments scattered at once: as many as a dispatch of one dimension can do, and few enough to be staged.
    const MOST_SCATTERED: usize = 1 << 20;

    pub(super) fn new(buffer: Handle<ShaderBuffer>) -> Self {
        Self::with_room(buffer, 0)
    }

    /// A write with room for so many segments.
    pub(super) fn with_room(buffer: Handle<ShaderBuffer>, len: usize) -> Self {
        Self { buffer, slots: Vec::with_capacity(len), segments: Vec::with_capacity(len) }
    }

    /// Number of segments.
    pub(super) fn len(&self) -> usize {
        self.segments.len()
    }

    /// Adds segments with their slots, and returns them.
    pub(super) fn add(
        &mut self,
        segments: impl Iterator<Item = (u32, SegmentInstance)>,
    ) -> (&[u32], &mut [SegmentInstance]) {
        let first = self.len();
        segments.for_each(|(slot, segment)| {
            self.slots.push(slot);
            self.segments.push(segment);
        });
        (&self.slots[first..], &mut self.segments[first..])
    }

    /// Adds hidden segments for a range of slots, to be filled in.
    pub(super) fn extend(&mut self, slots: Range<usize>) -> &mut [SegmentInstance] {
        let first = self.len();
        self.segments.resize(first + slots.len(), SegmentInstance::HIDDEN);
        self.slots.extend(slots.map(|slot| slot as u32));
        &mut self.segments[first..]
    }

    /// The slots as a range, if they are consecutive.
    fn run(&self) -> Option<Range<usize>> {
        let first = *self.slots.first()? as usize;
        self.slots.is_sorted_by(|a, b| a + 1 == *b).then(|| first..first + self.len())
    }

    /// Number of slots that the buffer must have.
    fn end(&self) -> usize {
        self.slots.iter().max().map_or(0, |&last| last as usize + 1)
    }
}

/// Waiting writes: in the main world for extraction, in the render world for their buffer.
#[derive(Resource, Debug, Default)]
pub(super) struct SegmentWrites {
    queued: Vec<SegmentWrite>,
}

impl SegmentWrites {
    /// Queues a write, unless there is nothing in it.
    pub(super) fn push(&mut self, write: SegmentWrite) {
        if write.len() > 0 {
            self.queued.push(write);
        }
    }
}

/// Moves queued writes to the render world.
pub(super) fn extract_writes(mut main: ResMut<MainWorld>, mut writes: ResMut<SegmentWrites>) {
    let mut main = main.resource_mut::<SegmentWrites>();
    if !main.queued.is_empty() {
        writes.queued.append(&mut main.queued);
    }
}

/// The compute pipeline that scatters segments.
#[derive(Resource)]
pub(super) struct ScatterPipeline {
    layout: BindGroupLayoutDescriptor,
    pipeline: CachedComputePipelineId,
}

/// Queues the pipeline.
pub(super) fn queue_scatter_pipeline(mut commands: Commands, assets: Res<AssetServer>, cache: Res<PipelineCache>) {
    let layout = BindGroupLayoutDescriptor::new(
        "scatter segments",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                storage_buffer_sized(false, None),
                storage_buffer_read_only_sized(false, None),
                storage_buffer_read_only_sized(false, None),
            ),
        ),
    );
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("scatter segments".into()),
        layout: vec![layout.clone()],
        shader: load_embedded_asset!(assets.as_ref(), "scatter.wgsl"),
        entry_point: Some("scatter".into()),
        ..default()
    });
    commands.insert_resource(ScatterPipeline { layout, pipeline });
}

/// Copies waiting segments into those buffers that have room for them; the others are retried in the next frame.
pub(super) fn write_segments_to_gpu(
    mut writes: ResMut<SegmentWrites>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    scatter: Res<ScatterPipeline>,
    cache: Res<PipelineCache>,
    (device, queue): (Res<RenderDevice>, Res<RenderQueue>),
) {
    if writes.queued.is_empty() {
        return;
    }
    let pipeline = cache.get_compute_pipeline(scatter.pipeline);
    let mut waiting = Vec::new();
    for write in std::mem::take(&mut writes.queued) {
        let bytes = (write.end() * SegmentInstance::SIZE) as u64;
        let room = buffers.get(&write.buffer).map(|gpu| &gpu.buffer).filter(|buffer| bytes <= buffer.size());
        // writes keep their order: a later one may replace parts of an earlier one
        let written = match (room.filter(|_| !waiting.contains(&write.buffer.id())), write.run(), pipeline) {
            (Some(buffer), Some(run), _) => {
                let offset = (run.start * SegmentInstance::SIZE) as u64;
                queue.write_buffer(buffer, offset, bytemuck::cast_slice(&write.segments));
                true
            }
            (Some(buffer), None, Some(pipeline)) => {
                scatter.run(pipeline, &write, buffer, &cache, &device, &queue);
                true
            }
            _ => false,
        };
        if !written {
            waiting.push(write.buffer.id());
            writes.queued.push(write);
        }
    }
}

impl ScatterPipeline {
    fn run(
        &self,
        pipeline: &ComputePipeline,
        write: &SegmentWrite,
        buffer: &Buffer,
        cache: &PipelineCache,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) {
        let staged = |label, contents| {
            device.create_buffer_with_data(&BufferInitDescriptor { label, contents, usage: BufferUsages::STORAGE })
        };
        let layout = cache.get_bind_group_layout(&self.layout);
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("scatter segments") });
        let most = SegmentWrite::MOST_SCATTERED;
        for (slots, segments) in write.slots.chunks(most).zip(write.segments.chunks(most)) {
            let staged_slots = staged(Some("changed slots"), bytemuck::cast_slice(slots));
            let staged_segments = staged(Some("changed segments"), bytemuck::cast_slice(segments));
            let entries = BindGroupEntries::sequential((
                buffer.as_entire_binding(),
                staged_slots.as_entire_binding(),
                staged_segments.as_entire_binding(),
            ));
            let group = device.create_bind_group("scatter segments", &layout, &entries);
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(slots.len().div_ceil(64) as u32, 1, 1);
        }
        queue.submit([encoder.finish()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_that_follow_one_another_are_a_run() {
        let write = |ranges: &[Range<usize>]| {
            let mut write = SegmentWrite::new(Handle::default());
            for range in ranges {
                write.extend(range.clone());
            }
            write
        };
        assert_eq!(write(&[3..5, 5..9]).run(), Some(3..9));
        assert_eq!((write(&[3..5, 6..9]).run(), write(&[3..5, 6..9]).end()), (None, 9));
        assert_eq!(write(&[5..6, 4..5]).run(), None);
        assert_eq!((write(&[]).run(), write(&[]).end()), (None, 0));
        assert!(write(&[0..2]).segments.iter().all(|segment| *segment == SegmentInstance::HIDDEN));
    }
}
