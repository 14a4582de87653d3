//! Keeps the chunks of every vessel entity, their boxes and their buffer up to date with its tree.

use super::{
    SegmentLimits,
    detail::{ChunkMeshes, FEWEST_SLOTS},
    material::{SegmentExtension, SegmentMaterial, VesselMaterials},
    stumps::Stumps,
    upload::{SegmentWrite, SegmentWrites},
};
use crate::{
    plugin::{
        ChangeCursor, ChangeLog, Changes, SegmentColoring, SegmentSupply, VesselAppearance, VesselWounds, Vessels,
        VesselsOf,
    },
    synthesis::{
        instances::{SegmentColors, SegmentInstance, segment_instance},
        tree::VesselKind,
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

/// The drawn form of a vessel entity: its buffer of segments, its material and its chunks.
///
/// Added to entities with [`Vessels`] and removed with them.
#[derive(Component, Debug)]
pub struct SegmentBuffer {
    pub(super) buffer: Handle<ShaderBuffer>,
    material: Handle<SegmentMaterial>,
    /// The changes that have been drawn.
    drawn: ChangeCursor,
    /// Node slots in the buffer.
    capacity: usize,
    /// Slots that may hold segments that are not hidden.
    written: usize,
    /// Chunk entities, in the order of their slots.
    chunks: Vec<Entity>,
    /// The contents of each chunk.
    contents: Vec<ChunkContents>,
    colors: SegmentColors,
    /// The appearance that `colors` follow, `None` at first.
    look: Option<Look>,
    warned_of_limit: bool,
    /// The remaining pieces of severed segments.
    pub(super) stumps: Stumps,
    /// Slots for stumps in the buffer, behind those of the nodes.
    room: usize,
}

impl SegmentBuffer {
    /// Material of all chunks of this vessel entity.
    pub fn material(&self) -> &Handle<SegmentMaterial> {
        &self.material
    }

    /// The buffer that holds this vessel entity's segments, one
    /// [`SegmentInstance`](crate::synthesis::instances::SegmentInstance) per node, for materials and compute shaders of
    /// your own. From [`capacity`](Self::capacity) on it holds the further pieces of severed segments, after the first
    /// of each, in no order. It is on the GPU only, and moves when it grows: get it again after the handle's asset was
    /// modified.
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

    /// Number of nodes whose segments fit before the buffer has to grow.
    pub fn capacity(&self) -> usize {
        self.capacity
    }
}

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
    bounds: Option<Aabb3d>,
    thickest: f32,
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

/// The inputs of the colours.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Look {
    Uniform([f32; 3]),
    Supply([f32; 3]),
    Ramp(SegmentColoring),
}

impl Look {
    fn new(appearance: &VesselAppearance, kind: VesselKind) -> Self {
        let own = appearance.colors[kind].to_linear().to_f32_array_no_alpha();
        match appearance.coloring {
            SegmentColoring::Kind => Self::Uniform(own),
            SegmentColoring::Supply => Self::Supply(own),
            ramp => Self::Ramp(ramp),
        }
    }

    fn colors(self) -> SegmentColors {
        match self {
            Self::Uniform(color) => SegmentColors::Uniform(color),
            Self::Supply(full) => SegmentColors::Supply { full, levels: Vec::new() },
            Self::Ramp(SegmentColoring::Kind | SegmentColoring::Supply) => SegmentColors::Uniform([1.0; 3]),
            Self::Ramp(SegmentColoring::Radius) => SegmentColors::RADIUS,
            Self::Ramp(SegmentColoring::Age) => SegmentColors::AGE,
            Self::Ramp(SegmentColoring::StrahlerOrder) => SegmentColors::STRAHLER,
        }
    }
}

/// Gives every new vessel entity an empty buffer and a material.
pub(super) fn attach_buffers(
    mut commands: Commands,
    new: Query<(Entity, &Vessels, Option<&Children>), Without<SegmentBuffer>>,
    chunks: Query<(), With<SegmentChunk>>,
    templates: Res<VesselMaterials>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut materials: ResMut<Assets<SegmentMaterial>>,
) {
    for (entity, vessels, children) in &new {
        // Chunks that came with a scene or a clone draw nothing.
        for &stray in children.into_iter().flatten().filter(|&&child| chunks.contains(child)) {
            commands.entity(stray).try_despawn();
        }
        let (capacity, stumps) = (FEWEST_SLOTS, Stumps::default());
        let bytes = (capacity + stumps.room()) * SegmentInstance::SIZE;
        let mut buffer = ShaderBuffer::with_size(bytes, RenderAssetUsages::default());
        buffer.buffer_description.label = Some("vessel segments");
        let buffer = buffers.add(buffer);
        let extension = SegmentExtension { segments: buffer.clone() };
        let material = materials.add(SegmentMaterial { base: templates.0[vessels.kind()].clone(), extension });
        commands.entity(entity).insert(SegmentBuffer {
            buffer,
            material,
            drawn: ChangeCursor::default(),
            capacity,
            written: 0,
            chunks: Vec::new(),
            contents: Vec::new(),
            colors: SegmentColors::Uniform([1.0; 3]),
            look: None,
            warned_of_limit: false,
            room: stumps.room(),
            stumps,
        });
    }
}

/// Removes the chunks of an entity that lost its vessels but still exists.
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
    drawn: Query<'w, 's, (&'static mut Aabb, &'static mut SegmentChunk)>,
    buffers: ResMut<'w, Assets<ShaderBuffer>>,
    materials: ResMut<'w, Assets<SegmentMaterial>>,
    meshes: ResMut<'w, Assets<Mesh>>,
    pub(super) writes: ResMut<'w, SegmentWrites>,
    templates: ResMut<'w, ChunkMeshes>,
    limits: Res<'w, SegmentLimits>,
}

