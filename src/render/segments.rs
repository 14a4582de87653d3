//! Keeps the chunks of every vessel entity, their boxes and their buffer up to date with its tree.

use super::{
    buffer::{Look, SegmentBuffer},
    chunk::{ChunkContents, SegmentChunk},
    detail::ChunkMeshes,
    levels::FEWEST_SLOTS,
    limits::SegmentLimits,
    material::{SegmentMaterial, VesselMaterials, set_opacity},
    upload::{SegmentWrite, SegmentWrites},
};
use crate::{
    plugin::{ChangeLog, Changes, SegmentSupply, VesselAppearance, VesselMesh, VesselWounds, Vessels, VesselsOf},
    synthesis::{
        instances::{SegmentInstance, segment_instance},
        tree::VesselKind,
    },
};
use bevy::{
    camera::{primitives::Aabb, visibility::NoAutoAabb},
    ecs::{query::QueryData, system::SystemParam},
    mesh::MeshTag,
    prelude::*,
    render::storage::ShaderBuffer,
};

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
    looks: Res<'w, VesselMaterials>,
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
    mesh: Option<&'static VesselMesh>,
    segments: &'static mut SegmentBuffer,
}

/// Updates buffers, boxes and chunks from changed trees and colours.
pub(super) fn update_segments(
    mut drawn: Query<DrawnVessels>,
    appearances: Query<Ref<VesselAppearance>>,
    mut store: SegmentStore,
) {
    for mut drawn in &mut drawn {
        // What is not drawn is not kept up to date, colours included.
        let was_covered = drawn.segments.is_covered();
        drawn.segments.bypass_change_detection().note_cover(drawn.mesh.is_some_and(VesselMesh::is_shown));
        if drawn.segments.is_covered() {
            continue;
        }
        let appearance = appearances.get(drawn.organ.0).ok();
        let restyled = was_covered || !drawn.segments.has_look() || appearance.as_ref().is_some_and(Ref::is_changed);
        let blanched = drawn.segments.follows_supply() && drawn.supply.as_ref().is_some_and(Ref::is_changed);
        if drawn.segments.drawn.is_current(drawn.log) && !restyled && !blanched {
            continue;
        }
        let look = match appearance {
            Some(ref appearance) => Look::new(appearance, drawn.vessels.kind()),
            None => Look::new(&VesselAppearance::default(), drawn.vessels.kind()),
        };
        let (vessels, segments) = (&*drawn.vessels, &mut *drawn.segments);
        let nodes = vessels.tree().len();
        let supply = drawn.supply.as_ref().map_or(&[][..], |supply| &supply.segments[..]);
        let mut changes = segments.drawn.read(drawn.log);
        let wounds = drawn.wounds.map(|wounds| &**wounds);
        segments.stumps.note(wounds, vessels, drawn.vessels.is_changed(), &mut changes);
        segments.adopt(look, vessels, supply, &mut changes);
        let opacity = appearance.map_or(1.0, |appearance| appearance.colors[vessels.kind()].alpha());
        store.set_opacity(opacity, vessels.kind(), segments);
        segments.stumps.update(wounds, vessels, &segments.colors, &changes, nodes);
        let len = store.drawable(drawn.entity, nodes, segments);
        store.resize(segments, len);
        store.write(vessels, &changes, segments, len);
        store.fit_chunks(drawn.entity, segments, len);
        store.write_stumps(drawn.entity, segments);
    }
}

impl SegmentStore<'_, '_> {
    /// Makes vessels as opaque as their kind's colour, if that has changed.
    fn set_opacity(&mut self, opacity: f32, kind: VesselKind, segments: &mut SegmentBuffer) {
        if segments.opacity != opacity
            && let Some(mut material) = self.materials.get_mut(&segments.material)
        {
            set_opacity(&mut material.base, &self.looks.0[kind], opacity);
            segments.opacity = opacity;
        }
    }

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
    fn fit_chunk(
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

    /// Moves the stumps behind the nodes' slots, whose number may have changed. The slots that they leave belong, or
    /// belonged, to nodes, and are hidden.
    fn move_stumps(&mut self, segments: &mut SegmentBuffer) {
        let first = segments.capacity();
        let stumps = &mut segments.stumps;
        if stumps.first == first {
            return;
        }
        let whole_chunks = stumps.slots.len().next_multiple_of(FEWEST_SLOTS);
        for first in [stumps.first, first].into_iter().filter(|_| whole_chunks > 0) {
            let mut hidden = SegmentWrite::new(segments.buffer.clone());
            hidden.extend(first..first + whole_chunks);
            self.writes.push(hidden);
        }
        stumps.first = first;
        stumps.changed.extend(0..stumps.slots.len() as u32);
        for chunk in stumps.chunks.drain(..) {
            self.commands.entity(chunk).try_despawn();
        }
    }

    /// Queues changed stumps, and fits the boxes of their chunks.
    fn write_stumps(&mut self, entity: Entity, segments: &mut SegmentBuffer) {
        let first = segments.stumps.first;
        let changed = segments.stumps.take_changed();
        let mut write = SegmentWrite::new(segments.buffer.clone());
        for run in &changed {
            let out = write.extend(first + run.start..first + run.end);
            out.copy_from_slice(&segments.stumps.slots[run.clone()]);
        }
        self.writes.push(write);
        let mut chunks: Vec<usize> =
            changed.iter().flat_map(|run| run.start / FEWEST_SLOTS..run.end.div_ceil(FEWEST_SLOTS)).collect();
        chunks.dedup();
        for chunk in chunks {
            let slots = segments.stumps.slots[chunk * FEWEST_SLOTS..].iter().take(FEWEST_SLOTS);
            let mut contents = ChunkContents::default();
            contents.add(slots);
            let known = segments.stumps.chunks.get(chunk).copied();
            let at = first + chunk * FEWEST_SLOTS;
            let spawned = self.fit_chunk((entity, segments), known, at, &contents, FEWEST_SLOTS);
            segments.stumps.chunks.extend(spawned);
        }
    }
}
