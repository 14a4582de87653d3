//! The maps of an organ: their state.

use crate::plugin::{
    job::Job,
    lineage::Lineage,
    texture::{
        bake::Baked,
        messages::VesselTextureError,
        settings::{TextureBase, VesselTexture},
    },
};
use crate::synthesis::texture::{BakeReport, MapKind};
use bevy::{
    asset::{AssetId, Handle},
    ecs::{component::Component, entity::Entity},
    image::Image,
    mesh::Mesh,
};
use std::fmt;

/// The maps of an organ's vessels. Read-only: the plugin keeps it for organs with a [`VesselTexture`].
#[derive(Component, Default)]
pub struct VesselMaps {
    pub(super) made: Option<Made>,
    pub(super) coming: Option<(MadeFor, Coming)>,
    pub(super) failed: Option<(MadeFor, VesselTextureError)>,
    /// Whether they are those of the present vessels.
    pub(super) is_ready: bool,
    pub(super) is_shown: bool,
    /// Whether the vessels give way to them.
    pub(super) hides_vessels: bool,
    /// The vessels that it has hidden.
    pub(super) hidden: Vec<Entity>,
}

/// Maps that are being made.
pub(super) type Coming = Job<Result<Baked, VesselTextureError>>;

/// Maps that are there.
pub(super) struct Made {
    pub made_for: MadeFor,
    pub images: Vec<(MapKind, Handle<Image>)>,
    pub report: BakeReport,
    pub has_tangents: bool,
}

/// What maps were made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MadeFor {
    /// Each vessel entity, its tree, and how often that was changed.
    pub vessels: Vec<(Entity, Lineage, u64)>,
    pub mesh: AssetId<Mesh>,
    pub texture: VesselTexture,
    pub base: Option<TextureBase>,
}

impl MadeFor {
    /// Whether maps show the same vessels on the same mesh.
    pub fn is_of_vessels(&self, other: &Self) -> bool {
        self.vessels == other.vessels && self.mesh == other.mesh
    }

    /// Whether maps that were made for this are as good as ones made for the other.
    pub fn serves(&self, other: &Self) -> bool {
        let (own, others) = (&self.texture, &other.texture);
        self.is_of_vessels(other)
            && (&own.settings, &own.looks, &self.base) == (&others.settings, &others.looks, &other.base)
    }
}

impl VesselMaps {
    /// A map, if it was asked for and is there.
    ///
    /// Colours, normals and roughness are for drawing. Heights, depths and ids stay in main memory, as numbers of 16 bits,
    /// or of 8 bits in four channels: see [`BakedMap`](crate::synthesis::texture::BakedMap).
    pub fn image(&self, kind: MapKind) -> Option<&Handle<Image>> {
        self.made.as_ref()?.images.iter().find(|(of, _)| *of == kind).map(|(_, image)| image)
    }

    /// What was done for the maps, and what their values mean.
    pub fn report(&self) -> Option<&BakeReport> {
        self.made.as_ref().map(|made| &made.report)
    }

    /// Whether the maps are those of the present vessels.
    pub fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Whether the maps are to be shown.
    pub fn is_shown(&self) -> bool {
        self.is_shown
    }

    /// Whether the organ's mesh has tangents, without which no renderer can draw the map of normals.
    pub fn has_tangents(&self) -> bool {
        self.made.as_ref().is_some_and(|made| made.has_tangents)
    }

    /// Share of the work on the next maps that is done, from 0 to 1; `None` if none is under way.
    pub fn progress(&self) -> Option<f32> {
        self.coming.as_ref().map(|(_, job)| job.progress())
    }

    /// Why there are no maps of the present vessels, if they could not be made.
    pub fn error(&self) -> Option<&VesselTextureError> {
        self.failed.as_ref().map(|(_, error)| error)
    }
}

impl fmt::Debug for VesselMaps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = f.debug_struct("VesselMaps");
        out.field("is_ready", &self.is_ready).field("is_shown", &self.is_shown).field("progress", &self.progress());
        out.field("error", &self.error()).finish_non_exhaustive()
    }
}
