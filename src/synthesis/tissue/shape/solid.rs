//! Solid shapes: ball, box and ellipsoid.

use super::{in_unit_ball, signed, tolerance};
use crate::synthesis::random::{VesselRng, many};
use crate::synthesis::tissue::{
    Extent, Tissue, TissuePoint,
    error::{TissueError, finite_point, positive},
};
use bevy_math::{DVec3, Vec3, bounding::Aabb3d};
use std::f32::consts::PI;

/// A point of a solid, where there is no normal.
fn inside(position: Vec3) -> TissuePoint {
    TissuePoint::new(position, Vec3::ZERO)
}

/// Appends points drawn uniformly from the unit ball, each mapped by `place`.
fn draw_in_ball(rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>, place: impl Fn(Vec3) -> Vec3) {
    many::draw(rng, count, candidates, |words| {
        let point = Vec3::from(words.map(many::signed));
        (point.length_squared() <= 1.0, place(point))
    });
}

/// A solid ball.
#[derive(Clone, Debug, PartialEq)]
pub struct Ball {
    center: Vec3,
    radius: f32,
}

impl Ball {
    /// A ball around `center`.
    ///
    /// # Errors
    /// A coordinate that is not finite, a radius that is not above 0.
    pub fn new(center: Vec3, radius: f32) -> Result<Self, TissueError> {
        let center = finite_point("the ball's centre", center)?;
        Ok(Self { center, radius: positive("the ball's radius", radius)? })
    }

    /// Its centre.
    pub fn center(&self) -> Vec3 {
        self.center
    }

    /// Its radius.
    pub fn radius(&self) -> f32 {
        self.radius
    }
}

impl Tissue for Ball {
    fn bounds(&self) -> Aabb3d {
        Aabb3d { min: (self.center - self.radius).into(), max: (self.center + self.radius).into() }
    }

    fn extent(&self) -> Extent {
        Extent::Volume(4.0 / 3.0 * PI * self.radius * self.radius * self.radius)
    }

    fn contains(&self, point: Vec3) -> bool {
        point.distance(self.center) <= self.radius + tolerance(self.center, self.radius)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        inside(self.center + (point - self.center).clamp_length_max(self.radius))
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        Some(self.radius - point.distance(self.center))
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        Some(self.center + in_unit_ball(rng)? * self.radius)
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        draw_in_ball(rng, count, candidates, |point| self.center + point * self.radius);
    }
}

/// A solid box along the axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuboid {
    center: Vec3,
    half: Vec3,
}

impl Cuboid {
    /// A box around `center` with these full side lengths.
    ///
    /// # Errors
    /// A coordinate that is not finite, a side that is not above 0.
    pub fn new(center: Vec3, size: Vec3) -> Result<Self, TissueError> {
        let center = finite_point("the box's centre", center)?;
        for side in size.to_array() {
            positive("a side of the box", side)?;
        }
        Ok(Self { center, half: size / 2.0 })
    }
}

impl Tissue for Cuboid {
    fn bounds(&self) -> Aabb3d {
        Aabb3d { min: (self.center - self.half).into(), max: (self.center + self.half).into() }
    }

    fn extent(&self) -> Extent {
        Extent::Volume(8.0 * self.half.element_product())
    }

    fn contains(&self, point: Vec3) -> bool {
        let tolerance = tolerance(self.center, self.half.max_element());
        (point - self.center).abs().cmple(self.half + tolerance).all()
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        inside(self.center + (point - self.center).clamp(-self.half, self.half))
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        Some((self.half - (point - self.center).abs()).min_element())
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        Some(self.center + self.half * Vec3::new(signed(rng), signed(rng), signed(rng)))
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        many::draw(rng, count, candidates, |words| {
            (true, self.center + self.half * Vec3::from(words.map(many::signed)))
        });
    }
}

/// A solid ellipsoid along the axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    center: Vec3,
    half: Vec3,
}

impl Ellipsoid {
    /// An ellipsoid around `center` with these half axes.
    ///
    /// # Errors
    /// A coordinate that is not finite, a half axis that is not above 0.
    pub fn new(center: Vec3, half_axes: Vec3) -> Result<Self, TissueError> {
        let center = finite_point("the ellipsoid's centre", center)?;
        for axis in half_axes.to_array() {
            positive("a half axis of the ellipsoid", axis)?;
        }
        Ok(Self { center, half: half_axes })
    }
}

impl Tissue for Ellipsoid {
    fn bounds(&self) -> Aabb3d {
        Aabb3d { min: (self.center - self.half).into(), max: (self.center + self.half).into() }
    }

    fn extent(&self) -> Extent {
        Extent::Volume(4.0 / 3.0 * PI * self.half.element_product())
    }

    fn contains(&self, point: Vec3) -> bool {
        let share = tolerance(self.center, self.half.max_element()) / self.half.min_element();
        ((point - self.center) / self.half).length() <= 1.0 + share
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        if self.contains(point) {
            return inside(point);
        }
        inside(self.center + nearest_on_ellipsoid((point - self.center).as_dvec3(), self.half.as_dvec3()).as_vec3())
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        let half = self.half.as_dvec3();
        // Off the planes of symmetry, on which the nearest point may not be unique.
        let offset = (point - self.center).as_dvec3().abs().max(OFF_PLANE * half);
        let distance = nearest_on_ellipsoid(offset, half).distance(offset);
        let is_inside = (offset / half).length_squared() <= 1.0;
        // The shift off the planes must not make it more.
        Some((if is_inside { distance } else { -distance } - OFF_PLANE * half.length()) as f32)
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        // A uniform distribution stays uniform when stretched.
        Some(self.center + in_unit_ball(rng)? * self.half)
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        draw_in_ball(rng, count, candidates, |point| self.center + point * self.half);
    }
}

/// Distance, in half axes, that a point keeps from the planes of symmetry of an ellipsoid when its depth is measured.
const OFF_PLANE: f64 = 1.0e-7;

/// The point of an ellipsoid around the origin that is nearest to a point outside it, or to one inside that is on none
/// of the planes of symmetry.
///
/// It is x = e²·p / (t + e²) for the t that satisfies F(t) = Σ (e·p / (t + e²))² − 1 = 0 (Eberly, "Distance from a
/// Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid", 2013). Outside, t is above 0; inside, it is above −e² for
/// the least e. There F is decreasing and convex, so Newton's steps from below never overshoot.
fn nearest_on_ellipsoid(point: DVec3, half: DVec3) -> DVec3 {
    let squares = half * half;
    // At this t one term is already 1, so F is not below 0.
    let mut t = (half * point.abs() - squares).max_element();
    for _ in 0..100 {
        let ratios = half * point / (squares + t);
        let value = ratios.length_squared() - 1.0;
        let slope = -2.0 * (ratios * ratios / (squares + t)).element_sum();
        let next = t - value / slope;
        // `next` is NaN if the slope is 0: then nothing is gained either.
        let gains = next > t;
        if !gains {
            break;
        }
        t = next;
    }
    squares * point / (squares + t)
}
