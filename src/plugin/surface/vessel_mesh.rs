//! The closed surface of a vessel entity: its state.

use crate::plugin::{
    job::Job,
    lineage::Lineage,
    surface::{build::Built, messages::VesselSurfaceError, settings::VesselSurface},
    vessels::{change_log::ChangeCursor, tree::Vessels, wounds::VesselWounds},
};
use crate::synthesis::surface::{Surface, SurfaceSettings};
use bevy::{
    asset::Handle,
    ecs::{component::Component, entity::Entity, reflect::ReflectComponent},
    math::{Vec3, Vec3A},
    mesh::Mesh,
    reflect::{Reflect, std_traits::ReflectDefault},
};
use std::{fmt, sync::Arc};

/// The closed surface of a vessel entity. Read-only: the plugin keeps it for the vessels of organs with a
/// [`VesselSurface`].
///
/// The meshes are drawn by child entities with a [`SurfaceLevel`]. Their positions are relative to these entities'
/// `Transform`, the middle of the vessels.
#[derive(Component, Default)]
pub struct VesselMesh {
    pub(super) built: Option<(MadeFor, Built)>,
    pub(super) coming: Option<(MadeFor, Coming)>,
    pub(super) failed: Option<(MadeFor, VesselSurfaceError)>,
    /// Whether a command has asked for it.
    pub(super) is_wanted: bool,
    /// Whether it is that of the present vessels.
    pub(super) is_ready: bool,
    pub(super) is_shown: bool,
    /// Bevy's meshes, one for each level, and the entities that draw them.
    pub(super) handles: Vec<Handle<Mesh>>,
    pub(super) entities: Vec<Entity>,
    /// The changes of the vessels that the meshes have followed, and whether they are elsewhere than at rest.
    pub(super) followed: ChangeCursor,
    pub(super) is_moved: bool,
    /// What the wounds leave, by the number of the last action.
    shape: Option<(Lineage, u32, u64)>,
    /// Scratch: positions of nodes.
    pub(super) scratch: Vec<Vec3>,
}

/// A surface that is being made.
pub(super) type Coming = Job<Result<(Built, Vec<Mesh>), VesselSurfaceError>>;

/// An entity that draws a surface at one level of detail, a child of the vessel entity.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct SurfaceLevel {
    /// 0 for the finest.
    pub level: u32,
}

/// The vessels and settings of a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MadeFor {
    lineage: Lineage,
    edits: u64,
    /// What the wounds leave; `None` for everything.
    shape: Option<u64>,
    settings: SurfaceSettings,
    has_levels: bool,
    /// Whether it can follow moving nodes.
    is_followed: bool,
}

impl MadeFor {
    /// Whether it has the same tree, as it grew.
    pub fn is_of_growth(&self, other: &Self) -> bool {
        (self.lineage, self.edits) == (other.lineage, other.edits)
    }

    /// Whether it has the same tree, cut alike.
    pub fn is_of_shape(&self, other: &Self) -> bool {
        self.is_of_growth(other) && self.shape == other.shape
    }

    /// Whether a surface that was made for this is as good as one made for the other.
    pub fn serves(&self, other: &Self) -> bool {
        let alike = self.settings == other.settings && self.has_levels == other.has_levels;
        self.is_of_shape(other) && alike && (self.is_followed || !other.is_followed)
    }

    /// Whether wounds take something away.
    pub fn is_cut(&self) -> bool {
        self.shape.is_some()
    }
}

impl VesselMesh {
    /// The finest surface, in the space of the vessels at rest; `None` until there is one.
    ///
    /// Once there is one, it stays until the next is ready: see [`is_ready`](Self::is_ready).
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.levels().next()
    }

    /// The surfaces of all levels of detail, the finest first.
    pub fn levels(&self) -> impl Iterator<Item = &Arc<Surface>> {
        self.built.iter().flat_map(|(_, built)| built.levels.iter().map(|level| &level.surface))
    }

    /// Whether the surface is that of the present vessels.
    pub fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Whether the mesh is shown, in place of the segments.
    pub fn is_shown(&self) -> bool {
        self.is_shown
    }

    /// Share of the work on the next surface that is done, from 0 to 1; `None` if none is under way.
    pub fn progress(&self) -> Option<f32> {
        self.coming.as_ref().map(|(_, job)| job.progress())
    }

    /// Why there is no surface of the present vessels, if it could not be made.
    pub fn error(&self) -> Option<&VesselSurfaceError> {
        self.failed.as_ref().map(|(_, error)| error)
    }

    /// The entities that draw the levels, children of the vessel entity. There are none without mesh assets.
    pub fn entities(&self) -> &[Entity] {
        &self.entities
    }

    /// Diagonal of the box around the vessels at rest: the unit of
    /// [`SurfaceDetail::distances`](crate::plugin::SurfaceDetail::distances).
    pub fn size(&self) -> f32 {
        self.built.as_ref().map_or(0.0, |(_, built)| 2.0 * Vec3A::length(built.aabb.half_extents))
    }

    /// What a surface of these vessels has to be made for.
    pub(super) fn wanted(
        &mut self,
        vessels: &Vessels,
        wounds: Option<&VesselWounds>,
        surface: &VesselSurface,
        is_followed: bool,
    ) -> MadeFor {
        let wounds = wounds.filter(|wounds| wounds.is_of(vessels) && !wounds.is_empty());
        let shape = wounds.map(|wounds| self.shape_of(vessels.lineage(), wounds));
        MadeFor {
            lineage: vessels.lineage(),
            edits: vessels.edits(),
            // Clamps take nothing away.
            shape: shape.filter(|_| wounds.is_some_and(|wounds| wounds.severed_segments().next().is_some())),
            settings: surface.settings.clone(),
            has_levels: surface.detail.is_some(),
            is_followed,
        }
    }

    /// What wounds leave. It is computed once after each action.
    fn shape_of(&mut self, lineage: Lineage, wounds: &VesselWounds) -> u64 {
        match self.shape {
            Some((of, generation, shape)) if (of, generation) == (lineage, wounds.generation()) => shape,
            _ => {
                let shape = wounds.shape();
                self.shape = Some((lineage, wounds.generation(), shape));
                shape
            }
        }
    }
}

impl fmt::Debug for VesselMesh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("VesselMesh");
        out.field("is_ready", &self.is_ready).field("is_shown", &self.is_shown).field("progress", &self.progress());
        out.field("error", &self.error()).field("entities", &self.entities).finish_non_exhaustive()
    }
}
