//! Open ends of severed vessels as entities, for particles, sounds and instruments where blood leaves.
//!
//! In: the ledgers in [`VesselWounds`]. Out: one entity with an [`OpenEnd`] for each open lumen, a child of its vessel
//! entity. It moves with the tissue and is despawned when the lumen closes.

use crate::plugin::vessels::{relations::VesselsOf, tree::Vessels, wounds::VesselWounds};
use crate::synthesis::tree::VesselTree;
use crate::synthesis::{
    haemodynamics::EndState,
    tree::{Place, VesselKind},
    units::{Flow, Pressure, Volume},
    wound::{EndId, EndSide, SeveredEnd},
};
use bevy::{
    camera::visibility::Visibility,
    ecs::{
        component::Component,
        entity::Entity,
        hierarchy::{ChildOf, Children},
        query::{Added, Changed, Or},
        reflect::ReflectComponent,
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    math::Vec3,
    reflect::{Reflect, std_traits::ReflectDefault},
    transform::components::Transform,
};
use std::collections::{BTreeMap, BTreeSet};

/// An open end of a severed vessel. Read-only: the plugin writes it.
///
/// The entity's `Transform` is at the end's tip and its forward direction points out of the lumen, in the space of the
/// organ's mesh. Blood leaves it only where the organ has a [`Perfusion`](crate::plugin::Perfusion).
///
/// A particle system, on the CPU or the GPU, needs only these entities: emit [`flow`](Self::flow) times the frame's
/// duration at the `GlobalTransform`, with [`velocity`](Self::velocity) along its forward direction. The entity is
/// spawned with its end and despawned when that closes. [`BleedingStarted`](crate::plugin::BleedingStarted) and
/// [`BleedingStopped`](crate::plugin::BleedingStopped) tell when it bleeds.
///
/// ```
/// # use bevy_vessels::plugin::OpenEnd;
/// # use bevy::prelude::{GlobalTransform, Query, Res, Time, Vec3};
/// fn emit(time: Res<Time>, ends: Query<(&OpenEnd, &GlobalTransform)>) {
///     for (end, place) in &ends {
///         let millilitres = end.flow.ml_per_min() / 60.0 * time.delta_secs_f64();
///         let (from, speed): (Vec3, Vec3) = (place.translation(), end.velocity as f32 * place.forward());
/// #       let _ = (millilitres, from, speed);
///     }
/// }
/// # bevy::ecs::system::assert_is_system(emit);
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone, PartialEq)]
#[require(Transform, Visibility)]
pub struct OpenEnd {
    /// The organ.
    #[entities]
    pub organ: Entity,
    /// The vessel entity.
    #[entities]
    pub vessels: Entity,
    /// The kind of the severed vessel.
    pub kind: VesselKind,
    /// Its identifier in the ledger.
    pub id: EndId,
    /// Its place on the tree.
    pub place: Place,
    /// Its side of the cut.
    pub side: EndSide,
    /// Position in the space of the organ's mesh.
    pub position: Vec3,
    /// Unit vector out of the lumen, in the space of the organ's mesh.
    pub direction: Vec3,
    /// Radius of the vessel, in tissue lengths.
    pub radius: f32,
    /// Number of bifurcations between the root and here.
    pub bifurcations: u32,
    /// The blood that leaves it, as a mean over the last frame.
    pub flow: Flow,
    /// Pressure in the vessel before the hole.
    pub pressure: Pressure,
    /// Mean velocity in the hole, in m/s: how fast a drop leaves.
    pub velocity: f64,
    /// Volume lost since it was opened.
    pub lost: Volume,
    /// Whether it bleeds, and why not.
    pub state: EndState,
}

impl OpenEnd {
    fn new(organ: Entity, vessels: Entity, kind: VesselKind, end: &SeveredEnd, bifurcations: u32) -> Self {
        Self {
            organ,
            vessels,
            kind,
            id: end.id,
            place: end.place,
            side: end.side,
            position: end.position,
            direction: end.direction,
            radius: end.radius,
            bifurcations,
            flow: Flow::ZERO,
            pressure: Pressure::ZERO,
            velocity: 0.0,
            lost: Volume::ZERO,
            state: EndState::Dry,
        }
    }

    /// Stops bleeding, because the vessel no longer carries blood.
    pub(crate) fn dry(&mut self) {
        (self.flow, self.pressure, self.velocity) = (Flow::ZERO, Pressure::ZERO, 0.0);
        self.state = EndState::Dry;
    }

