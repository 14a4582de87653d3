//! Keeps the chunks of every vessel entity, their boxes and their buffer up to date with its tree.

use super::{
    SegmentLimits, SegmentTemplate,
    material::{SegmentExtension, SegmentMaterial, VesselMaterials},
    stumps::Stumps,
    template::SEGMENTS_PER_CHUNK,
    upload::{SegmentWrite, SegmentWrites},
};
use crate::{
    plugin::{
        SegmentChanges, SegmentColoring, SegmentSupply, VesselAppearance, VesselSystem, VesselWounds, Vessels, VesselsOf,
    },
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
    pub(super) buffer: Handle<ShaderBuffer>,
    material: Handle<SegmentMaterial>,
    /// Segments that the buffer has room for.
    capacity: usize,
    /// Chunk entities, in the order of their slots.
    chunks: Vec<Entity>,
    colors: SegmentColors,
    /// The appearance that `colors` follow, `None` at first.
    look: Option<Look>,
    warned_of_limit: bool,
    /// What severed segments show.
    pub(super) stumps: Stumps,
    /// Slots that the buffer has for stumps, behind those of the nodes.
    pub(super) room: usize,
}

impl SegmentBuffer {
    /// Material of all chunks of this vessel entity.
    pub fn material(&self) -> &Handle<SegmentMaterial> {
        &self.material
    }

    /// The buffer that holds this vessel entity's segments, one
    /// [`SegmentInstance`](crate::synthesis::instances::SegmentInstance) per node, for materials and compute shaders of
    /// your own. From [`capacity`](Self::capacity) on follow what pieces of severed segments there are beside the first of
    /// each, in no order. It is on the GPU only, and moves when it grows: ask again after the handle's asset was modified.
    pub fn buffer(&self) -> &Handle<ShaderBuffer> {
        &self.buffer
    }

    /// The entities that draw, children of the vessel entity; each has a mesh tag, its first node, and a bounding box.
    pub fn chunks(&self) -> &[Entity] {
        &self.chunks
    }

    /// The entities that draw the further pieces of severed segments, children of the vessel entity.
    pub fn stump_chunks(&self) -> &[Entity] {
        self.stumps.chunks()
    }

    /// Nodes' segments that fit before the buffer has to grow.
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
    Supply([f32; 3]),
    Ramp(SegmentColoring),
}

impl Look {
    fn new(appearance: &VesselAppearance, system: System) -> Self {
        let own = appearance.color(system).to_linear().to_f32_array_no_alpha();
        match appearance.coloring {
            SegmentColoring::System => Self::Uniform(own),
            SegmentColoring::Supply => Self::Supply(own),
            ramp => Self::Ramp(ramp),
        }
    }

    fn colors(self) -> SegmentColors {
        match self {
            Self::Uniform(color) => SegmentColors::Uniform(color),
            Self::Supply(full) => SegmentColors::Supply { full, levels: Vec::new() },
            Self::Ramp(SegmentColoring::System | SegmentColoring::Supply) => SegmentColors::Uniform([1.0; 3]),
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
        let (capacity, stumps) = (SEGMENTS_PER_CHUNK, Stumps::default());
        let bytes = (capacity + stumps.room()) * SegmentInstance::SIZE;
        let mut buffer = ShaderBuffer::with_size(bytes, RenderAssetUsages::default());
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
            room: stumps.room(),
            stumps,
        });
    }
}

/// Removes what was drawn of an entity that lost its vessels but lives on.
pub(super) fn detach_buffer(removed: On<Remove, Vessels>, mut commands: Commands, buffers: Query<&SegmentBuffer>) {
    if let Ok(buffer) = buffers.get(removed.entity) {
        for &chunk in buffer.chunks.iter().chain(buffer.stump_chunks()) {
            commands.entity(chunk).try_despawn();
        }
        commands.entity(removed.entity).try_remove::<SegmentBuffer>();
    }
}

