//! Surfaces are made of vessels that have grown or were cut.
//!
//! In: [`VesselSurface`] on organs, their [`Vessels`] and wounds. Out: [`VesselMesh`]es, by jobs; messages.

use crate::plugin::{
    announcer::Announcer,
    growth::progress::{GrowthControl, GrowthProgress},
    job::{Job, Jobs, as_one},
    organ::rest::RestMesh,
    surface::{
        build::{Built, ITEMS, Source, build},
        messages::{SurfaceFailed, SurfaceReady},
        settings::{SurfaceDetail, SurfaceMoment, SurfaceShown, VesselSurface},
        vessel_mesh::{MadeFor, VesselMesh},
    },
    vessels::{
        appearance::{SegmentColoring, VesselAppearance},
        change_log::ChangeCursor,
        relations::{OrganVessels, VesselsOf},
        tree::Vessels,
        wounds::VesselWounds,
    },
};
use bevy::{
    asset::Assets,
    ecs::{
        change_detection::{DetectChangesMut, ResMut},
        entity::Entity,
        query::{Has, QueryData, With, Without},
        system::{Commands, Query, SystemParam},
    },
    log::warn,
    mesh::Mesh,
};

/// An organ whose vessels have surfaces.
#[derive(QueryData)]
pub(crate) struct SurfacedOrgan {
    surface: &'static VesselSurface,
    appearance: Option<&'static VesselAppearance>,
    progress: Option<&'static GrowthProgress>,
    control: Option<&'static GrowthControl>,
    is_followed: Has<RestMesh>,
}

/// Vessels that have a surface, or will.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct SurfacedVessels {
    entity: Entity,
    vessels: &'static Vessels,
    of: &'static VesselsOf,
    wounds: Option<&'static VesselWounds>,
    mesh: &'static mut VesselMesh,
}

/// Tells what became of surfaces.
#[derive(SystemParam)]
pub(crate) struct SurfaceNews<'w, 's> {
    ready: Announcer<'w, 's, SurfaceReady>,
    failed: Announcer<'w, 's, SurfaceFailed>,
}

/// Surface: gives a [`VesselMesh`] to the vessels of organs that ask for it.
pub(crate) fn attach_meshes(
    mut commands: Commands,
    organs: Query<&OrganVessels, With<VesselSurface>>,
    bare: Query<(), (With<Vessels>, Without<VesselMesh>)>,
) {
    for &entity in organs.iter().flat_map(|vessels| vessels.entities()).filter(|&&entity| bare.contains(entity)) {
        commands.entity(entity).try_insert(VesselMesh::default());
    }
}

/// Surface: takes over surfaces that are ready, begins those that are needed, and decides what is shown.
pub(crate) fn make_surfaces(
    organs: Query<SurfacedOrgan>,
    mut vessels: Query<SurfacedVessels>,
    mut meshes: Option<ResMut<Assets<Mesh>>>,
    jobs: Jobs,
    mut news: SurfaceNews,
) {
    for mut vessels in &mut vessels {
        let Ok(organ) = organs.get(vessels.of.0) else { continue };
        let mesh = vessels.mesh.bypass_change_detection();
        let wanted = mesh.wanted(vessels.vessels, vessels.wounds, organ.surface, organ.is_followed);
        vessels.receive(meshes.as_deref_mut(), &mut news);
        vessels.begin(&organ, &wanted, &jobs);
        // Small surfaces are there at once.
        vessels.receive(meshes.as_deref_mut(), &mut news);
        vessels.decide(&organ, &wanted);
    }
}

impl SurfacedOrganItem<'_, '_> {
    /// Whether the vessels have grown, or did not grow here.
    fn is_grown(&self) -> bool {
        self.progress.is_none_or(GrowthProgress::is_grown)
    }

    /// Whether the vessels don't grow at the moment.
    fn rests(&self) -> bool {
        let is_settled = self.progress.is_some_and(GrowthProgress::is_settled);
        self.is_grown() || is_settled || self.control == Some(&GrowthControl::Paused)
    }
}

