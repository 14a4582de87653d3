//! The blood of one patient, which several organs may share.

use crate::synthesis::haemodynamics::{BloodVolume, BloodVolumeSettings, FlowError};
use bevy::{
    ecs::{component::Component, entity::Entity, hierarchy::ChildOf, reflect::ReflectComponent, system::Query},
    reflect::{Reflect, ReflectDeserialize, ReflectSerialize, std_traits::ReflectDefault},
};

/// The blood of one patient. Its loss lowers the pressure in all organs.
///
/// Put it on an organ, or on an entity above several organs, which then share it. An organ that finds none on itself or
/// above gets one of its own, with the default settings. To fill a patient up again, insert a new one.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(opaque, Component, Default, Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Patient {
    pub(crate) blood: BloodVolume,
}

impl Patient {
    /// A patient who has lost no blood.
    ///
    /// # Errors
    /// If a setting is outside its limits.
    pub fn new(settings: BloodVolumeSettings) -> Result<Self, FlowError> {
        Ok(Self { blood: BloodVolume::new(settings)? })
    }

    /// The patient's blood.
    pub fn blood(&self) -> &BloodVolume {
        &self.blood
    }
}

impl Default for Patient {
    fn default() -> Self {
        Self::new(BloodVolumeSettings::default()).expect("defaults are within their limits")
    }
}

/// The patient of an organ: the organ itself, or the nearest patient above it.
pub(crate) fn patient_of(
    organ: Entity,
    parents: &Query<&ChildOf>,
    is_patient: impl Fn(Entity) -> bool,
) -> Option<Entity> {
    std::iter::once(organ).chain(parents.iter_ancestors(organ)).find(|&entity| is_patient(entity))
}
