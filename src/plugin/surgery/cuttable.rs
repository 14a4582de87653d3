//! The component that makes an organ's vessels cuttable.

use crate::synthesis::wound::Retraction;
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// Lets an organ's vessels be cut, clamped and cauterised. Put it beside the organ's
/// [`Vasculature`](crate::plugin::Vasculature), or on an organ with vessels of your own.
///
/// An organ without it has no cost from it. With a [`Perfusion`](crate::plugin::Perfusion), too, open vessels bleed.
/// Removing it makes the vessels whole again.
///
/// ```
/// # use bevy_vessels::{plugin::{Cuttable, Vasculature}, synthesis::preset::PresetName};
/// let organ = (Vasculature::new(PresetName::Colon), Cuttable::default());
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct Cuttable {
    /// How far the ends of later cuts retract, so that a gap is visible.
    pub retraction: Retraction,
}
