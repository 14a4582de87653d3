//! Flat shapes: disc and rectangle, which are surfaces.

use super::{in_unit_disc, signed, tolerance};
use crate::synthesis::random::{VesselRng, many};
use crate::synthesis::tissue::{
    Extent, Tissue, TissuePiece, TissuePoint,
    error::{TissueError, finite_point, positive},
    pieces,
};
use bevy_math::{UVec2, Vec2, Vec3, bounding::Aabb3d, ops};
use std::f32::consts::{FRAC_1_SQRT_2, PI};

/// A flat disc, the tissue of the paper's examples.
#[derive(Clone, Debug, PartialEq)]
pub struct Disc {
    center: Vec3,
    normal: Vec3,
    /// Perpendicular unit vectors in the disc's plane.
    axes: [Vec3; 2],
    radius: f32,
}

impl Disc {
    /// A disc around `center`, with any nonzero `normal`.
    ///
    /// # Errors
    /// A coordinate that is not finite, a normal without direction, a radius that is not above 0.
    pub fn new(center: Vec3, normal: Vec3, radius: f32) -> Result<Self, TissueError> {
        finite_point("the disc's centre", center)?;
        let length = positive("the length of the disc's normal", finite_point("the disc's normal", normal)?.length())?;
        let radius = positive("the disc's radius", radius)?;
        let normal = normal / length;
        // For the usual disc these are X and Y.
        let (x, y) = normal.any_orthonormal_pair();
        Ok(Self { center, normal, axes: [x, y], radius })
    }

    /// A disc in the plane z = 0 around the origin.
    ///
    /// # Errors
    /// A radius that is not finite and above 0.
    pub fn flat(radius: f32) -> Result<Self, TissueError> {
        Self::new(Vec3::ZERO, Vec3::Z, radius)
    }

    /// Its centre.
    pub fn center(&self) -> Vec3 {
        self.center
    }

    /// Its unit normal.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Its radius.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Coordinates of a point in the disc's plane, and its height over the plane.
    fn local(&self, point: Vec3) -> (Vec2, f32) {
        let offset = point - self.center;
        (Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1])), offset.dot(self.normal))
    }

    fn at(&self, local: Vec2) -> Vec3 {
        self.center + self.axes[0] * local.x + self.axes[1] * local.y
    }
}

impl Tissue for Disc {
    fn bounds(&self) -> Aabb3d {
        // Along each axis, a disc reaches its radius times the sine of the angle between axis and normal.
        let half = (Vec3::ONE - self.normal * self.normal).max(Vec3::ZERO).map(f32::sqrt) * self.radius;
        Aabb3d { min: (self.center - half).into(), max: (self.center + half).into() }
    }

    fn extent(&self) -> Extent {
        Extent::Area(PI * self.radius * self.radius)
    }

    fn contains(&self, point: Vec3) -> bool {
        let (local, height) = self.local(point);
        let tolerance = tolerance(self.center, self.radius);
        height.abs() <= tolerance && local.length() <= self.radius + tolerance
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        let position = self.at(self.local(point).0.clamp_length_max(self.radius));
        TissuePoint::new(position, self.normal)
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        Some(self.radius - self.local(point).0.length())
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        Some(self.at(in_unit_disc(rng)? * self.radius))
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        many::draw(rng, count, candidates, |words| {
            let point = Vec2::from(words.map(many::signed));
            (point.length_squared() <= 1.0, self.at(point * self.radius))
        });
    }

    /// Rings of equal width, from the middle outwards, of 3, 9, 15, … sectors: all of the same area.
    fn cut(&self, reach: f32, pieces: &mut Vec<TissuePiece>) -> bool {
        let rings = pieces::parts(self.radius, 1.15 * reach);
        let width = self.radius / rings as f32;
        let measure = PI * width * width / SECTORS as f32;
        for ring in 0..rings {
            let sectors = SECTORS * (2 * ring + 1);
            let half = PI / sectors as f32;
            let (inner, outer) = (ring as f32 * width, (ring + 1) as f32 * width);
            // Halfway between inner and outer arc; the corners of the outer one are the farthest.
            let middle = 0.5 * (inner * ops::cos(half) + outer);
            let corner = Vec2::new(outer * ops::cos(half) - middle, outer * ops::sin(half)).length();
            let inner_corner = Vec2::new(inner * ops::cos(half) - middle, inner * ops::sin(half)).length();
            let reach = corner.max(inner_corner).max(outer - middle).max(middle - inner);
            for sector in 0..sectors {
                let center = self.at(middle * direction(half * (2 * sector + 1) as f32));
                pieces.push(TissuePiece { center, reach, measure, side: Vec3::ZERO, id: [ring, sector] });
            }
        }
        true
    }

