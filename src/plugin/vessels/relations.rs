//! Which vessels are whose: the relation of vessel entities to their organ.

use bevy::{
    ecs::{component::Component, entity::Entity, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// The organ that the vessels on this entity belong to.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone, PartialEq)]
#[relationship(relationship_target = OrganVessels)]
pub struct VesselsOf(pub Entity);

/// The vessel entities of an organ, one for each kind. They are despawned with it.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[relationship_target(relationship = VesselsOf, linked_spawn)]
pub struct OrganVessels(Vec<Entity>);

impl OrganVessels {
    /// The vessel entities.
    pub fn entities(&self) -> &[Entity] {
        &self.0
    }
}