impl SurfacedVesselsItem<'_, '_> {
    /// Takes over a surface that has become ready.
    fn receive(&mut self, meshes: Option<&mut Assets<Mesh>>, news: &mut SurfaceNews) {
        let mesh = self.mesh.bypass_change_detection();
        let Some((made_for, job)) = mesh.coming.take() else { return };
        let mut job = Some(job);
        let outcome = Job::poll(&mut job);
        mesh.coming = job.map(|job| (made_for.clone(), job));
        let (organ, vessels) = (self.of.0, self.entity);
        match outcome.map(as_one) {
            None => {}
            Some(Ok((built, new))) => {
                self.take_over(made_for, built, new, meshes);
                news.ready.announce(SurfaceReady { organ, vessels, kind: self.vessels.kind() });
            }
            Some(Err(error)) => {
                warn!("{vessels}: these vessels have no surface: {error}");
                self.mesh.is_wanted = false;
                self.mesh.failed = Some((made_for, error.clone()));
                news.failed.announce(SurfaceFailed { organ, vessels, error });
            }
        }
    }

    fn take_over(&mut self, made_for: MadeFor, built: Built, new: Vec<Mesh>, meshes: Option<&mut Assets<Mesh>>) {
        let mesh = &mut *self.mesh;
        mesh.handles = meshes.map_or_else(Vec::new, |meshes| new.into_iter().map(|new| meshes.add(new)).collect());
        mesh.built = Some((made_for, built));
        (mesh.followed, mesh.is_moved) = (ChangeCursor::default(), false);
        (mesh.failed, mesh.is_wanted) = (None, false);
    }

    /// Begins a surface if the vessels need one, and stops one that they no longer need.
    fn begin(&mut self, organ: &SurfacedOrganItem, wanted: &MadeFor, jobs: &Jobs) {
        let mesh = self.mesh.bypass_change_detection();
        let is_of_growth = |(made_for, _): &(MadeFor, Built)| made_for.is_of_growth(wanted);
        let may_be_made = match organ.surface.when {
            SurfaceMoment::WhenGrown => organ.is_grown(),
            SurfaceMoment::OnDemand => mesh.built.as_ref().is_some_and(is_of_growth) && organ.rests(),
        };
        let may_be_made = may_be_made || (mesh.is_wanted && organ.rests());
        let serves = |made_for: &MadeFor| made_for.serves(wanted);
        if mesh.coming.as_ref().is_some_and(|(made_for, _)| !serves(made_for) || !may_be_made) {
            mesh.coming = None;
        }
        let is_there = mesh.built.as_ref().is_some_and(|(made_for, _)| serves(made_for));
        mesh.is_wanted &= !is_there;
        let has_failed = mesh.failed.as_ref().is_some_and(|(made_for, _)| serves(made_for));
        if !may_be_made || is_there || has_failed || mesh.coming.is_some() || self.vessels.tree().is_empty() {
            return;
        }
        let source = Source {
            tree: self.vessels.tree_at_rest().into_owned(),
            wounds: self.wounds.filter(|_| wanted.is_cut()).map(|wounds| wounds.without_history()),
            is_followed: organ.is_followed,
            settings: organ.surface.settings.clone(),
            levels: if organ.surface.detail.is_some() { SurfaceDetail::LEVELS } else { 1 },
        };
        let items = ITEMS.saturating_mul(source.tree.len());
        mesh.coming = Some((wanted.clone(), jobs.start(items, |pace| build(source, pace))));
    }

    /// Decides whether the mesh is shown.
    fn decide(&mut self, organ: &SurfacedOrganItem, wanted: &MadeFor) {
        let mesh = self.mesh.bypass_change_detection();
        let built = mesh.built.as_ref().filter(|(made_for, _)| made_for.is_of_shape(wanted));
        let is_ready = built.is_some_and(|(_, built)| built.can_follow() || !self.vessels.is_deformed());
        let is_of_kind = organ.appearance.is_none_or(|look| look.coloring == SegmentColoring::Kind);
        let is_asked_for = organ.surface.shows == SurfaceShown::Mesh && is_of_kind;
        let is_shown = is_ready && is_asked_for && !mesh.handles.is_empty();
        if (mesh.is_ready, mesh.is_shown) != (is_ready, is_shown) {
            (self.mesh.is_ready, self.mesh.is_shown) = (is_ready, is_shown);
        }
    }
}
