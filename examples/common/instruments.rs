//! Instruments: what they touch, a scalpel that the mouse drags, keys for clamp and cautery, and clamps to be seen.

use bevy::prelude::*;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_vessels::{
    plugin::{CuttableVessels, Perfusion, VesselSystems, VesselWounds, read_mesh},
    prelude::*,
    synthesis::{
        mesh::TriangleMesh,
        tissue::TriangleIndex,
        wound::{Blade, BladeError},
    },
};

/// What the keys and the mouse do.
pub const INSTRUMENTS_HELP: &str = "right drag  scalpel\nK U  clamp on, off\nB  cautery\nZ  undo";

/// How deep the scalpel goes, and how far its edge reaches out of the tissue. World units.
const DEPTH: f32 = 0.035;
const ABOVE: f32 = 0.01;
/// Radius of what the cautery's tip heats, and the widest vessel that it seals.
const CAUTERY_RADIUS: f32 = 0.022;
const SEALED_CALIBRE: f32 = 0.02;
/// How near to a vessel one has to point to clamp it.
const REACH: f32 = 0.03;

/// Instruments in the user's hands, where there is a window.
pub struct InstrumentsPlugin;

impl Plugin for InstrumentsPlugin {
    fn build(&self, app: &mut App) {
        let by_hand = (slash, operate).before(VesselSystems::Cut);
        let in_window = any_with_component::<PanOrbitCamera>;
        app.add_systems(Update, by_hand.run_if(resource_exists::<Surface>).run_if(in_window))
            .add_systems(PostUpdate, show_clamps.before(TransformSystems::Propagate));
    }
}

/// An organ's surface at rest, in the world: what instruments touch, and blood falls on.
#[derive(Resource)]
pub struct Surface {
    mesh: TriangleMesh,
    index: TriangleIndex,
    /// From where the organ is looked at first.
    pub eye: Vec3,
}

impl Surface {
    /// The surface of a mesh at a place, looked at from somewhere.
    pub fn new(mesh: &Mesh, place: &Transform, eye: Vec3) -> Result<Self> {
        let mesh = read_mesh(mesh)?;
        let positions = mesh.positions().iter().map(|&at| place.transform_point(at)).collect();
        let mesh = TriangleMesh::new(positions, mesh.triangles().to_vec(), None)?;
        Ok(Self { index: TriangleIndex::new(&mesh), mesh, eye })
    }

    /// Where a way first meets the surface, and the normal there.
    pub fn hit(&self, from: Vec3, to: Vec3) -> Option<(Vec3, Vec3)> {
        let hit = self.index.first_hit(from, to)?;
        Some((hit.position, self.mesh.triangle_normal(hit.triangle)))
    }

    /// The nearest point of the surface, and the normal there.
    pub fn nearest(&self, point: Vec3) -> Option<(Vec3, Vec3)> {
        let near = self.index.closest(point)?;
        Some((near.position, self.mesh.triangle_normal(near.triangle)))
    }
}

/// The scalpel's edge when it is held along a direction and touches a point: from just outside to a set depth.
fn edge(touch: Vec3, along: Vec3) -> [Vec3; 2] {
    [touch - ABOVE * along, touch + DEPTH * along]
}

/// Draws the scalpel from one touch of the surface to the next. An edge that has not moved cuts nothing.
pub fn draw_scalpel(vessels: &mut CuttableVessels, [before, now]: [[Vec3; 2]; 2]) -> Result<(), BladeError> {
    match Blade::sweep(edge(before[0], before[1]), edge(now[0], now[1])) {
        Ok(blade) => vessels.cut(blade),
        Err(BladeError::NoArea { .. }) => {}
        Err(error) => return Err(error),
    }
    Ok(())
}

/// Touches a point with the cautery.
pub fn cauterise(vessels: &mut CuttableVessels, touch: Vec3) -> Result<(), BladeError> {
    vessels.cauterise(Blade::ball(touch, CAUTERY_RADIUS)?, SEALED_CALIBRE);
    Ok(())
}

/// Puts a clamp on the vessel at a point.
pub fn clamp(vessels: &mut CuttableVessels, touch: Vec3) {
    vessels.clamp(touch, REACH);
}

/// Where the cursor points to: the point of the surface, and the direction of the view.
fn aim(window: &Window, camera: (&Camera, &GlobalTransform), surface: &Surface) -> Option<[Vec3; 2]> {
    let ray = camera.0.viewport_to_world(camera.1, window.cursor_position()?).ok()?;
    let (touch, _) = surface.hit(ray.origin, ray.get_point(100.0))?;
    Some([touch, *ray.direction])
}

/// Dragging with the right button cuts, from where the cursor was in the last frame to where it is.
fn slash(
    buttons: Res<ButtonInput<MouseButton>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform, &mut PanOrbitCamera)>,
    surface: Res<Surface>,
    mut vessels: ResMut<CuttableVessels>,
    mut last: Local<Option<[Vec3; 2]>>,
) -> Result {
    let (view, place, mut orbit) = camera.into_inner();
    orbit.button_pan = MouseButton::Middle;
    let now = aim(&window, (view, place), &surface).filter(|_| buttons.pressed(MouseButton::Right));
    if let (Some(before), Some(now)) = (*last, now) {
        draw_scalpel(&mut vessels, [before, now])?;
    }
    *last = now;
    Ok(())
}

/// Keys for what is done at the cursor, and for undo and pause.
fn operate(
    keys: Res<ButtonInput<KeyCode>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform)>,
    surface: Res<Surface>,
    mut vessels: ResMut<CuttableVessels>,
    mut organs: Query<&mut Perfusion>,
) -> Result {
    if keys.just_pressed(KeyCode::KeyZ) {
        vessels.undo();
    }
    if keys.just_pressed(KeyCode::Space) {
        organs.iter_mut().for_each(|mut organ| organ.paused = !organ.paused);
    }
    let Some([touch, _]) = aim(&window, *camera, &surface) else { return Ok(()) };
    if keys.just_pressed(KeyCode::KeyK) {
        clamp(&mut vessels, touch);
    }
    if keys.just_pressed(KeyCode::KeyU) {
        vessels.unclamp_near(touch, REACH);
    }
    if keys.pressed(KeyCode::KeyB) {
        cauterise(&mut vessels, touch)?;
    }
    Ok(())
}

/// A clamp to be seen.
#[derive(Component)]
struct ClampModel;

/// A small bar of steel across each vessel that is clamped.
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
