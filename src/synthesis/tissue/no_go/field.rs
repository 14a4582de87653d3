//! Where no vessel may be: regions, painted vertices and functions.

use crate::synthesis::{
    mesh::IndexedMesh,
    pace::{Pace, at_once},
    tissue::error::{TissueError, finite_point, positive},
};
use bevy_math::Vec3;
use std::{fmt, sync::Arc};

/// Interpolated share of painted corners from which a point of a triangle is forbidden.
const HALF: f32 = 0.5;

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
        self.0.iter().any(|part| match part {
            Part::Function(forbids) => forbids(point),
            Part::Vertices { mesh, values } => mesh.value_near(point, values).is_some_and(|share| share >= HALF),
            Part::Region(region) => region.contains(point),
        })
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
