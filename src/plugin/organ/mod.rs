//! Organs in Bevy: meshes and images that are read, meshes at rest while they are deformed, and procedural meshes.

pub(crate) mod image;
pub(crate) mod mesh;
mod procedural;
pub(crate) mod rest;

pub use image::{OrganImage, OrganImageError};
pub use mesh::{OrganMeshError, triangle_mesh};
pub use rest::RestMesh;
