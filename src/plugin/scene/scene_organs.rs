//! Organs in a scene, such as that of a glTF file, whose meshes are on entities below the scene's root.
//!
//! In: [`VasculatureOfScene`] on the root. Out: a [`Vasculature`] on the entities with the meshes that are meant.

use crate::plugin::{growth::Vasculature, vessels::Vessels};
use bevy::{
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut},
        component::Component,
        entity::Entity,
        hierarchy::{ChildOf, Children},
        name::Name,
        query::{Added, With},
        reflect::ReflectComponent,
        system::{Commands, Query, SystemParam},
        world::Mut,
    },
    log::warn,
    mesh::Mesh3d,
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// Grows vessels on meshes of a scene: put it on the scene's root, beside a `WorldAssetRoot` with a scene of a glTF
/// file. Once the scene has been spawned, each mesh that is meant gets a [`Vasculature`], on its own entity, and is an
/// organ.
///
/// Later changes of this change these vasculatures, too; removing it leaves them as they are. A mesh of several
/// materials is as many entities in Bevy, each of which becomes an organ. All of them have the same seed.
///
/// To add more to these organs, such as a [`Perfusion`](crate::plugin::Perfusion), observe where a `Vasculature` is
/// added.
///
/// ```
/// # use bevy_vessels::{plugin::{Vasculature, VasculatureOfScene}, synthesis::preset::PresetName};
/// # use bevy::{prelude::{AssetServer, Commands, Handle, Res}, world_serialization::{WorldAsset, WorldAssetRoot}};
/// fn spawn_abdomen(server: Res<AssetServer>, mut commands: Commands) {
///     let scene: Handle<WorldAsset> = server.load("abdomen.glb#Scene0");
///     let vessels = VasculatureOfScene::new(Vasculature::new(PresetName::Liver)).named(["liver"]);
///     commands.spawn((WorldAssetRoot(scene), vessels));
/// }
/// # bevy::ecs::system::assert_is_system(spawn_abdomen);
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct VasculatureOfScene {
    /// The vessels of each mesh.
    pub vasculature: Vasculature,
    /// Which meshes are meant. Default: all.
    pub meshes: SceneMeshes,
    /// Frames without a mesh that is meant.
    #[serde(skip)]
    #[reflect(ignore)]
    waited: u32,
}

/// Meshes of a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum SceneMeshes {
    /// Every mesh.
    #[default]
    All,
    /// Those with one of these names: of the mesh, or of its node or one above that, below the root of the scene.
    Named(Vec<String>),
}

impl VasculatureOfScene {
    /// Frames after which the log says that no mesh is meant.
    const PATIENCE: u32 = 300;

    /// Vessels on every mesh of a scene.
    pub fn new(vasculature: Vasculature) -> Self {
        Self { vasculature, ..Self::default() }
    }

    /// Vessels on meshes, or nodes, with these names alone.
    #[must_use]
    pub fn named(self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self { meshes: SceneMeshes::Named(names.into_iter().map(Into::into).collect()), ..self }
    }
}

impl SceneMeshes {
    /// Whether a mesh is meant whose entity, or one above it, has this name.
    ///
    /// Bevy names the entity of a glTF mesh after the mesh, with a dot and its material. A number after a dot belongs
    /// to the name, as in Blender.
    fn mean(&self, name: &str) -> bool {
        let is_material = |rest: &str| rest.strip_prefix('.').is_some_and(|rest| !is_number(rest));
        match self {
            Self::All => true,
            Self::Named(names) => names
                .iter()
                .filter_map(|wanted| name.strip_prefix(&wanted[..]))
                .any(|rest| rest.is_empty() || is_material(rest)),
        }
    }
}

/// Whether text begins with a number, up to the next dot.
fn is_number(text: &str) -> bool {
    let first = text.split('.').next().unwrap_or_default();
    first.len() > 1 && first.bytes().all(|byte| byte.is_ascii_digit())
}

