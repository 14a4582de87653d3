//! Vessels follow an organ whose mesh is deformed.
//!
//! In: the organ's mesh asset, whose positions someone writes. Out: [`Vessels`] with moved nodes. Growth goes on at rest:
//! what grows is bound to the organ as it was when its tissue was prepared, and moved from there.

use crate::plugin::{
    circulation::AT_ONCE,
    components::{GrowthProgress, OrganVessels},
    growth_state::GrowthState,
    organ_mesh::{MeshCopy, copy_mesh, vertex_positions},
    segment_changes::SegmentChanges,
    vessel_index::VesselIndex,
    vessels::{Lineage, Vessels},
};
use crate::synthesis::{
    binding::{Binding, BindingError},
    mesh::{MeshError, TriangleMesh},
    tree::VesselTree,
};
use bevy::{
    asset::Assets,
    camera::primitives::Aabb,
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut, Res},
        component::Component,
        entity::Entity,
        lifecycle::Remove,
        observer::On,
        query::{QueryData, With, Without},
        reflect::ReflectComponent,
        system::{Commands, Query},
        world::EntityWorldMut,
    },
    log::warn,
    math::Vec3,
    mesh::{Mesh, Mesh3d},
    reflect::{Reflect, std_traits::ReflectDefault},
    tasks::{AsyncComputeTaskPool, Task, TaskPool, futures::check_ready},
};
use std::sync::Arc;

/// Lets an organ's vessels follow its mesh: put it beside the organ's [`Vasculature`](crate::plugin::Vasculature), and
/// write new positions of the vertices into the mesh asset, each frame if need be, as a soft body does.
///
/// New positions no longer start the growth again; another number of vertices, or another mesh asset, still does. The
/// organ is at rest as its mesh is when its tissue is prepared, or when this is added later. Vessels may still grow: they
/// do so at rest, and are moved from there.
///
/// Write the mesh before [`VesselSystems::Publish`](crate::plugin::VesselSystems::Publish), and the vessels follow in the
/// same frame; later, they follow in the next. The mesh must keep its data in main memory
/// (`RenderAssetUsages::MAIN_WORLD`), and have its own asset: organs that share one move alike. Radii, flow and what is
/// ischaemic stay as they are at rest. Removing this brings the vessels back to rest.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(RestMesh)]
pub struct FollowsMesh;

/// An organ's mesh at rest. The plugin keeps it for organs with [`FollowsMesh`].
#[derive(Component, Clone, Default)]
pub struct RestMesh {
    copy: Option<Arc<MeshCopy>>,
    /// The tissue that was prepared from it.
    tissue: Lineage,
    /// Positions that the vessels followed last.
    followed: Vec<Vec3>,
    /// What was warned of, once.
    warned: bool,
}

impl RestMesh {
    /// The vertices at rest; `None` until the mesh has been loaded.
    pub fn positions(&self) -> Option<&[Vec3]> {
        self.copy.as_ref().map(|copy| &copy.positions[..])
    }

    /// Whether a mesh is this one deformed.
    pub(crate) fn is_of(&self, mesh: Option<&Mesh>) -> bool {
        let vertices = mesh.and_then(vertex_positions).map(<[_]>::len);
        vertices.is_some() && vertices == self.positions().map(<[_]>::len)
    }

    fn warn(&mut self, organ: Entity, what: &str) {
        if !std::mem::replace(&mut self.warned, true) {
            warn!("{organ}: its vessels don't follow its mesh: {what}");
        }
    }
}

/// The nodes of a vessel entity, bound to their organ at rest.
#[derive(Component, Debug, Default)]
pub(crate) struct VesselBinding {
    binding: Option<Binding>,
    task: Option<Task<Result<Binding, MeshError>>>,
    /// What it was made for.
    made_for: Option<MadeFor>,
}

/// What a binding is made for. Nodes shift a little while they grow, so grown ones are bound again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MadeFor {
    vessels: Lineage,
    tissue: Lineage,
    is_grown: bool,
}

/// Source: an organ is at rest as it is when its tissue is prepared.
pub(crate) fn take_rest(
    meshes: Res<Assets<Mesh>>,
    mut organs: Query<(Entity, &Mesh3d, Option<&GrowthState>, &mut RestMesh), With<FollowsMesh>>,
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

/// Publish: gives a binding to the vessels of organs that are followed.
pub(crate) fn attach_bindings(
    mut commands: Commands,
    organs: Query<&OrganVessels, With<FollowsMesh>>,
    unbound: Query<(), (With<Vessels>, Without<VesselBinding>)>,
) {
    for &vessels in organs.iter().flat_map(|vessels| vessels.entities()).filter(|&&entity| unbound.contains(entity)) {
        commands.entity(vessels).try_insert(VesselBinding::default());
    }
}

/// An organ that is followed.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Followed {
    entity: Entity,
    mesh: &'static Mesh3d,
    progress: Option<&'static GrowthProgress>,
    vessels: &'static OrganVessels,
    rest: &'static mut RestMesh,
}

/// Vessels that follow.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Bound {
    vessels: &'static mut Vessels,
    binding: &'static mut VesselBinding,
    changes: &'static mut SegmentChanges,
    aabb: Option<&'static mut Aabb>,
    index: Option<&'static mut VesselIndex>,
}

