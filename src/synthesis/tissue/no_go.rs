//! No-go regions: where no vessel may be, such as over a landmark that is to stay free.

use crate::synthesis::{
    mesh::IndexedMesh,
    pace::{Pace, at_once},
    random::VesselRng,
    tissue::{
        Extent, Tissue, TissuePiece, TissuePoint,
        error::{TissueError, finite_point, positive},
    },
};
use bevy_math::{Vec3, bounding::Aabb3d};
use std::{fmt, sync::Arc};

/// Share of a triangle's painted corners from which on a point of it is forbidden.
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

/// Where no vessel may be, at every point. A clone shares what the field was made of.
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
    /// A field given by a function, for determinism's sake one that always says the same of the same point.
    pub fn function(forbids: impl Fn(Vec3) -> bool + Send + Sync + 'static) -> Self {
        Self(vec![Part::Function(Arc::new(forbids))])
    }

    /// A field painted on a mesh, one entry per vertex. Within a triangle, what is nearer to its painted corners is
    /// forbidden: the side of the line on which the painted share is at least a half. Away from the mesh its nearest point
    /// counts, so that what lies below painted surface is forbidden, too.
    ///
    /// # Errors
    /// Entries that are not one per vertex.
    pub fn on_vertices(mesh: &IndexedMesh, painted: &[bool]) -> Result<Self, TissueError> {
        at_once(Self::on_vertices_paced(mesh, painted, &Pace::default()))
    }

    /// The same, with rests.
    pub(super) async fn on_vertices_paced(
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

    /// The field that forbids what either of two forbids.
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

/// A tissue with no-go regions.
///
/// Its shape stays what it is, and so does its extent; but no sample falls into the regions, and generators
/// [place no node there](Tissue::no_go).
#[derive(Clone, Debug)]
pub struct NoGoTissue {
    tissue: Arc<dyn Tissue>,
    field: NoGoField,
}

impl NoGoTissue {
    /// Lays a field over a tissue. What the tissue forbids already stays forbidden.
    ///
    /// # Errors
    /// A tissue that changes in stages: lay the field over its stages instead.
    pub fn new(tissue: Arc<dyn Tissue>, field: NoGoField) -> Result<Self, TissueError> {
        if tissue.stage(1).is_some() {
            return Err(TissueError::NoGoOverStages);
        }
        let field = match tissue.no_go() {
            Some(before) => before.clone().or(field),
            None => field,
        };
        Ok(Self { tissue, field })
    }

    fn allowed(&self, point: Option<Vec3>) -> Option<Vec3> {
        point.filter(|&point| !self.field.forbids(point))
    }
}

impl Tissue for NoGoTissue {
    fn bounds(&self) -> Aabb3d {
        self.tissue.bounds()
    }

    fn extent(&self) -> Extent {
        self.tissue.extent()
    }

    fn contains(&self, point: Vec3) -> bool {
        self.tissue.contains(point)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        self.tissue.closest_point(point)
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        let point = self.tissue.sample(rng);
        self.allowed(point)
    }

    fn draw(&self, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        let first = candidates.len();
        let mut kept = first;
        self.tissue.draw(rng, count, candidates);
        for index in first..candidates.len() {
            if !self.field.forbids(candidates[index]) {
                candidates[kept] = candidates[index];
                kept += 1;
            }
        }
        candidates.truncate(kept);
    }

    fn cut(&self, reach: f32, pieces: &mut Vec<TissuePiece>) -> bool {
        self.tissue.cut(reach, pieces)
    }

    fn point_of(&self, reach: f32, piece: [u32; 2], numbers: [f32; 3]) -> Option<Vec3> {
        self.allowed(self.tissue.point_of(reach, piece, numbers))
    }

    fn entrance(&self) -> Option<Vec3> {
        self.allowed(self.tissue.entrance())
    }

    fn no_go(&self) -> Option<&NoGoField> {
        Some(&self.field)
    }
}
