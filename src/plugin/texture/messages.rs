//! What becomes of textures.

use crate::plugin::{job::JobPanic, organ::mesh::OrganMeshError};
use crate::synthesis::texture::BakeError;
use bevy::{
    ecs::{
        entity::Entity,
        event::EntityEvent,
        message::Message,
        reflect::{ReflectEvent, ReflectMessage},
    },
    reflect::Reflect,
};

/// The maps of an organ are ready. Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct TextureReady {
    /// The entity with the [`VesselTexture`](crate::plugin::VesselTexture).
    #[event_target]
    pub organ: Entity,
}

/// The maps of an organ could not be made; its vessels stay. Changing the settings, the mesh or the vessels tries again.
/// Also an event on the organ, for observers.
#[derive(Message, EntityEvent, Clone, Debug, PartialEq, Reflect)]
#[reflect(Message, Event, Clone, PartialEq)]
pub struct TextureFailed {
    /// The entity with the [`VesselTexture`](crate::plugin::VesselTexture).
    #[event_target]
    pub organ: Entity,
    /// What was wrong, with the value and the remedy.
    pub error: VesselTextureError,
}

/// Why an organ has no maps.
#[derive(Clone, Debug, PartialEq, thiserror::Error, Reflect)]
#[reflect(opaque, Clone, Debug, PartialEq)]
pub enum VesselTextureError {
    /// The organ has no mesh.
    #[error("the organ has no Mesh3d; only the texture of a mesh can show vessels")]
    NoMesh,
    /// The mesh cannot be an organ.
    #[error(transparent)]
    Mesh(#[from] OrganMeshError),
    /// The picture between the vessels is not in main memory, or has a format without colours.
    #[error(
        "the picture of the organ's texture can't be read ({reason}); load it with RenderAssetUsages::MAIN_WORLD | \
         RenderAssetUsages::RENDER_WORLD, or give the organ another TextureBase"
    )]
    BaseImage {
        /// What is wrong with it.
        reason: String,
    },
    /// The texture coordinates or the settings don't allow it.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// The work on it panicked.
    #[error(transparent)]
    Panicked(#[from] JobPanic),
}
