//! Blades: shapes that cut, checked once, and their transforms into the space of an organ.
//!
//! Two kinds. A **surface** (rectangle, disc, swept edge, triangles) severs a vessel where its centre line passes
//! through. A **volume** (ball, capsule) removes all that lies inside, and severs what passes its boundary.
//!
//! A blade is given in the space of the caller, usually the world. [`Blade::to_local`] transforms it into an organ's
//! space, where the vessels are. Triangles are transformed corner by corner. Curved shapes keep the map from the new
//! space back to the original one and are evaluated there, so a ball stays a ball of the world under non-uniform scale,
//! mirrors and shears.

use crate::synthesis::segment_index::{Region, axes};
use bevy_math::{Affine3A, DAffine3, DMat3, DVec3, Vec3};

/// The reason why a blade cannot cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BladeError {
    /// A coordinate or size that is infinite or NaN.
    #[error("{what} of the blade is {value}; it must be a finite number")]
    NotFinite {
        /// Which one.
        what: &'static str,
        /// The value found.
        value: f32,
    },
    /// A radius that is zero or negative.
    #[error("{what} of the blade is {value}; it must be above 0")]
    NotPositive {
        /// Which one.
        what: &'static str,
        /// The value found.
        value: f32,
    },
    /// A surface without area, such as an edge that has not moved.
    #[error(
        "the blade has no area: the corners of each of its {triangles} triangles lie on a line; skip edges that have not moved"
    )]
    NoArea {
        /// Number of triangles.
        triangles: usize,
    },
    /// A cutter without triangles.
    #[error("the blade has no triangles; give at least one")]
    NoTriangles,
    /// A disc whose plane is not given.
    #[error("the normal of the disc has no length; give the direction in which it faces")]
    NoNormal,
    /// A transform that flattens space, or holds NaN.
    #[error(
        "the organ's transform has determinant {determinant}; it must be finite and not 0: give every axis a scale"
    )]
    Singular {
        /// Its determinant.
        determinant: f64,
    },
    /// An action that needs a ball or capsule.
    #[error("the blade is a surface and holds nothing; cauterise with a ball or a capsule")]
    NotAVolume,
}

/// A shape that cuts.
///
/// A surface blade includes its edges and corners: a centre line that passes exactly through one is severed once,
/// however many triangles meet there.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct Blade {
    pub(super) shape: Shape,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// Corners in the present space.
    Triangles(Vec<[Vec3; 3]>),
    Disc(Disc),
    Volume(Volume),
}

/// The maps between the present space and a shape's original one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// From the present space to the shape's.
    pub inward: DAffine3,
    /// From the shape's space to the present one.
    outward: DAffine3,
}

/// A flat round blade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    pub center: DVec3,
    /// Unit vector.
    pub normal: DVec3,
    pub radius: f64,
    pub frame: Frame,
}

/// All points within a distance of a line, or of a point if both ends coincide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Volume {
    pub from: DVec3,
    pub to: DVec3,
    pub radius: f64,
    pub frame: Frame,
}

impl Blade {
    /// A flat rectangle, given by its centre and the vectors from there to the middles of two neighbouring sides.
    ///
    /// Vectors that are not perpendicular make a parallelogram. Units: those of the caller's space.
    ///
    /// # Errors
    /// A coordinate that is not finite; vectors that span no area.
    pub fn rectangle(center: Vec3, half_width: Vec3, half_height: Vec3) -> Result<Self, BladeError> {
        let [a, b] = [center - half_width, center + half_width];
        Self::sweep([a - half_height, b - half_height], [a + half_height, b + half_height])
    }

    /// A flat disc. The normal may have any length.
    ///
    /// # Errors
    /// A number that is not finite, a radius that is not above 0, a normal without length.
    pub fn disc(center: Vec3, normal: Vec3, radius: f32) -> Result<Self, BladeError> {
        finite_point("the centre", center)?;
        finite_point("the normal", normal)?;
        let radius = positive("the radius", radius)?;
        let normal = normal.as_dvec3().try_normalize().ok_or(BladeError::NoNormal)?;
        let disc = Disc { center: center.as_dvec3(), normal, radius, frame: Frame::IDENTITY };
        Ok(Self { shape: Shape::Disc(disc) })
    }

