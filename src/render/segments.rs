//! Keeps the chunks of every vessel entity, their boxes and their buffer up to date with its tree.

use super::{
    SegmentLimits, SegmentTemplate,
    material::{SegmentExtension, SegmentMaterial, VesselMaterials},
    template::SEGMENTS_PER_CHUNK,
    upload::{SegmentWrite, SegmentWrites},
};
use crate::{
    plugin::{SegmentChanges, SegmentColoring, VesselAppearance, VesselSystem, Vessels, VesselsOf},
    synthesis::{
        instances::{SegmentColors, SegmentInstance, write_segments},
        tree::System,
    },
};
use bevy::{
    asset::RenderAssetUsages,
    camera::{primitives::Aabb, visibility::NoAutoAabb},
    ecs::{query::QueryData, system::SystemParam},
    math::bounding::Aabb3d,
    mesh::MeshTag,
    prelude::*,
    render::storage::ShaderBuffer,
};
use std::ops::Range;

/// What is drawn of a vessel entity: its buffer of segments, its material and its chunks.
///
/// Added to entities with [`Vessels`] and removed with them.
#[derive(Component, Debug)]
pub struct SegmentBuffer {
    buffer: Handle<ShaderBuffer>,
    material: Handle<SegmentMaterial>,
    /// Segments that the buffer has room for.
    capacity: usize,
    /// Chunk entities, in the order of their slots.
    chunks: Vec<Entity>,
    colors: SegmentColors,
    /// The appearance that `colors` follow, `None` at first.
    look: Option<Look>,
    warned_of_limit: bool,
}

impl SegmentBuffer {
    /// Material of all chunks of this vessel entity.
    pub fn material(&self) -> &Handle<SegmentMaterial> {
        &self.material
    }

    /// The buffer that holds this vessel entity's segments, one
    /// [`SegmentInstance`](crate::synthesis::instances::SegmentInstance) per node, for materials and compute shaders of
    /// your own. It is on the GPU only, and moves when it grows: ask again after the handle's asset was modified.
    pub fn buffer(&self) -> &Handle<ShaderBuffer> {
        &self.buffer
    }

    /// The entities that draw, children of the vessel entity; each has a mesh tag, its first node, and a bounding box.
    pub fn chunks(&self) -> &[Entity] {
        &self.chunks
    }

    /// Segments that fit before the buffer has to grow.
    pub fn capacity(&self) -> usize {
        self.capacity
    }
}

/// Marks an entity that draws one chunk of segments.
#[derive(Component, Debug)]
pub struct SegmentChunk;

/// What decides the colours.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Look {
    Uniform([f32; 3]),
    Ramp(SegmentColoring),
}

impl Look {
    fn new(appearance: &VesselAppearance, system: System) -> Self {
        if appearance.coloring != SegmentColoring::System {
            return Self::Ramp(appearance.coloring);
        }
        Self::Uniform(appearance.color(system).to_linear().to_f32_array_no_alpha())
    }

    fn colors(self) -> SegmentColors {
        match self {
            Self::Uniform(color) => SegmentColors::Uniform(color),
            Self::Ramp(SegmentColoring::System) => SegmentColors::Uniform([1.0; 3]),
            Self::Ramp(SegmentColoring::Radius) => SegmentColors::RADIUS,
            Self::Ramp(SegmentColoring::Age) => SegmentColors::AGE,
            Self::Ramp(SegmentColoring::StrahlerOrder) => SegmentColors::STRAHLER,
        }
    }
}