    fn point_of(&self, reach: f32, [ring, sector]: [u32; 2], [outward, around, _]: [f32; 3]) -> Option<Vec3> {
        let rings = pieces::parts(self.radius, 1.15 * reach);
        let (inner, outer) = (ring as f32, (ring + 1) as f32);
        let distance = (inner * inner + (outer * outer - inner * inner) * outward).sqrt() * self.radius / rings as f32;
        let angle = (sector as f32 + around) * (2.0 * PI / (SECTORS * (2 * ring + 1)) as f32);
        Some(self.at(distance * direction(angle)))
    }
}

/// Sectors in the innermost ring of a disc that is cut.
const SECTORS: u32 = 3;

/// The unit vector at an angle from the first axis, in radians.
fn direction(angle: f32) -> Vec2 {
    let (sin, cos) = ops::sin_cos(angle);
    Vec2::new(cos, sin)
}

/// A flat rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectangle {
    center: Vec3,
    /// Perpendicular unit vectors along the sides.
    axes: [Vec3; 2],
    half: Vec2,
}

/// Cosine of the angle between two sides below which they count as perpendicular.
const PERPENDICULAR: f32 = 1.0e-4;

impl Rectangle {
    /// A rectangle around `center`; `half_x` and `half_y` go from there to the middles of two sides.
    ///
    /// Its normal is `half_x` × `half_y`.
    ///
    /// # Errors
    /// A coordinate that is not finite, a side without length, sides that are not perpendicular.
    pub fn new(center: Vec3, half_x: Vec3, half_y: Vec3) -> Result<Self, TissueError> {
        finite_point("the rectangle's centre", center)?;
        let x =
            positive("half the rectangle's first side", finite_point("the rectangle's first side", half_x)?.length())?;
        let y = positive(
            "half the rectangle's second side",
            finite_point("the rectangle's second side", half_y)?.length(),
        )?;
        let (axis_x, axis_y) = (half_x / x, half_y / y);
        let cosine = axis_x.dot(axis_y);
        if cosine.abs() > PERPENDICULAR {
            return Err(TissueError::NotPerpendicular { cosine });
        }
        Ok(Self { center, axes: [axis_x, (axis_y - axis_x * cosine).normalize()], half: Vec2::new(x, y) })
    }

    /// A rectangle of this size in the plane z = 0 around the origin.
    ///
    /// # Errors
    /// A size that is not finite and above 0.
    pub fn flat(size: Vec2) -> Result<Self, TissueError> {
        Self::new(Vec3::ZERO, Vec3::X * (size.x / 2.0), Vec3::Y * (size.y / 2.0))
    }

    /// Its unit normal.
    pub fn normal(&self) -> Vec3 {
        self.axes[0].cross(self.axes[1])
    }

    fn at(&self, local: Vec2) -> Vec3 {
        self.center + self.axes[0] * local.x + self.axes[1] * local.y
    }

    /// Number of pieces along each side.
    fn parts(&self, reach: f32) -> UVec2 {
        UVec2::from((2.0 * self.half).to_array().map(|length| pieces::parts(length, 2.0 * FRAC_1_SQRT_2 * reach)))
    }

    fn nearest(&self, point: Vec3) -> Vec3 {
        let offset = point - self.center;
        self.at(Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1])).clamp(-self.half, self.half))
    }
}

impl Tissue for Rectangle {
    fn bounds(&self) -> Aabb3d {
        let half = self.axes[0].abs() * self.half.x + self.axes[1].abs() * self.half.y;
        Aabb3d { min: (self.center - half).into(), max: (self.center + half).into() }
    }

    fn extent(&self) -> Extent {
        Extent::Area(4.0 * self.half.x * self.half.y)
    }

    fn contains(&self, point: Vec3) -> bool {
        point.distance(self.nearest(point)) <= tolerance(self.center, self.half.length())
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        TissuePoint::new(self.nearest(point), self.normal())
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        let offset = point - self.center;
        let local = Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1]));
        Some((self.half - local.abs()).min_element())
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        Some(self.at(self.half * Vec2::new(signed(rng), signed(rng))))
    }

    fn cut(&self, reach: f32, pieces: &mut Vec<TissuePiece>) -> bool {
        let counts = self.parts(reach);
        let part = 2.0 * self.half / counts.as_vec2();
        for y in 0..counts.y {
            for x in 0..counts.x {
                let center = self.at((UVec2::new(x, y).as_vec2() + 0.5) * part - self.half);
                let (reach, measure) = (0.5 * part.length(), part.x * part.y);
                pieces.push(TissuePiece { center, reach, measure, side: Vec3::ZERO, id: [x, y] });
            }
        }
        true
    }

    fn point_of(&self, reach: f32, piece: [u32; 2], [x, y, _]: [f32; 3]) -> Option<Vec3> {
        let part = 2.0 * self.half / self.parts(reach).as_vec2();
        Some(self.at((UVec2::from(piece).as_vec2() + Vec2::new(x, y)) * part - self.half))
    }
}
