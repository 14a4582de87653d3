//! The relationship between vessel entities and their organ.

use bevy::{
    ecs::{
        change_detection::DetectChanges,
        component::Component,
        entity::Entity,
        hierarchy::{ChildOf, Children},
        query::Added,
        reflect::ReflectComponent,
        system::{Commands, Query},
    },
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// The organ that the vessels on this entity belong to.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone, PartialEq)]
#[relationship(relationship_target = OrganVessels)]
pub struct VesselsOf(pub Entity);

/// The vessel entities of an organ, one for each kind. They are despawned with the organ.
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

/// Repairs the relationships of organs that came with a scene or are clones.
///
/// A scene may hold an organ without its vessels, whose entities don't exist then. When Bevy clones entities that are
/// related in two ways, as an organ and its vessels are, it maps one relationship to entities that never exist.
pub(crate) fn mend_relations(
    mut organs: Query<(Entity, &mut OrganVessels)>,
    new_vessels: Query<(Entity, &VesselsOf, Option<&ChildOf>), Added<VesselsOf>>,
    vessels: Query<&VesselsOf>,
    parents: Query<&Children>,
    mut commands: Commands,
) {
    for (organ, mut entities) in organs.iter_mut().filter(|(_, entities)| entities.is_added()) {
        let is_its = |entity: &Entity| vessels.get(*entity).is_ok_and(|of| of.0 == organ);
        if !entities.0.iter().all(is_its) {
            entities.0.retain(is_its);
        }
    }
    for (entity, organ, parent) in &new_vessels {
        if let Ok((_, mut entities)) = organs.get_mut(organ.0)
            && !entities.0.contains(&entity)
        {
            entities.0.push(entity);
        }
        if let Some(parent) = parent.map(ChildOf::parent)
            && parents.get(parent).is_ok_and(|children| !children.contains(&entity))
        {
            commands.entity(entity).try_insert(ChildOf(parent));
        }
    }
}
