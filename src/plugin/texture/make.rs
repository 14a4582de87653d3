//! Maps are made of vessels that have grown.
//!
//! In: [`VesselTexture`] on organs, their meshes and [`Vessels`]. Out: [`VesselMaps`], by jobs; messages; vessels that
//! give way to the texture.

use crate::plugin::{
    announcer::Announcer,
    growth::progress::GrowthProgress,
    job::{Job, Jobs, as_one},
    organ::{mesh::copy_mesh, rest::RestMesh},
    texture::{
        bake::{Baked, Shading, Source, bake},
        maps::{Made, MadeFor, VesselMaps},
        messages::{TextureFailed, TextureReady, VesselTextureError},
        settings::{TextureBase, TextureShown, VesselTexture},
    },
    vessels::{relations::OrganVessels, tree::Vessels},
};
use bevy::{
    asset::Assets,
    ecs::{
        change_detection::{DetectChangesMut, Res, ResMut},
        entity::Entity,
        query::QueryData,
        system::{Query, SystemParam},
    },
    image::Image,
    log::warn,
    mesh::{Mesh, Mesh3d},
};

/// An organ whose vessels are in its texture, or will be.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct TexturedOrgan {
    entity: Entity,
    texture: &'static VesselTexture,
    base: Option<&'static TextureBase>,
    mesh: Option<&'static Mesh3d>,
    rest: Option<&'static RestMesh>,
    vessels: Option<&'static OrganVessels>,
    progress: Option<&'static GrowthProgress>,
    maps: &'static mut VesselMaps,
}

/// What textures are made of.
#[derive(SystemParam)]
pub(crate) struct TextureAssets<'w> {
    meshes: Option<Res<'w, Assets<Mesh>>>,
    images: Option<ResMut<'w, Assets<Image>>>,
}

/// Tells what became of textures.
#[derive(SystemParam)]
pub(crate) struct TextureNews<'w, 's> {
    ready: Announcer<'w, 's, TextureReady>,
    failed: Announcer<'w, 's, TextureFailed>,
}

/// Texture: takes over maps that are ready, begins those that are needed, and decides what is shown.
pub(crate) fn make_textures(
    mut organs: Query<TexturedOrgan>,
    vessels: Query<(Entity, &Vessels)>,
    mut assets: TextureAssets,
    jobs: Jobs,
    mut news: TextureNews,
) {
    for mut organ in &mut organs {
        let wanted = organ.wanted(&vessels);
        organ.receive(&mut assets, &mut news);
        if organ.begin(&wanted, &vessels, &assets, &jobs, &mut news) {
            // Small maps are there at once.
            organ.receive(&mut assets, &mut news);
        }
        organ.decide(&wanted);
    }
}

impl TexturedOrganItem<'_, '_> {
    /// What maps have to be made for.
    fn wanted(&self, vessels: &Query<(Entity, &Vessels)>) -> MadeFor {
        let entities = self.vessels.map_or(&[][..], OrganVessels::entities);
        let mut found: Vec<_> = vessels
            .iter_many(entities)
            .filter(|(_, vessels)| !vessels.tree().is_empty())
            .map(|(entity, vessels)| (vessels.kind(), (entity, vessels.lineage(), vessels.edits())))
            .collect();
        found.sort_unstable_by_key(|(kind, (entity, ..))| (*kind, *entity));
        MadeFor {
            vessels: found.into_iter().map(|(_, vessels)| vessels).collect(),
            mesh: self.mesh.map_or_else(Default::default, |mesh| mesh.id()),
            texture: self.texture.clone(),
            base: self.base.cloned(),
        }
    }

    /// Whether the vessels have grown, or did not grow here.
    fn is_grown(&self) -> bool {
        self.progress.is_none_or(GrowthProgress::is_grown)
    }

    /// Takes over maps that have become ready.
    fn receive(&mut self, assets: &mut TextureAssets, news: &mut TextureNews) {
        let maps = self.maps.bypass_change_detection();
        let Some((made_for, job)) = maps.coming.take() else { return };
        let mut job = Some(job);
        let outcome = Job::poll(&mut job);
        maps.coming = job.map(|job| (made_for.clone(), job));
        match outcome.map(as_one) {
            None => {}
            Some(Ok(baked)) => self.take_over(made_for, baked, assets, news),
            Some(Err(error)) => self.fail(made_for, error, news),
        }
    }

