//! The look of organs: moist tissue under the soft lights of an operating room, or under an endoscope's light.

use bevy::{
    light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap},
    prelude::*,
};

/// Tissue under a thin film of fluid. The tint multiplies the mesh's own colours, if it has any.
pub fn moist_tissue(tint: Color) -> StandardMaterial {
    StandardMaterial {
        base_color: tint,
        alpha_mode: if tint.alpha() < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
        perceptual_roughness: 0.5,
        reflectance: 0.4,
        clearcoat: 0.6,
        clearcoat_perceptual_roughness: 0.24,
        ..default()
    }
}

/// Lights for an organ about one unit across, around the origin.
pub struct LightPlugin;

impl Plugin for LightPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(ClearColor(Color::srgb(0.07, 0.076, 0.09)))
            .insert_resource(DirectionalLightShadowMap { size: 2048 })
            .init_resource::<Endoscope>()
            .add_systems(Startup, spawn_lights)
            .add_systems(PostUpdate, switch_lights.before(TransformSystems::Propagate));
    }
}

/// Whether the camera's light is the only one, as inside an organ.
#[derive(Resource, Default)]
pub struct Endoscope(pub bool);

/// A light of the room, with its illuminance when on.
#[derive(Component)]
struct RoomLight(f32);

/// The endoscope's light, just beside the camera.
#[derive(Component)]
pub struct HeadLight;

/// Position of the warm key light, at the upper left.
pub const KEY_LIGHT: Vec3 = Vec3::new(-1.4, 2.2, 2.2);
const SKY: f32 = 620.0;
const SKY_INSIDE: f32 = 60.0;
const HEAD_LIGHT: f32 = 260.0;

fn spawn_lights(mut commands: Commands) {
    // A key light, and a cool one from behind for the outline.
    let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 4.0, ..default() }.build();
    let key = DirectionalLight { color: Color::srgb(1.0, 0.96, 0.9), shadow_maps_enabled: true, ..default() };
    let key_place = Transform::from_translation(KEY_LIGHT).looking_at(Vec3::ZERO, Vec3::Y);
    commands.spawn((key, key_place, cascades, RoomLight(8_000.0)));
    let edge = DirectionalLight { color: Color::srgb(0.72, 0.84, 1.0), ..default() };
    commands.spawn((edge, Transform::from_xyz(2.0, 0.6, -1.6).looking_at(Vec3::ZERO, Vec3::Y), RoomLight(4_000.0)));
}

/// The lights of a camera: soft light from all around, and the endoscope's.
pub fn camera_lights(images: &mut Assets<Image>) -> impl Bundle {
    let sky = EnvironmentMapLight::hemispherical_gradient(
        images,
        Color::srgb(1.0, 0.98, 0.96),
        Color::srgb(0.6, 0.6, 0.64),
        Color::srgb(0.36, 0.26, 0.25),
    );
    let head =
        PointLight { intensity: 0.0, range: 2.0, radius: 0.004, color: Color::srgb(1.0, 0.97, 0.93), ..default() };
    (sky, children![(head, HeadLight, Transform::from_xyz(0.006, 0.01, 0.0))])
}

fn switch_lights(
    endoscope: Res<Endoscope>,
    mut room: Query<(&mut DirectionalLight, &RoomLight)>,
    mut head: Query<&mut PointLight, With<HeadLight>>,
    mut sky: Query<&mut EnvironmentMapLight>,
) {
    let inside = endoscope.0;
    for (mut light, on) in &mut room {
        light.illuminance = if inside { 0.0 } else { on.0 };
    }
    for mut light in &mut head {
        light.intensity = if inside { HEAD_LIGHT } else { 0.0 };
    }
    for mut light in &mut sky {
        light.intensity = if inside { SKY_INSIDE } else { SKY };
    }
}