    /// Its position and direction.
    fn pose(end: &SeveredEnd) -> Transform {
        Transform::from_translation(end.position).looking_to(end.direction, end.direction.any_orthogonal_vector())
    }
}

/// The entities of the open ends of a vessel entity.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[component(clone_behavior = Ignore)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct OpenEndEntities(BTreeMap<EndId, Entity>);

impl OpenEndEntities {
    /// The entity of an end, while the end is open.
    pub fn get(&self, end: EndId) -> Option<Entity> {
        self.0.get(&end).copied()
    }

    /// All ends, in the order of their creation.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (EndId, Entity)> + '_ {
        self.0.iter().map(|(&end, &entity)| (end, entity))
    }
}

/// Cut: despawns open ends that came with a scene or a clone; the wounds of the vessels spawn new ones.
pub(crate) fn despawn_strays(
    mut commands: Commands,
    new: Query<(Entity, &OpenEnd), Added<OpenEnd>>,
    vessels: Query<&OpenEndEntities>,
) {
    for (entity, end) in &new {
        let is_known = vessels.get(end.vessels).is_ok_and(|entities| entities.get(end.id) == Some(entity));
        if !is_known {
            commands.entity(entity).try_despawn();
        }
    }
}

/// Cut: spawns an entity for each end that has opened, and despawns the entities of closed ends.
pub(crate) fn spawn_open_ends(
    mut commands: Commands,
    mut vessels: Query<(Entity, &VesselsOf, &Vessels, &VesselWounds, &mut OpenEndEntities), Changed<VesselWounds>>,
) {
    for (entity, organ, vessels, wounds, mut entities) in &mut vessels {
        let mut before = std::mem::take(&mut entities.0);
        for end in wounds.ends(vessels.tree()).filter(|end| end.is_open) {
            let spawned = before.remove(&end.id).unwrap_or_else(|| {
                let bifurcations = bifurcations_above(vessels, end.place);
                let open_end = OpenEnd::new(organ.0, entity, vessels.kind(), &end, bifurcations);
                commands.spawn((open_end, OpenEnd::pose(&end), ChildOf(entity))).id()
            });
            entities.0.insert(end.id, spawned);
        }
        if !before.is_empty() {
            let closed = before.into_values().collect();
            commands.entity(entity).queue_silenced(|vessels: EntityWorldMut| despawn_children(vessels, closed));
        }
    }
}

/// Despawns many children at once: one by one, each would be looked for among all of them.
pub(crate) fn despawn_children(mut parent: EntityWorldMut, unwanted: Vec<Entity>) {
    let unwanted: BTreeSet<Entity> = unwanted.into_iter().collect();
    let children = parent.get::<Children>().into_iter().flatten().copied();
    let (gone, kept): (Vec<Entity>, Vec<Entity>) = children.partition(|child| unwanted.contains(child));
    parent.replace_related_with_difference::<ChildOf>(&gone, &kept, &[]);
    let world = parent.into_world_mut();
    // This includes those that the app has given another parent.
    for child in unwanted {
        world.try_despawn(child).ok();
    }
}

/// Publish: moves open ends with their vessels.
pub(crate) fn move_open_ends(
    vessels: Query<(&Vessels, &VesselWounds, &OpenEndEntities), Or<(Changed<Vessels>, Changed<VesselWounds>)>>,
    mut ends: Query<(&mut OpenEnd, &mut Transform)>,
) {
    for (vessels, wounds, entities) in vessels.iter().filter(|(vessels, wounds, _)| wounds.is_of(vessels)) {
        for (id, entity) in entities.iter() {
            let (Some(now), Ok((mut end, mut transform))) = (wounds.end(id, vessels.tree()), ends.get_mut(entity))
            else {
                continue;
            };
            let moved = OpenEnd {
                place: now.place,
                position: now.position,
                direction: now.direction,
                radius: now.radius,
                ..*end
            };
            if *end != moved {
                *end = moved;
                *transform = OpenEnd::pose(&now);
            }
        }
    }
}

/// Number of bifurcations between a segment and its root.
fn bifurcations_above(vessels: &Vessels, place: Place) -> u32 {
    let tree: &VesselTree = vessels.tree();
    let above = std::iter::successors(tree.parent(place.node), |&node| tree.parent(node));
    above.filter(|node| vessels.children(node.index()).nth(1).is_some()).count() as u32
}
