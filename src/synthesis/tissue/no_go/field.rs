//! Where no vessel may be: regions, painted vertices and functions.

use crate::synthesis::{
    mesh::IndexedMesh,
    pace::{Pace, at_once},
    tissue::error::{TissueError, finite_point, positive},
};
use bevy_math::{DVec3, Vec3};
use std::{fmt, sync::Arc};

/// Interpolated share of painted corners from which a point of a triangle is forbidden.
const HALF: f32 = 0.5;
/// Sections of a search for the least distance from a box, each of which leaves two thirds: to 10⁻¹⁰ of a way.
const SECTIONS: usize = 57;

/// A part of space in which no vessel may be. Its boundary belongs to it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub enum NoGoRegion {
    /// A ball.
    Ball {
        /// Its centre, in the organ's local space.
        center: Vec3,
        /// Its radius.
        ///
        /// Units: tissue lengths. Limits: `> 0`.
        radius: f32,
    },
    /// A box along the axes.
    Cuboid {
        /// Its centre, in the organ's local space.
        center: Vec3,
        /// Its full side lengths.
        ///
        /// Units: tissue lengths. Limits: each `> 0`.
        size: Vec3,
    },
}

impl NoGoRegion {
    /// Whether a point is in the region.
    pub fn contains(&self, point: Vec3) -> bool {
        match *self {
            Self::Ball { center, radius } => point.distance_squared(center) <= radius * radius,
            Self::Cuboid { center, size } => (point - center).abs().cmple(size / 2.0).all(),
        }
    }

    /// Distance from the straight way between two points; 0 where it leads through.
    fn distance(self, [from, to]: [DVec3; 2]) -> f64 {
        match self {
            Self::Ball { center, radius } => {
                let (way, to_center) = (to - from, center.as_dvec3() - from);
                let square = way.length_squared();
                let share = if square > 0.0 { (to_center.dot(way) / square).clamp(0.0, 1.0) } else { 0.0 };
                (to_center.distance(way * share) - f64::from(radius)).max(0.0)
            }
            Self::Cuboid { center, size } => {
                // The distance of a point from a box is a convex function of its place on the way.
                let (center, half) = (center.as_dvec3(), 0.5 * size.as_dvec3());
                let apart = |share: f64| ((from.lerp(to, share) - center).abs() - half).max(DVec3::ZERO).length();
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..SECTIONS {
                    let [first, second] = [(2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0];
                    if apart(first) <= apart(second) { high = second } else { low = first }
                }
                [0.0, 1.0, 0.5 * (low + high)].map(apart).into_iter().fold(f64::INFINITY, f64::min)
            }
        }
    }

    fn check(self) -> Result<Self, TissueError> {
        match self {
            Self::Ball { center, radius } => {
                finite_point("the centre of a no-go ball", center)?;
                positive("the radius of a no-go ball", radius)?;
            }
            Self::Cuboid { center, size } => {
                finite_point("the centre of a no-go box", center)?;
                for side in size.to_array() {
                    positive("a side of a no-go box", side)?;
                }
            }
        }
        Ok(self)
    }
}

/// Tells for every point whether vessels are forbidden. A clone shares its data.
#[derive(Clone)]
pub struct NoGoField(Vec<Part>);

#[derive(Clone)]
enum Part {
    Function(Arc<dyn Fn(Vec3) -> bool + Send + Sync>),
    /// 1 at painted vertices, 0 at the others.
    Vertices {
        mesh: IndexedMesh,
        values: Arc<[f32]>,
    },
    Region(NoGoRegion),
}

impl NoGoField {
    /// A field given by a function. For determinism, it must always give the same result for the same point.
    pub fn function(forbids: impl Fn(Vec3) -> bool + Send + Sync + 'static) -> Self {
        Self(vec![Part::Function(Arc::new(forbids))])
    }

