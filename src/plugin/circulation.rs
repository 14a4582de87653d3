//! Circulate: blood flows through the vessels of organs with a [`Perfusion`], and is lost.

use bevy::ecs::component::Component;

/// The flow in an organ's vessels. The plugin drives it.
#[derive(Component, Debug, Default)]
pub struct CirculationState {}
