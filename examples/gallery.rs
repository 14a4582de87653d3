//! The presets side by side: six networks of one seed on discs, and one through the inside of a procedural liver.
//!
//! The discs are those of Fig. 5 of Rauch & Harders (2021): the paper's arteries and veins, then those with a larger
//! exponent κ, a larger direction weight ω, and a smaller and a larger bifurcation threshold φ.
//!
//! Keys as on the screen. `--headless --out DIR` writes `discs.png` and `liver.png`.

mod common;
#[path = "common/stouter.rs"]
mod stouter;

use bevy::{math::ops, prelude::*};
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_vessels::{
    prelude::*,
    render::SegmentRenderPlugin,
    synthesis::{
        organ::{LiverSettings, Viewpoint},
        tree::ByKind,
    },
};
use clap::Parser;
use common::{
    controls::{ControlsPlugin, HELP, Organ, OrganAssets},
    photo::{Shot, Shots},
    studio::{StudioArgs, StudioPlugin, View, moved, to_unit_size},
};
use stouter::stouter;

/// The presets side by side.
#[derive(Parser, Resource, Clone)]
struct Args {
    #[command(flatten)]
    studio: StudioArgs,
    /// Seed of the networks.
    #[arg(long, default_value_t = 3)]
    seed: u64,
}

/// The contents of each disc: caption, preset, and the kind of vessels to show if not both.
const DISCS: [(&str, PresetName, Option<VesselKind>); 6] = [
    ("arteries", PresetName::Paper, Some(VesselKind::Artery)),
    ("veins", PresetName::Paper, Some(VesselKind::Vein)),
    ("larger kappa: wider angles", PresetName::WideAngles, Some(VesselKind::Artery)),
    ("larger omega: straighter", PresetName::Straight, Some(VesselKind::Artery)),
    ("smaller phi: symmetric", PresetName::Symmetric, Some(VesselKind::Artery)),
    ("larger phi: lateral branches", PresetName::Lateral, Some(VesselKind::Artery)),
];
/// Position of the liver, beside the discs.
const LIVER: Vec3 = Vec3::new(2.4, 0.0, 0.0);
/// Lowest and highest corner of all discs with their captions and the liver, and room for the texts.
const EVERYTHING: [Vec3; 2] = [Vec3::new(-1.65, -1.4, -0.2), Vec3::new(2.95, 1.5, 0.2)];

fn main() -> AppExit {
    let args = Args::parse();
    // With four samples a pixel, lines of a quarter of one are still lines.
    let segments = SegmentRenderPlugin { least_width: 0.25, ..default() };
    App::new()
        .add_plugins(StudioPlugin { args: args.studio.clone(), title: "Presets", help: HELP, more_help: "" })
        .add_plugins((VesselPlugin { segments, ..default() }, ControlsPlugin))
        .insert_resource(args)
        .add_systems(Startup, (spawn_discs, spawn_liver).chain())
        .add_systems(PostStartup, keep_thin_vessels_whole)
        .add_systems(Update, see_everything.run_if(resource_equals(View::Window)))
        .add_systems(PostUpdate, place_captions.after(TransformSystems::Propagate))
        .run()
}

/// A line of text below a place in the world.
#[derive(Component)]
struct Caption(Vec3);

/// Without several samples in each pixel, vessels thinner than a pixel break into dots.
fn keep_thin_vessels_whole(mut cameras: Query<&mut Msaa, With<Camera3d>>) {
    for mut samples in &mut cameras {
        samples.set_if_neq(Msaa::Sample4);
    }
}

fn spawn_discs(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) {
    for (index, (caption, preset, only)) in DISCS.into_iter().enumerate() {
        let place = Transform::from_xyz((index % 3) as f32 * 1.12 - 1.12, 0.6 - (index / 3) as f32 * 1.2, 0.0);
        let disc = Circle::new(0.5).mesh().resolution(160).build();
        let shown = ByKind::from_fn(|kind| only.is_none_or(|only| only == kind));
        assets.spawn(&mut commands, disc, Color::srgb(0.93, 0.87, 0.82), place).insert((
            Name::new(preset.name()),
            stouter(Vasculature::new(preset).with_seed(args.seed), 2.5),
            (VesselAppearance { shown, ..default() }, Organ { kinds: shown }),
        ));
        let font = TextFont { font_size: FontSize::Px(15.0), ..default() };
        let text = (Text::new(caption), font, TextLayout::justify(Justify::Center));
        let node = Node { position_type: PositionType::Absolute, ..default() };
        commands.spawn((text, node, Caption(place.translation - 0.53 * Vec3::Y)));
    }
    let view = Viewpoint { eye: Vec3::new(0.0, -0.05, 3.0), target: Vec3::new(0.0, -0.05, 0.0), up: Vec3::Y };
    shots.0.push(Shot { file: "discs.png", view, field_of_view: 46.0, endoscope: false });
}

fn spawn_liver(mut commands: Commands, args: Res<Args>, mut assets: OrganAssets, mut shots: ResMut<Shots>) -> Result {
    let liver = LiverSettings { seed: args.seed, ..default() }.generate()?;
    let place = to_unit_size(liver.mesh.bounds());
    let place = place.with_translation(place.translation + LIVER);
    let mut wish = stouter(Vasculature::new(PresetName::Liver).with_seed(args.seed), 2.0);
    // Coarser than the preset, so that the inside is visible.
    wish.generator = wish.generator.scaled(1.5);
    wish.roots.artery = RootPlacement::Nearest(liver.roots.arterial.clone());
    wish.roots.vein = RootPlacement::Nearest(liver.roots.venous.clone());
    let glass = Color::srgba(1.0, 0.9, 0.85, 0.16);
    assets.spawn(&mut commands, liver.mesh.into(), glass, place).insert((Name::new("liver"), wish));
    let view = moved(&liver.front, &place);
    shots.0.push(Shot { file: "liver.png", view, field_of_view: 36.0, endoscope: false });
    Ok(())
}

/// Wherever the camera looks from, a window of a new shape shows everything.
fn see_everything(window: Single<&Window>, mut orbit: Single<&mut PanOrbitCamera>, mut seen: Local<Vec2>) {
    if *seen == window.size() {
        return;
    }
    *seen = window.size();
    let [low, high] = EVERYTHING;
    let (half, center) = (0.5 * (high - low), low.midpoint(high));
    let slope = ops::tan(0.5 * PerspectiveProjection::default().fov);
    let radius = (half.y / slope).max(half.x / slope * seen.y / seen.x.max(1.0)) + half.z;
    (orbit.focus, orbit.target_focus) = (center, center);
    (orbit.radius, orbit.target_radius) = (Some(radius), radius);
    orbit.yaw.get_or_insert(0.0);
    orbit.pitch.get_or_insert(0.0);
    orbit.force_update = true;
}

/// Captions stay below their discs wherever the camera is, no wider than these.
fn place_captions(
    camera: Option<Single<(&Camera, &GlobalTransform), With<Camera3d>>>,
    scale: Res<UiScale>,
    mut captions: Query<(&Caption, &mut Node)>,
) {
    let Some(camera) = camera else { return };
    for (caption, mut node) in &mut captions {
        let side = |x| camera.0.world_to_viewport(camera.1, caption.0 + x * Vec3::X).map(|at| at / scale.0);
        if let (Ok(a), Ok(b)) = (side(-0.55), side(0.55)) {
            node.display = Display::Flex;
            (node.left, node.width, node.top) = (px(a.x.min(b.x)), px((b.x - a.x).abs()), px(a.midpoint(b).y));
        } else {
            node.display = Display::None;
        }
    }
}
