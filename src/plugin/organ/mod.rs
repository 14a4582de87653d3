//! Organs as Bevy has them: meshes and images that are read, meshes kept at rest while they are deformed, or made by code.

pub(crate) mod image;
pub(crate) mod mesh;
mod procedural;
pub(crate) mod rest;

pub use image::{OrganImage, OrganImageError};
pub use mesh::{OrganMeshError, triangle_mesh};
pub use rest::RestMesh;
