//! Vessels follow a deformed organ: its mesh, or the tetrahedra that fill it.
//!
//! In: the organ's mesh asset or its [`FollowsTetrahedra`], with positions written by the app. Out: [`Vessels`] with
//! moved nodes. Growth goes on at rest: new nodes are bound to the organ at rest, and moved from there.

use crate::plugin::organ::rest::RestMesh;
use crate::plugin::{
    deformation::bound::{Bound, Motion, RestOrgan, VesselBinding},
    growth::{progress::GrowthProgress, state::GrowthState},
    job::Jobs,
    lineage::Lineage,
    organ::mesh::{copy_mesh, vertex_positions},
    vessels::{relations::OrganVessels, tree::Vessels},
};
use crate::synthesis::mesh::TetMesh;
use bevy::{
    asset::Assets,
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Res},
        component::Component,
        entity::Entity,
        lifecycle::Remove,
        observer::On,
        query::{Has, Or, QueryData, With, Without},
        reflect::ReflectComponent,
        system::{Commands, Query},
        world::{EntityWorldMut, Ref},
    },
    math::Vec3,
    mesh::{Mesh, Mesh3d},
    reflect::{Reflect, ReflectDeserialize, ReflectSerialize, std_traits::ReflectDefault},
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Lets an organ's vessels follow its mesh. Put it beside the organ's [`Vasculature`](crate::plugin::Vasculature), and
/// write new vertex positions into the mesh asset, each frame if needed, as a soft body does.
///
/// New positions then don't start the growth again, but another number of vertices or another mesh asset does. The
/// organ's rest shape is that of its mesh when its tissue is prepared, or when this is added later. Vessels may still
/// grow: they do so at rest, and are moved from there.
///
/// If the mesh is written before [`VesselSystems::Publish`](crate::plugin::VesselSystems::Publish), the vessels follow
/// in the same frame, otherwise in the next. The mesh must keep its data in main memory
/// (`RenderAssetUsages::MAIN_WORLD`), and be an asset of its own: organs that share one move alike. Radii, flow and
/// ischaemia stay as they are at rest. Removing this brings the vessels back to rest.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(RestMesh)]
pub struct FollowsMesh;

/// Lets an organ's vessels follow tetrahedra that fill it, such as those of a soft body. Put it beside the organ's
/// [`Vasculature`](crate::plugin::Vasculature), and write [`positions_mut`](Self::positions_mut) each frame.
///
/// Vessels inside a solid organ move with the tissue around them, whereas [`FollowsMesh`] uses its surface alone. Each
/// node follows the tetrahedron that holds it, exactly, even if that is stretched and sheared. Nodes outside all of
/// them, such as those of vessels lifted off the surface, follow the nearest.
///
/// All positions are in the local space of the organ's mesh, and vessels grow in the organ at [`rest`](Self::rest). The
/// app may also deform the mesh, to draw it: as with [`FollowsMesh`], that doesn't start the growth again. An organ
/// with both follows the tetrahedra. To change the tetrahedra themselves, after a remeshing for example, insert a new
/// component, with the tetrahedra of the organ at rest.
///
/// If the positions are written before [`VesselSystems::Publish`](crate::plugin::VesselSystems::Publish), the vessels
/// follow in the same frame. Radii, flow and ischaemia stay as they are at rest. Removing this brings the vessels back
/// to rest.
///
/// ```
/// # use bevy_vessels::{plugin::FollowsTetrahedra, synthesis::mesh::{TetMesh, TetMeshError}};
/// # use bevy::prelude::{Query, Vec3};
/// fn tetrahedra() -> Result<FollowsTetrahedra, TetMeshError> {
///     let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
///     Ok(FollowsTetrahedra::new(TetMesh::new(corners, vec![[0, 1, 2, 3]])?))
/// }
///
/// fn sag(mut organs: Query<&mut FollowsTetrahedra>) {
///     for mut organ in &mut organs {
///         organ.positions_mut().iter_mut().for_each(|at| at.y -= 0.001);
///     }
/// }
/// # bevy::ecs::system::assert_is_system(sag);
/// # assert!(tetrahedra().is_ok());
/// ```
#[derive(Component, Clone, Debug, Reflect, Serialize, Deserialize)]
#[reflect(opaque, Component, Clone, Debug, Serialize, Deserialize)]
#[serde(into = "SavedTetrahedra", try_from = "SavedTetrahedra")]
#[require(RestMesh)]
pub struct FollowsTetrahedra {
    rest: Arc<TetMesh>,
    lineage: Lineage,
    positions: Vec<Vec3>,
}

