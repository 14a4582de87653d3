//! Organs from files, with any parts and unit.

use crate::common::studio::to_unit_size;
use bevy::{
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use bevy_vessels::synthesis::io::{MeshReadError, load_mesh};
use std::path::{Path, PathBuf};

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
}

impl OrganFile {
    /// Requests a file.
    pub fn new(path: PathBuf) -> Self {
        Self { path }
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

fn load(mut commands: Commands, file: Res<OrganFile>, mut exit: MessageWriter<AppExit>) {
    match read(&file.path) {
        Ok(loaded) => commands.trigger(loaded),
        Err(error) => {
            eprintln!("{error}");
            exit.write(AppExit::error());
        }
    }
    commands.remove_resource::<OrganFile>();
}

/// All triangles of a file as one mesh, as the command `generate` reads it.
fn read(path: &Path) -> Result<OrganLoaded, MeshReadError> {
    let organ = load_mesh(path)?;
    let bounds = organ.bounds();
    let mesh = Mesh::new(PrimitiveTopology::TriangleList, default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, organ.positions().to_vec())
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, organ.vertex_normals())
        .with_inserted_indices(Indices::U32(organ.triangles().iter().flatten().copied().collect()));
    Ok(OrganLoaded { mesh, place: to_unit_size((bounds.min.into(), bounds.max.into())) })
}
