//! Publish: writes the changes of growths to the vessel entities, where the rest of the app sees them.
//!
//! Only new and changed nodes are touched. A restart keeps the entities with all their other components.

use crate::plugin::{
    growth::{budget::GrowthFrame, progress::GrowthProgress, state::GrowthState, vasculature::Vasculature},
    lineage::Lineage,
    vessels::{
        appearance::VesselAppearance,
        change_log::ChangeLog,
        relations::{OrganVessels, VesselsOf},
        tree::Vessels,
    },
};
use crate::synthesis::{growth::GrownTree, tree::VesselKind};
use bevy::{
    camera::primitives::Aabb,
    ecs::{
        change_detection::{DetectChangesMut, ResMut},
        entity::Entity,
        hierarchy::ChildOf,
        lifecycle::Remove,
        name::Name,
        observer::On,
        query::QueryData,
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    platform::time::Instant,
};

/// The vessels of one kind of an organ, to be written.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct PublishedVessels {
    vessels: &'static mut Vessels,
    changes: &'static mut ChangeLog,
    aabb: Option<&'static mut Aabb>,
}

/// Brings the vessel entities up to date with the growths. Spawns those that are missing.
pub(crate) fn publish_vessels(
    mut commands: Commands,
    mut organs: Query<(Entity, &mut GrowthState, &VesselAppearance, Option<&OrganVessels>)>,
    mut published: Query<PublishedVessels>,
    mut frame: ResMut<GrowthFrame>,
) {
    for (organ, mut state, appearance, entities) in organs.iter_mut().filter(|(_, state, ..)| state.has_changes()) {
        let start = Instant::now();
        let entities = entities.map_or(&[][..], OrganVessels::entities);
        for kind in VesselKind::ALL {
            let is_of_kind = |&&entity: &&Entity| published.get(entity).is_ok_and(|found| found.vessels.kind() == kind);
            let entity = entities.iter().find(is_of_kind).copied();
            match news(&state, kind, entity) {
                News::None => {}
                News::Update(entity) => {
                    if let Ok(mut vessels) = published.get_mut(entity) {
                        vessels.update(&state);
                    }
                }
                News::Despawn(entity) => commands.entity(entity).try_despawn(),
                News::Spawn(grown) => {
                    spawn_vessels(&mut commands, organ, kind, (grown, state.lineage(kind)), appearance);
                }
            }
        }
        let cost = start.elapsed();
        state.clear_changes(cost);
        frame.publish_time += cost;
    }
}

/// Removes the vessels of an organ that lost its [`Vasculature`].
pub(crate) fn remove_vessels(removed: On<Remove, Vasculature>, mut commands: Commands) {
    // Silenced, since the organ itself may have been despawned; the relationship despawns the vessels then.
    commands.entity(removed.entity).queue_silenced(|mut organ: EntityWorldMut| {
        organ.despawn_related::<OrganVessels>().remove::<(GrowthState, GrowthProgress)>();
    });
}

/// The change to the vessel entity of a kind.
enum News<'a> {
    None,
    Update(Entity),
    Despawn(Entity),
    Spawn(GrownTree<'a>),
}

/// An entity stays while it may have vessels: until a growth has no roots of its kind.
fn news(state: &GrowthState, kind: VesselKind, entity: Option<Entity>) -> News<'_> {
    let rooted = state.growth().map(|growth| growth.trees()[kind].filter(|grown| !grown.tree.is_empty()));
    match (rooted, entity) {
        (Some(Some(grown)), None) => News::Spawn(grown),
        (Some(None), Some(entity)) => News::Despawn(entity),
        (Some(Some(_)) | None, Some(entity)) => News::Update(entity),
        (Some(None) | None, None) => News::None,
    }
}

impl PublishedVesselsItem<'_, '_> {
    fn update(&mut self, state: &GrowthState) {
        let kind = self.vessels.kind();
        let (grown, changed) = state.news(kind);
        self.vessels.follow(grown, state.lineage(kind), changed, &mut self.changes);
        let aabb = self.vessels.aabb();
        if let Some(known) = &mut self.aabb {
            known.set_if_neq(aabb);
        }
    }
}

fn spawn_vessels(
    commands: &mut Commands,
    organ: Entity,
    kind: VesselKind,
    (grown, lineage): (GrownTree, Lineage),
    look: &VesselAppearance,
) {
    let (mut vessels, mut changes) = (Vessels::new(kind), ChangeLog::default());
    vessels.follow(Some(grown), lineage, None, &mut changes);
    let visibility = look.visibility(kind);
    let name = Name::new(kind.plural());
    let aabb = vessels.aabb();
    // By the time this is applied, the organ may be gone or have lost its vasculature, or `grow_now` may have given it
    // these vessels.
    commands.entity(organ).queue_silenced(move |mut organ: EntityWorldMut| {
        let id = organ.id();
        if !organ.contains::<Vasculature>() {
            return;
        }
        organ.world_scope(|world| {
            let mut siblings = world.query::<(&Vessels, &VesselsOf)>();
            if !siblings.iter(world).any(|(other, of)| other.kind() == kind && of.0 == id) {
                world.spawn((ChildOf(id), VesselsOf(id), vessels, changes, aabb, visibility, name));
            }
        });
    });
}
