//! Tetrahedra that fill an organ, checked once.

use super::{MAX_COORDINATE, MAX_TRIANGLES, is_usable};
use bevy_math::{DMat3, Vec3};

/// Volume of a tetrahedron, relative to the cube of its longest edge from the first corner, below which it counts as
/// degenerate.
const DEGENERATE_SHAPE: f64 = 1.0e-9;

/// Why a mesh of tetrahedra cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TetMeshError {
    /// More vertices or tetrahedra than [`MAX_TRIANGLES`].
    #[error("the mesh has {count} {what}, more than {MAX_TRIANGLES}; use a coarser one")]
    TooLarge {
        /// What exceeds the limit.
        what: &'static str,
        /// Their number.
        count: usize,
    },
    /// A vertex with a NaN or infinite coordinate, or one beyond [`MAX_COORDINATE`].
    #[error(
        "vertex {vertex} is at {position}; coordinates must be finite and within ±{MAX_COORDINATE}: repair or rescale the mesh"
    )]
    BadPosition {
        /// The first such vertex.
        vertex: usize,
        /// Its position.
        position: Vec3,
    },
    /// A tetrahedron with a vertex that does not exist.
    #[error(
        "tetrahedron {tetrahedron} refers to vertex {index}, but there are {vertices} vertices; the index buffer is damaged"
    )]
    IndexOutOfRange {
        /// The first such tetrahedron.
        tetrahedron: usize,
        /// The index found.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// No tetrahedron has a volume.
    #[error(
        "none of {tetrahedra} tetrahedra has a volume (their corners coincide or lie in a plane); nothing can be bound to them"
    )]
    NoVolume {
        /// Number of tetrahedra.
        tetrahedra: usize,
    },
}

/// Tetrahedra that fill an organ, such as those of a soft body, checked by [`new`](Self::new).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize), serde(try_from = "TetMeshArrays"))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect), reflect(opaque, Clone, Debug, PartialEq))]
pub struct TetMesh {
    positions: Vec<Vec3>,
    tetrahedra: Vec<[u32; 4]>,
}

/// Tetrahedra read from a file, still unchecked.
#[cfg(feature = "serialize")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TetMeshArrays {
    positions: Vec<Vec3>,
    tetrahedra: Vec<[u32; 4]>,
}

#[cfg(feature = "serialize")]
impl TryFrom<TetMeshArrays> for TetMesh {
    type Error = TetMeshError;

    fn try_from(arrays: TetMeshArrays) -> Result<Self, TetMeshError> {
        Self::new(arrays.positions, arrays.tetrahedra)
    }
}

impl TetMesh {
    /// Checks and takes over a mesh. The corners of a tetrahedron may have any order; degenerate ones are kept, and
    /// nothing is bound to them.
    ///
    /// # Errors
    /// The first error that makes the mesh unusable: see [`TetMeshError`].
    pub fn new(positions: Vec<Vec3>, tetrahedra: Vec<[u32; 4]>) -> Result<Self, TetMeshError> {
        let vertices = positions.len();
        for (what, count) in [("vertices", vertices), ("tetrahedra", tetrahedra.len())] {
            if count > MAX_TRIANGLES {
                return Err(TetMeshError::TooLarge { what, count });
            }
        }
        if let Some(vertex) = positions.iter().position(|&position| !is_usable(position)) {
            return Err(TetMeshError::BadPosition { vertex, position: positions[vertex] });
        }
        for (tetrahedron, corners) in tetrahedra.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&index| index as usize >= vertices) {
                return Err(TetMeshError::IndexOutOfRange { tetrahedron, index, vertices });
            }
        }
        let mesh = Self { positions, tetrahedra };
        let count = mesh.tetrahedra.len();
        if (0..count).all(|tetrahedron| mesh.is_degenerate(tetrahedron)) {
            return Err(TetMeshError::NoVolume { tetrahedra: count });
        }
        Ok(mesh)
    }

    /// Position of every vertex, in tissue lengths.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The four vertices of every tetrahedron.
    pub fn tetrahedra(&self) -> &[[u32; 4]] {
        &self.tetrahedra
    }

    /// Whether a tetrahedron has no significant volume.
    ///
    /// # Panics
    /// If there is no such tetrahedron.
    pub fn is_degenerate(&self, tetrahedron: usize) -> bool {
        let edges = edges(self.corners(tetrahedron));
        let longest = edges.x_axis.length().max(edges.y_axis.length()).max(edges.z_axis.length());
        // NaN and a longest edge of 0 fail it, too.
        let has_volume = edges.determinant().abs() > DEGENERATE_SHAPE * longest * longest * longest;
        !has_volume
    }

    pub(crate) fn corners(&self, tetrahedron: usize) -> [Vec3; 4] {
        self.tetrahedra[tetrahedron].map(|index| self.positions[index as usize])
    }
}

/// Vectors from the first corner to the others.
pub(crate) fn edges([a, b, c, d]: [Vec3; 4]) -> DMat3 {
    let [a, b, c, d] = [a, b, c, d].map(|corner| corner.as_dvec3());
    DMat3::from_cols(b - a, c - a, d - a)
}