/// Gives every new vessel entity an empty buffer and a material.
pub(super) fn attach_buffers(
    mut commands: Commands,
    new: Query<(Entity, &VesselSystem), (With<Vessels>, Without<SegmentBuffer>)>,
    templates: Res<VesselMaterials>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut materials: ResMut<Assets<SegmentMaterial>>,
) {
    for (entity, system) in &new {
        let capacity = SEGMENTS_PER_CHUNK;
        let mut buffer = ShaderBuffer::with_size(capacity * SegmentInstance::SIZE, RenderAssetUsages::default());
        buffer.buffer_description.label = Some("vessel segments");
        let buffer = buffers.add(buffer);
        let extension = SegmentExtension { segments: buffer.clone() };
        let material = materials.add(SegmentMaterial { base: templates.of(system.0).clone(), extension });
        commands.entity(entity).insert(SegmentBuffer {
            buffer,
            material,
            capacity,
            chunks: Vec::new(),
            colors: SegmentColors::Uniform([1.0; 3]),
            look: None,
            warned_of_limit: false,
        });
    }
}

/// Removes what was drawn of an entity that lost its vessels but lives on.
pub(super) fn detach_buffer(removed: On<Remove, Vessels>, mut commands: Commands, buffers: Query<&SegmentBuffer>) {
    if let Ok(buffer) = buffers.get(removed.entity) {
        for &chunk in &buffer.chunks {
            commands.entity(chunk).try_despawn();
        }
        commands.entity(removed.entity).try_remove::<SegmentBuffer>();
    }
}

/// Everything that drawing segments writes to.
#[derive(SystemParam)]
pub(super) struct SegmentStore<'w, 's> {
    commands: Commands<'w, 's>,
    boxes: Query<'w, 's, &'static mut Aabb, With<SegmentChunk>>,
    buffers: ResMut<'w, Assets<ShaderBuffer>>,
    materials: ResMut<'w, Assets<SegmentMaterial>>,
    writes: ResMut<'w, SegmentWrites>,
    template: Res<'w, SegmentTemplate>,
    limits: Res<'w, SegmentLimits>,
}

/// A vessel entity that is drawn.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct DrawnVessels {
    entity: Entity,
    vessels: &'static Vessels,
    system: &'static VesselSystem,
    organ: &'static VesselsOf,
    changes: &'static mut SegmentChanges,
    segments: &'static mut SegmentBuffer,
}

/// Brings buffers, boxes and chunks up to date with trees and colours that changed.
pub(super) fn update_segments(
    mut drawn: Query<DrawnVessels>,
    appearances: Query<Ref<VesselAppearance>>,
    mut store: SegmentStore,
) {
    for mut drawn in &mut drawn {
        let appearance = appearances.get(drawn.organ.0).ok();
        let restyled = drawn.segments.look.is_none() || appearance.as_ref().is_some_and(Ref::is_changed);
        if drawn.changes.is_empty() && !restyled {
            continue;
        }
        let look = match appearance {
            Some(appearance) => Look::new(&appearance, drawn.system.0),
            None => Look::new(&VesselAppearance::default(), drawn.system.0),
        };
        let len = store.drawable(drawn.entity, drawn.vessels.tree().len(), &mut drawn.segments);
        let dirty = drawn.segments.dirty_chunks(drawn.vessels, &drawn.changes, look, len);
        store.resize(&mut drawn.segments, len);
        store.write(drawn.entity, drawn.vessels, &mut drawn.segments, &dirty, len);
        drawn.changes.bypass_change_detection().clear();
    }
}

impl SegmentBuffer {
    /// Adopts the look and returns the chunks to be written, rising, all within `len` nodes.
    fn dirty_chunks(&mut self, vessels: &Vessels, changes: &SegmentChanges, look: Look, len: usize) -> Vec<usize> {
        let (tree, births) = (vessels.tree(), vessels.birth_steps());
        if self.look != Some(look) {
            self.look = Some(look);
            self.colors = look.colors();
            self.colors.refresh(tree, births, [0..tree.len()]);
            return (0..len.div_ceil(SEGMENTS_PER_CHUNK)).collect();
        }
        let recolored = self.colors.refresh(tree, births, changes.dirty_ranges(tree.len()));
        let ranges = changes.dirty_ranges(len).chain(recolored);
        let mut chunks: Vec<usize> = ranges.flat_map(|range| chunks_of(range, len)).collect();
        chunks.sort_unstable();
        chunks.dedup();
        chunks
    }
}

