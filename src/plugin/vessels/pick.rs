//! Which vessel is nearest to a point of the world, or in the way of a ray: what was clicked, or what an instrument
//! touches.
//!
//! In: vessel entities with their [`VesselIndex`], and a point or a ray in world space. Out: a [`VesselPlace`].

use crate::plugin::vessels::{
    change_log::ChangeLog,
    index::{IndexedVessels, VesselIndex},
    relations::VesselsOf,
    tree::Vessels,
    wounds::VesselWounds,
};
use crate::synthesis::{
    segment_index::{RayCast, Region},
    tree::{NodeId, Place, VesselKind},
    wound::Wounds,
};
use bevy::{
    ecs::{
        entity::Entity,
        query::QueryData,
        system::{Query, SystemParam},
    },
    math::{Affine3A, Ray3d, Vec3},
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
    /// How far its wall is, in world units: from the point, negative within the vessel; or along the ray, 0 where that
    /// begins within.
    pub distance: f32,
}

/// Finds vessels in world space, of all organs, shown or hidden.
///
/// Where an organ is [`Cuttable`](crate::plugin::Cuttable), only what is left of severed vessels is found. Transforms are
/// those of the organ and of all that it hangs on, as they are when it is asked. Of equally near vessels that of the lowest
/// entity and node counts.
///
/// The first question about vessels indexes them; see [`VesselIndex`]. Vessels out of reach are not asked about.
///
/// ```
/// # use bevy_vessels::plugin::VesselPicker;
/// # use bevy::prelude::{Camera, GlobalTransform, Single, Window};
/// fn under_the_mouse(window: Single<&Window>, camera: Single<(&Camera, &GlobalTransform)>, picker: VesselPicker) {
///     let ((camera, place), Some(cursor)) = (*camera, window.cursor_position()) else { return };
///     let Ok(ray) = camera.viewport_to_world(place, cursor) else { return };
///     if let Some(vessel) = picker.ray(ray, f32::INFINITY) {
///         println!("{:?} of {}, {} away", vessel.kind, vessel.organ, vessel.distance);
///     }
/// }
/// # bevy::ecs::system::assert_is_system(under_the_mouse);
/// ```
#[derive(SystemParam)]
pub struct VesselPicker<'w, 's> {
    vessels: Query<'w, 's, Pickable>,
    transforms: TransformHelper<'w, 's>,
}

/// Vessels that can be found.
#[derive(QueryData)]
struct Pickable {
    entity: Entity,
    organ: &'static VesselsOf,
    vessels: &'static Vessels,
    log: &'static ChangeLog,
    index: &'static VesselIndex,
    wounds: Option<&'static VesselWounds>,
}

impl PickableItem<'_, '_> {
    fn search(&self) -> IndexedVessels<'_> {
        self.index.search(self.vessels, self.log)
    }

    /// What was done to these vessels, and not to others before them.
    fn wounds(&self) -> Option<&Wounds> {
        self.wounds.filter(|wounds| wounds.is_of(self.vessels)).map(VesselWounds::ledger)
    }

    fn place(&self, Near { place, position, distance }: Near) -> VesselPlace {
        let Self { entity, organ, vessels, .. } = *self;
        VesselPlace { organ: organ.0, vessels: entity, kind: vessels.kind(), place, position, distance }
    }
}

impl VesselPicker<'_, '_> {
    /// The place, where there still is a vessel, that is nearest to a point; `None` where no vessel's wall is within
    /// `reach`, which is finite. World units.
    ///
    /// Under a scale that is not the same along all axes, centre lines are where they are drawn, and radii count by the
    /// mean scale, as for a cut.
    pub fn nearest(&self, point: Vec3, reach: f32) -> Option<VesselPlace> {
        self.best(reach, |found, to_world, reach| {
            let touch = Touch { point, reach, to_world };
            touch.reaches(found.vessels).then(|| nearest_place(&touch, &found.search(), found.wounds()))?
        })
    }

    /// The place where a ray meets a vessel's wall first, at most `reach` from its origin; `reach` may be infinite. World
    /// units.
    ///
    /// What is met is what is drawn, under any scale, mirror or shear. `distance` is along the ray; the place is that of
    /// the centre line behind the wall that was met. Light passes through a gap, but not into the lumen beside it: a vessel
    /// that was cut is closed there by a flat face.
    pub fn ray(&self, ray: Ray3d, reach: f32) -> Option<VesselPlace> {
        self.best(reach, |found, to_world, reach| first_place(ray, reach, to_world, found))
    }

