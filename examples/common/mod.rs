//! What all examples share: a window or, without a display, a picture file; lights, a camera that orbits, and a clear
//! word about what is missing.

pub mod headless;
pub mod pictures;
pub mod scene;

use bevy::{
    app::PluginGroupBuilder,
    prelude::*,
    window::{Window, WindowPlugin},
};
use bevy_panorbit_camera::PanOrbitCameraPlugin;
use headless::{HOW_TO_GET_PICTURES, OffscreenPlugin, find_adapter, headless_plugins};
use std::path::PathBuf;

/// How an example is shown.
#[derive(Clone, Debug)]
pub struct Show {
    /// Title of the window.
    pub title: &'static str,
    /// Whether to do without a window even where there is a display.
    pub headless: bool,
    /// Pixels of the window or the picture.
    pub size: UVec2,
    /// Frames until the picture is taken, without a window.
    pub frames: u32,
    /// Where the picture goes, without a window. PNG.
    pub picture: PathBuf,
}

/// What there is to show an example with.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Display {
    /// A window.
    Window,
    /// An image that becomes a file.
    Offscreen,
    /// Nothing: the example runs, but draws no picture.
    None,
}

impl Show {
    /// Bevy's plugins, and the scene, for what there is to draw with. Says in one line when a window or a picture was
    /// wanted and can't be had.
    pub fn plugins(self) -> PluginGroupBuilder {
        let display = self.display();
        let plugins = match display {
            Display::Window => DefaultPlugins.build().set(self.window()).add(PanOrbitCameraPlugin),
            Display::Offscreen => headless_plugins(true).add(OffscreenPlugin { size: self.size }),
            Display::None => headless_plugins(false),
        };
        let run = pictures::HeadlessRun { frames_left: self.frames, picture: self.picture };
        plugins.add(pictures::PicturePlugin { display, run }).add(scene::ScenePlugin)
    }

    fn display(&self) -> Display {
        if find_adapter().is_none() {
            println!("{HOW_TO_GET_PICTURES}");
            return Display::None;
        }
        if self.headless {
            return Display::Offscreen;
        }
        if !has_display() {
            println!("no display found: drawing to {} instead of a window", self.picture.display());
            return Display::Offscreen;
        }
        Display::Window
    }

    fn window(&self) -> WindowPlugin {
        let window = Window { title: self.title.into(), resolution: self.size.into(), ..default() };
        WindowPlugin { primary_window: Some(window), ..default() }
    }
}

/// Whether a window can be opened.
fn has_display() -> bool {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(all(unix, not(target_os = "macos"))) || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY")
}
