//! The drawn form of a vessel entity.
//!
//! In: a new entity with [`Vessels`]. Out: its [`SegmentBuffer`], empty at first, with a material of its own.

use super::{
    chunk::{ChunkContents, SegmentChunk},
    levels::FEWEST_SLOTS,
    material::{SegmentExtension, SegmentMaterial, VesselMaterials},
    stumps::Stumps,
};
use crate::{
    plugin::{ChangeCursor, Changes, SegmentColoring, VesselAppearance, Vessels},
    synthesis::{
        instances::{SegmentColors, SegmentInstance},
        tree::VesselKind,
    },
};
use bevy::{asset::RenderAssetUsages, prelude::*, render::storage::ShaderBuffer};

/// The drawn form of a vessel entity: its buffer of segments, its material and its chunks.
///
/// Added to entities with [`Vessels`] and removed with them.
#[derive(Component, Debug)]
pub struct SegmentBuffer {
    pub(super) buffer: Handle<ShaderBuffer>,
    pub(super) material: Handle<SegmentMaterial>,
    /// The changes that have been drawn.
    pub(super) drawn: ChangeCursor,
    /// Node slots in the buffer.
    pub(super) capacity: usize,
    /// Slots that may hold segments that are not hidden.
    pub(super) written: usize,
    /// Chunk entities, in the order of their slots.
    pub(super) chunks: Vec<Entity>,
    /// The contents of each chunk.
    pub(super) contents: Vec<ChunkContents>,
    pub(super) colors: SegmentColors,
    /// The appearance that `colors` follow, `None` at first.
    look: Option<Look>,
    /// The opacity that the material follows.
    pub(super) opacity: f32,
    pub(super) warned_of_limit: bool,
    /// The remaining pieces of severed segments.
    pub(super) stumps: Stumps,
    /// Slots for stumps in the buffer, behind those of the nodes.
    pub(super) room: usize,
    /// Frames for which a mesh has been shown in place of the segments.
    covered: u32,
}

/// Frames for which segments are drawn together with a new mesh: until its data and shaders are on the graphics card.
const OVERLAP: u32 = 10;

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

    /// Counts a frame with or without a mesh in place of the segments.
    pub(super) fn note_cover(&mut self, has_mesh: bool) {
        self.covered = if has_mesh { self.covered.saturating_add(1) } else { 0 };
    }

    /// Whether a mesh is drawn, and the segments are not.
    pub(super) fn is_covered(&self) -> bool {
        self.covered > OVERLAP
    }

    /// Whether it has got its colours.
    pub(super) fn has_look(&self) -> bool {
        self.look.is_some()
    }

    /// Whether colours show the supply.
    pub(super) fn follows_supply(&self) -> bool {
        matches!(self.look, Some(Look::Supply(_)))
    }

    /// Takes over look and supply, and adds the segments whose colour changed.
    pub(super) fn adopt(&mut self, look: Look, vessels: &Vessels, supply: &[f32], changes: &mut Changes) {
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

/// The inputs of the colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Look {
    Uniform([f32; 3]),
    Supply([f32; 3]),
    Ramp(SegmentColoring),
}

impl Look {
    pub(super) fn new(appearance: &VesselAppearance, kind: VesselKind) -> Self {
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
        commands.entity(entity).try_insert(SegmentBuffer {
            buffer,
            material,
            drawn: ChangeCursor::default(),
            capacity,
            written: 0,
            chunks: Vec::new(),
            contents: Vec::new(),
            colors: SegmentColors::Uniform([1.0; 3]),
            look: None,
            opacity: 1.0,
            warned_of_limit: false,
            room: stumps.room(),
            stumps,
            covered: 0,
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
