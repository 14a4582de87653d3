//! Runs without a window: vessels grow frame by frame, then pictures are taken, networks written and figures printed.

use super::{
    headless::{OffscreenTarget, PipelinesReady, write_picture},
    light::Endoscope,
    studio::{StudioArgs, transform_of},
};
use bevy::{
    asset::RenderAssetUsages,
    prelude::*,
    render::view::screenshot::{Screenshot, ScreenshotCaptured},
};
use bevy_vessels::{
    plugin::{OrganVessels, VesselMesh, VesselSurface},
    prelude::*,
    synthesis::{
        io::{SwcOptions, save_swc},
        organ::Viewpoint,
    },
};
use std::{io, time::Duration};

/// The pictures to take once the vessels are grown.
#[derive(Resource, Clone, Default)]
pub struct Shots(pub Vec<Shot>);

/// Further pictures beyond those in [`Shots`]: with these, the app goes on after the last.
#[derive(Resource, Clone, Copy, Default)]
pub struct MoreShots {
    /// Whether any are expected.
    pub expected: bool,
    /// Number of [`Shots`] that were taken, or can't be.
    pub taken: usize,
}

/// A picture to take.
#[derive(Clone)]
pub struct Shot {
    /// Name of the file.
    pub file: &'static str,
    /// Position and direction of the camera.
    pub view: Viewpoint,
    /// Vertical field of view, in degrees.
    pub field_of_view: f32,
    /// Whether the only light is the camera's.
    pub endoscope: bool,
}

/// Takes the [`Shots`] and ends the app.
pub struct PhotoPlugin;

impl Plugin for PhotoPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Session>()
            .init_resource::<MoreShots>()
            .add_systems(Update, (give_up, grow.run_if(not(grown)), photograph.run_if(grown)).chain());
    }
}

/// Frames for which a view is drawn before its picture is taken, so that shadows and buffers are up to date.
const STILL_FRAMES: u32 = 2;
/// Frames for which segments are still drawn under a closed mesh that takes their place.
const HANDOVER_FRAMES: u32 = 12;
/// Pixels drawn for one pixel of a picture, along each side.
pub const OVERSAMPLING: u32 = 2;

#[derive(Resource, Default)]
struct Session {
    grown: bool,
    frame_times: Vec<Duration>,
    /// Frames to wait before the first picture.
    handover: u32,
    shot: usize,
    still: u32,
    waiting: bool,
}

fn grown(session: Res<Session>) -> bool {
    session.grown
}

/// Ends the app with an error if an organ cannot grow or a picture cannot be written.
fn give_up(mut failures: MessageReader<GrowthFailed>, mut exit: MessageWriter<AppExit>) {
    for failure in failures.read() {
        eprintln!("{}", failure.error);
        exit.write(AppExit::error());
    }
}

/// Spreads the steps over the frames that the user asked for; the rest is then done at once.
fn grow(
    args: Res<StudioArgs>,
    (time, shots): (Res<Time<Real>>, Res<Shots>),
    organs: Query<(Entity, &GrowthProgress)>,
    surfaces: Query<(), With<VesselSurface>>,
    vessels: Query<Option<&VesselMesh>, With<Vessels>>,
    mut session: ResMut<Session>,
    mut budget: ResMut<GrowthBudget>,
    mut commands: MessageWriter<GrowthCommand>,
) {
    if organs.is_empty() {
        // Pictures are requested together with the organs that grow for them, or nothing grows.
        session.grown = !shots.0.is_empty();
        return;
    }
    let steps: u32 = organs.iter().map(|(_, progress)| progress.steps).sum();
    budget.set_if_neq(GrowthBudget::Steps(steps.div_ceil(args.frames)));
    if organs.iter().any(|(.., progress)| progress.step > 0) {
        session.frame_times.push(time.delta());
    }
    if session.frame_times.len() > args.frames as usize {
        commands.write_batch(organs.iter().map(|(organ, ..)| GrowthCommand::new(organ, GrowthAction::Finish)));
    }
    let has_meshes = !surfaces.is_empty();
    let is_settled = |mesh: Option<&VesselMesh>| mesh.is_some_and(|mesh| mesh.is_shown() || mesh.error().is_some());
    session.grown =
        organs.iter().all(|(.., progress)| progress.is_finished()) && (!has_meshes || vessels.iter().all(is_settled));
    session.handover = if has_meshes { HANDOVER_FRAMES } else { 0 };
}

