//! The ledgers that record the wounds of an organ's vessels.
//!
//! In: [`Cuttable`] on an organ. Out: [`VesselWounds`] on each of its vessel entities, which a regrowth clears.

use crate::plugin::{
    surgery::{
        cuttable::Cuttable,
        cuttable_vessels::CuttableVessels,
        open_ends::{OpenEndEntities, despawn_children},
    },
    vessels::{
        change_log::ChangeLog, index::VesselIndex, relations::OrganVessels, tree::Vessels, wounds::VesselWounds,
    },
};
use bevy::{
    ecs::{
        change_detection::{DetectChangesMut, ResMut},
        entity::Entity,
        lifecycle::Remove,
        observer::On,
        query::{Changed, Or, With, Without},
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    log::warn,
};

/// Cut: gives a ledger to the vessels of cuttable organs.
pub(crate) fn attach_wounds(
    mut commands: Commands,
    organs: Query<&OrganVessels, With<Cuttable>>,
    bare: Query<&VesselIndex, (With<Vessels>, Or<(Without<VesselWounds>, Without<OpenEndEntities>)>)>,
) {
    for &entity in organs.iter().flat_map(|vessels| vessels.entities()) {
        let Ok(index) = bare.get(entity) else { continue };
        index.prepare();
        // Vessels from a scene have a ledger already.
        commands.entity(entity).try_insert_if_new((VesselWounds::default(), OpenEndEntities::default()));
    }
}

/// Cut: clears the wounds of vessels that grew again, except those that they were saved with.
pub(crate) fn clear_outdated(
    mut vessels: Query<(Entity, &Vessels, &mut VesselWounds)>,
    mut door: ResMut<CuttableVessels>,
) {
    for (entity, vessels, mut wounds) in &mut vessels {
        if let Some(saved) = wounds.saved() {
            if vessels.tree().is_empty() {
                continue;
            }
            if vessels.is_as_saved() && saved.fits(vessels.tree()) {
                wounds.resume(vessels);
                continue;
            }
            warn!("{entity}: its wounds are dropped: its vessels differ from those that it was saved with");
        }
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

/// Cut: applies changed settings to ledgers.
pub(crate) fn follow_settings(
    organs: Query<(Entity, &Cuttable, &OrganVessels), Or<(Changed<Cuttable>, Changed<OrganVessels>)>>,
    mut wounds: Query<&mut VesselWounds>,
) {
    for (organ, cuttable, vessels) in &organs {
        let mut wounds = wounds.iter_many_mut(vessels.entities());
        while let Some(mut wounds) = wounds.fetch_next() {
            let ledger = wounds.bypass_change_detection().ledger_mut();
            if let Err(error) = ledger.set_retraction(cuttable.retraction) {
                warn!("{organ}: the retraction of cut ends stays as before: {error}");
                break;
            }
        }
    }
}

/// Makes vessels whole when they cease to be cuttable.
pub(crate) fn remove_wounds(
    removed: On<Remove, Cuttable>,
    organs: Query<&OrganVessels>,
    mut vessels: Query<(&OpenEndEntities, &mut ChangeLog)>,
    mut commands: Commands,
) {
    let Ok(entities) = organs.get(removed.entity) else { return };
    for &entity in entities.entities() {
        let Ok((ends, mut changes)) = vessels.get_mut(entity) else { continue };
        let closed = ends.iter().map(|(_, end)| end).collect();
        commands.entity(entity).queue_silenced(|vessels: EntityWorldMut| despawn_children(vessels, closed));
        changes.mark_all();
        commands.entity(entity).try_remove::<(VesselWounds, OpenEndEntities)>();
    }
}

/// Removes a removed ledger from the undo history.
pub(crate) fn forget_ledger(removed: On<Remove, VesselWounds>, mut door: ResMut<CuttableVessels>) {
    door.forget(removed.entity);
}