    /// The path of a straight edge between two frames, such as a scalpel's, given by its two ends before and after.
    ///
    /// The path is two triangles that share the diagonal from the first end before to the second end after; if the edge
    /// also turned, they approximate its curved path. Sweeps of successive frames share their edges exactly, so nothing
    /// slips through between them. An edge that turns about one of its ends sweeps one triangle.
    ///
    /// # Errors
    /// A coordinate that is not finite; an edge without length, or one that has not moved sideways.
    pub fn sweep(before: [Vec3; 2], after: [Vec3; 2]) -> Result<Self, BladeError> {
        Self::triangles(vec![[before[0], before[1], after[1]], [before[0], after[1], after[0]]])
    }

    /// Any triangles, such as those of a cutter's mesh: open or closed, in any order and winding. Those without area cut
    /// nothing.
    ///
    /// # Errors
    /// No triangle; a coordinate that is not finite; no triangle with an area.
    pub fn triangles(triangles: Vec<[Vec3; 3]>) -> Result<Self, BladeError> {
        if triangles.is_empty() {
            return Err(BladeError::NoTriangles);
        }
        for &corner in triangles.as_flattened() {
            finite_point("a corner", corner)?;
        }
        if !triangles.iter().any(has_area) {
            return Err(BladeError::NoArea { triangles: triangles.len() });
        }
        Ok(Self { shape: Shape::Triangles(triangles) })
    }

    /// All points within `radius` of a point, such as the tip of an ultrasonic or bipolar instrument.
    ///
    /// # Errors
    /// A number that is not finite, a radius that is not above 0.
    pub fn ball(center: Vec3, radius: f32) -> Result<Self, BladeError> {
        Self::capsule(center, center, radius)
    }

    /// All points within `radius` of a line, such as the jaws of an instrument or the path of its tip in a frame.
    ///
    /// # Errors
    /// A number that is not finite, a radius that is not above 0.
    pub fn capsule(from: Vec3, to: Vec3, radius: f32) -> Result<Self, BladeError> {
        finite_point("an end", from)?;
        finite_point("an end", to)?;
        let radius = positive("the radius", radius)?;
        let volume = Volume { from: from.as_dvec3(), to: to.as_dvec3(), radius, frame: Frame::IDENTITY };
        Ok(Self { shape: Shape::Volume(volume) })
    }

    /// Whether the blade removes what lies within it.
    pub fn is_volume(&self) -> bool {
        matches!(self.shape, Shape::Volume(_))
    }

    /// The same blade in the space of an organ, given the transform from there to the blade's space.
    ///
    /// Mirrors, non-uniform scale and shear are allowed. Corners are mapped in f64 and rounded to f32, each by itself,
    /// so triangles still share their corners exactly.
    ///
    /// # Errors
    /// A transform without inverse; corners so far away in the organ's space that they are not finite there.
    pub fn to_local(&self, local_to_world: &Affine3A) -> Result<Self, BladeError> {
        let frame = Frame::new(local_to_world)?;
        let shape = match &self.shape {
            Shape::Triangles(triangles) => {
                let local = |corner: Vec3| frame.outward.transform_point3(corner.as_dvec3()).as_vec3();
                let triangles: Vec<_> = triangles.iter().map(|corners| corners.map(local)).collect();
                for &corner in triangles.as_flattened() {
                    finite_point("a corner in the organ's space", corner)?;
                }
                Shape::Triangles(triangles)
            }
            Shape::Disc(disc) => Shape::Disc(Disc { frame: disc.frame.after(&frame), ..*disc }),
            Shape::Volume(volume) => Shape::Volume(Volume { frame: volume.frame.after(&frame), ..*volume }),
        };
        Ok(Self { shape })
    }

    /// Calls `visit(region, part)` for parts that make up the blade.
    ///
    /// Triangles come in pairs, so that a swept edge needs only one index query.
    pub(super) fn parts(&self, mut visit: impl FnMut(&Region, Part)) {
        match &self.shape {
            Shape::Triangles(triangles) => {
                for pair in triangles.chunks(2) {
                    visit(&region_of(pair), Part::Triangles(pair));
                }
            }
            Shape::Disc(disc) => visit(&disc.region(), Part::Disc(disc)),
            Shape::Volume(volume) => visit(&volume.region(), Part::Volume(volume)),
        }
    }
}

