//! Publish: what the growths changed becomes visible to the rest of the app, on the vessel entities.
//!
//! Only new and changed nodes are touched. A restart keeps the entities, so whatever else is on them stays.

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

/// The vessels of one system of an organ, to be written.
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
    for (organ, mut state, appearance, entities) in organs.iter_mut().filter(|(_, state, ..)| state.has_news()) {
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
        state.clear_news(cost);
        frame.publish_time += cost;
    }
}

/// An organ that is to have no vessels any more loses them.
pub(crate) fn remove_vessels(removed: On<Remove, Vasculature>, mut commands: Commands) {
    // Silenced, since the organ itself may have been despawned; the vessels follow it by their relationship then.
    commands.entity(removed.entity).queue_silenced(|mut organ: EntityWorldMut| {
        organ.despawn_related::<OrganVessels>().remove::<(GrowthState, GrowthProgress)>();
    });
}

/// What happens to the vessel entity of a kind.
enum News<'a> {
    None,
    Update(Entity),
    Despawn(Entity),
    Spawn(GrownTree<'a>),
}

/// An entity stays while there may be vessels for it: until a growth has no roots of its kind.
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
    // The organ may be gone, or have got these vessels by `grow_now`, by the time that this is applied.
    commands.entity(organ).queue_silenced(move |mut organ: EntityWorldMut| {
        let id = organ.id();
        organ.world_scope(|world| {
            let mut siblings = world.query::<(&Vessels, &VesselsOf)>();
            if !siblings.iter(world).any(|(other, of)| other.kind() == kind && of.0 == id) {
                world.spawn((ChildOf(id), VesselsOf(id), vessels, changes, aabb, visibility, name));
            }
        });
    });
}
