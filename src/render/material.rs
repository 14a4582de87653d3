//! The material of segments: Bevy's standard material, with a vertex stage that pulls segments from a buffer.

use super::template::{ATTRIBUTE_DETAIL, ATTRIBUTE_SECOND_GOAL, ATTRIBUTE_THIRD_GOAL};
use crate::synthesis::tree::{ByKind, VesselKind};
use bevy::{
    asset::embedded_path,
    mesh::MeshVertexBufferLayoutRef,
    pbr::{ExtendedMaterial, MaterialExtension, MaterialExtensionKey, MaterialExtensionPipeline},
    prelude::*,
    render::{
        render_resource::{AsBindGroup, RenderPipelineDescriptor, SpecializedMeshPipelineError},
        storage::ShaderBuffer,
    },
    shader::ShaderRef,
};

/// The material of a vessel entity's chunks.
///
/// Its `base` is a plain [`StandardMaterial`]: change roughness, clearcoat, emission, blending or the base colour, which
/// multiplies the segments' own colours, as with any other. One material belongs to each vessel entity; find its handle in
/// [`SegmentBuffer::material`](super::SegmentBuffer::material).
pub type SegmentMaterial = ExtendedMaterial<StandardMaterial, SegmentExtension>;

/// The part of [`SegmentMaterial`] that shapes segments in the vertex stage.
#[derive(Asset, AsBindGroup, Clone, Debug, TypePath)]
pub struct SegmentExtension {
    /// [`SegmentInstance`](crate::synthesis::instances::SegmentInstance)s, one per node of the tree.
    #[storage(100, read_only, visibility(vertex))]
    pub segments: Handle<ShaderBuffer>,
}

impl SegmentExtension {
    fn shader() -> ShaderRef {
        ShaderRef::Path(bevy::asset::AssetPath::from_path_buf(embedded_path!("segments.wgsl")).with_source("embedded"))
    }
}

impl MaterialExtension for SegmentExtension {
    fn vertex_shader() -> ShaderRef {
        Self::shader()
    }

    fn prepass_vertex_shader() -> ShaderRef {
        Self::shader()
    }

    fn deferred_vertex_shader() -> ShaderRef {
        Self::shader()
    }

    fn specialize(
        _pipeline: &MaterialExtensionPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        _key: MaterialExtensionKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        // one set of inputs for all passes, which otherwise number attributes differently
        descriptor.vertex.buffers = vec![layout.0.get_layout(&[
            Mesh::ATTRIBUTE_POSITION.at_shader_location(0),
            Mesh::ATTRIBUTE_UV_0.at_shader_location(1),
            Mesh::ATTRIBUTE_NORMAL.at_shader_location(2),
            ATTRIBUTE_DETAIL.at_shader_location(3),
            ATTRIBUTE_SECOND_GOAL.at_shader_location(4),
            ATTRIBUTE_THIRD_GOAL.at_shader_location(5),
        ])?];
        // our vertex stage outputs a colour, although the mesh has no such attribute
        descriptor.vertex.shader_defs.push("VERTEX_COLORS".into());
        if let Some(fragment) = &mut descriptor.fragment {
            fragment.shader_defs.push("VERTEX_COLORS".into());
        }
        Ok(())
    }
}

/// Gives a material made from a template the opacity of a kind's colour. A translucent one is blended, unless the
/// template says how.
pub(super) fn set_opacity(material: &mut StandardMaterial, template: &StandardMaterial, opacity: f32) {
    material.base_color.set_alpha(template.base_color.alpha() * opacity);
    let is_translucent = opacity < 1.0 && template.alpha_mode == AlphaMode::Opaque;
    material.alpha_mode = if is_translucent { AlphaMode::Blend } else { template.alpha_mode };
}

/// The initial materials of new vessel entities.
///
/// Change this resource before vessels appear, or the material of one vessel entity at any time: see
/// [`SegmentMaterial`]. Base colours multiply the colours of the segments, so they stay white unless a tint is wanted.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource, Default, Clone, Debug)]
pub struct VesselMaterials(pub ByKind<StandardMaterial>);

impl Default for VesselMaterials {
    /// Moist tissue: rather smooth, with a faint clear film. Vessels with a thinner wall than arteries are a little duller.
    fn default() -> Self {
        let moist = StandardMaterial {
            perceptual_roughness: 0.35,
            reflectance: 0.5,
            clearcoat: 0.25,
            clearcoat_perceptual_roughness: 0.25,
            ..default()
        };
        let dull = StandardMaterial { perceptual_roughness: 0.42, ..moist.clone() };
        Self(ByKind::from_fn(|kind| if kind == VesselKind::Artery { moist.clone() } else { dull.clone() }))
    }
}