/// [`FollowsTetrahedra`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "FollowsTetrahedra", deny_unknown_fields)]
struct SavedTetrahedra {
    rest: TetMesh,
    positions: Vec<Vec3>,
}

impl From<FollowsTetrahedra> for SavedTetrahedra {
    fn from(follows: FollowsTetrahedra) -> Self {
        Self { rest: Arc::unwrap_or_clone(follows.rest), positions: follows.positions }
    }
}

impl TryFrom<SavedTetrahedra> for FollowsTetrahedra {
    type Error = String;

    fn try_from(saved: SavedTetrahedra) -> Result<Self, String> {
        let (vertices, positions) = (saved.rest.positions().len(), saved.positions.len());
        if vertices != positions {
            return Err(format!("tetrahedra of {vertices} vertices have {positions} positions; give one for each"));
        }
        Ok(Self { positions: saved.positions, ..Self::new(saved.rest) })
    }
}

impl FollowsTetrahedra {
    /// Tetrahedra at rest. [`TetMesh::new`] has rejected those that can't be followed.
    pub fn new(rest: impl Into<Arc<TetMesh>>) -> Self {
        let rest = rest.into();
        Self { lineage: Lineage::new_one(), positions: rest.positions().to_vec(), rest }
    }

    /// The tetrahedra at rest.
    pub fn rest(&self) -> &TetMesh {
        &self.rest
    }

    /// The present vertices of the tetrahedra.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The same, to be written. If one isn't finite, nothing moves, and the log says so once.
    pub fn positions_mut(&mut self) -> &mut [Vec3] {
        &mut self.positions
    }
}

/// Organs whose vessels follow them.
type Deforming = Or<(With<FollowsMesh>, With<FollowsTetrahedra>)>;

/// Source: takes the rest shape of an organ when its tissue is prepared.
pub(crate) fn take_rest(
    meshes: Res<Assets<Mesh>>,
    mut organs: Query<(Entity, &Mesh3d, Option<&GrowthState>, &mut RestMesh), Deforming>,
) {
    for (organ, mesh, growth, mut rest) in &mut organs {
        let tissue = growth.map(GrowthState::tissue_lineage).unwrap_or_default();
        if rest.copy.is_some() && rest.tissue == tissue {
            continue;
        }
        let Some(mesh) = meshes.get(mesh.id()) else { continue };
        match copy_mesh(mesh) {
            Ok(copy) => *rest = RestMesh { copy: Some(Arc::new(copy)), tissue, ..RestMesh::default() },
            Err(error) => rest.warn(organ, &error.to_string()),
        }
    }
}

/// Publish: gives a binding to vessels that follow their organ.
pub(crate) fn attach_bindings(
    mut commands: Commands,
    organs: Query<&OrganVessels, Deforming>,
    unbound: Query<(), (With<Vessels>, Without<VesselBinding>)>,
) {
    for &vessels in organs.iter().flat_map(|vessels| vessels.entities()).filter(|&&entity| unbound.contains(entity)) {
        commands.entity(vessels).try_insert(VesselBinding::default());
    }
}

/// An organ whose vessels follow its mesh.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct FollowedMesh {
    entity: Entity,
    mesh: &'static Mesh3d,
    progress: Option<&'static GrowthProgress>,
    vessels: &'static OrganVessels,
    rest: &'static mut RestMesh,
}