/// The region of some triangles: across their plane, and along their longest edge.
fn region_of(triangles: &[[Vec3; 3]]) -> Region {
    let normal = |&[a, b, c]: &[Vec3; 3]| (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3());
    let edges =
        triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).map(|(a, b)| b.as_dvec3() - a.as_dvec3());
    let longest = |a: DVec3, b: DVec3| if b.length_squared() > a.length_squared() { b } else { a };
    let [normal, along] = [triangles.iter().map(normal).fold(DVec3::ZERO, longest), edges.fold(DVec3::ZERO, longest)];
    Region::of(axes(normal, along), |axis| {
        let along = triangles.as_flattened().iter().map(|corner| corner.as_dvec3().dot(axis));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], along| [low.min(along), high.max(along)])
    })
}

/// A part of a blade for one index query.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part<'a> {
    Triangles(&'a [[Vec3; 3]]),
    Disc(&'a Disc),
    Volume(&'a Volume),
}

impl Frame {
    const IDENTITY: Self = Self { inward: DAffine3::IDENTITY, outward: DAffine3::IDENTITY };

    /// The frame of a shape that is given in the target space of a transform.
    fn new(local_to_world: &Affine3A) -> Result<Self, BladeError> {
        let axes = &local_to_world.matrix3;
        let matrix3 = DMat3::from_cols(axes.x_axis.as_dvec3(), axes.y_axis.as_dvec3(), axes.z_axis.as_dvec3());
        let inward = DAffine3 { matrix3, translation: local_to_world.translation.as_dvec3() };
        let determinant = matrix3.determinant();
        let outward = if determinant == 0.0 { DAffine3::ZERO } else { inward.inverse() };
        if determinant == 0.0 || !(inward.is_finite() && outward.is_finite()) {
            return Err(BladeError::Singular { determinant });
        }
        Ok(Self { inward, outward })
    }

    /// This frame, combined with a further one.
    fn after(&self, next: &Self) -> Self {
        Self { inward: self.inward * next.inward, outward: next.outward * self.outward }
    }

    /// Extent of a ball of the shape's space along an axis of the present space. `flat` is the normal of a disc
    /// instead.
    fn reach(&self, center: DVec3, radius: f64, flat: DVec3, axis: DVec3) -> [f64; 2] {
        let row = self.outward.matrix3.transpose() * axis;
        let along = row.dot(flat);
        let half = radius * (row.length_squared() - along * along).max(0.0).sqrt();
        let center = self.outward.transform_point3(center);
        // More than the rounding so far.
        let half = half + ROUNDING * (half + (center.abs() + self.outward.translation.abs()).dot(axis.abs()));
        let center = center.dot(axis);
        [center - half, center + half]
    }
}

/// Share by which regions of curved shapes are widened against rounding in f64.
const ROUNDING: f64 = 1e-12;

impl Disc {
    fn region(&self) -> Region {
        let Self { center, normal, radius, frame } = self;
        // Normals transform like planes.
        let plane = frame.inward.matrix3.transpose() * *normal;
        Region::of(axes(plane, plane.any_orthogonal_vector()), |axis| frame.reach(*center, *radius, *normal, axis))
    }
}

impl Volume {
    fn region(&self) -> Region {
        let Self { from, to, radius, frame } = self;
        let along = frame.outward.transform_vector3(*to - *from);
        Region::of(axes(along, along.any_orthogonal_vector()), |axis| {
            let [a, b] = frame.reach(*from, *radius, DVec3::ZERO, axis);
            let [c, d] = frame.reach(*to, *radius, DVec3::ZERO, axis);
            [a.min(c), b.max(d)]
        })
    }
}

fn has_area(&[a, b, c]: &[Vec3; 3]) -> bool {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a) != DVec3::ZERO
}

fn finite_point(what: &'static str, point: Vec3) -> Result<(), BladeError> {
    match point.to_array().into_iter().find(|value| !value.is_finite()) {
        Some(value) => Err(BladeError::NotFinite { what, value }),
        None => Ok(()),
    }
}

fn positive(what: &'static str, value: f32) -> Result<f64, BladeError> {
    if !value.is_finite() {
        return Err(BladeError::NotFinite { what, value });
    }
    if value > 0.0 { Ok(f64::from(value)) } else { Err(BladeError::NotPositive { what, value }) }
}