    /// The best of what is found in each vessel entity, each asked for what is no farther than the best before it.
    fn best(&self, reach: f32, find: impl Fn(&PickableItem, Affine3A, f32) -> Option<Near>) -> Option<VesselPlace> {
        let mut best: Option<VesselPlace> = None;
        for found in &self.vessels {
            let Ok(global) = self.transforms.compute_global_transform(found.entity) else { continue };
            let reach = best.map_or(reach, |best| best.distance);
            let Some(near) = find(&found, global.affine(), reach) else { continue };
            let is_nearer = best.is_none_or(|best| {
                near.distance < best.distance || (near.distance == best.distance && found.entity < best.vessels)
            });
            if is_nearer {
                best = Some(found.place(near));
            }
        }
        best
    }
}

/// The nearest place of one tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    pub(crate) place: Place,
    pub(crate) position: Vec3,
    pub(crate) distance: f32,
}

/// A point to look around, in the world, and where the vessels are in it.
pub(crate) struct Touch {
    pub(crate) point: Vec3,
    pub(crate) reach: f32,
    pub(crate) to_world: Affine3A,
}

impl Touch {
    /// The box, in the space of the vessels, of all that may be within reach; `None` where that is nowhere.
    fn region(&self, vessels: &Vessels) -> Option<Region> {
        let &Self { point, reach, to_world } = self;
        let to_local = to_world.inverse();
        if !(point.is_finite() && reach.is_finite() && to_local.is_finite()) {
            return None;
        }
        // Half the box, in local space, of a ball of radius 1 in the world.
        let unit = Vec3::from_array(std::array::from_fn(|axis| to_local.matrix3.row(axis).length()));
        let scaled = unit * mean_scale(&to_world);
        let half = reach.max(0.0) * unit + unevenness(scaled) * vessels.widest_radius();
        let center = to_local.transform_point3(point);
        Some(Region::between(center - half, center + half))
    }

    /// Whether some vessel may be within reach.
    fn reaches(&self, vessels: &Vessels) -> bool {
        self.region(vessels).is_some_and(|region| vessels.may_meet(region.min(), region.max()))
    }
}

/// The place of a tree whose wall is nearest to a point of the world. Radii count by the mean scale; centre lines are
/// measured in the world, whatever the scale of the axes.
pub(crate) fn nearest_place(touch: &Touch, indexed: &IndexedVessels, wounds: Option<&Wounds>) -> Option<Near> {
    let &Touch { point, reach, to_world } = touch;
    let (tree, scale) = (indexed.tree(), mean_scale(&to_world));
    let mut best: Option<Near> = None;
    indexed.candidates(&touch.region(indexed.vessels)?, &mut |node: NodeId| {
        let Some(parent) = tree.parent(node) else { return };
        let [a, b] = [parent, node].map(|node| to_world.transform_point3(tree.positions()[node.index()]));
        let radius = tree.radii()[node.index()] * scale;
        for [from, to] in pieces_left(wounds, node) {
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
        }
    });
    best
}

/// What is left of a segment, as shares of the way from the parent's node.
fn pieces_left(wounds: Option<&Wounds>, node: NodeId) -> impl Iterator<Item = [f32; 2]> {
    let severed = wounds.filter(|wounds| wounds.is_severed(node));
    let whole = severed.is_none().then_some([0.0, 1.0]);
    let pieces = severed.into_iter().flat_map(move |wounds| wounds.pieces(node));
    whole.into_iter().chain(pieces.map(|piece| [piece.from, piece.to]))
}

/// The place of a tree that a ray of the world meets first.
///
/// Transforms keep lines straight, and the order of what lies on them: the ray meets in the space of the vessels what it
/// meets in the world.
fn first_place(ray: Ray3d, reach: f32, to_world: Affine3A, found: &PickableItem) -> Option<Near> {
    /// What rounding may take off the reach.
    const ROOM: f32 = 1.0 + 1.0e-6;
    let to_local = to_world.inverse();
    let (from, direction) = (to_local.transform_point3(ray.origin), to_local.transform_vector3(*ray.direction));
    // How long a unit of the world is along the ray.
    let stretch = direction.length();
    let mut cast = RayCast::new(from, direction, reach * stretch * ROOM)?;
    let around = found.vessels.aabb();
    if !cast.may_meet_ball(around.center.into(), around.half_extents.length()) {
        return None;
    }
    let wounds = found.wounds();
    let indexed = found.search();
    indexed.cast(&mut cast, |node| pieces_left(wounds, node));
    let (place, distance) = cast.found()?;
    let position = to_world.transform_point3(indexed.tree().position_at(place));
    let near = Near { place, position, distance: distance / stretch };
    (near.distance <= reach).then_some(near)
}

/// Cube root of how much larger volumes are in the world.
pub(crate) fn mean_scale(to_world: &Affine3A) -> f32 {
    bevy::math::ops::cbrt(to_world.matrix3.determinant().abs())
}

/// By how many of its radii a vessel may reach out of its box, where axes have other scales than the mean.
fn unevenness(scaled_unit: Vec3) -> Vec3 {
    (scaled_unit - 1.0).max(Vec3::ZERO)
}
