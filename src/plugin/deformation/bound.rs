//! Vessels are bound to an organ at rest, and move with it.
//!
//! In: the organ at rest, and its present vertices. Out: [`Vessels`] with moved nodes, and everything that depends on
//! their positions. Jobs do the binding.

use crate::plugin::{
    job::{Job, Jobs},
    lineage::Lineage,
    organ::mesh::MeshCopy,
    vessels::{change_log::ChangeLog, tree::Vessels},
};
use crate::synthesis::{
    binding::{Binding, BindingError},
    mesh::{TetMesh, TriangleMesh},
    pace::Pace,
    tree::VesselTree,
};
use bevy::{
    camera::primitives::Aabb,
    ecs::{
        change_detection::{DetectChanges, DetectChangesMut},
        component::Component,
        entity::Entity,
        query::QueryData,
        system::Query,
    },
    log::warn,
    math::Vec3,
};
use std::sync::Arc;

/// An organ at rest, to which nodes are bound.
#[derive(Clone)]
pub(crate) enum RestOrgan {
    Surface(Arc<MeshCopy>),
    Solid(Arc<TetMesh>),
}

impl RestOrgan {
    /// Number of triangles or tetrahedra.
    fn elements(&self) -> usize {
        match self {
            Self::Surface(mesh) => mesh.triangles.len(),
            Self::Solid(mesh) => mesh.tetrahedra().len(),
        }
    }

    /// `None` if the triangles are not valid. The tissue is prepared from the same triangles, and reports what is
    /// wrong.
    async fn bind(&self, tree: &VesselTree, pace: &Pace) -> Option<Binding> {
        match self {
            Self::Surface(mesh) => {
                let (positions, triangles) = (mesh.positions.clone(), mesh.triangles.clone());
                let mesh = TriangleMesh::new_paced(positions, triangles, None, &pace.part(0.0..0.1)).await.ok()?;
                Some(Binding::to_surface_paced(tree, &mesh, &pace.part(0.1..1.0)).await)
            }
            Self::Solid(mesh) => Some(Binding::to_tetrahedra_paced(tree, mesh, pace).await),
        }
    }
}

/// The nodes of a vessel entity, bound to their organ at rest.
#[derive(Component, Debug, Default)]
pub(crate) struct VesselBinding {
    binding: Option<Binding>,
    job: Option<Job<Option<Binding>>>,
    /// The organ and vessels that it was made for.
    made_for: Option<MadeFor>,
}

/// The organ and vessels of a binding. Nodes shift a little while they grow, so they are bound again once grown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MadeFor {
    vessels: Lineage,
    organ: Lineage,
    is_grown: bool,
}

/// Vessels that follow their organ.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Bound {
    entity: Entity,
    vessels: &'static mut Vessels,
    binding: &'static mut VesselBinding,
    changes: &'static mut ChangeLog,
    aabb: Option<&'static mut Aabb>,
}

/// How an organ has moved in a frame.
pub(crate) struct Motion<'a> {
    pub(crate) rest: RestOrgan,
    /// Tells this organ at rest from others.
    pub(crate) lineage: Lineage,
    /// Whether its vessels have grown.
    pub(crate) is_grown: bool,
    /// Whether vertices have moved since the last frame.
    pub(crate) has_moved: bool,
    /// The vertices, `None` for those at rest.
    pub(crate) vertices: Option<&'a [Vec3]>,
}

impl Motion<'_> {
    /// Moves an organ's vessel entities if they need it. One that can't be moved doesn't stop the others.
    pub(crate) fn carry_along(
        &self,
        vessels: &[Entity],
        bound: &mut Query<Bound>,
        jobs: &Jobs,
    ) -> Result<(), BindingError> {
        let mut outcome = Ok(());
        let mut each = bound.iter_many_mut(vessels);
        while let Some(mut vessels) = each.fetch_next() {
            let is_new = vessels.bind(self, jobs);
            if self.has_moved || is_new || vessels.vessels.is_changed() {
                outcome = outcome.and(vessels.follow(self.vertices));
            }
        }
        outcome
    }
}

impl BoundItem<'_, '_> {
    /// Binds the vessels to the organ at rest if they need it. Returns whether there is a new binding.
    fn bind(&mut self, motion: &Motion, jobs: &Jobs) -> bool {
        let made_for = MadeFor { vessels: self.vessels.lineage(), organ: motion.lineage, is_grown: motion.is_grown };
        let binding = &mut *self.binding;
        if binding.made_for != Some(made_for) && !self.vessels.tree().is_empty() {
            let is_other = binding
                .made_for
                .is_none_or(|before| (before.vessels, before.organ) != (made_for.vessels, made_for.organ));
            if is_other {
                binding.binding = None;
            }
            binding.made_for = Some(made_for);
            let (tree, rest) = (self.vessels.tree_at_rest().into_owned(), motion.rest.clone());
            let work = tree.len() + rest.elements();
            binding.job = Some(jobs.start(work, async move |pace: Pace| rest.bind(&tree, &pace).await));
        }
        let Some(bound) = Job::poll(&mut binding.job) else { return false };
        binding.binding = bound.unwrap_or_else(|panic| {
            warn!("{}: these vessels don't follow their organ: {panic}", self.entity);
            None
        });
        true
    }

    /// Moves the vessels with the vertices; `None` brings them back to rest.
    fn follow(&mut self, vertices: Option<&[Vec3]>) -> Result<(), BindingError> {
        match (vertices, &mut self.binding.binding) {
            (None, _) => self.come_to_rest(),
            (Some(vertices), Some(binding)) => {
                self.vessels.bypass_change_detection().deform(binding, vertices)?;
                self.note_moved();
            }
            (Some(_), None) => {}
        }
        Ok(())
    }

    /// Brings the vessels back to where they grew.
    pub(crate) fn come_to_rest(&mut self) {
        if self.vessels.bypass_change_detection().come_to_rest() {
            self.note_moved();
        }
    }

    fn note_moved(&mut self) {
        self.vessels.set_changed();
        self.changes.mark_all();
        if let Some(aabb) = &mut self.aabb {
            aabb.set_if_neq(self.vessels.aabb());
        }
    }
}
