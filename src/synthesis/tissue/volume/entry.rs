//! The way into a solid: the nearest point inside, from one outside.

use super::solid::Solid;
use crate::synthesis::mesh::SurfacePoint;
use bevy_math::{DVec3, Vec3};
use std::sync::OnceLock;

/// Depths to which a point is brought inside, in voxels: the first that is inside is used.
const DEPTHS: [f64; 6] = [0.01, 0.05, 0.2, 0.5, 0.001, 0.0001];
/// Times that a way is halved to find where it leaves the solid.
const HALVINGS: u32 = 24;

/// Where to enter a solid whose surface is no sure guide to its inside.
#[derive(Clone, Debug, Default)]
pub(super) struct Entries {
    /// Triangles at whose middle one enters. Found when first needed, for meshes with flaps that enclose nothing.
    bounding: OnceLock<Vec<bool>>,
    /// Some points inside.
    anchors: Vec<Vec3>,
}

impl Entries {
    /// Entries with some points that are inside, for use where no surface leads in.
    pub fn new(anchors: Vec<Vec3>) -> Self {
        Self { bounding: OnceLock::new(), anchors }
    }

    /// A point a little inside, below the place of the surface nearest to a point outside. `None` for a point that is not
    /// finite.
    pub fn nearest(&self, solid: &Solid, point: Vec3) -> Option<Vec3> {
        let nearest = solid.index.closest(point)?;
        below(solid, &nearest, point).or_else(|| {
            let bounding = self.bounding.get_or_init(|| bounding(solid));
            let beyond = solid.index.closest_of(point, f32::INFINITY, |triangle| bounding[triangle]);
            beyond.and_then(|found| below(solid, &found, point)).or_else(|| self.beside_anchor(solid, point))
        })
    }

    /// The last point inside on a straight way from the nearest anchor.
    fn beside_anchor(&self, solid: &Solid, point: Vec3) -> Option<Vec3> {
        let distance = |anchor: &Vec3| anchor.as_dvec3().distance_squared(point.as_dvec3());
        let nearest = self.anchors.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(last_inside(solid, *nearest, point))
    }
}

/// Which triangles bound the inside, by their middles.
fn bounding(solid: &Solid) -> Vec<bool> {
    let mut bounding = vec![false; solid.corners.len()];
    for &triangle in solid.index.triangles() {
        let corners = solid.corners[triangle as usize];
        let middle = corners.map(|corner| corner.as_dvec3() / 3.0).into_iter().sum::<DVec3>().as_vec3();
        let place = SurfacePoint::of(corners, triangle as usize, middle);
        bounding[triangle as usize] = below(solid, &place, middle).is_some();
    }
    bounding
}

/// A point inside close to a place of the surface, as it is reached from `point`.
fn below(solid: &Solid, place: &SurfacePoint, point: Vec3) -> Option<Vec3> {
    let on = place.position.as_dvec3();
    let [a, b, c] = solid.corners[place.triangle].map(|corner| corner.as_dvec3());
    // Further in the same direction, and inwards by the triangle's normal, or outwards if that faces the wrong way.
    let onwards = (on - point.as_dvec3()).normalize_or_zero();
    let inwards = -(b - a).cross(c - a).normalize_or_zero();
    let corner_to_middle = ((a + b + c) / 3.0 - on).normalize_or_zero();
    let directions = [inwards, onwards, inwards + corner_to_middle, -inwards];
    let at = |direction: DVec3, depth: f64| (on + direction * (depth * solid.grid.cell())).as_vec3();
    let candidates = DEPTHS.iter().flat_map(|&depth| directions.map(|direction| at(direction, depth)));
    // Where it is thinner than any of these depths, the middle between both sides.
    let across = directions.into_iter().filter_map(|direction| {
        let hit = solid.index.first_hit(at(direction, 1e-6), at(direction, 1.0))?;
        Some(hit.position.midpoint(place.position))
    });
    candidates.chain(across).find(|&candidate| solid.contains(candidate))
}

/// The last point inside before a straight way first leaves the solid, or later leaves it again. It starts inside.
pub(super) fn last_inside(solid: &Solid, from: Vec3, to: Vec3) -> Vec3 {
    let (mut inside, mut beyond) = (from, to);
    for _ in 0..HALVINGS {
        let middle = inside.midpoint(beyond);
        if solid.contains(middle) {
            inside = middle;
        } else {
            beyond = middle;
        }
    }
    inside
}
