//! Drawing: vessels as instanced segments, lit by Bevy's own materials.
//!
//! In: [`Vessels`](crate::plugin::Vessels) and the changes that [`ChangeLog`](crate::plugin::ChangeLog) marks. Out: a
//! picture, with shadows, prepasses and multisampling.
//!
//! A vessel entity, however large, is a handful of chunk entities that share a few meshes: many copies of a template cone
//! with round ends. The vertex stage looks up each copy's end points and radii in a storage buffer and shapes it there.
//! Growth rewrites only the slots that changed; without a change nothing happens. Severed segments show their remaining
//! pieces (see `stumps`), with a view into the lumen. Chunks are children of the vessel entity, which is a child of the
//! organ: transforms, visibility and despawning follow the hierarchy. Each chunk has its own bounding box, so that
//! parts outside the view are not drawn, and the level of detail for its size in the picture.
//!
//! A chunk has up to 4096 segments, which makes an idle frame of a million segments cheap for the CPU: Bevy's work for
//! each entity, view and shadow cascade is done a few hundred times. Smaller chunks would not be culled more often:
//! vessels grow everywhere at once, so even 256 consecutive segments reach over three quarters of an organ.
//!
//! `RenderLayers`, `NotShadowCaster` and `NotShadowReceiver` of an organ or a vessel entity hold for all that is drawn
//! of its vessels, from the frame on in which they change. A vessel entity's own layers take the place of its organ's.
//! An alpha below 1 in [`VesselAppearance::colors`] makes vessels translucent.
//!
//! A translucent organ casts the same shadow as an opaque one in Bevy, and vessels inside are dark in it: give it
//! `NotShadowCaster`.
//!
//! Once vessels have a closed mesh ([`VesselMesh`]), that is drawn in their place, by Bevy's
//! standard material, in levels of detail that fade into each other.
//!
//! Without a GPU nothing is drawn and growth goes on. With one that lacks storage buffers (WebGL 2), closed meshes are
//! drawn and segments are not, with one warning.

use crate::plugin::{SurfaceLevel, VesselAppearance, VesselMaps, VesselMesh};
use bevy::{
    asset::{AssetEventSystems, embedded_asset},
    camera::visibility::RenderLayers,
    camera::{CameraUpdateSystems, visibility::VisibilitySystems},
    ecs::schedule::common_conditions::{any_component_removed, any_match_filter, any_with_component},
    light::{NotShadowCaster, NotShadowReceiver},
    pbr::PbrPlugin,
    prelude::*,
    render::{
        ExtractSchedule, Render, RenderApp, RenderStartup, RenderSystems,
        erased_render_asset::prepare_erased_assets,
        render_asset::prepare_assets,
        renderer::{RenderAdapter, RenderDevice},
        storage::GpuShaderBuffer,
    },
};

mod buffer;
mod chunk;
mod detail;
mod levels;
mod limits;
mod material;
mod segments;
mod stumps;
mod surfaces;
mod take_over;
mod template;
mod textures;
mod upload;

pub use buffer::SegmentBuffer;
pub use chunk::SegmentChunk;
pub use limits::SegmentLimits;
pub use material::{SegmentExtension, SegmentMaterial, VesselMaterials};

use buffer::{attach_buffers, detach_buffer};
use detail::{ChunkMeshes, choose_detail};
use levels::{Detail, Shape};
use segments::update_segments;
use upload::{SegmentWrites, extract_writes, queue_scatter_pipeline, write_segments_to_gpu};

/// Draws the segments of all vessel entities.
///
/// Part of [`VesselPlugin`](crate::VesselPlugin). Add it after Bevy's `DefaultPlugins`: without a renderer it does nothing.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentRenderPlugin {
    /// Corners of a vessel's cross-section.
    ///
    /// More are rounder and slower: 6 suits millions of thin segments, 16 suits close views.
    ///
    /// Limits: 3 to 64, clamped. Default: [`Self::DEFAULT_SIDES`].
    pub sides: u32,
    /// Rings between the rim and the tip of a segment's round end.
    ///
    /// More make tips and joints rounder and slower.
    ///
    /// Limits: 0 to 16, clamped. Default: [`Self::DEFAULT_CAP_RINGS`].
    pub cap_rings: u32,
    /// Largest error of a segment's outline that drawing it with fewer corners may cause.
    ///
    /// Higher values draw distant vessels faster and more angular. 0 keeps all corners at any distance.
    ///
    /// Units: pixels. Limits: 0 to 2, clamped. Default: [`Self::DEFAULT_TOLERANCE`].
    pub tolerance: f32,
    /// Width below which segments drop out. The fewer are left, the wider they are drawn, so that vessels cover the
    /// same area and don't sparkle. A distant organ costs little.
    ///
    /// Higher values are faster, and turn thin vessels into dots sooner. Half a pixel suits 4× multisampling, which
    /// shows such thin vessels as continuous lines; without multisampling, 1 keeps distant vessels from sparkling. At 0
    /// every segment is drawn, however small, and chance decides whether it is visible.
    ///
    /// Units: pixels. Limits: 0 to 2, clamped. Default: [`Self::DEFAULT_LEAST_WIDTH`].
    pub least_width: f32,
}

impl SegmentRenderPlugin {
    /// Default of [`sides`](Self::sides).
    pub const DEFAULT_SIDES: u32 = 8;
    /// Default of [`cap_rings`](Self::cap_rings).
    pub const DEFAULT_CAP_RINGS: u32 = 1;
    /// Default of [`tolerance`](Self::tolerance).
    pub const DEFAULT_TOLERANCE: f32 = 0.25;
    /// Default of [`least_width`](Self::least_width).
    pub const DEFAULT_LEAST_WIDTH: f32 = 0.5;