/// The meshes of scenes.
#[derive(SystemParam)]
pub(crate) struct SceneEntities<'w, 's> {
    new: Query<'w, 's, Entity, Added<Mesh3d>>,
    meshes: Query<'w, 's, (), With<Mesh3d>>,
    vessels: Query<'w, 's, (), With<Vessels>>,
    names: Query<'w, 's, &'static Name>,
    parents: Query<'w, 's, &'static ChildOf>,
    children: Query<'w, 's, &'static Children>,
}

impl SceneEntities<'_, '_> {
    /// Whether a mesh has come to a scene.
    fn has_news(&self, scene: Entity) -> bool {
        self.new.iter().any(|mesh| self.is_of_scene(mesh, scene))
    }

    /// Whether an entity is below a scene, and not part of drawn vessels.
    fn is_of_scene(&self, mesh: Entity, scene: Entity) -> bool {
        let mut above = self.parents.iter_ancestors(mesh).take_while(|&entity| !self.vessels.contains(entity));
        above.any(|entity| entity == scene)
    }

    /// The meshes of a scene.
    fn of_scene(&self, scene: Entity) -> Vec<Entity> {
        let below = self.children.iter_descendants(scene);
        below.filter(|&entity| self.meshes.contains(entity) && self.is_of_scene(entity, scene)).collect()
    }

    /// Whether a mesh is meant.
    fn is_meant(&self, mesh: Entity, scene: Entity, meant: &SceneMeshes) -> bool {
        let above = self.parents.iter_ancestors(mesh).take_while(|&entity| entity != scene);
        let mut names = std::iter::once(mesh).chain(above).filter_map(|entity| self.names.get(entity).ok());
        *meant == SceneMeshes::All || names.any(|name| meant.mean(name))
    }
}

/// Source: gives vasculatures to the meshes of scenes that have been spawned or have changed.
pub(crate) fn follow_scenes(
    entities: SceneEntities,
    mut scenes: Query<(Entity, &mut VasculatureOfScene)>,
    mut organs: Query<&mut Vasculature>,
    mut commands: Commands,
) {
    for (scene, mut wish) in &mut scenes {
        if wish.is_changed() || entities.has_news(scene) {
            let of_scene = entities.of_scene(scene);
            let meant: Vec<Entity> =
                of_scene.into_iter().filter(|&mesh| entities.is_meant(mesh, scene, &wish.meshes)).collect();
            for &organ in &meant {
                match organs.get_mut(organ) {
                    Ok(mut vasculature) => _ = vasculature.set_if_neq(wish.vasculature.clone()),
                    Err(_) => _ = commands.entity(organ).try_insert(wish.vasculature.clone()),
                }
            }
            wish.bypass_change_detection().waited = if meant.is_empty() { 0 } else { u32::MAX };
        }
        warn_of_waiting(scene, &mut wish, &entities);
    }
}

/// Says once which meshes a scene has, if none of them is meant for so many frames.
fn warn_of_waiting(scene: Entity, wish: &mut Mut<VasculatureOfScene>, entities: &SceneEntities) {
    let waited = &mut wish.bypass_change_detection().waited;
    if *waited > VasculatureOfScene::PATIENCE {
        return;
    }
    *waited += 1;
    if *waited > VasculatureOfScene::PATIENCE {
        let of_scene = entities.of_scene(scene);
        let names: Vec<&str> =
            of_scene.iter().filter_map(|&mesh| entities.names.get(mesh).ok()).map(Name::as_str).collect();
        let meant = &wish.meshes;
        if of_scene.is_empty() {
            warn!("{scene}: no vessels grow in this scene: it has no mesh; is a WorldAssetRoot beside this?");
        } else {
            warn!("{scene}: no vessels grow in this scene: {meant:?} means none of its meshes {names:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_meshes_with_or_without_material() {
        let liver = VasculatureOfScene::default().named(["Liver", "Gut.001"]).meshes;
        for meant in ["Liver", "Liver.Flesh", "Liver.Flesh.002", "Gut.001", "Gut.001.Flesh"] {
            assert!(liver.mean(meant), "{meant}");
        }
        for other in ["Liver2", "Liver.001", "Liver.001.Flesh", "liver", "Gut", "Gut.0011", "Gut.002", ""] {
            assert!(!liver.mean(other), "{other}");
        }
        assert!(SceneMeshes::All.mean("anything"));
    }
}
