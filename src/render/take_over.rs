//! Drawn entities look as their organ or vessel entity says: on which layers, and with which shadows.
//!
//! In: [`RenderLayers`], [`NotShadowCaster`] and [`NotShadowReceiver`] on an organ or a vessel entity. Out: the same on
//! the entities that draw: chunks of segments, stumps and closed meshes. Visibility needs nothing: it follows the
//! hierarchy.

use super::{buffer::SegmentBuffer, chunk::SegmentChunk};
use crate::plugin::{SurfaceLevel, VesselMesh, Vessels, VesselsOf};
use bevy::{
    camera::visibility::RenderLayers,
    ecs::query::QueryData,
    light::{NotShadowCaster, NotShadowReceiver},
    prelude::*,
};

/// What is taken over.
#[derive(QueryData)]
pub(super) struct Shown {
    layers: Option<&'static RenderLayers>,
    casts_none: Has<NotShadowCaster>,
    receives_none: Has<NotShadowReceiver>,
}

/// The entities that draw.
pub(super) type Drawing = Or<(With<SegmentChunk>, With<SurfaceLevel>)>;

/// What may have changed: something is drawn anew, or shown otherwise.
pub(super) type Restyled = Or<(
    Added<SegmentChunk>,
    Added<SurfaceLevel>,
    Changed<RenderLayers>,
    Added<NotShadowCaster>,
    Added<NotShadowReceiver>,
)>;

/// Brings the entities that draw up to date. A vessel entity's own layers take the place of its organ's.
pub(super) fn take_over(
    vessels: Query<(&VesselsOf, Shown, Option<&SegmentBuffer>, Option<&VesselMesh>), With<Vessels>>,
    organs: Query<Shown>,
    drawn: Query<Shown, Drawing>,
    mut commands: Commands,
) {
    for (of, own, segments, mesh) in &vessels {
        let organ = organs.get(of.0).ok();
        let layers = own.layers.or(organ.as_ref().and_then(|organ| organ.layers));
        let casts_none = own.casts_none || organ.as_ref().is_some_and(|organ| organ.casts_none);
        let receives_none = own.receives_none || organ.as_ref().is_some_and(|organ| organ.receives_none);
        let chunks = segments.into_iter().flat_map(|segments| segments.chunks().iter().chain(segments.stump_chunks()));
        for &entity in chunks.chain(mesh.into_iter().flat_map(|mesh| mesh.entities())) {
            let Ok(now) = drawn.get(entity) else { continue };
            if now.layers != layers {
                set(&mut commands, entity, layers.cloned());
            }
            if now.casts_none != casts_none {
                set(&mut commands, entity, casts_none.then_some(NotShadowCaster));
            }
            if now.receives_none != receives_none {
                set(&mut commands, entity, receives_none.then_some(NotShadowReceiver));
            }
        }
    }
}

/// Gives a component to an entity, or takes it away.
fn set<C: Component>(commands: &mut Commands, entity: Entity, component: Option<C>) {
    match component {
        Some(component) => drop(commands.entity(entity).try_insert(component)),
        None => drop(commands.entity(entity).try_remove::<C>()),
    }
}
