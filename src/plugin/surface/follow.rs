//! Meshes follow vessels that move with their organ.
//!
//! In: moved [`Vessels`]. Out: new vertices in the same mesh assets, once a frame, and boxes around them. A mesh that is
//! not shown waits until it is.

use crate::plugin::{
    surface::{
        build::Built,
        mesh::{at_rest, write_vertices},
        vessel_mesh::{SurfaceLevel, VesselMesh},
    },
    vessels::{ChangeLog, Vessels},
};
use crate::synthesis::{binding::SkinVertex, tree::VesselTree};
use bevy::{
    asset::{Assets, Handle},
    camera::primitives::Aabb,
    ecs::{
        change_detection::{DetectChangesMut, ResMut},
        query::With,
        system::Query,
    },
    math::Vec3,
    mesh::Mesh,
};

/// Surface: moves the vertices of shown meshes with their vessels.
pub(crate) fn follow_vessels(
    mut vessels: Query<(&Vessels, &ChangeLog, &mut VesselMesh)>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut levels: Query<&mut Aabb, With<SurfaceLevel>>,
) {
    for (vessels, log, mut mesh) in &mut vessels {
        if !mesh.is_shown || mesh.followed.is_current(log) {
            continue;
        }
        let mesh = mesh.bypass_change_detection();
        mesh.followed = log.now();
        let Some((_, built)) = &mut mesh.built else { continue };
        let aabb = if vessels.is_deformed() {
            bend(built, vessels.tree(), &mut mesh.scratch, &mesh.handles, &mut meshes)
        } else if mesh.is_moved {
            straighten(built, &mesh.handles, &mut meshes);
            Some(built.aabb)
        } else {
            None
        };
        mesh.is_moved = vessels.is_deformed();
        let Some(aabb) = aabb else { continue };
        let mut levels = levels.iter_many_mut(&mesh.entities);
        while let Some(mut current) = levels.fetch_next() {
            current.set_if_neq(aabb);
        }
    }
}

/// Moves all levels with the nodes of the present tree. Returns the box around them.
fn bend(
    built: &mut Built,
    tree: &VesselTree,
    scratch: &mut Vec<Vec3>,
    handles: &[Handle<Mesh>],
    meshes: &mut Assets<Mesh>,
) -> Option<Aabb> {
    let (nodes, origin) = (built.nodes(tree, scratch), built.origin);
    let mut bounds = None::<Bounds>;
    for (level, handle) in handles.iter().enumerate() {
        let skin = built.levels.get_mut(level).and_then(|level| level.skin.as_mut());
        // A skin of another tree has been refused when it was made.
        let Some(Ok(vertices)) = skin.map(|skin| skin.follow(nodes)) else { continue };
        if let Some(mut mesh) = meshes.get_mut(handle) {
            write_vertices(&mut mesh, origin, vertices.iter().copied());
        }
        bounds = Some(Bounds::around(bounds, vertices));
    }
    bounds.map(|Bounds(low, high)| built.box_around([low, high].into_iter()))
}

/// The extent of some vertices.
struct Bounds(Vec3, Vec3);

impl Bounds {
    /// The extent of what is known, and of more vertices.
    fn around(known: Option<Self>, vertices: &[SkinVertex]) -> Self {
        let first = vertices.first().map_or(Vec3::ZERO, |vertex| vertex.position);
        let around = |Self(low, high), vertex: &SkinVertex| Self(low.min(vertex.position), high.max(vertex.position));
        vertices.iter().fold(known.unwrap_or(Self(first, first)), around)
    }
}

/// Brings all levels back to rest.
fn straighten(built: &Built, handles: &[Handle<Mesh>], meshes: &mut Assets<Mesh>) {
    for (level, handle) in built.levels.iter().zip(handles) {
        if let Some(mut mesh) = meshes.get_mut(handle) {
            write_vertices(&mut mesh, built.origin, at_rest(&level.surface.mesh));
        }
    }
}