fn photograph(
    mut commands: Commands,
    mut session: ResMut<Session>,
    (shots, args): (Res<Shots>, Res<StudioArgs>),
    mut more: ResMut<MoreShots>,
    offscreen: Option<(Res<OffscreenTarget>, Res<PipelinesReady>)>,
    mut endoscope: Option<ResMut<Endoscope>>,
    mut camera: Query<(&mut Camera, &mut Transform, &mut Projection)>,
    networks: Networks,
    mut exit: MessageWriter<AppExit>,
) {
    more.taken = if offscreen.is_some() { session.shot } else { shots.0.len() };
    let is_wanted = more.taken < shots.0.len();
    // no camera is needed between pictures
    for (mut camera, ..) in camera.iter_mut().filter(|(camera, ..)| camera.is_active != is_wanted) {
        camera.is_active = is_wanted;
    }
    if !is_wanted && more.expected {
        return;
    }
    let (Some(shot), Some((target, ready))) = (shots.0.get(session.shot), offscreen) else {
        networks.write(&args);
        networks.print_figures(&mut session.frame_times);
        exit.write(AppExit::Success);
        return;
    };
    if session.waiting {
        return;
    }
    for (mut camera, mut transform, mut projection) in &mut camera {
        camera.viewport = None;
        *transform = transform_of(&shot.view);
        if let Projection::Perspective(lens) = &mut *projection {
            lens.fov = shot.field_of_view.to_radians();
        }
    }
    if let Some(endoscope) = &mut endoscope {
        endoscope.0 = shot.endoscope;
    }
    session.still = if ready.0 { session.still + 1 } else { 0 };
    if session.still > STILL_FRAMES.max(session.handover) {
        session.waiting = true;
        let path = args.out.join(shot.file);
        commands.spawn(Screenshot::image(target.0.clone())).observe(
            move |captured: On<ScreenshotCaptured>, mut session: ResMut<Session>, mut exit: MessageWriter<AppExit>| {
                match smaller(&captured.image).and_then(|picture| write_picture(&picture, &path)) {
                    Ok(()) => println!("{}", path.display()),
                    Err(error) => {
                        eprintln!("{}: {error}", path.display());
                        exit.write(AppExit::error());
                    }
                }
                *session = Session {
                    shot: session.shot + 1,
                    still: 0,
                    waiting: false,
                    handover: 0,
                    ..std::mem::take(&mut session)
                };
            },
        );
    }
}

/// A picture with half as many pixels each way, each the mean of four. This smooths edges, and costs a software driver
/// less than multisampling.
fn smaller(image: &Image) -> io::Result<Image> {
    let picture = image.clone().try_into_dynamic().map_err(io::Error::other)?;
    let (width, height) = (picture.width() / OVERSAMPLING, picture.height() / OVERSAMPLING);
    let smaller = picture.thumbnail_exact(width, height);
    Ok(Image::from_dynamic(smaller, true, RenderAssetUsages::MAIN_WORLD))
}

/// All vessels of all organs.
#[derive(bevy::ecs::system::SystemParam)]
struct Networks<'w, 's> {
    organs: Query<'w, 's, (NameOrEntity, &'static GrowthProgress, Option<&'static OrganVessels>)>,
    vessels: Query<'w, 's, &'static Vessels>,
}

impl Networks<'_, '_> {
    fn write(&self, args: &StudioArgs) {
        for (name, _, vessels) in &self.organs {
            for vessels in self.vessels.iter_many(vessels.map_or(&[][..], OrganVessels::entities)) {
                let path = args.out.join(format!("{name}_{}.swc", vessels.kind().name()));
                let written = std::fs::create_dir_all(&args.out).map_err(|error| error.to_string()).and_then(|()| {
                    save_swc(&path, vessels.tree(), &SwcOptions::default()).map_err(|error| error.to_string())
                });
                match written {
                    Ok(()) => println!("{}", path.display()),
                    Err(error) => eprintln!("{}: {error}", path.display()),
                }
            }
        }
    }

    fn print_figures(&self, frame_times: &mut [Duration]) {
        for (name, progress, _) in &self.organs {
            let (arterial, venous) = (progress.nodes.artery, progress.nodes.vein);
            let ms = progress.grow_time.as_secs_f64() * 1000.0;
            println!("{name}: {} steps, {arterial} + {venous} nodes, grown in {ms:.0} ms", progress.step);
        }
        frame_times.sort_unstable();
        if let Some(last) = frame_times.len().checked_sub(1) {
            let at = |share: usize| frame_times[last * share / 100].as_secs_f64() * 1000.0;
            println!("{} frames while growing: median {:.0} ms, 99th percentile {:.0} ms", last + 1, at(50), at(99));
        }
    }
}
