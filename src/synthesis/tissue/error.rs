use super::voxels::Grid;
use crate::synthesis::mesh::{MAX_COORDINATE, MeshError};
use bevy_math::Vec3;

/// Why a tissue could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TissueError {
    /// The mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A number that is NaN, infinite or beyond [`MAX_COORDINATE`].
    #[error("{what} is {value}; it must be a finite number within ±{MAX_COORDINATE}")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// The value found.
        value: f32,
    },
    /// A size that must be above zero.
    #[error("{what} is {value}; it must be above 0")]
    NotPositive {
        /// Which size.
        what: &'static str,
        /// The value found.
        value: f32,
    },
    /// A voxel grid without voxels.
    #[error("the resolution is 0; it must be at least 1 voxel along the longest side, 128 is usual")]
    NoResolution,
    /// More voxels than fit into memory.
    #[error("a resolution of {resolution} takes {voxels} voxels, more than {}; lower it", Grid::MAX_VOXELS)]
    TooManyVoxels {
        /// Voxels along the longest side.
        resolution: u32,
        /// All voxels.
        voxels: f64,
    },
    /// Large triangles in numbers that fill space instead of surrounding it.
    #[error("the triangles touch the voxels in more than {limit} places; lower the resolution, or repair the mesh")]
    TooManyTouches {
        /// The largest number of places.
        limit: usize,
    },
    /// A mesh that has no inside, such as a sheet.
    #[error(
        "no part of the mesh's box is enclosed by it at a resolution of {resolution}; close its holes, or grow on the surface instead"
    )]
    NoInside {
        /// Voxels along the longest side.
        resolution: u32,
    },
    /// Sides of a rectangle that are not perpendicular.
    #[error("the sides of the rectangle meet at an angle with cosine {cosine}; they must be perpendicular")]
    NotPerpendicular {
        /// Cosine of the angle between the sides.
        cosine: f32,
    },
}

/// Passes a number that is finite and not beyond reason.
pub(super) fn finite(what: &'static str, value: f32) -> Result<f32, TissueError> {
    // NaN fails it too.
    if value.abs() <= MAX_COORDINATE { Ok(value) } else { Err(TissueError::NotFinite { what, value }) }
}

/// Passes a point or vector whose coordinates are finite.
pub(super) fn finite_point(what: &'static str, point: Vec3) -> Result<Vec3, TissueError> {
    for value in point.to_array() {
        finite(what, value)?;
    }
    Ok(point)
}

/// Passes a size that is finite and above zero.
pub(super) fn positive(what: &'static str, value: f32) -> Result<f32, TissueError> {
    if finite(what, value)? > 0.0 { Ok(value) } else { Err(TissueError::NotPositive { what, value }) }
}