/// The chunks that nodes of a range are in.
fn chunks_of(range: Range<usize>, len: usize) -> Range<usize> {
    let end = range.end.min(len);
    if range.start >= end { 0..0 } else { range.start / SEGMENTS_PER_CHUNK..end.div_ceil(SEGMENTS_PER_CHUNK) }
}

impl SegmentStore<'_, '_> {
    /// How many of `len` nodes can be drawn; says so once when those are not all.
    fn drawable(&self, entity: Entity, len: usize, segments: &mut SegmentBuffer) -> usize {
        let most = self.limits.max_segments();
        if len > most && !segments.warned_of_limit {
            segments.warned_of_limit = true;
            warn!(
                "vessels {entity} have {len} nodes but this GPU's storage buffers hold {most}: the rest is not drawn. \
                 Grow several organs or fewer vessels."
            );
        }
        len.min(most)
    }

    /// Makes room for `len` segments and drops the chunks beyond them.
    fn resize(&mut self, segments: &mut SegmentBuffer, len: usize) {
        if len > segments.capacity {
            segments.capacity = len.next_power_of_two().min(self.limits.max_segments());
            if let Some(mut buffer) = self.buffers.get_mut(&segments.buffer) {
                buffer.resize_in_place((segments.capacity * SegmentInstance::SIZE) as u64);
            }
            // a mutable look at the material makes its bind group anew, with the larger buffer
            if let Some(mut material) = self.materials.get_mut(&segments.material) {
                material.extension.segments = segments.buffer.clone();
            }
        }
        let needed = len.div_ceil(SEGMENTS_PER_CHUNK);
        for chunk in segments.chunks.drain(needed.min(segments.chunks.len())..) {
            self.commands.entity(chunk).try_despawn();
        }
    }

    /// Queues the chunks' segments, neighbours as one write, and fits their boxes.
    fn write(&mut self, entity: Entity, vessels: &Vessels, segments: &mut SegmentBuffer, dirty: &[usize], len: usize) {
        for run in dirty.chunk_by(|a, b| a + 1 == *b) {
            let mut written = vec![SegmentInstance::HIDDEN; run.len() * SEGMENTS_PER_CHUNK];
            for (&chunk, out) in run.iter().zip(written.chunks_exact_mut(SEGMENTS_PER_CHUNK)) {
                let nodes = chunk * SEGMENTS_PER_CHUNK..((chunk + 1) * SEGMENTS_PER_CHUNK).min(len);
                let bounds = write_segments(vessels.tree(), vessels.birth_steps(), nodes, &segments.colors, out);
                self.fit_chunk(entity, segments, chunk, bounds);
            }
            let (buffer, first) = (segments.buffer.clone(), run[0] * SEGMENTS_PER_CHUNK);
            self.writes.0.push(SegmentWrite { buffer, first, segments: written });
        }
    }

    /// Puts the box around a chunk, spawning the chunk when it is the next one.
    fn fit_chunk(&mut self, entity: Entity, segments: &mut SegmentBuffer, chunk: usize, bounds: Option<Aabb3d>) {
        let aabb = bounds.map_or_else(Aabb::default, |b| Aabb::from_min_max(b.min.into(), b.max.into()));
        if chunk < segments.chunks.len() {
            if let Ok(mut current) = self.boxes.get_mut(segments.chunks[chunk]) {
                current.set_if_neq(aabb);
            }
            return;
        }
        let drawing = (
            Mesh3d(self.template.0.clone()),
            MeshMaterial3d(segments.material.clone()),
            MeshTag((chunk * SEGMENTS_PER_CHUNK) as u32),
        );
        let spawned = self.commands.spawn((drawing, SegmentChunk, aabb, NoAutoAabb, ChildOf(entity)));
        segments.chunks.push(spawned.id());
    }
}
