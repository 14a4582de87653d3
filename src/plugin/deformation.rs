//! Publish: vessels follow an organ whose mesh is deformed.

use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// Lets an organ's vessels follow its mesh: put it beside the organ's [`Vasculature`](crate::plugin::Vasculature), and
/// write new positions of the vertices into the mesh asset, each frame if need be, as a soft body does.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct FollowsMesh;
