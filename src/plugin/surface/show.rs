//! The entities that draw surfaces: one for each level of detail.
//!
//! In: changed [`VesselMesh`]es. Out: child entities with a [`SurfaceLevel`] and a mesh. They get materials, and
//! distances from which they are seen, where there is a renderer.

use crate::plugin::{
    surface::{
        settings::VesselSurface,
        vessel_mesh::{SurfaceLevel, VesselMesh},
    },
    vessels::{OrganVessels, Vessels},
};
use bevy::{
    asset::Handle,
    camera::{
        primitives::Aabb,
        visibility::{NoAutoAabb, Visibility},
    },
    ecs::{
        change_detection::DetectChangesMut,
        entity::Entity,
        hierarchy::{ChildOf, Children},
        lifecycle::Remove,
        name::Name,
        observer::On,
        query::Changed,
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    math::Vec3,
    mesh::{Mesh, Mesh3d},
    transform::components::Transform,
};

/// Surface: brings the entities that draw up to date with their surfaces.
pub(crate) fn show_surfaces(mut commands: Commands, changed: Query<(Entity, &VesselMesh), Changed<VesselMesh>>) {
    for (entity, mesh) in &changed {
        let Some((_, built)) = &mesh.built else { continue };
        let look = Look {
            handles: mesh.handles.clone(),
            visibility: if mesh.is_shown { Visibility::Inherited } else { Visibility::Hidden },
            origin: built.origin,
            // Those that have moved have a box of their own.
            aabb: (!mesh.is_moved).then_some(built.aabb),
        };
        // Silenced, since the vessels may be gone by then.
        commands.entity(entity).queue_silenced(move |vessels: EntityWorldMut| look.give_to(vessels));
    }
}

/// What the entities of a surface look like.
struct Look {
    handles: Vec<Handle<Mesh>>,
    visibility: Visibility,
    origin: Vec3,
    aabb: Option<Aabb>,
}

impl Look {
    fn give_to(self, mut vessels: EntityWorldMut) {
        let Some(known) = vessels.get::<VesselMesh>().map(|mesh| mesh.entities.clone()) else { return };
        // Levels that came with a scene or a clone draw nothing.
        let children = vessels.get::<Children>().map_or_else(Vec::new, |children| children.to_vec());
        let parent = vessels.id();
        let entities = vessels.world_scope(|world| {
            let is_level = |entity: &Entity| world.get::<SurfaceLevel>(*entity).is_some();
            let mut entities: Vec<Entity> = known.iter().copied().filter(is_level).collect();
            let surplus = entities.split_off(entities.len().min(self.handles.len()));
            let strays = children.into_iter().filter(|child| is_level(child) && !known.contains(child));
            for entity in strays.chain(surplus).collect::<Vec<_>>() {
                world.despawn(entity);
            }
            while entities.len() < self.handles.len() {
                entities.push(world.spawn((ChildOf(parent), NoAutoAabb)).id());
            }
            for (level, (&entity, handle)) in (0u32..).zip(entities.iter().zip(self.handles)) {
                let Ok(mut entity) = world.get_entity_mut(entity) else { continue };
                let place = Transform::from_translation(self.origin);
                let name = Name::new(format!("Surface {level}"));
                entity.insert((SurfaceLevel { level }, Mesh3d(handle), place, self.visibility, name));
                if let Some(aabb) = self.aabb {
                    entity.insert(aabb);
                }
            }
            entities
        });
        if let Some(mut mesh) = vessels.get_mut::<VesselMesh>() {
            // No change of the surface.
            mesh.bypass_change_detection().entities = entities;
        }
    }
}

/// Removes the surfaces of an organ that no longer asks for them. Work on them stops.
pub(crate) fn remove_surfaces(
    removed: On<Remove, VesselSurface>,
    organs: Query<&OrganVessels>,
    mut commands: Commands,
) {
    for &entity in organs.get(removed.entity).map_or(&[][..], OrganVessels::entities) {
        commands.entity(entity).try_remove::<VesselMesh>();
    }
}

/// Removes the surface of an entity that lost its vessels but still exists.
pub(crate) fn remove_surface(removed: On<Remove, Vessels>, mut commands: Commands) {
    commands.entity(removed.entity).queue_silenced(|mut vessels: EntityWorldMut| {
        vessels.remove::<VesselMesh>();
    });
}

/// Despawns the entities that drew a surface.
pub(crate) fn despawn_levels(removed: On<Remove, VesselMesh>, meshes: Query<&VesselMesh>, mut commands: Commands) {
    for &entity in meshes.get(removed.entity).map_or(&[][..], VesselMesh::entities) {
        commands.entity(entity).try_despawn();
    }
}