    /// The settings, within their limits.
    fn detail(&self) -> Detail {
        let shape = Shape { sides: self.sides.clamp(3, 64), cap_rings: self.cap_rings.min(16) };
        let pixels = |value: f32| if value.is_nan() { 0.0 } else { value.clamp(0.0, 2.0) };
        Detail { shape, tolerance: pixels(self.tolerance), least_width: pixels(self.least_width) }
    }
}

impl Default for SegmentRenderPlugin {
    fn default() -> Self {
        Self {
            sides: Self::DEFAULT_SIDES,
            cap_rings: Self::DEFAULT_CAP_RINGS,
            tolerance: Self::DEFAULT_TOLERANCE,
            least_width: Self::DEFAULT_LEAST_WIDTH,
        }
    }
}

impl Plugin for SegmentRenderPlugin {
    fn build(&self, app: &mut App) {
        // Without a renderer, or before Bevy's own plugins: `finish` tells these apart.
        if app.get_sub_app(RenderApp).is_none() || !app.is_plugin_added::<PbrPlugin>() {
            return;
        }
        embedded_asset!(app, "segments.wgsl");
        embedded_asset!(app, "scatter.wgsl");
        app.add_plugins(MaterialPlugin::<SegmentMaterial>::default())
            .insert_resource(ChunkMeshes::new(&self.detail()))
            .init_resource::<VesselMaterials>()
            .init_resource::<SegmentWrites>()
            .add_observer(detach_buffer)
            .add_observer(surfaces::uncover)
            .configure_sets(
                PostUpdate,
                SegmentSystems
                    .before(TransformSystems::Propagate)
                    .before(AssetEventSystems)
                    .run_if(resource_exists::<SegmentLimits>),
            )
            .add_systems(
                PostUpdate,
                (
                    (attach_buffers, update_segments, surfaces::hide_covered.run_if(any_with_component::<VesselMesh>))
                        .chain()
                        .in_set(SegmentSystems),
                    choose_detail
                        .after(TransformSystems::Propagate)
                        .after(CameraUpdateSystems)
                        .before(AssetEventSystems)
                        .before(VisibilitySystems::CheckVisibility)
                        .run_if(resource_exists::<SegmentLimits>),
                ),
            );
        build_surfaces(app);
        build_textures(app);
        build_render_app(app);
    }

    fn finish(&self, app: &mut App) {
        let slots = app.world().get_resource::<ChunkMeshes>().map(ChunkMeshes::slots);
        match (app.world().get_resource::<RenderDevice>(), app.world().get_resource::<RenderAdapter>(), slots) {
            (Some(device), Some(adapter), Some(slots)) => {
                let flags = adapter.get_downlevel_capabilities().flags;
                match SegmentLimits::new(&device.limits(), flags, slots) {
                    Some(limits) => drop(app.insert_resource(limits)),
                    None => warn!(
                        "segments are not drawn: this graphics backend has no storage buffers for vertices, or no compute \
                         shaders; with a VesselSurface, vessels are drawn once they have grown"
                    ),
                }
            }
            // Plugins that were added later finish later: there may be no device yet.
            (_, _, None) if app.get_sub_app(RenderApp).is_some() => {
                warn!("vessels are not drawn: add the vessel plugin after DefaultPlugins, with PbrPlugin");
            }
            _ => {}
        }
    }
}

/// Closed meshes are drawn by any GPU.
fn build_surfaces(app: &mut App) {
    let look = (
        surfaces::dress_levels.run_if(any_match_filter::<Added<SurfaceLevel>>),
        surfaces::recolor_levels.run_if(any_match_filter::<Changed<VesselAppearance>>),
    );
    app.add_systems(
        PostUpdate,
        (
            look.chain().before(AssetEventSystems),
            take_over::take_over.after(SegmentSystems).before(TransformSystems::Propagate).run_if(
                any_match_filter::<take_over::Restyled>
                    .or_else(any_component_removed::<RenderLayers>)
                    .or_else(any_component_removed::<NotShadowCaster>)
                    .or_else(any_component_removed::<NotShadowReceiver>),
            ),
            surfaces::range_levels
                .after(TransformSystems::Propagate)
                .before(VisibilitySystems::CheckVisibility)
                .run_if(any_with_component::<VesselMesh>),
        ),
    );
}

/// So are textures.
fn build_textures(app: &mut App) {
    app.add_observer(textures::undress).add_systems(
        PostUpdate,
        (textures::take_bases, textures::dress_organs)
            .chain()
            .before(AssetEventSystems)
            .run_if(any_with_component::<VesselMaps>),
    );
}

fn build_render_app(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<SegmentWrites>()
        .add_systems(RenderStartup, queue_scatter_pipeline)
        .add_systems(ExtractSchedule, extract_writes)
        .add_systems(
            Render,
            // Bevy doesn't order materials after the buffers that they bind: a buffer that grew must be ready first, or
            // its material would go on drawing from the old one
            write_segments_to_gpu
                .in_set(RenderSystems::PrepareAssets)
                .after(prepare_assets::<GpuShaderBuffer>)
                .before(prepare_erased_assets::<MeshMaterial3d<SegmentMaterial>>),
        );
}

/// The systems that update drawn segments, in `PostUpdate`, before transforms are propagated.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SegmentSystems;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_outside_their_limits_are_clamped() {
        let wild = SegmentRenderPlugin { sides: 0, cap_rings: 99, tolerance: f32::NAN, least_width: 1e9 };
        let Detail { shape, tolerance, least_width } = wild.detail();
        assert_eq!((shape.sides, shape.cap_rings, tolerance, least_width), (3, 16, 0.0, 2.0));
    }
}
