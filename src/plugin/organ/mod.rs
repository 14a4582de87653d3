//! Organs as Bevy has them: meshes that are read, kept at rest while they are deformed, or made by code.

pub(crate) mod mesh;
mod procedural;
pub(crate) mod rest;

pub use mesh::{OrganMeshError, triangle_mesh};
pub use rest::RestMesh;
