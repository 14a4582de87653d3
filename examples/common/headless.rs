//! Drawing without a window: finding an adapter, an app that draws to an image, and writing that image.

use bevy::{
    app::{PluginGroupBuilder, ScheduleRunnerPlugin},
    log::{DEFAULT_FILTER, LogPlugin},
    prelude::*,
    render::{
        ExtractSchedule, MainWorld, RenderApp, RenderPlugin,
        pipelined_rendering::PipelinedRenderingPlugin,
        render_resource::{PipelineCache, TextureFormat, TextureUsages},
        renderer::{RenderInstance, WgpuWrapper},
        settings::WgpuSettings,
    },
    tasks::block_on,
    window::ExitCondition,
    winit::WinitPlugin,
};
use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

/// The message for machines without an adapter.
pub const HOW_TO_GET_PICTURES: &str =
    "no graphics adapter found: for pictures install a Vulkan driver (Debian, Ubuntu: apt install mesa-vulkan-drivers)";

/// Name and driver of an adapter that Bevy can draw with, `None` if there is none. Bevy itself would panic.
pub fn find_adapter() -> Option<String> {
    let backends = WgpuSettings::default().backends?;
    let instance = RenderInstance(Arc::new(WgpuWrapper::new(Default::default())));
    let adapters = block_on(instance.enumerate_adapters(backends));
    let info = adapters.first()?.get_info();
    Some(format!("{} ({:?}, {:?})", info.name, info.backend, info.device_type))
}

/// Bevy's default plugins without window and event loop, for an app that runs frame after frame until it exits.
///
/// With `draws` off there is no renderer, and no adapter is needed.
pub fn headless_plugins(draws: bool) -> PluginGroupBuilder {
    let settings = if draws { WgpuSettings::default() } else { WgpuSettings { backends: None, ..default() } };
    // If nothing is drawn, Bevy reports the missing renderer as an error.
    let silenced = if draws { "" } else { "bevy_render=off,bevy_gltf=error," };
    DefaultPlugins
        .build()
        .disable::<WinitPlugin>()
        // a picture must show its own frame, not the one before
        .disable::<PipelinedRenderingPlugin>()
        .set(LogPlugin { filter: format!("{silenced}{DEFAULT_FILTER}"), ..default() })
        .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
        .set(RenderPlugin {
            render_creation: settings.into(),
            // otherwise the first frames show only the background
            synchronous_pipeline_compilation: true,
            ..default()
        })
        .add(ScheduleRunnerPlugin::run_loop(Duration::ZERO))
}

/// The image to which cameras draw instead of a window.
#[derive(Resource, Clone)]
pub struct OffscreenTarget(pub Handle<Image>);

/// Whether all requested shaders are loaded and compiled, so that a picture shows everything.
#[derive(Resource, Default)]
pub struct PipelinesReady(pub bool);

/// Makes an [`OffscreenTarget`] of a size and keeps [`PipelinesReady`] up to date. Add it after [`headless_plugins`].
pub struct OffscreenPlugin {
    /// Width and height of the target, pixels.
    pub size: UVec2,
}

impl Plugin for OffscreenPlugin {
    fn build(&self, app: &mut App) {
        let mut image = Image::new_target_texture(self.size.x, self.size.y, TextureFormat::Rgba8UnormSrgb, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        app.insert_resource(OffscreenTarget(target)).init_resource::<PipelinesReady>();
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app.add_systems(ExtractSchedule, |mut main: ResMut<MainWorld>, cache: Res<PipelineCache>| {
                main.insert_resource(PipelinesReady(cache.waiting_pipelines().next().is_none()));
            });
        }
    }
}

/// Writes a picture as PNG, whole or not at all: to a temporary file first, which is then renamed.
pub fn write_picture(image: &Image, path: &Path) -> io::Result<()> {
    let picture = image.clone().try_into_dynamic().map_err(io::Error::other)?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut beside = PathBuf::from(path).into_os_string();
    beside.push(".part");
    picture.to_rgb8().save_with_format(&beside, image::ImageFormat::Png).map_err(io::Error::other)?;
    std::fs::rename(&beside, path)
}