/// Publish: vessels go where their organ's mesh is.
pub(crate) fn follow_meshes(
    meshes: Option<Res<Assets<Mesh>>>,
    mut organs: Query<Followed, With<FollowsMesh>>,
    mut bound: Query<Bound>,
) {
    let Some(meshes) = meshes else { return };
    for mut organ in &mut organs {
        let (Some(mesh), Some(copy)) = (meshes.get(organ.mesh.id()), organ.rest.copy.clone()) else { continue };
        let Some(vertices) = vertex_positions(mesh) else {
            organ.rest.warn(organ.entity, "its positions are not in main memory as three floats each");
            continue;
        };
        if vertices.len() != copy.positions.len() {
            // The tissue of a mesh that is another one is being prepared; vessels that did not grow have none.
            if organ.progress.is_none() {
                organ.rest.warn(organ.entity, "it has another number of vertices than it had at rest");
            }
            continue;
        }
        let moved = organ.rest.bypass_change_detection().take_vertices(vertices);
        let is_at_rest = organ.rest.followed == copy.positions;
        let is_grown = organ.progress.is_none_or(GrowthProgress::is_finished);
        let mut each = bound.iter_many_mut(organ.vessels.entities());
        while let Some(mut vessels) = each.fetch_next() {
            let made_for = MadeFor { vessels: vessels.vessels.lineage(), tissue: organ.rest.tissue, is_grown };
            let is_new = vessels.bind(made_for, &copy);
            if moved || is_new || vessels.vessels.is_changed() {
                let followed = if is_at_rest { None } else { Some(&organ.rest.followed[..]) };
                if let Err(error) = vessels.follow(followed) {
                    organ.rest.bypass_change_detection().warn(organ.entity, &error.to_string());
                }
            }
        }
    }
}

impl RestMesh {
    /// Takes over where the vertices are, and says whether that is elsewhere than before.
    fn take_vertices(&mut self, vertices: &[[f32; 3]]) -> bool {
        let is_same = self.followed.len() == vertices.len()
            && self.followed.iter().zip(vertices).all(|(before, now)| before.to_array() == *now);
        if !is_same {
            self.followed.clear();
            self.followed.extend(vertices.iter().map(|&vertex| Vec3::from(vertex)));
        }
        !is_same
    }
}

impl BoundItem<'_, '_> {
    /// Binds the vessels to the organ at rest where that is due: at once where it is quick. Says whether there is a new
    /// binding.
    fn bind(&mut self, made_for: MadeFor, rest: &Arc<MeshCopy>) -> bool {
        let binding = &mut *self.binding;
        if binding.made_for != Some(made_for) && !self.vessels.tree().is_empty() {
            let is_other = binding
                .made_for
                .is_none_or(|before| (before.vessels, before.tissue) != (made_for.vessels, made_for.tissue));
            if is_other {
                binding.binding = None;
            }
            binding.made_for = Some(made_for);
            let (tree, rest) = (self.vessels.tree_at_rest().into_owned(), Arc::clone(rest));
            let work = tree.len() + rest.triangles.len();
            let bind = move || bind_to(&tree, &rest);
            if work > AT_ONCE {
                let pool = AsyncComputeTaskPool::get_or_init(TaskPool::new);
                binding.task = Some(pool.spawn(async move { bind() }));
            } else {
                binding.task = None;
                binding.binding = bind().ok();
                return true;
            }
        }
        let Some(bound) = binding.task.as_mut().and_then(check_ready) else { return false };
        binding.task = None;
        // The tissue was prepared from the same triangles, which were checked then.
        binding.binding = bound.ok();
        true
    }

    /// Moves the vessels with the vertices; `None` for back to rest.
    fn follow(&mut self, vertices: Option<&[Vec3]>) -> Result<(), BindingError> {
        let moved = match (vertices, &mut self.binding.binding) {
            (None, _) => self.vessels.bypass_change_detection().come_to_rest(),
            (Some(vertices), Some(binding)) => {
                self.vessels.bypass_change_detection().deform(binding, vertices)?;
                true
            }
            (Some(_), None) => false,
        };
        if moved {
            self.vessels.set_changed();
            self.changes.mark_all();
            if let Some(aabb) = &mut self.aabb {
                let now = self.vessels.aabb();
                aabb.set_if_neq(now);
            }
            if let Some(index) = &mut self.index {
                index.note_moved(&self.vessels, None);
            }
        }
        Ok(())
    }
}

fn bind_to(tree: &VesselTree, rest: &MeshCopy) -> Result<Binding, MeshError> {
    let mesh = TriangleMesh::new(rest.positions.clone(), rest.triangles.clone(), None)?;
    Ok(Binding::to_surface(tree, &mesh))
}

/// Vessels that no longer follow come to rest.
pub(crate) fn release_vessels(
    removed: On<Remove, FollowsMesh>,
    organs: Query<&OrganVessels>,
    mut vessels: Query<Bound>,
    mut commands: Commands,
) {
    let entities = organs.get(removed.entity).map_or(&[][..], OrganVessels::entities);
    let mut each = vessels.iter_many_mut(entities);
    while let Some(mut bound) = each.fetch_next() {
        // Coming to rest needs no binding, and cannot fail.
        let _ = bound.follow(None);
    }
    for &entity in entities {
        commands.entity(entity).try_remove::<VesselBinding>();
    }
    commands.entity(removed.entity).queue_silenced(|mut organ: EntityWorldMut| {
        organ.remove::<RestMesh>();
    });
}
