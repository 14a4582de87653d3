//! Organs from glTF files, with any parts and unit.

use crate::common::studio::to_unit_size;
use bevy::{
    asset::LoadState,
    ecs::system::SystemParam,
    gltf::{Gltf, GltfMesh, GltfNode},
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use bevy_vessels::{plugin::triangle_mesh, synthesis::mesh::TriangleMesh};
use std::path::PathBuf;

/// Loads an organ's file when there is an [`OrganFile`], and triggers [`OrganLoaded`]. A file without an organ ends the
/// app.
pub struct OrganFilePlugin;

impl Plugin for OrganFilePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, load.run_if(resource_exists::<OrganFile>));
    }
}

/// An organ's file to be loaded.
#[derive(Resource)]
pub struct OrganFile {
    /// Its path.
    pub path: PathBuf,
    handle: Option<Handle<Gltf>>,
}

impl OrganFile {
    /// Requests a file.
    pub fn new(path: PathBuf) -> Self {
        Self { path, handle: None }
    }
}

/// An organ has been loaded.
#[derive(Event)]
pub struct OrganLoaded {
    /// All its triangles.
    pub mesh: Mesh,
    /// The transform that makes it one unit large.
    pub place: Transform,
}

/// The contents of loaded files.
#[derive(SystemParam)]
struct Files<'w> {
    server: Res<'w, AssetServer>,
    files: Res<'w, Assets<Gltf>>,
    nodes: Res<'w, Assets<GltfNode>>,
    parts: Res<'w, Assets<GltfMesh>>,
    meshes: Res<'w, Assets<Mesh>>,
}

fn load(mut commands: Commands, mut file: ResMut<OrganFile>, files: Files, mut exit: MessageWriter<AppExit>) {
    let path = std::path::absolute(&file.path).unwrap_or_else(|_| file.path.clone());
    let handle = file.handle.get_or_insert_with(|| files.server.load(path));
    match files.organ(handle) {
        Ok(None) => return,
        Ok(Some(loaded)) => commands.trigger(loaded),
        Err(error) => {
            eprintln!("{}: {error}", file.path.display());
            exit.write(AppExit::error());
        }
    }
    commands.remove_resource::<OrganFile>();
}

impl Files<'_> {
    /// All triangles of a file as one mesh, `None` while it is loading.
    fn organ(&self, file: &Handle<Gltf>) -> Result<Option<OrganLoaded>> {
        if let LoadState::Failed(error) = self.server.load_state(file) {
            return Err(error.into());
        }
        let Some(gltf) = self.files.get(file).filter(|_| self.server.is_loaded_with_dependencies(file)) else {
            return Ok(None);
        };
        let children: Vec<_> = self.nodes_of(&gltf.nodes).flat_map(|node| &node.children).collect();
        let mut triangles = Triangles::default();
        for root in gltf.nodes.iter().filter(|node| !children.contains(node)) {
            self.collect(root, GlobalTransform::IDENTITY, &mut triangles)?;
        }
        triangles.into_organ().map(Some)
    }

    fn nodes_of<'a>(&'a self, nodes: &'a [Handle<GltfNode>]) -> impl Iterator<Item = &'a GltfNode> {
        nodes.iter().filter_map(|node| self.nodes.get(node))
    }

    fn collect(&self, node: &Handle<GltfNode>, parent: GlobalTransform, all: &mut Triangles) -> Result {
        let Some(node) = self.nodes.get(node) else { return Ok(()) };
        let place = parent.mul_transform(node.transform);
        let mesh = node.mesh.as_ref().and_then(|mesh| self.parts.get(mesh));
        for primitive in mesh.iter().flat_map(|mesh| &mesh.primitives) {
            if let Some(mesh) = self.meshes.get(&primitive.mesh) {
                all.add(&triangle_mesh(mesh)?, place);
            }
        }
        node.children.iter().try_for_each(|child| self.collect(child, place, all))
    }
}

#[derive(Default)]
struct Triangles {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Triangles {
    fn add(&mut self, mesh: &TriangleMesh, place: GlobalTransform) {
        let first = self.positions.len() as u32;
        self.positions.extend(mesh.positions().iter().map(|&point| place.transform_point(point)));
        self.triangles.extend(mesh.triangles().iter().map(|corners| corners.map(|corner| first + corner)));
    }

    fn into_organ(self) -> Result<OrganLoaded> {
        let organ = TriangleMesh::new(self.positions, self.triangles, None)?;
        let bounds = organ.bounds();
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, organ.positions().to_vec())
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, organ.vertex_normals())
            .with_inserted_indices(Indices::U32(organ.triangles().iter().flatten().copied().collect()));
        Ok(OrganLoaded { mesh, place: to_unit_size((bounds.min.into(), bounds.max.into())) })
    }
}
