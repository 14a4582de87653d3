//! Organs whose vessels come from a preset file.
//!
//! In: [`VesselPreset`] on an organ, and its asset. Out: the organ's [`Vasculature`].

use crate::plugin::{
    announcer::Announcer,
    growth::{GrowthFailed, OrganGrowthError, Vasculature},
    scene::preset_asset::PresetAsset,
};
use bevy::{
    asset::{AssetEvent, AssetId, AssetLoadFailedEvent, AssetServer, Assets, Handle, LoadState},
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Res},
        component::Component,
        entity::Entity,
        message::MessageReader,
        query::QueryData,
        reflect::ReflectComponent,
        system::{Commands, Query},
        world::Ref,
    },
    log::warn,
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::collections::BTreeMap;

/// Gives an organ the vessels of a preset: put it beside the organ's `Mesh3d` instead of a [`Vasculature`], which is
/// inserted when the preset has been loaded.
///
/// When the preset changes, in its file or in `Assets<PresetAsset>`, the vessels grow again. The organ's seed stays.
/// The log names a file that cannot be loaded, and what is wrong with it. An organ that has vessels keeps them then;
/// one that has none yet gets a [`GrowthFailed`].
///
/// Whenever this is inserted or the preset is loaded, also with a scene, other changes of the vasculature are
/// overwritten. To keep them, remove this: the vasculature stays as it is.
///
/// ```
/// # use bevy_vessels::plugin::VesselPreset;
/// # use bevy::prelude::{AssetServer, Commands, Mesh3d, Res};
/// fn spawn_organ(server: Res<AssetServer>, mut commands: Commands) {
///     let preset = VesselPreset::new(server.load("presets/spleen.vessels.ron")).with_seed(7);
///     commands.spawn((Mesh3d(server.load("spleen.glb#Mesh0/Primitive0")), preset));
/// }
/// # bevy::ecs::system::assert_is_system(spawn_organ);
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct VesselPreset {
    /// The preset.
    pub preset: Handle<PresetAsset>,
    /// The [`Vasculature::seed`], for an organ that has no vasculature yet. Default: 0.
    pub seed: u64,
}

impl VesselPreset {
    /// The vessels of a preset, with seed 0.
    pub fn new(preset: Handle<PresetAsset>) -> Self {
        Self { preset, seed: 0 }
    }

    /// Chooses another network.
    #[must_use]
    pub fn with_seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }
}

/// An organ with a preset.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct PresetOrgan {
    entity: Entity,
    preset: Ref<'static, VesselPreset>,
    vasculature: Option<&'static mut Vasculature>,
}

/// Source: updates vasculatures from presets that have been loaded or have changed.
pub(crate) fn follow_presets(
    mut changes: MessageReader<AssetEvent<PresetAsset>>,
    mut failures: MessageReader<AssetLoadFailedEvent<PresetAsset>>,
    presets: Res<Assets<PresetAsset>>,
    server: Res<AssetServer>,
    mut organs: Query<PresetOrgan>,
    mut commands: Commands,
    mut failed: Announcer<GrowthFailed>,
) {
    let changed: Vec<AssetId<PresetAsset>> = changes.read().filter_map(changed_preset).collect();
    let failures: BTreeMap<_, _> = failures.read().map(|failure| (failure.id, failure.error.to_string())).collect();
    for mut organ in &mut organs {
        let id = organ.preset.preset.id();
        let is_due = organ.preset.is_changed() || changed.contains(&id);
        let problem = match (failures.get(&id), presets.get(id)) {
            (Some(failure), _) => Some(failure.clone()),
            (None, Some(preset)) if is_due => {
                organ.take_over(preset, &mut commands);
                None
            }
            // The preset failed before the organ asked for it.
            (None, None) if is_due => match server.load_state(id) {
                LoadState::Failed(failure) => Some(failure.to_string()),
                _ => None,
            },
            _ => None,
        };
        if let Some(reason) = problem {
            organ.report_failure(reason, &mut failed);
        }
    }
}

fn changed_preset(event: &AssetEvent<PresetAsset>) -> Option<AssetId<PresetAsset>> {
    match *event {
        AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(id),
        _ => None,
    }
}

impl PresetOrganItem<'_, '_> {
    /// Gives the organ the preset's vasculature, if that differs from its own.
    fn take_over(&mut self, preset: &PresetAsset, commands: &mut Commands) {
        let seed = self.vasculature.as_ref().map_or(self.preset.seed, |vasculature| vasculature.seed);
        let wish = Vasculature::from_preset(preset.0.clone()).with_seed(seed);
        match &mut self.vasculature {
            Some(vasculature) => _ = vasculature.set_if_neq(wish),
            None => _ = commands.entity(self.entity).try_insert(wish),
        }
    }

    /// Reports that there is no preset, or that its file has become invalid.
    fn report_failure(&self, reason: String, failed: &mut Announcer<GrowthFailed>) {
        let organ = self.entity;
        if self.vasculature.is_some() {
            warn!("{organ}: its vessels stay as they are, since their preset cannot be loaded: {reason}");
        } else {
            warn!("{organ}: no vessels grow here, since their preset cannot be loaded: {reason}");
            failed.announce(GrowthFailed { organ, error: OrganGrowthError::Preset { reason } });
        }
    }
}
