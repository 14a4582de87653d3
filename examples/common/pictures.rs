//! Picture files: on request, and at the end of a run without a window.

use super::{
    Display,
    headless::{OffscreenTarget, PipelinesReady, write_picture},
};
use bevy::{
    prelude::*,
    render::view::screenshot::{Screenshot, ScreenshotCaptured},
};
use std::path::PathBuf;

/// Writes a picture of what the window, or the camera without one, shows. PNG.
#[derive(Message, Clone, Debug)]
pub struct SavePicture {
    /// The file. Its folder is made where it is missing.
    pub path: PathBuf,
}

/// A run without a window: so many frames, a picture, and the end. Examples may put the end off while they have work.
#[derive(Resource, Clone, Debug)]
pub struct HeadlessRun {
    /// Frames to go until the picture is taken.
    pub frames_left: u32,
    /// Where the picture goes.
    pub picture: PathBuf,
}

pub(super) struct PicturePlugin {
    pub display: Display,
    pub run: HeadlessRun,
}

impl Plugin for PicturePlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(self.display).add_message::<SavePicture>().init_resource::<Pending>();
        if self.display != Display::None {
            app.add_systems(Last, take_pictures);
        }
        if self.display != Display::Window {
            app.insert_resource(self.run.clone()).add_systems(PostUpdate, run_to_the_end);
        }
    }
}

/// Pictures on their way to the disk, and whether one didn't arrive.
#[derive(Resource, Default)]
struct Pending {
    pictures: usize,
    failed: bool,
}

fn take_pictures(
    mut requests: MessageReader<SavePicture>,
    mut commands: Commands,
    target: Option<Res<OffscreenTarget>>,
    mut pending: ResMut<Pending>,
) {
    for SavePicture { path } in requests.read().cloned() {
        let screenshot = match &target {
            Some(target) => Screenshot::image(target.0.clone()),
            None => Screenshot::primary_window(),
        };
        pending.pictures += 1;
        commands.spawn(screenshot).observe(move |captured: On<ScreenshotCaptured>, mut pending: ResMut<Pending>| {
            pending.pictures -= 1;
            match write_picture(&captured.image, &path) {
                Ok(()) => println!("wrote {}", path.display()),
                Err(error) => {
                    pending.failed = true;
                    eprintln!("could not write {}: {error}", path.display());
                }
            }
        });
    }
}

/// Counts the frames, asks for the picture when all shaders are there, and exits when it is on the disk.
fn run_to_the_end(
    mut run: ResMut<HeadlessRun>,
    ready: Option<Res<PipelinesReady>>,
    pending: Res<Pending>,
    mut requests: MessageWriter<SavePicture>,
    mut exit: MessageWriter<AppExit>,
    mut asked: Local<bool>,
) {
    if run.frames_left > 0 {
        run.frames_left -= 1;
        return;
    }
    if let (Some(ready), false) = (ready, *asked) {
        if ready.0 {
            *asked = true;
            requests.write(SavePicture { path: run.picture.clone() });
        }
        return;
    }
    if pending.pictures == 0 {
        exit.write(if pending.failed { AppExit::error() } else { AppExit::Success });
    }
}
