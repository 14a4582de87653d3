//! Organs that wait in vain for a mesh or an image: the log says so once.
//!
//! In: organs whose growth waits. Out: one warning for each, with the remedy.

use crate::plugin::{
    growth::{
        progress::{GrowthPhase, GrowthProgress},
        state::GrowthState,
        tissue::AssetsUnderWay,
    },
    organ::image::OrganImage,
};
use bevy::{
    ecs::{
        entity::Entity,
        hierarchy::Children,
        query::{QueryData, With},
        system::Query,
    },
    log::warn,
    mesh::Mesh3d,
};

/// Frames after which an organ that waits for something that nobody loads gets a warning. Scenes are spawned within
/// fewer.
const PATIENCE: u32 = 300;

/// An organ that may wait.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct WaitingOrgan {
    entity: Entity,
    progress: &'static GrowthProgress,
    state: &'static mut GrowthState,
    mesh: Option<&'static Mesh3d>,
    image: Option<&'static OrganImage>,
}

/// Source: warns of organs that have waited too long.
pub(crate) fn warn_of_waiting(
    assets: AssetsUnderWay,
    mut organs: Query<WaitingOrgan>,
    children: Query<&Children>,
    meshes: Query<(), With<Mesh3d>>,
) {
    for mut organ in &mut organs {
        let (what, is_coming) = match organ.progress.phase {
            GrowthPhase::WaitingForMesh => ("mesh", organ.mesh.is_some_and(|mesh| assets.is_coming(mesh))),
            GrowthPhase::WaitingForImage => ("image", organ.image.is_some_and(|image| assets.is_coming(image))),
            _ => {
                if organ.state.waited > 0 {
                    organ.state.waited = 0;
                }
                continue;
            }
        };
        // What is being loaded comes, or fails with an error of its own.
        if is_coming || organ.state.waited > PATIENCE {
            continue;
        }
        organ.state.waited += 1;
        if organ.state.waited > PATIENCE {
            let has_mesh_below = || children.iter_descendants(organ.entity).any(|entity| meshes.contains(entity));
            let entity = organ.entity;
            if organ.mesh.is_some() || organ.image.is_some() {
                warn!("{entity}: no vessels grow here: its {what} is not there, and nobody loads it");
            } else if has_mesh_below() {
                warn!(
                    "{entity}: no vessels grow here: it has no Mesh3d, but entities below it have; for the meshes of a \
                     scene, give it a VasculatureOfScene instead of a Vasculature"
                );
            } else {
                warn!(
                    "{entity}: no vessels grow here: it has no Mesh3d; put the Vasculature on the entity with the mesh, \
                     or choose a plain shape as its tissue"
                );
            }
        }
    }
}
