//! Vessels give way to the texture that they are painted into.
//!
//! In: changed [`VesselMaps`], and vessels that an appearance shows. Out: hidden vessel entities, and later visible ones
//! again. Those that the app itself has hidden stay so.

use crate::plugin::{
    texture::{maps::VesselMaps, settings::VesselTexture},
    vessels::{appearance::VesselAppearance, relations::OrganVessels, tree::Vessels},
};
use bevy::{
    camera::visibility::Visibility,
    ecs::{
        change_detection::DetectChangesMut,
        entity::Entity,
        lifecycle::Remove,
        observer::On,
        system::{Commands, Query},
    },
};

/// Texture: hides vessels that are in the texture, and shows them again when it no longer is.
pub(crate) fn hide_vessels(
    mut organs: Query<(&mut VesselMaps, &OrganVessels, Option<&VesselAppearance>)>,
    mut vessels: Query<(Entity, &Vessels, &mut Visibility)>,
) {
    for (mut maps, entities, appearance) in &mut organs {
        let maps = maps.bypass_change_detection();
        if maps.hides_vessels {
            let mut vessels = vessels.iter_many_mut(entities.entities());
            while let Some((entity, _, mut visibility)) = vessels.fetch_next() {
                if visibility.set_if_neq(Visibility::Hidden) && !maps.hidden.contains(&entity) {
                    maps.hidden.push(entity);
                }
            }
        } else {
            show(&std::mem::take(&mut maps.hidden), appearance, &mut vessels);
        }
    }
}

/// Shows vessels as far as the organ's appearance does.
fn show(
    hidden: &[Entity],
    appearance: Option<&VesselAppearance>,
    vessels: &mut Query<(Entity, &Vessels, &mut Visibility)>,
) {
    let mut vessels = vessels.iter_many_mut(hidden);
    while let Some((_, vessels, mut visibility)) = vessels.fetch_next() {
        let shown = appearance.map_or(Visibility::Inherited, |appearance| appearance.visibility(vessels.kind()));
        visibility.set_if_neq(shown);
    }
}

/// Removes the maps of an organ that no longer asks for them. Work on them stops.
pub(crate) fn remove_maps(removed: On<Remove, VesselTexture>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<VesselMaps>();
}

/// Shows the vessels of an organ that lost its maps.
pub(crate) fn show_vessels(
    removed: On<Remove, VesselMaps>,
    organs: Query<(&VesselMaps, Option<&VesselAppearance>)>,
    mut vessels: Query<(Entity, &Vessels, &mut Visibility)>,
) {
    if let Ok((maps, appearance)) = organs.get(removed.entity) {
        show(&maps.hidden, appearance, &mut vessels);
    }
}
