//! What makes an organ's vessels cuttable, and the ledger of what was done to them.
//!
//! In: [`Cuttable`] on an organ. Out: [`VesselWounds`] on each of its vessel entities, which a regrowth clears.

use crate::plugin::{
    circulation::CirculationState,
    components::OrganVessels,
    cutting::CuttableVessels,
    open_ends::{OpenEndEntities, despawn_children},
    segment_changes::SegmentChanges,
    vessel_index::VesselIndex,
    vessels::{Lineage, Vessels},
};
use crate::synthesis::{
    tree::{Place, VesselTree},
    wound::{ClampId, Retraction, WoundReport, Wounds},
};
use bevy::{
    ecs::{
        change_detection::{DetectChangesMut, ResMut},
        component::Component,
        entity::Entity,
        lifecycle::Remove,
        observer::On,
        query::{Changed, Or, With, Without},
        reflect::ReflectComponent,
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    log::warn,
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::{collections::BTreeSet, ops::Deref};

/// Lets an organ's vessels be cut, clamped and cauterised: put it beside the organ's
/// [`Vasculature`](crate::plugin::Vasculature), or on an organ with vessels of your own.
///
/// An organ without it pays nothing for it. Add a [`Perfusion`](crate::plugin::Perfusion), too, and open vessels bleed.
/// Removing it makes the vessels whole again.
///
/// ```
/// # use bevy_vessels::{plugin::{Cuttable, Vasculature}, synthesis::preset::PresetName};
/// let organ = (Vasculature::new(PresetName::Colon), Cuttable::default());
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct Cuttable {
    /// How far the ends of later cuts draw back, so that a gap is seen.
    pub retraction: Retraction,
}

/// All that was done to the vessels of a vessel entity. For reading, as a [`Wounds`]: operate through
/// [`CuttableVessels`](crate::plugin::CuttableVessels).
///
/// Changed only in frames in which something was done. The segments that an action changed are marked in the entity's
/// [`SegmentChanges`].
#[derive(Component, Debug, Default)]
pub struct VesselWounds {
    wounds: Wounds,
    lineage: Lineage,
    clamps: BTreeSet<ClampId>,
}

impl VesselWounds {
    /// The ledger.
    pub fn ledger(&self) -> &Wounds {
        &self.wounds
    }

    /// The clamps that are on, in the order in which they were put on, and where.
    pub fn clamps(&self) -> impl Iterator<Item = (ClampId, Place)> + '_ {
        self.clamps.iter().filter_map(|&clamp| Some((clamp, self.wounds.clamp_place(clamp)?)))
    }

    pub(crate) fn ledger_mut(&mut self) -> &mut Wounds {
        &mut self.wounds
    }

    /// Takes note of what an action changed.
    pub(crate) fn note(&mut self, report: &WoundReport, changes: &mut SegmentChanges) {
        self.clamps.extend(&report.clamped);
        for clamp in &report.unclamped {
            self.clamps.remove(clamp);
        }
        report.changed.iter().for_each(|node| changes.mark_node(node.index()));
    }

    /// Whether the ledger is that of these vessels.
    pub(crate) fn is_of(&self, vessels: &Vessels) -> bool {
        self.lineage == vessels.lineage()
    }

    /// Forgets the wounds of an earlier growth.
    fn begin_anew(&mut self, vessels: &Vessels) {
        self.lineage = vessels.lineage();
        self.wounds.clear();
        self.clamps.clear();
    }
}

impl Deref for VesselWounds {
    type Target = Wounds;

    fn deref(&self) -> &Wounds {
        &self.wounds
    }
}

/// Cut: gives a ledger to the vessels of cuttable organs, and makes all ledgers those of the present vessels.
pub(crate) fn attach_wounds(
    mut commands: Commands,
    organs: Query<&OrganVessels, With<Cuttable>>,
    bare: Query<(), (With<Vessels>, Without<VesselWounds>)>,
) {
    for entity in organs.iter().flat_map(|vessels| vessels.entities()).filter(|&&entity| bare.contains(entity)) {
        commands.entity(*entity).insert((VesselWounds::default(), VesselIndex::default(), OpenEndEntities::default()));
    }
}

/// Cut and Publish: vessels that grew anew have no wounds.
pub(crate) fn clear_outdated(
    mut vessels: Query<(Entity, &Vessels, &mut VesselWounds)>,
    mut door: ResMut<CuttableVessels>,
) {
    for (entity, vessels, mut wounds) in &mut vessels {
        if !wounds.is_of(vessels) {
            door.bypass_change_detection().forget(entity);
            if wounds.is_empty() {
                wounds.bypass_change_detection().begin_anew(vessels);
            } else {
                wounds.begin_anew(vessels);
            }
        }
    }
}

/// Cut: ledgers follow changed settings.
pub(crate) fn follow_settings(
    organs: Query<(Entity, &Cuttable, &OrganVessels), Or<(Changed<Cuttable>, Changed<OrganVessels>)>>,
    mut wounds: Query<&mut VesselWounds>,
) {
    for (organ, cuttable, vessels) in &organs {
        let mut wounds = wounds.iter_many_mut(vessels.entities());
        while let Some(mut wounds) = wounds.fetch_next() {
            let ledger = wounds.bypass_change_detection().ledger_mut();
            if let Err(error) = ledger.set_retraction(cuttable.retraction) {
                warn!("{organ}: ends go on drawing back as before: {error}");
                break;
            }
        }
    }
}

/// Vessels that are no longer cuttable are whole.
pub(crate) fn remove_wounds(
    removed: On<Remove, Cuttable>,
    mut organs: Query<(&OrganVessels, Option<&mut CirculationState>)>,
    mut vessels: Query<(&OpenEndEntities, &mut SegmentChanges)>,
    mut commands: Commands,
) {
    let Ok((entities, circulation)) = organs.get_mut(removed.entity) else { return };
    if let Some(mut circulation) = circulation {
        circulation.lay_again();
    }
    for &entity in entities.entities() {
        let Ok((ends, mut changes)) = vessels.get_mut(entity) else { continue };
        let closed = ends.iter().map(|(_, end)| end).collect();
        commands.entity(entity).queue_silenced(|vessels: EntityWorldMut| despawn_children(vessels, closed));
        changes.mark_all();
        commands.entity(entity).try_remove::<(VesselWounds, VesselIndex, OpenEndEntities)>();
    }
}

/// A ledger that is gone can't undo anything.
pub(crate) fn forget_ledger(removed: On<Remove, VesselWounds>, mut door: ResMut<CuttableVessels>) {
    door.forget(removed.entity);
}

/// Number of bifurcations between a segment and its root.
pub(crate) fn generation(vessels: &Vessels, place: Place) -> u32 {
    let tree: &VesselTree = vessels.tree();
    let above = std::iter::successors(tree.parent(place.node), |&node| tree.parent(node));
    above.filter(|node| vessels.children(node.index()).nth(1).is_some()).count() as u32
}