/// Publish: moves vessels with their organ's mesh.
pub(crate) fn follow_meshes(
    meshes: Option<Res<Assets<Mesh>>>,
    mut organs: Query<FollowedMesh, (With<FollowsMesh>, Without<FollowsTetrahedra>)>,
    mut bound: Query<Bound>,
    jobs: Jobs,
) {
    let Some(meshes) = meshes else { return };
    for mut organ in &mut organs {
        let (Some(mesh), Some(copy)) = (meshes.get(organ.mesh.id()), organ.rest.copy.clone()) else { continue };
        let Some(vertices) = vertex_positions(mesh) else {
            organ.rest.warn(organ.entity, "its mesh's positions are not in main memory as three floats each");
            continue;
        };
        if vertices.len() != copy.positions.len() {
            // A new mesh gets a new tissue, so only vessels that did not grow need the warning.
            if organ.progress.is_none() {
                organ.rest.warn(organ.entity, "its mesh has another number of vertices than it had at rest");
            }
            continue;
        }
        let has_moved = organ.rest.bypass_change_detection().take_vertices(vertices);
        let is_at_rest = organ.rest.followed == copy.positions;
        let motion = Motion {
            rest: RestOrgan::Surface(copy),
            lineage: organ.rest.tissue,
            is_grown: organ.progress.is_none_or(GrowthProgress::is_settled),
            has_moved,
            vertices: if is_at_rest { None } else { Some(&organ.rest.followed) },
        };
        if let Err(error) = motion.carry_along(organ.vessels.entities(), &mut bound, &jobs) {
            organ.rest.bypass_change_detection().warn(organ.entity, &error.to_string());
        }
    }
}

/// An organ whose vessels follow its tetrahedra.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct FollowedTetrahedra {
    entity: Entity,
    tetrahedra: Ref<'static, FollowsTetrahedra>,
    progress: Option<&'static GrowthProgress>,
    vessels: &'static OrganVessels,
    rest: &'static mut RestMesh,
}

/// Publish: moves vessels with their organ's tetrahedra.
pub(crate) fn follow_tetrahedra(mut organs: Query<FollowedTetrahedra>, mut bound: Query<Bound>, jobs: Jobs) {
    for mut organ in &mut organs {
        let tetrahedra = &organ.tetrahedra;
        let is_at_rest = tetrahedra.positions == tetrahedra.rest.positions();
        let motion = Motion {
            rest: RestOrgan::Solid(Arc::clone(&tetrahedra.rest)),
            lineage: tetrahedra.lineage,
            is_grown: organ.progress.is_none_or(GrowthProgress::is_settled),
            has_moved: tetrahedra.is_changed(),
            vertices: if is_at_rest { None } else { Some(&tetrahedra.positions) },
        };
        if let Err(error) = motion.carry_along(organ.vessels.entities(), &mut bound, &jobs) {
            organ.rest.bypass_change_detection().warn(organ.entity, &error.to_string());
        }
    }
}

/// Brings vessels back to rest when a component that they followed is removed, unless they also follow the other.
pub(crate) fn release_vessels<Followed: Component, Other: Component>(
    removed: On<Remove, Followed>,
    organs: Query<(Option<&OrganVessels>, Has<Other>)>,
    mut vessels: Query<Bound>,
    mut commands: Commands,
) {
    let Ok((entities, follows_otherwise)) = organs.get(removed.entity) else { return };
    let entities = entities.map_or(&[][..], OrganVessels::entities);
    let mut each = vessels.iter_many_mut(entities);
    while let Some(mut bound) = each.fetch_next() {
        bound.come_to_rest();
    }
    for &entity in entities {
        commands.entity(entity).try_remove::<VesselBinding>();
    }
    if !follows_otherwise {
        commands.entity(removed.entity).queue_silenced(|mut organ: EntityWorldMut| {
            organ.remove::<RestMesh>();
        });
    }
}