    fn take_over(&mut self, made_for: MadeFor, baked: Baked, assets: &mut TextureAssets, news: &mut TextureNews) {
        let organ = self.entity;
        for warning in &baked.report.warnings {
            warn!("{organ}: {warning}");
        }
        let mesh = assets.meshes.as_ref().and_then(|meshes| meshes.get(made_for.mesh));
        let has_tangents = mesh.is_some_and(|mesh| mesh.try_attribute(Mesh::ATTRIBUTE_TANGENT).is_ok());
        let images = match &mut assets.images {
            Some(images) => baked.images.into_iter().map(|(kind, image)| (kind, images.add(image))).collect(),
            None => Vec::new(),
        };
        self.maps.made = Some(Made { made_for, images, report: baked.report, has_tangents });
        self.maps.failed = None;
        news.ready.announce(TextureReady { organ });
    }

    fn fail(&mut self, made_for: MadeFor, error: VesselTextureError, news: &mut TextureNews) {
        let organ = self.entity;
        warn!("{organ}: its vessels are not in its texture: {error}");
        self.maps.failed = Some((made_for, error.clone()));
        news.failed.announce(TextureFailed { organ, error });
    }

    /// Begins maps if the vessels need them, and stops those that they no longer need. Returns whether it did begin some.
    fn begin(
        &mut self,
        wanted: &MadeFor,
        vessels: &Query<(Entity, &Vessels)>,
        assets: &TextureAssets,
        jobs: &Jobs,
        news: &mut TextureNews,
    ) -> bool {
        let may_be_made = self.is_grown() && !wanted.vessels.is_empty();
        let maps = self.maps.bypass_change_detection();
        if maps.coming.as_ref().is_some_and(|(made_for, _)| !made_for.serves(wanted) || !may_be_made) {
            maps.coming = None;
        }
        let is_there = maps.made.as_ref().is_some_and(|made| made.made_for.serves(wanted));
        let has_failed = maps.failed.as_ref().is_some_and(|(made_for, _)| made_for.serves(wanted));
        if !may_be_made || is_there || has_failed || maps.coming.is_some() {
            return false;
        }
        match self.source(wanted, vessels, assets) {
            Ok(Some(source)) => {
                let coming = jobs.start(source.items(), |pace| bake(source, pace));
                self.maps.bypass_change_detection().coming = Some((wanted.clone(), coming));
                return true;
            }
            Ok(None) => {}
            Err(error) => self.fail(wanted.clone(), error, news),
        }
        false
    }

    /// Copies what maps are made of; `None` while an asset is still being loaded.
    fn source(
        &self,
        wanted: &MadeFor,
        vessels: &Query<(Entity, &Vessels)>,
        assets: &TextureAssets,
    ) -> Result<Option<Source>, VesselTextureError> {
        let handle = self.mesh.ok_or(VesselTextureError::NoMesh)?;
        let Some(mesh) = assets.meshes.as_ref().and_then(|meshes| meshes.get(handle)) else { return Ok(None) };
        let mut copy = copy_mesh(mesh)?;
        let rest = self.rest.and_then(RestMesh::positions).filter(|rest| rest.len() == copy.positions.len());
        let shading = Shading::of(mesh, rest.is_some());
        if let Some(rest) = rest {
            copy.positions = rest.to_vec();
        }
        let mut settings = wanted.texture.settings.clone();
        let mut base = None;
        if let Some(own) = &wanted.base {
            (settings.base_color, settings.base_roughness) = (own.color, own.roughness);
            if let Some(image) = &own.image {
                let Some(image) = assets.images.as_ref().and_then(|images| images.get(image)) else { return Ok(None) };
                base = Some(image.clone());
            }
        }
        let of = |&(entity, ..): &(Entity, _, _)| {
            let (_, vessels) = vessels.get(entity).ok()?;
            Some((vessels.tree_at_rest().into_owned(), wanted.texture.look(vessels.kind())))
        };
        let vessels = wanted.vessels.iter().filter_map(of).collect();
        Ok(Some(Source { mesh: copy, shading, vessels, base, settings }))
    }

    /// Decides whether the maps are shown.
    fn decide(&mut self, wanted: &MadeFor) {
        let maps = self.maps.bypass_change_detection();
        let is_ready = maps.made.as_ref().is_some_and(|made| made.made_for.is_of_vessels(wanted));
        let shows = self.texture.shows;
        let is_shown = is_ready && shows != TextureShown::Vessels;
        let hides_vessels = is_ready && shows == TextureShown::Texture;
        let decided = (is_ready, is_shown, hides_vessels);
        if (maps.is_ready, maps.is_shown, maps.hides_vessels) != decided {
            (self.maps.is_ready, self.maps.is_shown, self.maps.hides_vessels) = decided;
        }
    }
}
