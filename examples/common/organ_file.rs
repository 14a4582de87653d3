//! Organs from glTF files, whatever parts and unit they come in.

use crate::common::studio::to_unit_size;
use bevy::{
    asset::LoadState,
    gltf::{Gltf, GltfMesh, GltfNode},
    mesh::{Indices, PrimitiveTopology, VertexAttributeValues},
    prelude::*,
};
use std::path::Path;

/// An organ's file on its way.
#[derive(Resource)]
pub struct OrganFile(Handle<Gltf>);

impl OrganFile {
    /// Begins to load a file. Whether it is there, and an organ, shows in [`OrganFiles::mesh`].
    pub fn load(path: &Path, server: &AssetServer) -> Self {
        Self(server.load(std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())))
    }
}

/// What is in the files that are loaded.
#[derive(bevy::ecs::system::SystemParam)]
pub struct OrganFiles<'w> {
    server: Res<'w, AssetServer>,
    files: Res<'w, Assets<Gltf>>,
    nodes: Res<'w, Assets<GltfNode>>,
    parts: Res<'w, Assets<GltfMesh>>,
}

impl OrganFiles<'_> {
    /// All triangles of a file as one mesh with the transform that makes it one unit large, `None` while it is on its way.
    ///
    /// # Errors
    /// The file isn't glTF, or has no triangles.
    pub fn mesh(&self, file: &OrganFile, meshes: &Assets<Mesh>) -> Result<Option<(Mesh, Transform)>, String> {
        if let LoadState::Failed(error) = self.server.load_state(&file.0) {
            return Err(error.to_string());
        }
        if !self.server.is_loaded_with_dependencies(&file.0) {
            return Ok(None);
        }
        let Some(gltf) = self.files.get(&file.0) else { return Ok(None) };
        let mut all = Triangles::default();
        let nodes: Vec<&GltfNode> = gltf.nodes.iter().filter_map(|node| self.nodes.get(node)).collect();
        let is_child =
            |node: &GltfNode| nodes.iter().any(|other| other.children.iter().any(|child| self.is(child, node)));
        for node in nodes.iter().filter(|node| !is_child(node)) {
            self.collect(node, meshes, GlobalTransform::IDENTITY, &mut all);
        }
        if all.indices.is_empty() {
            return Err("the file has no triangles".into());
        }
        let place = to_unit_size(all.bounds());
        Ok(Some((all.into_mesh(), place)))
    }

    fn is(&self, handle: &Handle<GltfNode>, node: &GltfNode) -> bool {
        self.nodes.get(handle).is_some_and(|found| found.index == node.index)
    }

    fn collect(&self, node: &GltfNode, meshes: &Assets<Mesh>, parent: GlobalTransform, all: &mut Triangles) {
        let place = parent.mul_transform(node.transform);
        let primitives =
            node.mesh.as_ref().and_then(|mesh| self.parts.get(mesh)).map_or(&[][..], |mesh| &mesh.primitives);
        for mesh in primitives.iter().filter_map(|primitive| meshes.get(&primitive.mesh)) {
            all.add(mesh, place);
        }
        for child in node.children.iter().filter_map(|child| self.nodes.get(child)) {
            self.collect(child, meshes, place, all);
        }
    }
}

#[derive(Default)]
struct Triangles {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
}

impl Triangles {
    fn add(&mut self, mesh: &Mesh, place: GlobalTransform) {
        let (Some(VertexAttributeValues::Float32x3(positions)), PrimitiveTopology::TriangleList) =
            (mesh.attribute(Mesh::ATTRIBUTE_POSITION), mesh.primitive_topology())
        else {
            return;
        };
        let first = self.positions.len() as u32;
        self.positions.extend(positions.iter().map(|point| place.transform_point(Vec3::from(*point)).to_array()));
        match mesh.indices() {
            Some(indices) => self.indices.extend(indices.iter().map(|index| first + index as u32)),
            None => self.indices.extend(first..self.positions.len() as u32),
        }
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        let points = self.positions.iter().map(|point| Vec3::from(*point)).filter(|point| point.is_finite());
        points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)))
    }

    fn into_mesh(self) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
            .with_inserted_indices(Indices::U32(self.indices))
            .with_computed_smooth_normals()
    }
}
