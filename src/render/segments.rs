//! Keeps the chunks of every vessel entity, their boxes and their buffer up to date with its tree.

use super::{
    SegmentLimits,
    detail::{ChunkMeshes, FEWEST_SLOTS},
    material::{SegmentExtension, SegmentMaterial, VesselMaterials},
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
    math::bounding::{Aabb3d, BoundingVolume},
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
    /// Slots that may hold something else than hidden segments.
    written: usize,
    /// Chunk entities, in the order of their slots.
    chunks: Vec<Entity>,
    /// What is in each chunk.
    contents: Vec<ChunkContents>,
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

/// An entity that draws one chunk of segments. For reading: its mesh follows its size in the picture.
#[derive(Component, Debug)]
pub struct SegmentChunk {
    /// Radius of the thickest segment, in the local space of the vessel entity.
    pub(super) thickest: f32,
    /// Slots that its mesh must have.
    pub(super) slots: usize,
    /// Its level of detail.
    pub(super) level: usize,
    /// Level and slots of the mesh that it has.
    pub(super) drawn: (usize, usize),
}

impl SegmentChunk {
    /// Level of detail, 0 for the finest. Each further one has fewer corners, or fewer segments.
    pub fn level(&self) -> usize {
        self.level
    }
}

/// What a chunk's box and thickness follow from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChunkContents {
    bounds: Option<Aabb3d>,
    thickest: f32,
}

impl ChunkContents {
    /// Takes in segments within a box. While vessels grow, what they were before lies within what they are now.
    fn add(&mut self, bounds: Option<Aabb3d>, segments: &[SegmentInstance]) {
        let Some(new) = bounds else { return };
        self.bounds = Some(self.bounds.map_or(new, |old| old.merge(&new)));
        let radii = segments.iter().map(|segment| segment.start_radius.max(segment.end_radius));
        self.thickest = radii.fold(self.thickest, f32::max);
    }
}

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
        let capacity = FEWEST_SLOTS;
        let mut buffer = ShaderBuffer::with_size(capacity * SegmentInstance::SIZE, RenderAssetUsages::default());
        buffer.buffer_description.label = Some("vessel segments");
        let buffer = buffers.add(buffer);
        let extension = SegmentExtension { segments: buffer.clone() };
        let material = materials.add(SegmentMaterial { base: templates.of(system.0).clone(), extension });
        commands.entity(entity).insert(SegmentBuffer {
            buffer,
            material,
            capacity,
            written: 0,
            chunks: Vec::new(),
            contents: Vec::new(),
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
    drawn: Query<'w, 's, (&'static mut Aabb, &'static mut SegmentChunk)>,
    buffers: ResMut<'w, Assets<ShaderBuffer>>,
    materials: ResMut<'w, Assets<SegmentMaterial>>,
    meshes: ResMut<'w, Assets<Mesh>>,
    writes: ResMut<'w, SegmentWrites>,
    templates: ResMut<'w, ChunkMeshes>,
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
        let changes = drawn.changes.bypass_change_detection();
        drawn.segments.adopt(look, drawn.vessels, changes);
        store.resize(&mut drawn.segments, len);
        store.write(drawn.vessels, changes, &mut drawn.segments, len);
        store.fit_chunks(drawn.entity, &mut drawn.segments, len);
        changes.clear();
    }
}

impl SegmentBuffer {
    /// Adopts the look, and marks the segments that have another colour now.
    fn adopt(&mut self, look: Look, vessels: &Vessels, changes: &mut SegmentChanges) {
        let (tree, births) = (vessels.tree(), vessels.birth_steps());
        if self.look != Some(look) {
            self.look = Some(look);
            self.colors = look.colors();
            self.colors.refresh(tree, births, [0..tree.len()]);
            changes.mark_all();
            return;
        }
        for recolored in self.colors.refresh(tree, births, changes.dirty_ranges(tree.len())) {
            recolored.for_each(|node| changes.mark_node(node));
        }
    }
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
        let needed = len.div_ceil(self.templates.slots());
        segments.contents.resize(needed, ChunkContents::default());
        for chunk in segments.chunks.drain(needed.min(segments.chunks.len())..) {
            self.commands.entity(chunk).try_despawn();
        }
    }

    /// Queues the segments that changed, and takes them into their chunks.
    fn write(&mut self, vessels: &Vessels, changes: &SegmentChanges, segments: &mut SegmentBuffer, len: usize) {
        let slots = self.templates.slots();
        if changes.is_all() {
            segments.contents.fill(ChunkContents::default());
        }
        let mut write = SegmentWrite::new(segments.buffer.clone());
        for range in changes.dirty_ranges(len) {
            for nodes in split(range, slots) {
                let (chunk, first) = (nodes.start / slots, write.len());
                let out = write.extend(nodes.clone());
                let bounds = write_segments(vessels.tree(), vessels.birth_steps(), nodes, &segments.colors, out);
                segments.contents[chunk].add(bounds, write.added_since(first));
            }
        }
        // what a longer tree left behind
        write.extend(len..segments.written.max(len));
        segments.written = len;
        self.writes.push(write);
    }

    /// Gives chunks that changed their boxes, and spawns those that are missing.
    fn fit_chunks(&mut self, entity: Entity, segments: &mut SegmentBuffer, len: usize) {
        let full = self.templates.slots();
        for (chunk, contents) in segments.contents.iter().enumerate() {
            let aabb = contents.bounds.map_or_else(Aabb::default, |b| Aabb::from_min_max(b.min.into(), b.max.into()));
            let used = (len - chunk * full).min(full);
            let (thickest, slots) = (contents.thickest, used.next_power_of_two().clamp(FEWEST_SLOTS, full));
            if let Some(&known) = segments.chunks.get(chunk) {
                if let Ok((mut current, mut chunk)) = self.drawn.get_mut(known) {
                    current.set_if_neq(aabb);
                    (chunk.thickest, chunk.slots) = (thickest, slots);
                }
                continue;
            }
            let drawing = (
                Mesh3d(self.templates.mesh(0, slots, &mut self.meshes)),
                MeshMaterial3d(segments.material.clone()),
                MeshTag((chunk * full) as u32),
            );
            let drawn = SegmentChunk { thickest, slots, level: 0, drawn: (0, slots) };
            segments.chunks.push(self.commands.spawn((drawing, drawn, aabb, NoAutoAabb, ChildOf(entity))).id());
        }
    }
}

/// The parts of a range that lie in one chunk each.
fn split(range: Range<usize>, slots: usize) -> impl Iterator<Item = Range<usize>> {
    let chunks = if range.is_empty() { 0..0 } else { range.start / slots..range.end.div_ceil(slots) };
    chunks.map(move |chunk| range.start.max(chunk * slots)..range.end.min((chunk + 1) * slots))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_split_where_chunks_meet() {
        let parts = |range: Range<usize>| split(range, 4).collect::<Vec<_>>();
        assert_eq!(parts(1..3), [1..3]);
        assert_eq!(parts(0..4), [0..4]);
        assert_eq!(parts(3..9), [3..4, 4..8, 8..9]);
        assert_eq!(parts(4..4), [0..0; 0]);
    }
}
