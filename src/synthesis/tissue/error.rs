use crate::synthesis::mesh::{MAX_COORDINATE, MeshError, VoxelError};
use bevy_math::{Vec3, bounding::Aabb3d};

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
    /// A tissue so far from the origin that coordinates hold too little of its shape.
    #[error(
        "the tissue is {distance} from the origin, but only {size} long: coordinates there are {rounding} apart, too \
        coarse for it; move it to the origin"
    )]
    TooFar {
        /// Its largest coordinate.
        distance: f32,
        /// Its longest side.
        size: f32,
        /// Distance between neighbouring coordinates.
        rounding: f32,
    },
    /// A size that must be above zero.
    #[error("{what} is {value}; it must be above 0")]
    NotPositive {
        /// Which size.
        what: &'static str,
        /// The value found.
        value: f32,
    },
    /// The mesh cannot be voxelised at the resolution.
    #[error(transparent)]
    Voxels(#[from] VoxelError),
    /// A mesh that has no inside, such as a sheet.
    #[error(
        "no part of the mesh's box is enclosed by it at a resolution of {resolution}; close its holes, or grow on the surface instead"
    )]
    NoInside {
        /// Voxels along the longest side.
        resolution: u32,
    },
    /// A length that must not be below zero.
    #[error("{what} is {value}; it must be at least 0")]
    Negative {
        /// Which length.
        what: &'static str,
        /// The value found.
        value: f32,
    },
    /// A mask whose number of cells differs from its size, or is too large.
    #[error("the mask has {cells} cells for a size of {size:?}; give one for each, at most {limit}")]
    MaskSize {
        /// Cells along each axis.
        size: [usize; 3],
        /// Cells found.
        cells: usize,
        /// The largest number.
        limit: usize,
    },
    /// A mask in which no cell is set.
    #[error("no cell of the mask is set; lower its threshold")]
    EmptyMask,
    /// A guide of too few or too many points.
    #[error("a guide has {points} points; it needs 2 to {limit}")]
    GuidePoints {
        /// Number of points.
        points: usize,
        /// The largest number.
        limit: usize,
    },
    /// A guide without length.
    #[error("a guide is {length} long; its points must not all coincide, nor their nearest points on the tissue")]
    GuideLength {
        /// Its length.
        length: f32,
    },
    /// A density field without exactly one value for each vertex or grid point.
    #[error("the density field has {values} values; it needs {expected}, one for each vertex or grid point")]
    DensityCount {
        /// Number of values.
        values: usize,
        /// Number of vertices or grid points.
        expected: usize,
    },
    /// A value of a density field that is NaN.
    #[error("value {index} of the density field is not a number; it must be 0 to 1")]
    DensityNotANumber {
        /// Which value.
        index: usize,
    },
    /// A density field over a tissue that changes in stages.
    #[error("a density field cannot be put over a staged tissue; put it over its stages")]
    DensityOverStages,
    /// A no-go region without exactly one mark for each vertex.
    #[error("{values} vertices are marked as no-go or free; the mesh has {expected}, give one mark for each")]
    NoGoCount {
        /// Number of marks.
        values: usize,
        /// Number of vertices.
        expected: usize,
    },
    /// No-go regions over a tissue that changes in stages.
    #[error("no-go regions cannot be laid over a staged tissue; lay them over its stages")]
    NoGoOverStages,
    /// Paint on a staged tissue.
    #[error("a staged tissue cannot be painted; prepare and paint its stages")]
    PaintOverStages,
    /// Paint on the vertices of a tissue that has none.
    #[error(
        "{what} is painted on vertices, but the tissue is not made from a mesh; leave it out, or mark balls and boxes"
    )]
    NoVertices {
        /// What is painted.
        what: &'static str,
    },
    /// A tissue made from a mesh, without a mesh.
    #[error("the tissue is made from the organ's mesh, but there is none; give the organ a mesh, or choose a shape")]
    NoMesh,
    /// A tissue made from an image, without an image.
    #[error("the tissue is made from the organ's image, but there is none; give the organ an image, or choose a shape")]
    NoImage,
    /// A staged tissue as the stage of another.
    #[error("a stage of a staged tissue cannot be staged itself; list its stages instead")]
    StagesWithinStages,
    /// Sides of a rectangle that are not perpendicular.
    #[error("the sides of the rectangle meet at an angle with cosine {cosine}; they must be perpendicular")]
    NotPerpendicular {
        /// Cosine of the angle between the sides.
        cosine: f32,
    },
}

/// Checks that a number is finite and within [`MAX_COORDINATE`].
pub(super) fn finite(what: &'static str, value: f32) -> Result<f32, TissueError> {
    // NaN fails it, too.
    if value.abs() <= MAX_COORDINATE { Ok(value) } else { Err(TissueError::NotFinite { what, value }) }
}

/// Checks that the coordinates of a point or vector are finite.
pub(super) fn finite_point(what: &'static str, point: Vec3) -> Result<Vec3, TissueError> {
    for value in point.to_array() {
        finite(what, value)?;
    }
    Ok(point)
}

/// Coordinates that a tissue's longest side must hold at least.
const FEWEST_COORDINATES: f32 = 4096.0;

/// Distance within which coordinates in a box are rounded.
///
/// # Errors
/// A box too far from the origin for its size.
pub(super) fn rounding_within(bounds: &Aabb3d) -> Result<f32, TissueError> {
    let distance = bounds.min.abs().max(bounds.max.abs()).max_element();
    let size = (bounds.max - bounds.min).max_element();
    let rounding = distance * f32::EPSILON;
    if size >= FEWEST_COORDINATES * rounding {
        Ok(2.0 * rounding)
    } else {
        Err(TissueError::TooFar { distance, size, rounding })
    }
}

/// Checks that a size is finite and above zero.
pub(super) fn positive(what: &'static str, value: f32) -> Result<f32, TissueError> {
    if finite(what, value)? > 0.0 { Ok(value) } else { Err(TissueError::NotPositive { what, value }) }
}
