//! Surfaces are saved in the background.
//!
//! In: [`SurfaceCommand`]s. Out: files, each written whole or not at all, and a message for each.

use crate::plugin::{
    announcer::Announcer,
    growth::progress::GrowthProgress,
    job::{Job, Jobs},
    surface::{
        messages::{SurfaceAction, SurfaceCommand, SurfaceNotSaved, SurfaceSaveError, SurfaceSaved},
        settings::VesselSurface,
        vessel_mesh::VesselMesh,
    },
    vessels::{OrganVessels, VesselAppearance, Vessels},
};
use crate::synthesis::{
    io::{SurfaceOptions, SurfacePart, WriteError, save_surface},
    surface::Surface,
    tree::{VesselKind, VesselTree},
};
use bevy::{
    color::ColorToComponents,
    ecs::{
        change_detection::{DetectChangesMut, Res, ResMut},
        entity::Entity,
        message::MessageReader,
        query::{QueryData, With},
        resource::Resource,
        system::{Query, SystemParam},
    },
    log::warn,
};
use std::{path::PathBuf, sync::Arc};

/// The files that are still to be written.
#[derive(Resource, Debug, Default)]
pub(crate) struct SurfaceSaves(Vec<Save>);

/// A file that is still to be written.
#[derive(Debug)]
struct Save {
    organ: Entity,
    path: PathBuf,
    options: SurfaceOptions,
    /// `None` until all surfaces are ready.
    job: Option<Job<Result<(), WriteError>>>,
}

impl SurfaceSaves {
    /// Run condition: whether there are any.
    pub(crate) fn any(saves: Res<Self>) -> bool {
        !saves.0.is_empty()
    }
}

/// Tells what became of files.
#[derive(SystemParam)]
pub(crate) struct SaveNews<'w, 's> {
    saved: Announcer<'w, 's, SurfaceSaved>,
    not_saved: Announcer<'w, 's, SurfaceNotSaved>,
}

/// An organ whose surfaces may be saved.
#[derive(QueryData)]
pub(crate) struct SavedOrgan {
    vessels: Option<&'static OrganVessels>,
    appearance: Option<&'static VesselAppearance>,
    progress: Option<&'static GrowthProgress>,
}

/// Surface: reads commands.
pub(crate) fn read_commands(
    mut commands: MessageReader<SurfaceCommand>,
    organs: Query<Option<&OrganVessels>, With<VesselSurface>>,
    mut meshes: Query<&mut VesselMesh>,
    mut saves: ResMut<SurfaceSaves>,
) {
    for command in commands.read() {
        let organ = command.organ;
        match &command.action {
            SurfaceAction::Save { path, options } => {
                saves.0.push(Save { organ, path: path.clone(), options: options.clone(), job: None });
            }
            SurfaceAction::Make => match organs.get(organ) {
                Ok(vessels) => want(vessels, &mut meshes),
                Err(_) => warn!("{organ}: a surface is made only for an organ with a VesselSurface"),
            },
        }
    }
}

/// Asks for the surfaces of an organ's vessels.
fn want(vessels: Option<&OrganVessels>, meshes: &mut Query<&mut VesselMesh>) {
    let mut meshes = meshes.iter_many_mut(vessels.map_or(&[][..], OrganVessels::entities));
    while let Some(mut mesh) = meshes.fetch_next() {
        mesh.is_wanted = true;
    }
}

/// Surface: writes the files whose surfaces are ready, and tells which are written.
pub(crate) fn save_surfaces(
    organs: Query<SavedOrgan, With<VesselSurface>>,
    mut meshes: Query<(&Vessels, &mut VesselMesh)>,
    mut saves: ResMut<SurfaceSaves>,
    jobs: Jobs,
    mut news: SaveNews,
) {
    saves.0.retain_mut(|save| {
        let Some(outcome) = save.advance(&organs, &mut meshes, &jobs) else { return true };
        let (organ, path) = (save.organ, save.path.clone());
        match outcome {
            Ok(()) => news.saved.announce(SurfaceSaved { organ, path }),
            Err(error) => {
                warn!("{organ}: its surfaces were not saved: {error}");
                news.not_saved.announce(SurfaceNotSaved { organ, path, error });
            }
        }
        false
    });
}

