//! Drawing: vessels as instanced segments, lit by Bevy's own materials.
//!
//! In: [`Vessels`](crate::plugin::Vessels) and the chunks of them that [`SegmentChanges`](crate::plugin::SegmentChanges)
//! marks. Out: a picture, with shadows, prepasses and multisampling.
//!
//! A vessel entity, however large, is a handful of chunk entities that share one mesh: many copies of a template cone
//! with round ends. The vertex stage looks up each copy's end points and radii in a storage buffer and shapes it there.
//! Growth rewrites only the slots that changed; with nothing changed, nothing happens. Severed segments show what is left of
//! them, see `stumps`, with a view into the lumen. Chunks are children of the vessel
//! entity, which is a child of the organ: transforms, visibility and despawning follow the hierarchy. Each chunk has its own
//! bounding box, so parts outside the view are not drawn.
//!
//! Without a GPU, or with one that lacks storage buffers (WebGL 2), nothing is drawn and growth goes on: one warning says so.

use crate::synthesis::instances::SegmentInstance;
use bevy::{
    asset::{AssetEventSystems, embedded_asset},
    pbr::PbrPlugin,
    prelude::*,
    render::{
        ExtractSchedule, Render, RenderApp, RenderSystems,
        erased_render_asset::prepare_erased_assets,
        render_asset::prepare_assets,
        render_resource::{DownlevelFlags, WgpuLimits},
        renderer::{RenderAdapter, RenderDevice},
        storage::GpuShaderBuffer,
    },
};

mod material;
mod segments;
mod stumps;
mod template;
mod upload;

pub use material::{SegmentExtension, SegmentMaterial, VesselMaterials};
pub use segments::{SegmentBuffer, SegmentChunk};
pub use template::{SEGMENTS_PER_CHUNK, chunk_mesh};

use upload::{SegmentWrites, extract_writes, write_segments_to_gpu};

/// Draws the segments of all vessel entities.
///
/// Part of [`VesselPlugin`](crate::VesselPlugin). Add it after Bevy's `DefaultPlugins`: without a renderer it does nothing.
#[derive(Clone, Debug)]
pub struct SegmentRenderPlugin {
    /// Corners of a vessel's cross-section.
    ///
    /// More are rounder and slower: 6 suits millions of thin segments, 16 a close look.
    ///
    /// Limits: 3 to 64, clamped. Default: [`Self::DEFAULT_SIDES`].
    pub sides: u32,
    /// Rings between the rim and the tip of a segment's round end.
    ///
    /// More make tips and joints rounder and slower.
    ///
    /// Limits: 0 to 16, clamped. Default: [`Self::DEFAULT_CAP_RINGS`].
    pub cap_rings: u32,
}

impl SegmentRenderPlugin {
    /// Default of [`sides`](Self::sides).
    pub const DEFAULT_SIDES: u32 = 8;
    /// Default of [`cap_rings`](Self::cap_rings).
    pub const DEFAULT_CAP_RINGS: u32 = 1;
}

impl Default for SegmentRenderPlugin {
    fn default() -> Self {
        Self { sides: Self::DEFAULT_SIDES, cap_rings: Self::DEFAULT_CAP_RINGS }
    }
}

impl Plugin for SegmentRenderPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_none() || !app.is_plugin_added::<PbrPlugin>() {
            return;
        }
        embedded_asset!(app, "segments.wgsl");
        app.add_plugins(MaterialPlugin::<SegmentMaterial>::default());
        let mesh = chunk_mesh(self.sides.clamp(3, 64), self.cap_rings.min(16));
        let template = SegmentTemplate(app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh));
        app.insert_resource(template)
            .init_resource::<VesselMaterials>()
            .init_resource::<SegmentWrites>()
            .add_observer(segments::detach_buffer)
            .configure_sets(
                PostUpdate,
                SegmentSystems
                    .before(TransformSystems::Propagate)
                    .before(AssetEventSystems)
                    .run_if(resource_exists::<SegmentLimits>),
            )
            .add_systems(
                PostUpdate,
                (segments::attach_buffers, segments::update_segments).chain().in_set(SegmentSystems),
            );
        build_render_app(app);
    }

    fn finish(&self, app: &mut App) {
        let draws = app.world().contains_resource::<SegmentTemplate>();
        match (app.world().get_resource::<RenderDevice>(), app.world().get_resource::<RenderAdapter>()) {
            (Some(device), Some(adapter)) if draws => {
                let flags = adapter.get_downlevel_capabilities().flags;
                match SegmentLimits::new(&device.limits(), flags) {
                    Some(limits) => drop(app.insert_resource(limits)),
                    None => warn!("vessels are not drawn: this graphics backend has no storage buffers for vertices"),
                }
            }
            (Some(_), _) => warn!("vessels are not drawn: add the vessel plugin after DefaultPlugins, with PbrPlugin"),
            (None, _) => {}
        }
    }
}

fn build_render_app(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app.init_resource::<SegmentWrites>().add_systems(ExtractSchedule, extract_writes).add_systems(
        Render,
        // Bevy doesn't order materials after the buffers that they bind: one that grew must be there first, or its
        // material would go on drawing from the old one
        write_segments_to_gpu
            .in_set(RenderSystems::PrepareAssets)
            .after(prepare_assets::<GpuShaderBuffer>)
            .before(prepare_erased_assets::<MeshMaterial3d<SegmentMaterial>>),
    );
}

/// The systems that bring drawn segments up to date, in `PostUpdate`, before transforms are propagated.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SegmentSystems;

/// The chunk mesh that all vessel entities share.
#[derive(Resource, Debug)]
struct SegmentTemplate(Handle<Mesh>);

/// What the GPU can take. Present only where segments are drawn.
#[derive(Resource, Clone, Copy, Debug)]
pub struct SegmentLimits {
    max_segments: usize,
}

impl SegmentLimits {
    /// `None` when the vertex stage can't read storage buffers.
    fn new(limits: &WgpuLimits, flags: DownlevelFlags) -> Option<Self> {
        if !flags.contains(DownlevelFlags::VERTEX_STORAGE) || limits.max_storage_buffers_per_shader_stage == 0 {
            return None;
        }
        let bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        // mesh tags and node indices are 32-bit
        let segments = (bytes / SegmentInstance::SIZE as u64).min(1 << 31) as usize;
        Some(Self { max_segments: segments - segments % SEGMENTS_PER_CHUNK })
    }

    /// Segments of one vessel entity that can be drawn: those that fit in a storage buffer.
    pub fn max_segments(&self) -> usize {
        self.max_segments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_whole_chunks_that_fit_in_a_buffer() {
        let device = WgpuLimits { max_storage_buffer_binding_size: 1 << 20, max_buffer_size: 1 << 30, ..default() };
        let limits = SegmentLimits::new(&device, DownlevelFlags::all()).unwrap();
        assert_eq!(limits.max_segments() % SEGMENTS_PER_CHUNK, 0);
        let bytes = limits.max_segments() * SegmentInstance::SIZE;
        assert!(bytes <= 1 << 20 && bytes > (1 << 20) - SEGMENTS_PER_CHUNK * SegmentInstance::SIZE);
    }

    #[test]
    fn devices_without_storage_buffers_draw_nothing() {
        let without_vertex_storage = DownlevelFlags::all() - DownlevelFlags::VERTEX_STORAGE;
        assert!(SegmentLimits::new(&WgpuLimits::default(), without_vertex_storage).is_none());
        let none = WgpuLimits::downlevel_webgl2_defaults();
        assert!(SegmentLimits::new(&none, DownlevelFlags::all()).is_none());
    }
}