/// A vessel entity that is drawn.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct DrawnVessels {
    entity: Entity,
    vessels: Ref<'static, Vessels>,
    organ: &'static VesselsOf,
    log: &'static ChangeLog,
    wounds: Option<&'static VesselWounds>,
    supply: Option<Ref<'static, SegmentSupply>>,
    segments: &'static mut SegmentBuffer,
}

/// Updates buffers, boxes and chunks from changed trees and colours.
pub(super) fn update_segments(
    mut drawn: Query<DrawnVessels>,
    appearances: Query<Ref<VesselAppearance>>,
    mut store: SegmentStore,
) {
    for mut drawn in &mut drawn {
        let appearance = appearances.get(drawn.organ.0).ok();
        let restyled = drawn.segments.look.is_none() || appearance.as_ref().is_some_and(Ref::is_changed);
        let blanched = drawn.segments.follows_supply() && drawn.supply.as_ref().is_some_and(Ref::is_changed);
        if drawn.segments.drawn.is_current(drawn.log) && !restyled && !blanched {
            continue;
        }
        let look = match appearance {
            Some(appearance) => Look::new(&appearance, drawn.vessels.kind()),
            None => Look::new(&VesselAppearance::default(), drawn.vessels.kind()),
        };
        let (vessels, segments) = (&*drawn.vessels, &mut *drawn.segments);
        let nodes = vessels.tree().len();
        let supply = drawn.supply.as_ref().map_or(&[][..], |supply| &supply.segments[..]);
        let mut changes = segments.drawn.read(drawn.log);
        let wounds = drawn.wounds.map(|wounds| &**wounds);
        segments.stumps.note(wounds, vessels, drawn.vessels.is_changed(), &mut changes);
        segments.adopt(look, vessels, supply, &mut changes);
        segments.stumps.update(wounds, vessels, &segments.colors, &changes, nodes);
        let len = store.drawable(drawn.entity, nodes, segments);
        store.resize(segments, len);
        store.write(vessels, &changes, segments, len);
        store.fit_chunks(drawn.entity, segments, len);
        store.write_stumps(drawn.entity, segments);
    }
}

impl SegmentBuffer {
    /// Whether colours show the supply.
    fn follows_supply(&self) -> bool {
        matches!(self.look, Some(Look::Supply(_)))
    }

    /// Takes over look and supply, and adds the segments whose colour changed.
    fn adopt(&mut self, look: Look, vessels: &Vessels, supply: &[f32], changes: &mut Changes) {
        let (tree, births) = (vessels.tree(), vessels.birth_steps());
        if self.look != Some(look) {
            self.look = Some(look);
            self.colors = look.colors();
            self.colors.refresh(tree, births, [0..tree.len()]);
            self.colors.set_supply(supply);
            changes.add_all();
            return;
        }
        let recolored = self.colors.refresh(tree, births, changes.dirty_ranges(tree.len()));
        for recolored in recolored.into_iter().chain(self.colors.set_supply(supply)) {
            recolored.for_each(|node| changes.add(node));
        }
    }
}

