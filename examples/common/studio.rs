//! A studio for organs: lights, a camera, and a window or a folder for pictures.

use super::{
    headless::{HOW_TO_GET_PICTURES, OffscreenPlugin, OffscreenTarget, find_adapter, headless_plugins},
    light::{LightPlugin, camera_lights},
    photo::{OVERSAMPLING, PhotoPlugin, Shots},
};
use bevy::{
    asset::UnapprovedPathMode,
    camera::{RenderTarget, Viewport},
    log::LogPlugin,
    prelude::*,
};
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_vessels::synthesis::organ::Viewpoint;
use std::path::PathBuf;

/// Arguments of every example.
#[derive(clap::Args, Resource, Clone, Debug)]
pub struct StudioArgs {
    /// Write pictures and networks instead of opening a window. Without a display, this is the default.
    #[arg(long)]
    pub headless: bool,
    /// Frames over which the vessels grow, without a window.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Folder for pictures and networks.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// Width and height of the pictures, in pixels.
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [1280, 960])]
    pub size: Vec<u32>,
}

impl StudioArgs {
    fn picture_size(&self) -> UVec2 {
        UVec2::new(self.size[0], self.size[1]).clamp(UVec2::splat(16), UVec2::splat(4096))
    }
}

/// Bevy with or without a window, and everything needed to see an organ of about one unit at the origin.
pub struct StudioPlugin {
    /// The user's arguments.
    pub args: StudioArgs,
    /// Title of the window.
    pub title: &'static str,
    /// Help for the keys, one line each.
    pub help: &'static str,
    /// Help for the keys of this example alone.
    pub more_help: &'static str,
}

/// The kind of view.
#[derive(Resource, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// A window, with a camera that the mouse turns.
    Window,
    /// Pictures are taken.
    Pictures,
    /// No adapter to draw with.
    Nothing,
}

/// The line below the keys.
#[derive(Resource, Default)]
pub struct StatusLine(pub String);

#[derive(Resource)]
struct Help(String);

impl Plugin for StudioPlugin {
    fn build(&self, app: &mut App) {
        let view = if self.args.headless || !has_display() { self.add_headless(app) } else { self.add_window(app) };
        app.insert_resource(view)
            .insert_resource(self.args.clone())
            .insert_resource(Help(format!("{}\n{}", self.help, self.more_help)));
        // Examples add their pictures even if a window is open and none are taken.
        app.init_resource::<StatusLine>().init_resource::<Shots>();
        if view != View::Nothing {
            app.add_plugins(LightPlugin).add_systems(Startup, spawn_camera);
        }
    }
}

impl StudioPlugin {
    fn add_window(&self, app: &mut App) -> View {
        let window = Window { title: self.title.into(), ..default() };
        let window = WindowPlugin { primary_window: Some(window), ..default() };
        app.add_plugins(DefaultPlugins.set(window).set(any_file()))
            .add_plugins(PanOrbitCameraPlugin)
            .add_systems(Startup, spawn_texts)
            .add_systems(Update, (fit_texts, show_status.run_if(resource_changed::<StatusLine>)));
        View::Window
    }

    fn add_headless(&self, app: &mut App) -> View {
        let adapter = find_adapter();
        match &adapter {
            Some(name) => println!("no window: drawing to files on {name}"),
            None => println!("{HOW_TO_GET_PICTURES}"),
        }
        // Warnings about a software driver, or cameras without a window, are of no use here.
        let render = if adapter.is_some() { "error" } else { "off" };
        let filter = format!("warn,bevy_render={render},bevy_light=error,bevy_gltf=error,wgpu=error");
        let log = LogPlugin { filter, ..default() };
        app.add_plugins(headless_plugins(adapter.is_some()).set(log).set(any_file()));
        if adapter.is_some() {
            let size = self.args.picture_size();
            app.insert_resource(UiScale(text_scale(size.as_vec2()) * OVERSAMPLING as f32))
                .add_plugins(OffscreenPlugin { size: size * OVERSAMPLING });
        }
        app.add_plugins(PhotoPlugin);
        if adapter.is_some() { View::Pictures } else { View::Nothing }
    }
}

/// Organs may be anywhere, not only in an assets folder.
fn any_file() -> AssetPlugin {
    AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() }
}

/// Whether a window can be opened. Without one, Bevy panics.
#[cfg(target_os = "linux")]
pub fn has_display() -> bool {
    let Ok(display) = std::env::var("DISPLAY") else { return false };
    let answers = x_server_answers(&display);
    if !answers && !display.is_empty() {
        println!("no X server answers at DISPLAY={display}: set it to that of a running one, or try xvfb-run");
    }
    answers
}

