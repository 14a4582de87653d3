//! Organs show the maps that their vessels are painted into.
//!
//! In: [`VesselMaps`] of organs with a `StandardMaterial`. Out: a material of their own with these maps, in place of the
//! one that they had, which comes back when the maps are no longer shown; and what lies between the vessels, taken from
//! that material. Nothing here needs storage buffers.

use crate::{
    plugin::{TextureBase, VesselMaps, VesselTexture},
    synthesis::texture::MapKind,
};
use bevy::{math::Affine2, prelude::*};

/// The material that an organ had before it showed maps, and the one that shows them.
#[derive(Component)]
pub(super) struct Dressed {
    plain: Handle<StandardMaterial>,
    own: Handle<StandardMaterial>,
}

/// Tells what lies between the vessels of an organ: what its material shows.
pub(super) fn take_bases(
    mut commands: Commands,
    organs: Query<(Entity, &MeshMaterial3d<StandardMaterial>), (With<VesselTexture>, Without<TextureBase>)>,
    materials: Res<Assets<StandardMaterial>>,
) {
    for (organ, material) in &organs {
        let Some(material) = materials.get(material) else { continue };
        let color = material.base_color.to_linear();
        let base = TextureBase {
            image: material.base_color_texture.clone(),
            color: [color.red, color.green, color.blue].map(|channel| channel.clamp(0.0, 1.0)),
            roughness: material.perceptual_roughness.clamp(0.0, 1.0),
        };
        commands.entity(organ).try_insert(base);
    }
}

/// Gives organs whose maps have changed a material with them, or their plain one.
pub(super) fn dress_organs(
    mut commands: Commands,
    mut organs: Query<
        (Entity, &VesselMaps, &mut MeshMaterial3d<StandardMaterial>, Option<&Dressed>),
        Or<(Changed<VesselMaps>, Changed<MeshMaterial3d<StandardMaterial>>)>,
    >,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (organ, maps, mut material, dressed) in &mut organs {
        // An app that gives the organ another material means that one to show the maps.
        let plain = dressed.filter(|dressed| dressed.own == material.0).map_or(&material.0, |dressed| &dressed.plain);
        let plain = plain.clone();
        if !maps.is_shown() {
            if material.0 != plain {
                material.0 = plain;
            }
            continue;
        }
        let Some(base) = materials.get(&plain) else { continue };
        let wanted = with_maps(base.clone(), maps);
        match dressed.filter(|dressed| dressed.plain == plain).map(|dressed| dressed.own.clone()) {
            Some(own) => {
                if let Some(mut shown) = materials.get_mut(&own) {
                    *shown = wanted;
                }
                if material.0 != own {
                    material.0 = own;
                }
            }
            None => {
                let own = materials.add(wanted);
                material.0 = own.clone();
                commands.entity(organ).try_insert(Dressed { plain, own });
            }
        }
    }
}

/// A material with maps in place of its own.
fn with_maps(mut material: StandardMaterial, maps: &VesselMaps) -> StandardMaterial {
    if let Some(albedo) = maps.image(MapKind::Albedo) {
        // The maps have the colour of the base.
        material.base_color = Color::WHITE.with_alpha(material.base_color.alpha());
        material.base_color_texture = Some(albedo.clone());
    }
    if let Some(normal) = maps.image(MapKind::Normal).filter(|_| maps.has_tangents()) {
        material.normal_map_texture = Some(normal.clone());
        material.flip_normal_map_y = false;
    }
    if let Some(roughness) = maps.image(MapKind::Roughness) {
        (material.perceptual_roughness, material.metallic) = (1.0, 1.0);
        material.metallic_roughness_texture = Some(roughness.clone());
    }
    material.uv_transform = Affine2::IDENTITY;
    material
}

/// Gives an organ that lost its maps its plain material.
pub(super) fn undress(
    removed: On<Remove, VesselMaps>,
    mut organs: Query<(&Dressed, &mut MeshMaterial3d<StandardMaterial>)>,
    mut commands: Commands,
) {
    if let Ok((dressed, mut material)) = organs.get_mut(removed.entity) {
        if material.0 == dressed.own {
            material.0 = dressed.plain.clone();
        }
        commands.entity(removed.entity).try_remove::<Dressed>();
    }
}
