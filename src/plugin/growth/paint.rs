//! The paint on an organ, as a component.

use crate::synthesis::tissue::TissuePaint;
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    prelude::{Deref, DerefMut},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// The paint on an organ: where more or fewer vessels grow, where none may be, and guide lines for large ones. Put it
/// beside the organ's [`Vasculature`](crate::plugin::Vasculature).
///
/// A brush stroke is a change of this component. The tissue made from the organ's mesh is not prepared again: the paint
/// is laid over it, and new vessels grow there unseen. The drawn vessels stay, and can be cut, until their successors
/// have done as many steps; then all are replaced at once, and their wounds are dropped. Another stroke in between
/// starts the successors again. Until then [`GrowthProgress`](crate::plugin::GrowthProgress) is in
/// [`GrowthPhase::Regrowing`](crate::plugin::GrowthPhase::Regrowing).
///
/// If settings, seed or tissue change too, the vessels start again at once. Paint on vertices belongs to the mesh: give
/// a mesh with another number of vertices its own paint in the same frame. Removing the component is blank paint.
///
/// Invalid paint, such as a density with too few values, ends in
/// [`GrowthPhase::Failed`](crate::plugin::GrowthPhase::Failed). The vessels stay, and taking the stroke back is enough.
///
/// ```
/// # use bevy::math::Vec3;
/// # use bevy_vessels::{plugin::OrganPaint, synthesis::tissue::NoGoRegion};
/// let mut paint = OrganPaint::default();
/// paint.no_go.regions.push(NoGoRegion::Ball { center: Vec3::Y, radius: 0.2 });
/// ```
#[derive(
    Component, Clone, Debug, Default, PartialEq, Deref, DerefMut, Reflect, serde::Serialize, serde::Deserialize,
)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct OrganPaint(pub TissuePaint);

impl From<TissuePaint> for OrganPaint {
    fn from(paint: TissuePaint) -> Self {
        Self(paint)
    }
}