/// Whether a window can be opened.
#[cfg(not(target_os = "linux"))]
pub fn has_display() -> bool {
    true
}

/// Whether an X server listens where a display, such as `:0` or `host:10.0`, says.
#[cfg(target_os = "linux")]
fn x_server_answers(display: &str) -> bool {
    use std::{
        net::TcpStream,
        os::{
            linux::net::SocketAddrExt,
            unix::net::{SocketAddr, UnixStream},
        },
    };
    let Some((host, screen)) = display.rsplit_once(':') else { return false };
    let Some(Ok(number)) = screen.split('.').next().map(str::parse::<u16>) else { return false };
    if !host.is_empty() && host != "unix" {
        return TcpStream::connect((host, number.saturating_add(6000))).is_ok();
    }
    let path = format!("/tmp/.X11-unix/X{number}");
    let hidden = SocketAddr::from_abstract_name(&path).and_then(|address| UnixStream::connect_addr(&address));
    UnixStream::connect(&path).is_ok() || hidden.is_ok()
}

fn spawn_camera(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    args: Res<StudioArgs>,
    target: Option<Res<OffscreenTarget>>,
) {
    let projection = Projection::from(PerspectiveProjection { near: 0.002, ..default() });
    let mut camera = commands.spawn((Camera3d::default(), IsDefaultUiCamera, projection, camera_lights(&mut images)));
    match target {
        // Growing vessels are drawn small; pictures use the whole target.
        Some(target) => {
            let viewport = Viewport { physical_size: args.picture_size(), ..default() };
            let camera_to_image = Camera { viewport: Some(viewport), ..default() };
            camera.insert((camera_to_image, RenderTarget::from(target.0.clone()), Msaa::Off))
        }
        None => camera.insert((PanOrbitCamera { button_pan: MouseButton::Right, ..default() }, Msaa::Sample4)),
    };
    camera.insert(transform_of(&front_view()));
}

/// A view of an organ of unit size from the front.
pub fn front_view() -> Viewpoint {
    Viewpoint { eye: Vec3::new(0.15, 0.12, 1.8), target: Vec3::ZERO, up: Vec3::Y }
}

/// The transform of a camera for a view.
pub fn transform_of(view: &Viewpoint) -> Transform {
    Transform::from_translation(view.eye).looking_at(view.target, view.up)
}

/// The transform that moves an organ, between two corners in any unit, to the origin and makes it one unit large.
pub fn to_unit_size((low, high): (Vec3, Vec3)) -> Transform {
    let scale = 1.0 / (high - low).max_element().max(f32::MIN_POSITIVE);
    Transform::from_translation(-0.5 * (low + high) * scale).with_scale(Vec3::splat(scale))
}

/// A view of an organ, after the organ has been moved.
pub fn moved(view: &Viewpoint, place: &Transform) -> Viewpoint {
    Viewpoint { eye: place.transform_point(view.eye), target: place.transform_point(view.target), up: view.up }
}

#[derive(Component)]
struct StatusText;

/// Width and height of a window, in logical pixels, in which the texts have their full size.
const ROOMY: Vec2 = Vec2::new(800.0, 500.0);

/// The size of texts in a window or picture, relative to their full size.
fn text_scale(size: Vec2) -> f32 {
    (size / ROOMY).min_element().clamp(0.3, 1.0)
}

/// Texts in small windows are smaller. Long lines break before the window's edge.
fn fit_texts(window: Single<&Window>, mut scale: ResMut<UiScale>) {
    let fit = text_scale(window.size());
    if scale.0 != fit {
        scale.0 = fit;
    }
}

fn spawn_texts(mut commands: Commands, help: Res<Help>) {
    let font = TextFont { font_size: FontSize::Px(14.0), ..default() };
    let place = Node { position_type: PositionType::Absolute, left: px(12), right: px(12), ..default() };
    let node = |bottom, top| Node { bottom, top, ..place.clone() };
    let color = TextColor(Color::srgba(1.0, 1.0, 1.0, 0.75));
    commands.spawn((Text::new(&help.0), font.clone(), color, node(auto(), px(12))));
    commands.spawn((Text::default(), font, color, node(px(12), auto()), StatusText));
}

fn show_status(status: Res<StatusLine>, mut text: Single<&mut Text, With<StatusText>>) {
    text.0.clone_from(&status.0);
}