impl Save {
    /// `None` until the file is written or cannot be.
    fn advance(
        &mut self,
        organs: &Query<SavedOrgan, With<VesselSurface>>,
        meshes: &mut Query<(&Vessels, &mut VesselMesh)>,
        jobs: &Jobs,
    ) -> Option<Result<(), SurfaceSaveError>> {
        if self.job.is_none() {
            let parts = organs.get(self.organ).map_err(|_| SurfaceSaveError::NoSurface);
            match parts.and_then(|organ| Part::of(&organ, meshes)) {
                Ok(None) => return None,
                Ok(Some(parts)) => self.begin(parts, jobs),
                Err(error) => return Some(Err(error)),
            }
        }
        let outcome = Job::poll(&mut self.job)?;
        let written =
            |written: Result<(), WriteError>| written.map_err(|error| SurfaceSaveError::Write(Arc::new(error)));
        Some(outcome.map_err(SurfaceSaveError::from).and_then(written))
    }

    fn begin(&mut self, parts: Vec<Part>, jobs: &Jobs) {
        let (path, options) = (self.path.clone(), self.options.clone());
        let vertices = parts.iter().map(|part| part.surface.mesh.positions.len()).sum();
        self.job = Some(jobs.start(vertices, async move |_| {
            let parts: Vec<SurfacePart> = parts.iter().map(Part::borrowed).collect();
            save_surface(&path, &parts, &options)
        }));
    }
}

/// A surface to be saved.
struct Part {
    kind: VesselKind,
    tree: Arc<VesselTree>,
    surface: Arc<Surface>,
    color: [f32; 3],
}

impl Part {
    /// The surfaces of an organ, in the order of kinds; `None` until all are ready. Those that are not are asked for.
    fn of(
        organ: &SavedOrganItem,
        meshes: &mut Query<(&Vessels, &mut VesselMesh)>,
    ) -> Result<Option<Vec<Self>>, SurfaceSaveError> {
        let Some(entities) = organ.vessels.filter(|vessels| !vessels.entities().is_empty()) else {
            return Err(SurfaceSaveError::NoVessels);
        };
        let default = VesselAppearance::default();
        let colors = &organ.appearance.unwrap_or(&default).colors;
        let (mut parts, mut is_complete) = (Vec::new(), true);
        for &entity in entities.entities() {
            let Ok((vessels, mut mesh)) = meshes.get_mut(entity) else {
                is_complete = false;
                continue;
            };
            if vessels.tree().is_empty() && organ.progress.is_none_or(GrowthProgress::is_finished) {
                continue;
            }
            match &mesh.built {
                Some((_, built)) if mesh.is_ready => {
                    let Some(level) = built.levels.first() else { continue };
                    let (kind, surface) = (vessels.kind(), Arc::clone(&level.surface));
                    let color = colors[kind].to_linear().to_f32_array_no_alpha().map(|value| value.clamp(0.0, 1.0));
                    parts.push(Self { kind, tree: Arc::clone(&built.tree), surface, color });
                }
                _ => {
                    if let Some(error) = mesh.error().filter(|_| mesh.coming.is_none()) {
                        return Err(error.clone().into());
                    }
                    is_complete = false;
                    mesh.bypass_change_detection().is_wanted = true;
                }
            }
        }
        if is_complete && parts.is_empty() {
            return Err(SurfaceSaveError::NoVessels);
        }
        parts.sort_by_key(|part| part.kind.index());
        Ok(is_complete.then_some(parts))
    }

    fn borrowed(&self) -> SurfacePart<'_> {
        SurfacePart { color: self.color, ..SurfacePart::new(self.kind, &self.tree, &self.surface.mesh) }
    }
}
