//! Publish: what the growths changed becomes visible to the rest of the app, on the vessel entities.
//!
//! Only new and changed nodes are touched. A restart keeps the entities, so whatever else is on them stays.

use crate::plugin::{
    components::{GrowthProgress, OrganVessels, Vasculature, VesselAppearance, VesselSystem, VesselsOf},
    growth::GrowthFrame,
    growth_state::GrowthState,
    segment_changes::SegmentChanges,
    vessel_index::VesselIndex,
    vessels::{Lineage, Vessels},
};
use crate::synthesis::{colonization::Growth, tree::System};
use bevy::{
    camera::{primitives::Aabb, visibility::Visibility},
    ecs::{
        change_detection::{DetectChangesMut, ResMut},
        entity::Entity,
        hierarchy::ChildOf,
        lifecycle::Remove,
        name::Name,
        observer::On,
        query::{Changed, QueryData},
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    platform::time::Instant,
};

/// The vessels of one system of an organ, to be written.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct PublishedVessels {
    system: &'static VesselSystem,
    vessels: &'static mut Vessels,
    changes: &'static mut SegmentChanges,
    aabb: &'static mut Aabb,
    index: Option<&'static mut VesselIndex>,
}

/// Brings the vessel entities up to date with the growths. Spawns those that are missing.
pub(crate) fn publish_vessels(
    mut commands: Commands,
    mut organs: Query<(Entity, &mut GrowthState, &VesselAppearance, Option<&OrganVessels>)>,
    mut published: Query<PublishedVessels>,
    mut frame: ResMut<GrowthFrame>,
) {
    for (organ, mut state, appearance, entities) in organs.iter_mut().filter(|(_, state, ..)| state.has_news()) {
        let start = Instant::now();
        let entities = entities.map_or(&[][..], OrganVessels::entities);
        for system in System::ALL {
            let is_of_system = |&&entity: &&Entity| published.get(entity).is_ok_and(|found| found.system.0 == system);
            let entity = entities.iter().find(is_of_system).copied();
            match news(&state, system, entity) {
                News::None => {}
                News::Update(entity) => {
                    if let Ok(mut vessels) = published.get_mut(entity) {
                        vessels.update(&state);
                    }
                }
                News::Despawn(entity) => commands.entity(entity).try_despawn(),
                News::Spawn(growth) => {
                    spawn_vessels(&mut commands, organ, system, (growth, state.lineage()), appearance);
                }
            }
        }
        let cost = start.elapsed();
        state.clear_news(cost);
        frame.publish_time += cost;
    }
}

/// Shows and hides systems as the organ's appearance says.
pub(crate) fn show_systems(
    organs: Query<(&VesselAppearance, &OrganVessels), Changed<VesselAppearance>>,
    mut vessels: Query<(&VesselSystem, &mut Visibility)>,
) {
    for (appearance, entities) in &organs {
        let mut vessels = vessels.iter_many_mut(entities.entities());
        while let Some((system, mut visibility)) = vessels.fetch_next() {
            visibility.set_if_neq(visibility_of(appearance, system.0));
        }
    }
}

/// An organ that is to have no vessels any more loses them.
pub(crate) fn remove_vessels(removed: On<Remove, Vasculature>, mut commands: Commands) {
    // Silenced, since the organ itself may have been despawned; the vessels follow it by their relationship then.
    commands.entity(removed.entity).queue_silenced(|mut organ: EntityWorldMut| {
        organ.despawn_related::<OrganVessels>().remove::<(GrowthState, GrowthProgress)>();
    });
}

/// What happens to the vessel entity of a system.
enum News<'a> {
    None,
    Update(Entity),
    Despawn(Entity),
    Spawn(&'a Growth),
}

/// An entity stays while there may be vessels for it: until a growth has no roots in its system.
fn news(state: &GrowthState, system: System, entity: Option<Entity>) -> News<'_> {
    let rooted = state.growth().map(|growth| (!growth.tree(system).is_empty()).then_some(growth));
    match (rooted, entity) {
        (Some(Some(growth)), None) => News::Spawn(growth),
        (Some(None), Some(entity)) => News::Despawn(entity),
        (Some(Some(_)) | None, Some(entity)) => News::Update(entity),
        (Some(None) | None, None) => News::None,
    }
}

impl PublishedVesselsItem<'_, '_> {
    fn update(&mut self, state: &GrowthState) {
        let (growth, changed) = state.news(self.system.0);
        self.vessels.follow(growth, state.lineage(), self.system.0, changed, &mut self.changes);
        if let Some(index) = &mut self.index {
            index.note_moved(&self.vessels, changed);
        }
        let aabb = self.vessels.aabb();
        self.aabb.set_if_neq(aabb);
    }
}

fn spawn_vessels(
    commands: &mut Commands,
    organ: Entity,
    system: System,
    (growth, lineage): (&Growth, Lineage),
    look: &VesselAppearance,
) {
    let (mut vessels, mut changes) = (Vessels::default(), SegmentChanges::default());
    vessels.follow(Some(growth), lineage, system, None, &mut changes);
    let visibility = visibility_of(look, system);
    let name = Name::new(match system {
        System::Arterial => "Arteries",
        System::Venous => "Veins",
    });
    let aabb = vessels.aabb();
    // The organ may be gone, or have got these vessels by `grow_now`, by the time that this is applied.
    commands.entity(organ).queue_silenced(move |mut organ: EntityWorldMut| {
        let id = organ.id();
        organ.world_scope(|world| {
            let mut siblings = world.query::<(&VesselSystem, &VesselsOf)>();
            if !siblings.iter(world).any(|(other, of)| other.0 == system && of.0 == id) {
                let relations = (ChildOf(id), VesselsOf(id));
                world.spawn((relations, VesselSystem(system), vessels, changes, aabb, visibility, name));
            }
        });
    });
}

fn visibility_of(appearance: &VesselAppearance, system: System) -> Visibility {
    if appearance.shows(system) { Visibility::Inherited } else { Visibility::Hidden }
}
