//! Which vessel is nearest to a point of the world: what was clicked, or what an instrument touches.

use crate::plugin::vessels::{index::VesselIndex, relations::VesselsOf, tree::Vessels, wounds::VesselWounds};
use crate::synthesis::{
    segment_index::Region,
    tree::{NodeId, Place, VesselKind},
    wound::Wounds,
};
use bevy::{
    ecs::{
        entity::Entity,
        system::{Query, SystemParam},
    },
    math::{Affine3A, Vec3},
    transform::helper::TransformHelper,
};

/// A place on a vessel, found by [`VesselPicker`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VesselPlace {
    /// The organ.
    pub organ: Entity,
    /// The vessel entity.
    pub vessels: Entity,
    /// What kind of vessel it is.
    pub kind: VesselKind,
    /// Where on the tree.
    pub place: Place,
    /// Where its centre line is, in world space.
    pub position: Vec3,
    /// How far its wall is from the point, in world units; negative within it.
    pub distance: f32,
}

/// Finds vessels of [`Cuttable`](crate::plugin::Cuttable) organs in world space.
#[derive(SystemParam)]
pub struct VesselPicker<'w, 's> {
    vessels:
        Query<'w, 's, (Entity, &'static VesselsOf, &'static Vessels, &'static VesselWounds, &'static mut VesselIndex)>,
    transforms: TransformHelper<'w, 's>,
}

impl VesselPicker<'_, '_> {
    /// The place, where there still is a vessel, that is nearest to a point; `None` where no vessel's wall is within
    /// `reach`. World units. Of equally near ones that of the lowest entity and node counts.
    pub fn nearest(&mut self, point: Vec3, reach: f32) -> Option<VesselPlace> {
        let mut best: Option<VesselPlace> = None;
        for (vessels, organ, tree, wounds, mut index) in &mut self.vessels {
            let Ok(global) = self.transforms.compute_global_transform(vessels) else { continue };
            index.refresh(tree);
            let reach = best.map_or(reach, |best| best.distance);
            let touch = Touch { point, reach, to_world: global.affine() };
            let Some(near) = nearest_place(&touch, tree, wounds, &index) else { continue };
            let nearer = best.is_none_or(|best| {
                near.distance < best.distance || (near.distance == best.distance && vessels < best.vessels)
            });
            if nearer {
                let Near { place, position, distance } = near;
                best = Some(VesselPlace { organ: organ.0, vessels, kind: tree.kind(), place, position, distance });
            }
        }
        best
    }
}

/// A point to look around, in the world, and where the vessels are in it.
pub(crate) struct Touch {
    pub(crate) point: Vec3,
    pub(crate) reach: f32,
    pub(crate) to_world: Affine3A,
}

/// The nearest place of one tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    pub(crate) place: Place,
    pub(crate) position: Vec3,
    pub(crate) distance: f32,
}

/// The place of a tree whose wall is nearest to a point of the world. Radii count by the mean scale; centre lines are
/// measured in the world, whatever the scale of the axes.
pub(crate) fn nearest_place(touch: &Touch, vessels: &Vessels, wounds: &Wounds, index: &VesselIndex) -> Option<Near> {
    let &Touch { point, reach, to_world } = touch;
    let to_local = to_world.inverse();
    if !(point.is_finite() && reach.is_finite() && to_local.is_finite()) {
        return None;
    }
    let tree = vessels.tree();
    let scale = mean_scale(&to_world);
    // Half the box, in local space, of a ball of radius 1 in the world.
    let unit = Vec3::from_array(std::array::from_fn(|axis| to_local.matrix3.row(axis).length()));
    let half = reach.max(0.0) * unit + unevenness(unit * scale) * widest_radius(vessels, unit * scale);
    let center = to_local.transform_point3(point);
    let mut best: Option<Near> = None;
    index.candidates(tree, &Region::between(center - half, center + half), &mut |node: NodeId| {
        let Some(parent) = tree.parent(node) else { return };
        let [a, b] = [parent, node].map(|node| to_world.transform_point3(tree.positions()[node.index()]));
        let radius = tree.radii()[node.index()] * scale;
        let mut try_piece = |from: f32, to: f32| {
            let along = b - a;
            let share = (point - a).dot(along) / along.length_squared();
            // Not a number where the segment has no length.
            let share = if share.is_nan() { from } else { share.clamp(from, to) };
            let position = a.lerp(b, share);
            let near = Near { place: Place::new(node, share), position, distance: position.distance(point) - radius };
            let nearer = best.is_none_or(|best| {
                near.distance < best.distance || (near.distance == best.distance && node < best.place.node)
            });
            if near.distance <= reach && nearer {
                best = Some(near);
            }
        };
        if wounds.is_severed(node) {
            wounds.pieces(node).for_each(|piece| try_piece(piece.from, piece.to));
        } else {
            try_piece(0.0, 1.0);
        }
    });
    best
}

/// Cube root of how much larger volumes are in the world.
pub(crate) fn mean_scale(to_world: &Affine3A) -> f32 {
    bevy::math::ops::cbrt(to_world.matrix3.determinant().abs())
}

/// By how many of its radii a vessel may reach out of its box, where axes have other scales than the mean.
fn unevenness(scaled_unit: Vec3) -> Vec3 {
    (scaled_unit - 1.0).max(Vec3::ZERO)
}

/// Largest radius, if it makes a difference.
fn widest_radius(vessels: &Vessels, scaled_unit: Vec3) -> f32 {
    if unevenness(scaled_unit).max_element() < 1.0e-4 {
        return 0.0;
    }
    vessels.tree().radii().iter().copied().fold(0.0, f32::max)
}
