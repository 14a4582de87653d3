//! What is painted on an organ, as a component.

use crate::synthesis::tissue::TissuePaint;
use bevy::{
    ecs::{component::Component, reflect::ReflectComponent},
    prelude::{Deref, DerefMut},
    reflect::{Reflect, std_traits::ReflectDefault},
};

/// What is painted on an organ: where more vessels grow and where fewer, where none may be, and lines along which large ones
/// are led. Put it beside the organ's [`Vasculature`](crate::plugin::Vasculature).
///
/// A stroke of a brush is a change of this component. It prepares nothing again that was made of the organ's mesh: the paint
/// is laid over the tissue at hand, and vessels grow there unseen. Those that are drawn stay, and can be cut, until their
/// successors have done as many steps; then all of them are replaced at once, and wounds with them. A stroke meanwhile
/// starts the successors again. [`GrowthProgress`](crate::plugin::GrowthProgress) is in
/// [`GrowthPhase::Regrowing`](crate::plugin::GrowthPhase::Regrowing) for as long.
///
/// Paint that cannot be laid, such as a density of too few values, ends in
/// [`GrowthPhase::Failed`](crate::plugin::GrowthPhase::Failed). The vessels stay; taking the stroke back is enough.
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