/// Everything that drawing segments writes to.
#[derive(SystemParam)]
pub(super) struct SegmentStore<'w, 's> {
    pub(super) commands: Commands<'w, 's>,
    boxes: Query<'w, 's, &'static mut Aabb, With<SegmentChunk>>,
    buffers: ResMut<'w, Assets<ShaderBuffer>>,
    materials: ResMut<'w, Assets<SegmentMaterial>>,
    pub(super) writes: ResMut<'w, SegmentWrites>,
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
    wounds: Option<&'static VesselWounds>,
    supply: Option<Ref<'static, SegmentSupply>>,
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
        let blanched = drawn.segments.follows_supply() && drawn.supply.as_ref().is_some_and(Ref::is_changed);
        if drawn.changes.is_empty() && !restyled && !blanched {
            continue;
        }
        let look = match appearance {
            Some(appearance) => Look::new(&appearance, drawn.system.0),
            None => Look::new(&VesselAppearance::default(), drawn.system.0),
        };
        let (vessels, segments) = (drawn.vessels, &mut *drawn.segments);
        let supply = drawn.supply.as_ref().map_or(&[][..], |supply| &supply.segments[..]);
        let dirty = segments.dirty_chunks(vessels, &drawn.changes, look, supply);
        segments.cut(vessels, drawn.wounds, &dirty);
        let len = store.drawable(drawn.entity, vessels.tree().len(), segments);
        store.resize(segments, len);
        store.write(drawn.entity, vessels, segments, &dirty, len);
        store.write_stumps(drawn.entity, segments);
        drawn.changes.bypass_change_detection().clear();
    }
}

impl SegmentBuffer {
    /// Whether colours tell the supply.
    fn follows_supply(&self) -> bool {
        matches!(self.look, Some(Look::Supply(_)))
    }

    /// Adopts look and supply and returns the chunks to be written, rising.
    fn dirty_chunks(&mut self, vessels: &Vessels, changes: &SegmentChanges, look: Look, supply: &[f32]) -> Vec<usize> {
        let (tree, births) = (vessels.tree(), vessels.birth_steps());
        let len = tree.len();
        if self.look != Some(look) {
            self.look = Some(look);
            self.colors = look.colors();
            self.colors.refresh(tree, births, [0..len]);
            self.colors.set_supply(supply);
            return (0..len.div_ceil(SEGMENTS_PER_CHUNK)).collect();
        }
        let recolored = self.colors.refresh(tree, births, changes.dirty_ranges(len));
        let blanched = self.colors.set_supply(supply);
        let ranges = changes.dirty_ranges(len).chain(recolored).chain(blanched);
        let mut chunks: Vec<usize> = ranges.flat_map(|range| chunks_of(range, len)).collect();
        chunks.sort_unstable();
        chunks.dedup();
        chunks
    }

    /// Takes in what wounds left of the segments in some chunks.
    fn cut(&mut self, vessels: &Vessels, wounds: Option<&VesselWounds>, chunks: &[usize]) {
        let len = vessels.tree().len();
        let nodes = chunks.iter().map(|chunk| chunk * SEGMENTS_PER_CHUNK..((chunk + 1) * SEGMENTS_PER_CHUNK).min(len));
        self.stumps.update(wounds.map(|wounds| &**wounds), vessels, &self.colors, nodes, len);
    }
}

/// The chunks that nodes of a range are in.
fn chunks_of(range: Range<usize>, len: usize) -> Range<usize> {
    let end = range.end.min(len);
    if range.start >= end { 0..0 } else { range.start / SEGMENTS_PER_CHUNK..end.div_ceil(SEGMENTS_PER_CHUNK) }
}

