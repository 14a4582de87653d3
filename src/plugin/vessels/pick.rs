//! Finds the vessel that is nearest to a point of the world or hit by a ray: the one clicked, or touched by an
//! instrument.
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
    /// Position on its centre line, in world space.
    pub position: Vec3,
    /// Distance to its wall, in world units: from the point, negative inside the vessel; or along the ray, 0 if that
    /// begins inside.
    pub distance: f32,
}

/// Finds vessels of all organs in world space, shown or hidden.
///
/// If an organ is [`Cuttable`](crate::plugin::Cuttable), only the remaining parts of severed vessels are found.
/// Transforms are those of the organ and its parents at the time of the query. Of equally near vessels, the one with
/// the lowest entity and node is returned.
///
/// The first query of vessels indexes them; see [`VesselIndex`]. Vessels out of reach are not queried.
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

    /// The wounds of these vessels, not of others before them.
    fn wounds(&self) -> Option<&Wounds> {
        self.wounds.filter(|wounds| wounds.is_of(self.vessels)).map(VesselWounds::ledger)
    }

    fn place(&self, Near { place, position, distance }: Near) -> VesselPlace {
        let Self { entity, organ, vessels, .. } = *self;
        VesselPlace { organ: organ.0, vessels: entity, kind: vessels.kind(), place, position, distance }
    }
}

impl VesselPicker<'_, '_> {
    /// The nearest place of a remaining vessel to a point; `None` if no vessel's wall is within `reach`. World units.
    ///
    /// `reach` must be finite: nothing is within an infinite one.
    ///
    /// Under a non-uniform scale, centre lines are where they are drawn, and radii use the mean scale, as for a cut.
    pub fn nearest(&self, point: Vec3, reach: f32) -> Option<VesselPlace> {
        self.best(reach, |found, to_world, reach| {
            let touch = Touch { point, reach, to_world };
            touch.reaches(found.vessels).then(|| nearest_place(&touch, &found.search(), found.wounds()))?
        })
    }

    /// The place where a ray first hits a vessel's wall, at most `reach` from its origin; `reach` may be infinite.
    /// World units.
    ///
    /// The ray hits what is drawn, under any scale, mirror or shear. `distance` is along the ray; the place is on the
    /// centre line behind the hit wall. The ray passes through a gap, but not into the lumen beside it: a flat face
    /// closes a cut vessel there.
    pub fn ray(&self, ray: Ray3d, reach: f32) -> Option<VesselPlace> {
        self.best(reach, |found, to_world, reach| first_place(ray, reach, to_world, found))
    }

    /// The nearest result of all vessel entities. Each is queried only up to the nearest result before it.
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

/// A point in the world with a reach, and the transform of the vessels.
pub(crate) struct Touch {
    pub(crate) point: Vec3,
    pub(crate) reach: f32,
    pub(crate) to_world: Affine3A,
}

impl Touch {
    /// The box, in the space of the vessels, of everything that may be within reach; `None` if there is none.
    fn region(&self, vessels: &Vessels) -> Option<Region> {
        let &Self { point, reach, to_world } = self;
        let to_local = to_world.inverse();
        if !(point.is_finite() && reach.is_finite() && to_local.is_finite()) {
            return None;
        }
        // Half extent, in local space, of the box around a world ball of radius 1.
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

/// The place of a tree whose wall is nearest to a point of the world. Radii use the mean scale; distances to centre
/// lines are measured in the world, under any scale.
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
            // NaN if the segment has no length.
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

/// The remaining parts of a segment, as shares of the way from the parent's node.
fn pieces_left(wounds: Option<&Wounds>, node: NodeId) -> impl Iterator<Item = [f32; 2]> {
    let severed = wounds.filter(|wounds| wounds.is_severed(node));
    let whole = severed.is_none().then_some([0.0, 1.0]);
    let pieces = severed.into_iter().flat_map(move |wounds| wounds.pieces(node));
    whole.into_iter().chain(pieces.map(|piece| [piece.from, piece.to]))
}

/// The place of a tree that a world ray hits first.
///
/// Transforms keep lines straight and the order of points on them, so the ray hits the same things in the space of the
/// vessels as in the world.
fn first_place(ray: Ray3d, reach: f32, to_world: Affine3A, found: &PickableItem) -> Option<Near> {
    /// Margin for rounding errors of the reach.
    const ROOM: f32 = 1.0 + 1.0e-6;
    let to_local = to_world.inverse();
    let (from, direction) = (to_local.transform_point3(ray.origin), to_local.transform_vector3(*ray.direction));
    // Local length of a world unit along the ray.
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

/// Cube root of the factor by which volumes are larger in the world.
pub(crate) fn mean_scale(to_world: &Affine3A) -> f32 {
    bevy::math::ops::cbrt(to_world.matrix3.determinant().abs())
}

/// Number of its radii by which a vessel may extend beyond its box, along axes whose scale differs from the mean.
fn unevenness(scaled_unit: Vec3) -> Vec3 {
    (scaled_unit - 1.0).max(Vec3::ZERO)
}
