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
    /// What becomes of a growth under way when vessels are severed. Default: [`WoundedGrowth::Rests`].
    pub growth: WoundedGrowth,
}

/// What becomes of the growth of an organ when its vessels are severed, tied off or sealed before it is finished.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, serde::Serialize, serde::Deserialize)]
#[reflect(Default, Clone, PartialEq)]
pub enum WoundedGrowth {
    /// It rests, in [`GrowthPhase::Held`](crate::plugin::GrowthPhase::Held). So no vessel grows that would bleed or be
    /// supplied through one that is cut off, and no generator replaces the severed vessels. Once all of this has been
    /// undone, growth goes on, and gives the vessels that it would have given without a cut. Clamps don't hold it,
    /// since they are taken off again.
    #[default]
    Rests,
    /// It goes on as if the vessels were whole. What is cut off grows, too, without blood. A generator that inserts
    /// nodes, such as constrained constructive optimisation, replaces the vessels in its next step, and their wounds
    /// are dropped.
    GoesOn,
}
