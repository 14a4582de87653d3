//! An organ's mesh at rest, kept while it is deformed.

use crate::plugin::{
    lineage::Lineage,
    organ::mesh::{MeshCopy, vertex_positions},
};
use bevy::{
    ecs::{component::Component, entity::Entity},
    log::warn,
    math::Vec3,
    mesh::Mesh,
};
use std::sync::Arc;

/// An organ's mesh at rest. The plugin keeps it for organs with [`FollowsMesh`](crate::plugin::FollowsMesh) or
/// [`FollowsTetrahedra`](crate::plugin::FollowsTetrahedra).
#[derive(Component, Clone, Default)]
pub struct RestMesh {
    pub(crate) copy: Option<Arc<MeshCopy>>,
    /// The tissue that was prepared from it.
    pub(crate) tissue: Lineage,
    /// Vertex positions that the vessels last followed.
    pub(crate) followed: Vec<Vec3>,
    /// Whether a warning has been given.
    pub(crate) warned: bool,
}

impl RestMesh {
    /// The vertices at rest; `None` until the mesh has been loaded.
    pub fn positions(&self) -> Option<&[Vec3]> {
        self.copy.as_ref().map(|copy| &copy.positions[..])
    }

    /// Whether a mesh is this one, deformed.
    pub(crate) fn is_of(&self, mesh: Option<&Mesh>) -> bool {
        let vertices = mesh.and_then(vertex_positions).map(<[_]>::len);
        vertices.is_some() && vertices == self.positions().map(<[_]>::len)
    }

    pub(crate) fn warn(&mut self, organ: Entity, what: &str) {
        if !std::mem::replace(&mut self.warned, true) {
            warn!("{organ}: its vessels don't follow it: {what}");
        }
    }
}

impl RestMesh {
    /// Takes over the vertex positions, and returns whether they have changed.
    pub(crate) fn take_vertices(&mut self, vertices: &[[f32; 3]]) -> bool {
        let is_same = self.followed.len() == vertices.len()
            && self.followed.iter().zip(vertices).all(|(before, now)| before.to_array() == *now);
        if !is_same {
            self.followed.clear();
            self.followed.extend(vertices.iter().map(|&vertex| Vec3::from(vertex)));
        }
        !is_same
    }
}
