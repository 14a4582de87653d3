//! Instruments: a scalpel that the mouse drags, keys for clamp and cautery, and visible clamps.

use super::surface::Surface;
use bevy::prelude::*;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_vessels::{
    plugin::{CuttableVessels, Perfusion, Stroke, StrokeId, VesselSystems, VesselWounds},
    prelude::*,
    synthesis::wound::{Blade, BladeError},
};

/// Help for the keys and the mouse.
pub const INSTRUMENTS_HELP: &str = "right drag  scalpel\nK U  clamp on, off\nB  cautery, while held\nZ  undo";

/// Depth of the scalpel, and length of its edge outside the tissue, in world units.
const DEPTH: f32 = 0.035;
const ABOVE: f32 = 0.01;
/// Radius heated by the cautery's tip, and the widest vessel that it seals.
const CAUTERY_RADIUS: f32 = 0.022;
const SEALED_CALIBRE: f32 = 0.02;
/// Distance from the pointer within which a vessel is clamped.
const REACH: f32 = 0.03;

/// Instruments for the user, if there is a window.
pub struct InstrumentsPlugin;

impl Plugin for InstrumentsPlugin {
    fn build(&self, app: &mut App) {
        let by_hand = (slash, operate).before(VesselSystems::Cut);
        let in_window = any_with_component::<PanOrbitCamera>;
        app.add_systems(Update, by_hand.run_if(resource_exists::<Surface>).run_if(in_window))
            .add_systems(PostUpdate, show_clamps.before(TransformSystems::Propagate));
    }
}

/// The scalpel's edge, held along a direction at a point: from just outside to a set depth.
fn edge(touch: Vec3, along: Vec3) -> [Vec3; 2] {
    [touch - ABOVE * along, touch + DEPTH * along]
}

/// Draws the scalpel from one touch of the surface to the next. An edge that has not moved cuts nothing.
pub fn draw_scalpel(mut stroke: Stroke, [before, now]: [[Vec3; 2]; 2]) -> Result<(), BladeError> {
    match Blade::sweep(edge(before[0], before[1]), edge(now[0], now[1])) {
        Ok(blade) => stroke.cut(blade),
        Err(BladeError::NoArea { .. }) => {}
        Err(error) => return Err(error),
    }
    Ok(())
}

/// Touches a point with the cautery.
pub fn cauterise(mut stroke: Stroke, touch: Vec3) -> Result<(), BladeError> {
    stroke.cauterise(Blade::ball(touch, CAUTERY_RADIUS)?, SEALED_CALIBRE);
    Ok(())
}

/// Puts a clamp on the vessel at a point.
fn clamp(vessels: &mut CuttableVessels, touch: Vec3) {
    vessels.clamp(touch, REACH);
}

/// The point of the surface under the cursor, and the direction of the view.
fn aim(window: &Window, camera: (&Camera, &GlobalTransform), surface: &Surface) -> Option<[Vec3; 2]> {
    let ray = camera.0.viewport_to_world(camera.1, window.cursor_position()?).ok()?;
    let (touch, _) = surface.hit(ray.origin, ray.get_point(100.0))?;
    Some([touch, *ray.direction])
}

/// Dragging with the right button cuts, from the cursor's last position to the present one. One drag is one stroke,
/// even if it leaves the organ in between.
fn slash(
    buttons: Res<ButtonInput<MouseButton>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform, &mut PanOrbitCamera)>,
    surface: Res<Surface>,
    mut vessels: ResMut<CuttableVessels>,
    mut drag: Local<Option<(StrokeId, Option<[Vec3; 2]>)>>,
) -> Result {
    let (view, place, mut orbit) = camera.into_inner();
    orbit.button_pan = MouseButton::Middle;
    if !buttons.pressed(MouseButton::Right) {
        *drag = None;
        return Ok(());
    }
    let (stroke, last) = drag.get_or_insert_with(|| (StrokeId::begin(), None));
    let now = aim(&window, (view, place), &surface);
    if let (Some(before), Some(now)) = (*last, now) {
        draw_scalpel(vessels.in_stroke(*stroke), [before, now])?;
    }
    *last = now;
    Ok(())
}

/// Keys for actions at the cursor, and for undo and pause.
fn operate(
    keys: Res<ButtonInput<KeyCode>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform)>,
    surface: Res<Surface>,
    mut vessels: ResMut<CuttableVessels>,
    mut organs: Query<&mut Perfusion>,
    mut cautery: Local<Option<StrokeId>>,
) -> Result {
    if keys.just_pressed(KeyCode::KeyZ) {
        vessels.undo();
    }
    if keys.just_pressed(KeyCode::Space) {
        organs.iter_mut().for_each(|mut organ| organ.paused = !organ.paused);
    }
    if !keys.pressed(KeyCode::KeyB) {
        *cautery = None;
    }
    let Some([touch, _]) = aim(&window, *camera, &surface) else { return Ok(()) };
    if keys.just_pressed(KeyCode::KeyK) {
        clamp(&mut vessels, touch);
    }
    if keys.just_pressed(KeyCode::KeyU) {
        vessels.unclamp_near(touch, REACH);
    }
    if keys.pressed(KeyCode::KeyB) {
        let stroke = cautery.get_or_insert_with(StrokeId::begin);
        cauterise(vessels.in_stroke(*stroke), touch)?;
    }
    Ok(())
}

/// A visible clamp.
#[derive(Component)]
struct ClampModel;

/// Shows a small steel bar across each clamped vessel.
fn show_clamps(
    mut commands: Commands,
    changed: Query<(Entity, &Vessels, &VesselWounds), Or<(Changed<VesselWounds>, Changed<Vessels>)>>,
    shown: Query<(Entity, &ChildOf), With<ClampModel>>,
    assets: (ResMut<Assets<Mesh>>, Option<ResMut<Assets<StandardMaterial>>>),
    mut model: Local<Option<(Handle<Mesh>, Handle<StandardMaterial>)>>,
) {
    let (mut meshes, Some(mut materials)) = assets else { return };
    let (bar, steel) = model.get_or_insert_with(|| {
        let steel =
            StandardMaterial { metallic: 1.0, perceptual_roughness: 0.3, ..Color::srgb(0.8, 0.82, 0.85).into() };
        (meshes.add(Cuboid::from_length(1.0)), materials.add(steel))
    });
    for (entity, vessels, wounds) in &changed {
        for (old, _) in shown.iter().filter(|(_, parent)| parent.parent() == entity) {
            commands.entity(old).despawn();
        }
        for (_, place) in wounds.clamps() {
            let tree = vessels.tree();
            let (position, radius) = (tree.position_at(place), tree.radii()[place.node.index()]);
            let along = tree.segment_vector(place.node.index());
            let size = radius * Vec3::new(6.0, 1.6, 2.4);
            let pose = Transform::from_translation(position).looking_to(along, Vec3::Z).with_scale(size);
            commands.spawn((ClampModel, Mesh3d(bar.clone()), MeshMaterial3d(steel.clone()), pose, ChildOf(entity)));
        }
    }
}
