//! Density fields: where a tissue needs more or fewer vessels, such as in hypoxic regions.

use crate::synthesis::{
    mesh::{IndexedMesh, TriangleMesh},
    pace::{Pace, at_once},
    random::VesselRng,
    tissue::{
        Derived, Extent, Tissue, TissuePiece, TissuePoint,
        error::{TissueError, finite_point, positive},
    },
};
use bevy_math::{UVec3, Vec3, bounding::Aabb3d};
use rand::RngExt;
use std::{fmt, sync::Arc};

/// The probability, from 0 to 1, with which a sample is kept, at every point. Values outside that range are clamped.
#[derive(Clone)]
pub struct DensityField(Field);

#[derive(Clone)]
enum Field {
    Function(Arc<dyn Fn(Vec3) -> f32 + Send + Sync>),
    Vertices { mesh: IndexedMesh, values: Arc<[f32]> },
    Grid { size: [usize; 3], spacing: Vec3, origin: Vec3, values: Arc<[f32]> },
}

impl DensityField {
    /// A field given by a function. For determinism, it must always give the same value for the same point.
    ///
    /// Where the value is NaN, no sample is kept.
    pub fn function(field: impl Fn(Vec3) -> f32 + Send + Sync + 'static) -> Self {
        Self(Field::Function(Arc::new(field)))
    }

    /// A field painted on a mesh: one value per vertex, interpolated over the triangles. Away from the mesh, the value
    /// at the nearest point of the mesh is used.
    ///
    /// # Errors
    /// A number of values other than one per vertex, or a value that is NaN.
    pub fn on_vertices(mesh: &TriangleMesh, values: &[f32]) -> Result<Self, TissueError> {
        let values = at_once(check(values, mesh.positions().len(), &Pace::default()))?;
        Ok(Self(Field::Vertices { mesh: IndexedMesh::new(mesh.clone()), values }))
    }

    /// The same with an existing index of the mesh, which is shared.
    ///
    /// # Errors
    /// Those of [`on_vertices`](Self::on_vertices).
    pub fn on_indexed(mesh: &IndexedMesh, values: &[f32]) -> Result<Self, TissueError> {
        at_once(Self::on_indexed_paced(mesh, values, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub(super) async fn on_indexed_paced(mesh: &IndexedMesh, values: &[f32], pace: &Pace) -> Result<Self, TissueError> {
        let values = check(values, mesh.mesh().positions().len(), pace).await?;
        Ok(Self(Field::Vertices { mesh: mesh.clone(), values }))
    }

    /// A field on the points of a grid, along x first, then y, then z, interpolated between them. `origin` is the first
    /// point. Beyond the grid, the value at its border is used.
    ///
    /// # Errors
    /// A number of values other than one per point, or a value that is NaN; a spacing that is not above 0; an origin
    /// that is not finite.
    pub fn on_grid(size: UVec3, spacing: Vec3, origin: Vec3, values: &[f32]) -> Result<Self, TissueError> {
        let size = size.to_array().map(|count| count as usize);
        for side in spacing.to_array() {
            positive("the spacing of the density grid", side)?;
        }
        finite_point("the origin of the density grid", origin)?;
        let expected = size[0].saturating_mul(size[1]).saturating_mul(size[2]);
        if expected == 0 {
            return Err(TissueError::DensityCount { values: values.len(), expected: 1 });
        }
        let values = at_once(check(values, expected, &Pace::default()))?;
        Ok(Self(Field::Grid { size, spacing, origin, values }))
    }

    /// The field's value at a point, from 0 to 1.
    pub fn at(&self, point: Vec3) -> f32 {
        let value = match &self.0 {
            Field::Function(field) => field(point),
            Field::Vertices { mesh, values } => mesh.value_near(point, values).unwrap_or(0.0),
            Field::Grid { size, spacing, origin, values } => interpolate(*size, (point - *origin) / *spacing, values),
        };
        if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
    }
}

impl fmt::Debug for DensityField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Field::Function(_) => f.write_str("DensityField::function"),
            Field::Vertices { values, .. } => write!(f, "DensityField::on_vertices({})", values.len()),
            Field::Grid { size, .. } => write!(f, "DensityField::on_grid({size:?})"),
        }
    }
}

async fn check(values: &[f32], expected: usize, pace: &Pace) -> Result<Arc<[f32]>, TissueError> {
    if values.len() != expected {
        return Err(TissueError::DensityCount { values: values.len(), expected });
    }
    if let Some(index) = pace.part(0.0..0.5).find(expected, |index| values[index].is_nan()).await {
        return Err(TissueError::DensityNotANumber { index });
    }
    Ok(pace.part(0.5..1.0).collect(expected, |index| values[index].clamp(0.0, 1.0)).await.into())
}

/// Linear interpolation along each axis between the eight values around a place on the grid.
fn interpolate(size: [usize; 3], local: Vec3, values: &[f32]) -> f32 {
    if local.is_nan() {
        return 0.0;
    }
    let last = size.map(|count| count - 1);
    let local = local.clamp(Vec3::ZERO, Vec3::from_array(last.map(|count| count as f32)));
    let low: [usize; 3] = std::array::from_fn(|axis| (local[axis] as usize).min(last[axis]));
    let part = local - Vec3::from_array(low.map(|index| index as f32));
    let mut sum = 0.0;
    for corner in 0..8usize {
        let mut weight = 1.0;
        let mut place = [0; 3];
        for axis in 0..3 {
            let high = corner >> axis & 1;
            weight *= if high == 1 { part[axis] } else { 1.0 - part[axis] };
            place[axis] = (low[axis] + high).min(last[axis]);
        }
        sum += weight * values[(place[2] * size[1] + place[1]) * size[0] + place[0]];
    }
    sum
}

/// A tissue whose samples are kept with the local probability of a field.
///
/// The shape of the tissue stays: nodes may lie where the field is 0.
#[derive(Clone, Debug)]
pub struct DensityTissue {
    tissue: Arc<dyn Tissue>,
    field: DensityField,
    derived: Derived,
}

impl DensityTissue {
    /// Puts a field over a tissue.
    ///
    /// # Errors
    /// A tissue that changes in stages: put the field over its stages instead.
    pub fn new(tissue: Arc<dyn Tissue>, field: DensityField) -> Result<Self, TissueError> {
        if tissue.stage(1).is_some() {
            return Err(TissueError::DensityOverStages);
        }
        Ok(Self { tissue, field, derived: Derived::default() })
    }

    /// The field.
    pub fn field(&self) -> &DensityField {
        &self.field
    }
}

impl Tissue for DensityTissue {
    fn laid_over(&self) -> Option<&dyn Tissue> {
        Some(&*self.tissue)
    }

    fn bounds(&self) -> Aabb3d {
        self.tissue.bounds()
    }

    fn derived(&self) -> Option<&Derived> {
        Some(&self.derived)
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

    fn density(&self, point: Vec3) -> f32 {
        self.field.at(point) * self.tissue.density(point)
    }

    fn is_uniform(&self) -> bool {
        false
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        let point = self.tissue.sample(rng)?;
        (rng.random::<f32>() < self.field.at(point)).then_some(point)
    }

    fn cut(&self, reach: f32, pieces: &mut Vec<TissuePiece>) -> bool {
        self.tissue.cut(reach, pieces)
    }

    fn point_of(&self, reach: f32, piece: [u32; 2], numbers: [f32; 3]) -> Option<Vec3> {
        // Surfaces use two of the three numbers.
        let point = self.tissue.point_of(reach, piece, numbers)?;
        (numbers[2] < self.field.at(point)).then_some(point)
    }
}