impl SegmentStore<'_, '_> {
    /// How many of `len` nodes can be drawn beside the stumps; says so once when those are not all.
    fn drawable(&self, entity: Entity, len: usize, segments: &mut SegmentBuffer) -> usize {
        let stumps = segments.stumps.room();
        let most = self.limits.max_segments().saturating_sub(stumps);
        if len > most && !segments.warned_of_limit {
            segments.warned_of_limit = true;
            warn!(
                "vessels {entity} have {len} nodes but this GPU's storage buffers hold {most}, beside {stumps} pieces of \
                 severed vessels: the rest is not drawn. Grow several organs or fewer vessels."
            );
        }
        len.min(most)
    }

    /// Makes room for `len` segments and for the stumps, and drops the chunks beyond them.
    fn resize(&mut self, segments: &mut SegmentBuffer, len: usize) {
        let (most, room) = (self.limits.max_segments(), segments.stumps.room().min(self.limits.max_segments()));
        if len > segments.capacity || room > segments.room {
            let wanted = if len > segments.capacity { len.next_power_of_two() } else { segments.capacity };
            (segments.capacity, segments.room) = (wanted.min(most - room), room);
            if let Some(mut buffer) = self.buffers.get_mut(&segments.buffer) {
                buffer.resize_in_place(((segments.capacity + room) * SegmentInstance::SIZE) as u64);
            }
            // a mutable look at the material makes its bind group anew, with the larger buffer
            if let Some(mut material) = self.materials.get_mut(&segments.material) {
                material.extension.segments = segments.buffer.clone();
            }
        }
        self.move_stumps(segments);
        let needed = len.div_ceil(SEGMENTS_PER_CHUNK);
        for chunk in segments.chunks.drain(needed.min(segments.chunks.len())..) {
            self.commands.entity(chunk).try_despawn();
        }
    }

    /// Queues the chunks' segments, neighbours as one write, and fits their boxes.
    fn write(&mut self, entity: Entity, vessels: &Vessels, segments: &mut SegmentBuffer, dirty: &[usize], len: usize) {
        let drawn = dirty.partition_point(|&chunk| chunk * SEGMENTS_PER_CHUNK < len);
        for run in dirty[..drawn].chunk_by(|a, b| a + 1 == *b) {
            let mut written = vec![SegmentInstance::HIDDEN; run.len() * SEGMENTS_PER_CHUNK];
            for (&chunk, out) in run.iter().zip(written.chunks_exact_mut(SEGMENTS_PER_CHUNK)) {
                let nodes = chunk * SEGMENTS_PER_CHUNK..((chunk + 1) * SEGMENTS_PER_CHUNK).min(len);
                let (tree, births) = (vessels.tree(), vessels.birth_steps());
                let bounds = write_segments(tree, births, nodes.clone(), &segments.colors, out);
                segments.stumps.replace(nodes, out);
                let known = segments.chunks.get(chunk).copied();
                segments.chunks.extend(self.fit_chunk(entity, segments, known, chunk * SEGMENTS_PER_CHUNK, bounds));
            }
            let (buffer, first) = (segments.buffer.clone(), run[0] * SEGMENTS_PER_CHUNK);
            self.writes.0.push(SegmentWrite { buffer, first, segments: written });
        }
    }

    /// Puts the box around a chunk. Spawns one that is not known yet, and returns it.
    pub(super) fn fit_chunk(
        &mut self,
        entity: Entity,
        segments: &SegmentBuffer,
        known: Option<Entity>,
        first: usize,
        bounds: Option<Aabb3d>,
    ) -> Option<Entity> {
        let aabb = bounds.map_or_else(Aabb::default, |b| Aabb::from_min_max(b.min.into(), b.max.into()));
        if let Some(known) = known {
            if let Ok(mut current) = self.boxes.get_mut(known) {
                current.set_if_neq(aabb);
            }
            return None;
        }
        let material = MeshMaterial3d(segments.material.clone());
        let drawing = (Mesh3d(self.template.0.clone()), material, MeshTag(first as u32));
        Some(self.commands.spawn((drawing, SegmentChunk, aabb, NoAutoAabb, ChildOf(entity))).id())
    }
}
