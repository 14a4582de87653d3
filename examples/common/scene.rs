//! The room: a bright, plain background, a key light that casts shadows, a fill light, and a camera around the organ.

use super::headless::OffscreenTarget;
use bevy::{
    camera::{Exposure, RenderTarget},
    core_pipeline::tonemapping::Tonemapping,
    light::CascadeShadowConfigBuilder,
    prelude::*,
};
use bevy_panorbit_camera::PanOrbitCamera;

/// What the camera looks at. Changing it moves the camera.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct Framing {
    /// Middle of what is to be seen.
    pub center: Vec3,
    /// Radius of a ball around what is to be seen; it just fits the picture.
    pub radius: f32,
    /// Where the camera stands, as seen from the middle. Its length does not matter.
    pub from: Vec3,
}

impl Default for Framing {
    fn default() -> Self {
        Self { center: Vec3::ZERO, radius: 1.0, from: Vec3::new(0.45, 0.35, 1.0) }
    }
}

pub(super) struct ScenePlugin;

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Framing>()
            .insert_resource(ClearColor(Color::srgb(0.86, 0.89, 0.91)))
            .insert_resource(GlobalAmbientLight { color: Color::srgb(0.93, 0.97, 1.0), brightness: 450.0, ..default() })
            .add_systems(Startup, spawn_camera_and_lights)
            .add_systems(PostUpdate, frame.run_if(resource_changed::<Framing>).before(TransformSystems::Propagate));
    }
}

/// Lights that stand around the camera, so that what it looks at is lit from wherever it looks.
#[derive(Component)]
struct KeyLight;

fn spawn_camera_and_lights(mut commands: Commands, target: Option<Res<OffscreenTarget>>) {
    let mut camera = commands.spawn((
        Camera3d::default(),
        PanOrbitCamera { zoom_lower_limit: 0.0, ..default() },
        Tonemapping::TonyMcMapface,
        Exposure::default(),
        Msaa::Sample4,
    ));
    if let Some(target) = target {
        camera.insert(RenderTarget::from(target.0.clone()));
    }
    camera.with_children(|camera| {
        let key = DirectionalLight { illuminance: 9000.0, shadow_maps_enabled: true, ..default() };
        camera.spawn((KeyLight, key, Transform::from_xyz(-0.9, 1.2, 1.0).looking_at(Vec3::ZERO, Vec3::Y)));
        let fill = DirectionalLight { illuminance: 2500.0, color: Color::srgb(0.85, 0.92, 1.0), ..default() };
        camera.spawn((fill, Transform::from_xyz(1.2, -0.2, 0.8).looking_at(Vec3::ZERO, Vec3::Y)));
    });
}

/// Puts the camera where the framing says, and spreads the shadows over what it sees.
fn frame(
    framing: Res<Framing>,
    mut commands: Commands,
    mut cameras: Query<(&mut Transform, &mut PanOrbitCamera, &mut Projection)>,
    key: Query<Entity, With<KeyLight>>,
) {
    for (mut transform, mut orbit, mut projection) in &mut cameras {
        let Projection::Perspective(lens) = &mut *projection else { continue };
        let distance = framing.radius / ops::sin(0.5 * lens.fov.min(lens.fov * lens.aspect_ratio));
        lens.near = 0.01 * framing.radius;
        let from = framing.from.normalize_or(Vec3::Z);
        *transform = Transform::from_translation(framing.center + distance * from).looking_at(framing.center, Vec3::Y);
        let (yaw, pitch) = (ops::atan2(from.x, from.z), ops::asin(from.y));
        (orbit.focus, orbit.target_focus) = (framing.center, framing.center);
        (orbit.radius, orbit.target_radius) = (Some(distance), distance);
        (orbit.yaw, orbit.target_yaw, orbit.pitch, orbit.target_pitch) = (Some(yaw), yaw, Some(pitch), pitch);
        orbit.force_update = true;
        let cascades = CascadeShadowConfigBuilder {
            num_cascades: 2,
            minimum_distance: 0.01 * framing.radius,
            first_cascade_far_bound: distance,
            maximum_distance: 4.0 * distance,
            ..default()
        };
        for light in &key {
            commands.entity(light).insert(cascades.build());
        }
    }
}