impl SegmentStore<'_, '_> {
    /// Number of `len` nodes that can be drawn beside the stumps; warns once if not all can.
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
        let most = self.limits.max_segments();
        let room = segments.stumps.room().min(most);
        if len > segments.capacity || room > segments.room {
            let wanted = if len > segments.capacity { len.next_power_of_two() } else { segments.capacity };
            (segments.capacity, segments.room) = (wanted.min(most - room), room);
            if let Some(mut buffer) = self.buffers.get_mut(&segments.buffer) {
                buffer.resize_in_place(((segments.capacity + room) * SegmentInstance::SIZE) as u64);
            }
            // mutable access to the material makes its bind group again, with the larger buffer
            if let Some(mut material) = self.materials.get_mut(&segments.material) {
                material.extension.segments = segments.buffer.clone();
            }
        }
        self.move_stumps(segments);
        let needed = len.div_ceil(self.templates.slots());
        segments.contents.resize(needed, ChunkContents::default());
        for chunk in segments.chunks.drain(needed.min(segments.chunks.len())..) {
            self.commands.entity(chunk).try_despawn();
        }
    }

    /// Queues the segments that changed, and adds them to their chunks.
    fn write(&mut self, vessels: &Vessels, changes: &Changes, segments: &mut SegmentBuffer, len: usize) {
        let slots = self.templates.slots();
        if changes.is_all() {
            segments.contents.fill(ChunkContents::default());
        }
        let (tree, births) = (vessels.tree(), vessels.birth_steps());
        let left_behind = len..segments.written.max(len);
        let mut write = SegmentWrite::with_room(segments.buffer.clone(), changes.count(len) + left_behind.len());
        for (chunk, contents) in segments.contents.iter_mut().enumerate() {
            let nodes = changes.dirty_nodes(chunk * slots..((chunk + 1) * slots).min(len));
            let segment = |node| {
                let birth = births.get(node).copied().unwrap_or(0);
                segment_instance(tree, node, birth, &segments.colors)
            };
            let (nodes, out) = write.add(nodes.map(|node| (node as u32, segment(node))));
            segments.stumps.replace(nodes, out);
            contents.add(&*out);
        }
        // slots left over from a longer tree
        write.extend(left_behind);
        segments.written = len;
        self.writes.push(write);
    }

    /// Updates the boxes of changed chunks, and spawns missing chunks.
    fn fit_chunks(&mut self, entity: Entity, segments: &mut SegmentBuffer, len: usize) {
        let full = self.templates.slots();
        for chunk in 0..segments.contents.len() {
            let used = (len - chunk * full).min(full);
            let slots = used.next_power_of_two().clamp(FEWEST_SLOTS, full);
            let known = segments.chunks.get(chunk).copied();
            let spawned = self.fit_chunk((entity, segments), known, chunk * full, &segments.contents[chunk], slots);
            segments.chunks.extend(spawned);
        }
    }

    /// Gives a chunk its box. A chunk that is not known yet is spawned, from its first slot, and returned.
    pub(super) fn fit_chunk(
        &mut self,
        (entity, segments): (Entity, &SegmentBuffer),
        known: Option<Entity>,
        first: usize,
        contents: &ChunkContents,
        slots: usize,
    ) -> Option<Entity> {
        let aabb = contents.bounds.map_or_else(Aabb::default, |b| Aabb::from_min_max(b.min.into(), b.max.into()));
        let thickest = contents.thickest;
        if let Some(known) = known {
            if let Ok((mut current, mut chunk)) = self.drawn.get_mut(known) {
                current.set_if_neq(aabb);
                (chunk.thickest, chunk.slots) = (thickest, slots);
            }
            return None;
        }
        let drawing = (
            Mesh3d(self.templates.mesh(0, slots, &mut self.meshes)),
            MeshMaterial3d(segments.material.clone()),
            MeshTag(first as u32),
        );
        let drawn = SegmentChunk { thickest, slots, level: 0, drawn: (0, slots) };
        Some(self.commands.spawn((drawing, drawn, aabb, NoAutoAabb, ChildOf(entity))).id())
    }
}