    /// A field painted on a mesh, one entry per vertex. Within a triangle, points whose interpolated painted share is
    /// at least a half are forbidden. Away from the mesh, its nearest point decides, so tissue below painted surface is
    /// forbidden, too.
    ///
    /// # Errors
    /// A number of entries other than one per vertex.
    pub fn on_vertices(mesh: &IndexedMesh, painted: &[bool]) -> Result<Self, TissueError> {
        at_once(Self::on_vertices_paced(mesh, painted, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(in crate::synthesis::tissue) async fn on_vertices_paced(
        mesh: &IndexedMesh,
        painted: &[bool],
        pace: &Pace,
    ) -> Result<Self, TissueError> {
        let expected = mesh.mesh().positions().len();
        if painted.len() != expected {
            return Err(TissueError::NoGoCount { values: painted.len(), expected });
        }
        let values = pace.collect(expected, |vertex| f32::from(painted[vertex])).await.into();
        Ok(Self(vec![Part::Vertices { mesh: mesh.clone(), values }]))
    }

    /// A field of some regions.
    ///
    /// # Errors
    /// A coordinate that is not finite, a size that is not above 0.
    pub fn regions(regions: impl IntoIterator<Item = NoGoRegion>) -> Result<Self, TissueError> {
        regions.into_iter().map(|region| region.check().map(Part::Region)).collect::<Result<_, _>>().map(Self)
    }

    /// The field that forbids all points that either of two forbids.
    #[must_use]
    pub fn or(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// Whether no vessel may be at a point.
    pub fn forbids(&self, point: Vec3) -> bool {
        self.0.iter().any(|part| part.forbids(point))
    }

    /// Whether a vessel along the straight way between two points, with this radius, would be where none may be.
    ///
    /// Regions are met exactly, with the vessel's whole width and round ends. A function and painted vertices cannot
    /// tell how far away they forbid anything, so they are asked at `points` of the vessel.
    pub(crate) fn forbids_way<P: Iterator<Item = Vec3>>(
        &self,
        way: [DVec3; 2],
        radius: f64,
        points: impl Fn() -> P,
    ) -> bool {
        self.0.iter().any(|part| match part {
            Part::Region(region) => region.distance(way) <= radius,
            part => points().any(|point| part.forbids(point)),
        })
    }
}

impl Part {
    fn forbids(&self, point: Vec3) -> bool {
        match self {
            Self::Function(forbids) => forbids(point),
            Self::Vertices { mesh, values } => mesh.value_near(point, values).is_some_and(|share| share >= HALF),
            Self::Region(region) => region.contains(point),
        }
    }
}

impl fmt::Debug for NoGoField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(&self.0).finish()
    }
}

impl fmt::Debug for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Function(_) => f.write_str("Function"),
            Self::Vertices { values, .. } => write!(f, "Vertices({})", values.len()),
            Self::Region(region) => region.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;

    #[test]
    fn ways_are_as_far_from_a_region_as_the_nearest_of_their_points() {
        let mut rng = Stream::Statistics.rng(6);
        let (mut through, mut beside) = (0, 0);
        for case in 0..400 {
            let mut point = || Vec3::new(rng.random(), rng.random(), rng.random()) * 4.0 - 2.0;
            let way = [point(), point()].map(|end| end.as_dvec3());
            let center = point() * 0.5;
            let region = match case % 2 {
                0 => NoGoRegion::Ball { center, radius: 0.4 },
                _ => NoGoRegion::Cuboid { center, size: Vec3::new(0.3, 0.8, 1.5) },
            };
            let from_region = |at: DVec3| match region {
                NoGoRegion::Ball { center, radius } => at.distance(center.as_dvec3()) - f64::from(radius),
                NoGoRegion::Cuboid { center, size } => {
                    let half = 0.5 * size.as_dvec3();
                    at.distance(at.clamp(center.as_dvec3() - half, center.as_dvec3() + half))
                }
            };
            let points = (0..=2000).map(|at| way[0].lerp(way[1], f64::from(at) / 2000.0));
            let sampled = points.map(from_region).fold(f64::MAX, f64::min).max(0.0);
            let exact = region.distance(way);
            assert!(exact <= sampled + 1e-9 && sampled <= exact + 2e-3, "{region:?}: {exact}, sampled {sampled}");
            *(if exact == 0.0 { &mut through } else { &mut beside }) += 1;
        }
        assert!(through > 20 && beside > 100, "{through} through, {beside} beside");
    }
}
